//! What a script can say: commands for robots, log lines, drawings; and the few words of the language's core that it needs.

use std::sync::{Arc, Mutex};

use control::law::Note;
use rhai::{Array, Dynamic, Engine, EvalAltResult};

use super::lock;
use super::maths::number;
use crate::answer::{Answer, Motion, Order, Say, WHEELS};
use crate::view::Setup;

type Done = Result<(), Box<EvalAltResult>>;

/// Part of the reason of every command that cannot be.
pub(super) const BAD_COMMAND: &str = "the command for robot ";
/// Colours of drawings; others count on from the first.
const COLOURS: i64 = 8;

/// Changes what is said about one robot.
fn about(answer: &Mutex<Answer>, robot: &Dynamic, change: impl FnOnce(&mut Say)) -> Done {
    let mut answer = lock(answer);
    let count = answer.robots.len();
    let place = robot.as_int().ok().and_then(|place| usize::try_from(place).ok());
    match place.and_then(|place| answer.robots.get_mut(place)) {
        Some(say) => {
            change(say);
            Ok(())
        }
        None => Err(format!("{BAD_COMMAND}{robot}: there are robots 0 to {}", count - 1).into()),
    }
}

fn command(answer: &Mutex<Answer>, robot: &Dynamic, order: Order) -> Done {
    order.check(robot.as_int().unwrap_or(0).max(0) as usize)?;
    about(answer, robot, |say| say.order = Some(order))
}

fn colour(value: i64) -> u8 {
    value.rem_euclid(COLOURS) as u8
}

pub(super) fn register(engine: &mut Engine, setup: &Arc<Setup>, spoken: &Arc<Mutex<Answer>>) {
    commands(engine, spoken);
    drawings(engine, spoken);
    let own = setup.clone();
    let value = move |name: &str| {
        own.parameters
            .iter()
            .find(|(known, _)| known == name)
            .map(|(_, value)| *value)
    };
    let needed = value.clone();
    engine.register_fn("parameter", move |name: &str| {
        let none = || -> Box<EvalAltResult> { format!("the experiment gives no parameter {name:?}").into() };
        needed(name).ok_or_else(none)
    });
    engine.register_fn("parameter", move |name: &str, otherwise: Dynamic| {
        value(name).map_or_else(|| number(&otherwise), Ok)
    });
    let log = spoken.clone();
    engine.register_fn("log_line", move |value: Dynamic| lock(&log).log(&value.to_string()));
}

fn commands(engine: &mut Engine, spoken: &Arc<Mutex<Answer>>) {
    let to = spoken.clone();
    engine.register_fn("twist", move |robot: Dynamic, u: Dynamic, v: Dynamic, r: Dynamic| {
        let twist = [number(&u)?, number(&v)?, number(&r)?];
        command(&to, &robot, Order::twist(twist))
    });
    let to = spoken.clone();
    engine.register_fn("velocity", move |robot: Dynamic, x: Dynamic, y: Dynamic| {
        let order = velocity([number(&x)?, number(&y)?], None);
        command(&to, &robot, order)
    });
    let to = spoken.clone();
    engine.register_fn(
        "velocity",
        move |robot: Dynamic, x: Dynamic, y: Dynamic, yaw: Dynamic| {
            let order = velocity([number(&x)?, number(&y)?], Some(number(&yaw)?));
            command(&to, &robot, order)
        },
    );
    let to = spoken.clone();
    engine.register_fn("wheels", move |robot: Dynamic, speeds: Array| {
        command(&to, &robot, wheels(&speeds, None)?)
    });
    let to = spoken.clone();
    engine.register_fn("wheels", move |robot: Dynamic, speeds: Array, steering: Dynamic| {
        command(&to, &robot, wheels(&speeds, Some(number(&steering)?))?)
    });
    let to = spoken.clone();
    engine.register_fn("stop", move |robot: Dynamic| {
        command(&to, &robot, Order::twist([0.0; 3]))
    });
    let to = spoken.clone();
    engine.register_fn("finished", move |robot: Dynamic| {
        about(&to, &robot, |say| say.finished = true)
    });
    let to = spoken.clone();
    engine.register_fn("finished", move |robot: Dynamic, is: bool| {
        about(&to, &robot, |say| say.finished = is)
    });
    let to = spoken.clone();
    engine.register_fn("target", move |robot: Dynamic, x: Dynamic, y: Dynamic| {
        let place = [number(&x)?, number(&y)?];
        about(&to, &robot, |say| {
            say.target_m = Some(place).filter(|place| place.iter().all(|v| v.is_finite()))
        })
    });
}

fn velocity(velocity: [f64; 2], yaw_rad: Option<f64>) -> Order {
    Order {
        motion: Motion::Velocity(velocity),
        yaw_rad,
        steering_rad: None,
    }
}

fn wheels(speeds: &Array, steering_rad: Option<f64>) -> Result<Order, Box<EvalAltResult>> {
    if speeds.len() > WHEELS {
        return Err(format!("{} wheels; at most {WHEELS} are possible", speeds.len()).into());
    }
    let mut wheel_rad_per_s = [0.0; WHEELS];
    for (to, from) in wheel_rad_per_s.iter_mut().zip(speeds) {
        *to = number(from)?;
    }
    Ok(Order {
        motion: Motion::Wheels(wheel_rad_per_s),
        yaw_rad: None,
        steering_rad,
    })
}

fn drawings(engine: &mut Engine, spoken: &Arc<Mutex<Answer>>) {
    let to = spoken.clone();
    engine.register_fn("point", move |x: Dynamic, y: Dynamic, shade: i64| -> Done {
        let (at_m, colour) = ([number(&x)?, number(&y)?], colour(shade));
        lock(&to).draw(Note::Point { at_m, colour });
        Ok(())
    });
    let to = spoken.clone();
    engine.register_fn(
        "line",
        move |x: Dynamic, y: Dynamic, to_x: Dynamic, to_y: Dynamic, shade: i64| -> Done {
            let from_m = [number(&x)?, number(&y)?];
            let to_m = [number(&to_x)?, number(&to_y)?];
            let colour = colour(shade);
            lock(&to).draw(Note::Line { from_m, to_m, colour });
            Ok(())
        },
    );
    let to = spoken.clone();
    engine.register_fn("text", move |x: Dynamic, y: Dynamic, text: &str, shade: i64| -> Done {
        let (at_m, colour) = ([number(&x)?, number(&y)?], colour(shade));
        let text = text.to_owned();
        lock(&to).draw(Note::Text { at_m, text, colour });
        Ok(())
    });
}
