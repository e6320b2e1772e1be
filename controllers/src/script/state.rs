//! What a script keeps from tick to tick, held to the limits as a whole: an assignment by index is checked by the language for
//! the value alone.

use rhai::{Array, Dynamic, ImmutableString, Map};

use crate::limits::{SCRIPT_ARRAY_VALUES, SCRIPT_MAP_ENTRIES, SCRIPT_STATE_DEPTH, SCRIPT_STRING_BYTES};

#[derive(Default)]
struct Sizes {
    values: usize,
    entries: usize,
    bytes: usize,
}

/// What is too large about the state, in words.
pub(super) fn check(state: &Dynamic) -> Result<(), String> {
    let mut sizes = Sizes::default();
    sizes.add(state, 0)
}

impl Sizes {
    fn add(&mut self, value: &Dynamic, depth: usize) -> Result<(), String> {
        if depth > SCRIPT_STATE_DEPTH {
            return Err(format!("`this` is nested more than {SCRIPT_STATE_DEPTH} deep"));
        }
        if let Some(array) = value.read_lock::<Array>() {
            self.values += array.len();
            within("values in arrays", self.values, SCRIPT_ARRAY_VALUES)?;
            return array.iter().try_for_each(|value| self.add(value, depth + 1));
        }
        if let Some(map) = value.read_lock::<Map>() {
            self.entries += map.len();
            within("entries in maps", self.entries, SCRIPT_MAP_ENTRIES)?;
            for (key, value) in map.iter() {
                self.text(key.len())?;
                self.add(value, depth + 1)?;
            }
        } else if let Some(text) = value.read_lock::<ImmutableString>() {
            self.text(text.len())?;
        }
        Ok(())
    }

    fn text(&mut self, bytes: usize) -> Result<(), String> {
        self.bytes += bytes;
        within("bytes of text", self.bytes, SCRIPT_STRING_BYTES)
    }
}

fn within(what: &str, count: usize, most: usize) -> Result<(), String> {
    if count > most {
        return Err(format!("`this` is too large: more than {most} {what}"));
    }
    Ok(())
}
