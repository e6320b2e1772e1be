//! Bytes of a WebAssembly module, as far as the varied modules need them [WebAssembly core specification, binary format].

pub(super) const I32: u8 = 0x7f;
pub(super) const I64: u8 = 0x7e;
pub(super) const F64: u8 = 0x7c;
/// Of a block without a value.
pub(super) const NOTHING: u8 = 0x40;

pub(super) const BLOCK: u8 = 0x02;
pub(super) const LOOP: u8 = 0x03;
pub(super) const IF: u8 = 0x04;
pub(super) const ELSE: u8 = 0x05;
pub(super) const END: u8 = 0x0b;
pub(super) const SELECT: u8 = 0x1b;
pub(super) const F64_LT: u8 = 0x63;
pub(super) const F64_ABS: u8 = 0x99;
pub(super) const F64_ADD: u8 = 0xa0;
pub(super) const F64_MUL: u8 = 0xa2;
pub(super) const F64_MIN: u8 = 0xa4;
pub(super) const F64_MAX: u8 = 0xa5;
pub(super) const I32_ADD: u8 = 0x6a;
pub(super) const I32_SUB: u8 = 0x6b;
pub(super) const I32_MUL: u8 = 0x6c;
pub(super) const I32_AND: u8 = 0x71;
pub(super) const I32_REM_U: u8 = 0x70;
pub(super) const I32_GE_U: u8 = 0x4f;
pub(super) const I32_EQZ: u8 = 0x45;

/// Instructions of a function, one after the other.
#[derive(Debug, Default, Clone)]
pub(super) struct Code(Vec<u8>);

impl Code {
    pub(super) fn op(&mut self, byte: u8) -> &mut Code {
        self.0.push(byte);
        self
    }

    /// An instruction of several bytes.
    pub(super) fn ops(&mut self, bytes: &[u8]) -> &mut Code {
        self.0.extend_from_slice(bytes);
        self
    }

    /// A block, a loop or a choice with its type.
    pub(super) fn begin(&mut self, what: u8, kind: u8) -> &mut Code {
        self.op(what).op(kind)
    }

    pub(super) fn i32(&mut self, value: i32) -> &mut Code {
        self.op(0x41);
        signed(&mut self.0, value.into());
        self
    }

    pub(super) fn i64(&mut self, value: i64) -> &mut Code {
        self.op(0x42);
        signed(&mut self.0, value);
        self
    }

    pub(super) fn f64(&mut self, value: f64) -> &mut Code {
        self.op(0x44).ops(&value.to_le_bytes())
    }

    pub(super) fn get(&mut self, local: u32) -> &mut Code {
        self.with_index(0x20, local)
    }

    pub(super) fn set(&mut self, local: u32) -> &mut Code {
        self.with_index(0x21, local)
    }

    pub(super) fn get_global(&mut self, global: u32) -> &mut Code {
        self.with_index(0x23, global)
    }

    pub(super) fn set_global(&mut self, global: u32) -> &mut Code {
        self.with_index(0x24, global)
    }

    pub(super) fn call(&mut self, function: u32) -> &mut Code {
        self.with_index(0x10, function)
    }

    /// Calls the function of the table that the number on the stack chooses.
    pub(super) fn call_chosen(&mut self, kind: u32) -> &mut Code {
        self.with_index(0x11, kind).op(0)
    }

    pub(super) fn br(&mut self, depth: u32) -> &mut Code {
        self.with_index(0x0c, depth)
    }

    pub(super) fn br_if(&mut self, depth: u32) -> &mut Code {
        self.with_index(0x0d, depth)
    }

    pub(super) fn load_f64(&mut self, offset: u32) -> &mut Code {
        self.op(0x2b).with_index(3, offset)
    }

    pub(super) fn store_f64(&mut self, offset: u32) -> &mut Code {
        self.op(0x39).with_index(3, offset)
    }

    pub(super) fn load_i64(&mut self, offset: u32) -> &mut Code {
        self.op(0x29).with_index(3, offset)
    }

    pub(super) fn store_i64(&mut self, offset: u32) -> &mut Code {
        self.op(0x37).with_index(3, offset)
    }

    fn with_index(&mut self, byte: u8, index: u32) -> &mut Code {
        self.op(byte);
        unsigned(&mut self.0, index);
        self
    }

    /// As a function body with these locals besides the parameters: how many of which type.
    pub(super) fn body(mut self, locals: &[(u32, u8)]) -> Vec<u8> {
        self.op(END);
        let groups: Vec<Vec<u8>> = locals
            .iter()
            .map(|(count, kind)| {
                let mut group = Vec::new();
                unsigned(&mut group, *count);
                group.push(*kind);
                group
            })
            .collect();
        let mut bytes = list(&groups);
        bytes.extend(self.0);
        sized(&bytes)
    }

    /// As the value that a global begins with or the place of a segment.
    pub(super) fn constant(mut self) -> Vec<u8> {
        self.op(END);
        self.0
    }
}

pub(super) fn unsigned(bytes: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        bytes.push((value & 0x7f) as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

fn signed(bytes: &mut Vec<u8>, mut value: i64) {
    loop {
        let low = (value & 0x7f) as u8;
        value >>= 7;
        if (value == 0 && low & 0x40 == 0) || (value == -1 && low & 0x40 != 0) {
            return bytes.push(low);
        }
        bytes.push(low | 0x80);
    }
}

/// Behind their number of bytes.
pub(super) fn sized(content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    unsigned(&mut bytes, content.len() as u32);
    bytes.extend_from_slice(content);
    bytes
}

/// Behind their number.
pub(super) fn list(items: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    unsigned(&mut bytes, items.len() as u32);
    bytes.extend(items.concat());
    bytes
}

pub(super) fn function_type(parameters: &[u8], results: &[u8]) -> Vec<u8> {
    [&[0x60], sized(parameters).as_slice(), sized(results).as_slice()].concat()
}

/// A whole module from its sections, each with its number, in order.
pub(super) fn assembled(sections: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = b"\0asm\x01\0\0\0".to_vec();
    for (number, content) in sections {
        bytes.push(*number);
        bytes.extend(sized(content));
    }
    bytes
}
