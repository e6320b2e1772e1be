//! The part of `onnx.proto` (proto2) that a small network needs, without a code generator.
//!
//! Repeated numbers of shapes are not packed, as the proto2 file has them.

mod sequence;

pub use sequence::Sequence;

use prost::DecodeError;
pub use prost::Message;
use prost::bytes::{Buf, BufMut};
use prost::encoding::{self, DecodeContext, WireType};

macro_rules! messages {
    ($($(#[$doc:meta])* $name:ident { $($tag:literal $field:ident: $label:ident $kind:ident $type:ty,)* })*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct $name { $(pub $field: field_type!($label $type),)* }

        impl Message for $name {
            fn encode_raw(&self, buffer: &mut impl BufMut) {
                $(encode_field!($label $kind $tag, self.$field, buffer);)*
            }

            fn merge_field(
                &mut self,
                tag: u32,
                wire: WireType,
                buffer: &mut impl Buf,
                context: DecodeContext,
            ) -> Result<(), DecodeError> {
                match tag {
                    $($tag => merge_field!($label $kind wire, self.$field, buffer, context),)*
                    _ => encoding::skip_field(wire, tag, buffer, context),
                }
            }

            fn encoded_len(&self) -> usize {
                0 $(+ field_len!($label $kind $tag, self.$field))*
            }

            fn clear(&mut self) {
                *self = Self::default();
            }
        }
    )*};
}

macro_rules! field_type {
    (one $type:ty) => { $type };
    (many $type:ty) => { Vec<$type> };
    (maybe $type:ty) => { Option<$type> };
}

macro_rules! encode_field {
    (one $kind:ident $tag:literal, $field:expr, $buffer:ident) => {
        if is_set(&$field) {
            encoding::$kind::encode($tag, &$field, $buffer);
        }
    };
    (many $kind:ident $tag:literal, $field:expr, $buffer:ident) => {
        encoding::$kind::encode_repeated($tag, &$field, $buffer)
    };
    (maybe $kind:ident $tag:literal, $field:expr, $buffer:ident) => {
        if let Some(value) = &$field {
            encoding::$kind::encode($tag, value, $buffer);
        }
    };
}

macro_rules! merge_field {
    (one $kind:ident $wire:ident, $field:expr, $buffer:ident, $context:ident) => {
        encoding::$kind::merge($wire, &mut $field, $buffer, $context)
    };
    (many $kind:ident $wire:ident, $field:expr, $buffer:ident, $context:ident) => {
        encoding::$kind::merge_repeated($wire, &mut $field, $buffer, $context)
    };
    (maybe $kind:ident $wire:ident, $field:expr, $buffer:ident, $context:ident) => {
        encoding::$kind::merge($wire, $field.get_or_insert_with(Default::default), $buffer, $context)
    };
}

macro_rules! field_len {
    (one $kind:ident $tag:literal, $field:expr) => {
        if is_set(&$field) {
            encoding::$kind::encoded_len($tag, &$field)
        } else {
            0
        }
    };
    (many $kind:ident $tag:literal, $field:expr) => {
        encoding::$kind::encoded_len_repeated($tag, &$field)
    };
    (maybe $kind:ident $tag:literal, $field:expr) => {
        $field
            .as_ref()
            .map_or(0, |value| encoding::$kind::encoded_len($tag, value))
    };
}

messages! {
    /// `ModelProto`
    Model {
        1 ir_version: one int64 i64,
        2 producer_name: one string String,
        3 producer_version: one string String,
        6 doc_string: one string String,
        7 graph: maybe message Graph,
        8 opset_import: many message OperatorSet,
        14 metadata_props: many message Entry,
    }
    /// `OperatorSetIdProto`
    OperatorSet {
        1 domain: one string String,
        2 version: one int64 i64,
    }
    /// `StringStringEntryProto`
    Entry {
        1 key: one string String,
        2 value: one string String,
    }
    /// `GraphProto`
    Graph {
        1 node: many message Node,
        2 name: one string String,
        5 initializer: many message Tensor,
        10 doc_string: one string String,
        11 input: many message ValueInfo,
        12 output: many message ValueInfo,
    }
    /// `NodeProto`
    Node {
        1 input: many string String,
        2 output: many string String,
        3 name: one string String,
        4 op_type: one string String,
        5 attribute: many message Attribute,
        7 domain: one string String,
    }
    /// `AttributeProto`
    Attribute {
        1 name: one string String,
        2 f: one float f32,
        3 i: one int64 i64,
        5 t: maybe message Tensor,
        8 ints: many int64 i64,
        20 kind: one int32 i32,
    }
    /// `TensorProto`
    Tensor {
        1 dims: many int64 i64,
        2 data_type: one int32 i32,
        4 float_data: many float f32,
        7 int64_data: many int64 i64,
        8 name: one string String,
        9 raw_data: one bytes Vec<u8>,
        14 data_location: one int32 i32,
    }
    /// `ValueInfoProto`
    ValueInfo {
        1 name: one string String,
        2 kind: maybe message Type,
        3 doc_string: one string String,
    }
    /// `TypeProto`
    Type {
        1 tensor_type: maybe message TensorType,
    }
    /// `TypeProto.Tensor`
    TensorType {
        1 elem_type: one int32 i32,
        2 shape: maybe message Shape,
    }
    /// `TensorShapeProto`
    Shape {
        1 dim: many message Dimension,
    }
    /// `TensorShapeProto.Dimension`
    Dimension {
        1 dim_value: one int64 i64,
        2 dim_param: one string String,
    }
}

/// Fields with their default value are left out.
fn is_set<T: Default + PartialEq>(value: &T) -> bool {
    *value != T::default()
}

/// `TensorProto.FLOAT` and `INT64`.
pub const FLOAT: i32 = 1;
pub const INT64: i32 = 7;
/// `TensorProto.EXTERNAL`: the numbers stand in another file.
pub const EXTERNAL: i32 = 1;
/// `AttributeProto.FLOAT`.
pub const ATTRIBUTE_FLOAT: i32 = 1;
/// `AttributeProto.INT` and `INTS`.
pub const INT: i32 = 2;
pub const INTS: i32 = 7;
