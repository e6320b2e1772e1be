//! Functions of numbers for scripts, all from `libm`: the same bits natively and in the browser.

use crate::maths::{BINARY, Binary, UNARY, Unary, greatest, least};
use rhai::{Dynamic, Engine, EvalAltResult};

/// A whole number or a floating one.
pub(super) fn number(value: &Dynamic) -> Result<f64, Box<EvalAltResult>> {
    if let Ok(number) = value.as_float() {
        return Ok(number);
    }
    match value.as_int() {
        Ok(number) => Ok(number as f64),
        Err(what) => Err(format!("{what} is not a number").into()),
    }
}

/// Beyond what modules have as well.
const MORE_UNARY: [Unary; 16] = [
    ("sinh", libm::sinh),
    ("cosh", libm::cosh),
    ("asinh", libm::asinh),
    ("acosh", libm::acosh),
    ("atanh", libm::atanh),
    ("log", libm::log10),
    ("sqrt", f64::sqrt),
    ("cbrt", libm::cbrt),
    ("floor", f64::floor),
    ("ceiling", f64::ceil),
    ("round", f64::round),
    ("fraction", f64::fract),
    ("to_radians", |degrees| degrees * (core::f64::consts::PI / 180.0)),
    ("to_degrees", |radians| radians * (180.0 / core::f64::consts::PI)),
    ("to_float", |x| x),
    ("int", f64::trunc),
];
const MORE_BINARY: [Binary; 2] = [("min", least), ("max", greatest)];

pub(super) fn register(engine: &mut Engine) {
    for (name, function) in UNARY.into_iter().chain(MORE_UNARY) {
        engine.register_fn(name, function);
        engine.register_fn(name, move |x: i64| function(x as f64));
    }
    for (name, function) in BINARY.into_iter().chain(MORE_BINARY) {
        engine.register_fn(name, function);
        engine.register_fn(name, move |x: i64, y: f64| function(x as f64, y));
        engine.register_fn(name, move |x: f64, y: i64| function(x, y as f64));
        engine.register_fn(name, move |x: i64, y: i64| function(x as f64, y as f64));
    }
    engine.register_fn("min", |x: i64, y: i64| x.min(y));
    engine.register_fn("max", |x: i64, y: i64| x.max(y));
    engine.register_fn("clamp", |x: Dynamic, low: Dynamic, high: Dynamic| {
        let (x, low, high) = (number(&x)?, number(&low)?, number(&high)?);
        Ok::<f64, Box<EvalAltResult>>(least(greatest(x, low), high))
    });
    engine.register_fn("PI", || core::f64::consts::PI);
    engine.register_fn("is_nan", f64::is_nan);
    engine.register_fn("is_finite", f64::is_finite);
    engine.register_fn("to_int", |x: i64| x);
    engine.register_fn("to_int", |x: f64| {
        // Both bounds are exact as floating numbers.
        if (-9_223_372_036_854_775_808.0..9_223_372_036_854_775_808.0).contains(&x) {
            return Ok(x as i64);
        }
        Err::<i64, Box<EvalAltResult>>(format!("{x} is no whole number of 64 bits").into())
    });
    engine.register_fn("parse_float", |text: &str| {
        let parsed = text.trim().parse::<f64>();
        parsed.map_err(|_| -> Box<EvalAltResult> { "this text is not a number".into() })
    });
}
