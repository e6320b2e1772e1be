//! What a module may import: log, drawings, and functions of numbers from `libm`. Pointers and lengths are checked.

use crate::maths::{BINARY, UNARY, canonical};
use control::law::Note;
use wasmi::{Caller, Error, Linker, TrapCode};

use super::Host;
use crate::limits::{BYTES_PER_FUEL, HOST_CALL_FUEL, LINE_BYTES};

/// Module name of all imports.
pub(super) const NAME: &str = "robopheus";
/// Names of all imports.
pub(super) const FUNCTIONS: [&str; 17] = [
    "log", "point", "line", "text", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "hypot", "exp", "ln", "pow",
    "tanh", "wrap",
];

type Ask<'a> = Caller<'a, Host>;

/// Takes fuel for work that the host does.
fn charge(caller: &mut Ask<'_>, bytes: usize) -> Result<(), Error> {
    let cost = HOST_CALL_FUEL + bytes as u64 / u64::from(BYTES_PER_FUEL);
    let left = caller.get_fuel()?.checked_sub(cost);
    match left {
        Some(left) => caller.set_fuel(left),
        None => Err(TrapCode::OutOfFuel.into()),
    }
}

/// A text in the module's memory; of a longer one the beginning.
fn text(caller: &mut Ask<'_>, pointer: i32, length: i32) -> Result<String, Error> {
    let (pointer, length) = (pointer as u32 as usize, length as u32 as usize);
    let kept = length.min(LINE_BYTES);
    charge(caller, kept)?;
    let memory = caller.get_export("memory").and_then(|export| export.into_memory());
    let memory = memory.ok_or_else(|| Error::new("there is no memory"))?;
    let data = memory.data(&*caller);
    let whole = pointer.checked_add(length).is_some_and(|end| end <= data.len());
    match data.get(pointer..pointer + kept).filter(|_| whole) {
        Some(bytes) => Ok(String::from_utf8_lossy(bytes).into_owned()),
        None => Err(Error::new(format!(
            "a text of {length} bytes at {pointer} lies outside the memory"
        ))),
    }
}

fn draw(mut caller: Ask<'_>, note: Note) -> Result<(), Error> {
    charge(&mut caller, 0)?;
    caller.data_mut().answer.draw(note);
    Ok(())
}

fn colour(value: i32) -> u8 {
    value.rem_euclid(8) as u8
}

pub(super) fn define(linker: &mut Linker<Host>) -> Result<(), Error> {
    linker.func_wrap(NAME, "log", |mut caller: Ask<'_>, pointer: i32, length: i32| {
        let line = text(&mut caller, pointer, length)?;
        caller.data_mut().answer.log(&line);
        Ok::<(), Error>(())
    })?;
    linker.func_wrap(NAME, "point", |caller: Ask<'_>, x: f64, y: f64, shade: i32| {
        let (at_m, colour) = ([x, y], colour(shade));
        draw(caller, Note::Point { at_m, colour })
    })?;
    linker.func_wrap(
        NAME,
        "line",
        |caller: Ask<'_>, x: f64, y: f64, to_x: f64, to_y: f64, shade: i32| {
            let (from_m, to_m, colour) = ([x, y], [to_x, to_y], colour(shade));
            draw(caller, Note::Line { from_m, to_m, colour })
        },
    )?;
    linker.func_wrap(
        NAME,
        "text",
        |mut caller: Ask<'_>, x: f64, y: f64, pointer: i32, length: i32, shade: i32| {
            let (at_m, colour) = ([x, y], colour(shade));
            let text = text(&mut caller, pointer, length)?;
            caller.data_mut().answer.draw(Note::Text { at_m, text, colour });
            Ok::<(), Error>(())
        },
    )?;
    numbers(linker)
}

fn numbers(linker: &mut Linker<Host>) -> Result<(), Error> {
    for (name, function) in UNARY {
        linker.func_wrap(NAME, name, move |mut caller: Ask<'_>, x: f64| {
            charge(&mut caller, 0)?;
            Ok::<f64, Error>(canonical(function(x)))
        })?;
    }
    for (name, function) in BINARY {
        linker.func_wrap(NAME, name, move |mut caller: Ask<'_>, x: f64, y: f64| {
            charge(&mut caller, 0)?;
            Ok::<f64, Error>(canonical(function(x, y)))
        })?;
    }
    Ok(())
}
