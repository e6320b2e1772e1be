//! Every effect at its large size against the nominal robot.

use crate::{chart, manoeuvre, reference};
use std::fmt::Write as _;
use twin::effect::Effect;
use twin::effect::library::{EffectEntry, Hook, LIBRARY, Needs};
use twin::replay::ReplayRow;
use twin::world::RobotState;

/// One thing a sensor reports: name, unit, noise that it is compared with, value.
type Channel = (&'static str, &'static str, f64, fn(&RobotState, usize) -> f64);

const CHANNELS: [Channel; 9] = [
    ("x", "m", 0.001, |s, _| s.pose.x_m),
    ("y", "m", 0.001, |s, _| s.pose.y_m),
    ("yaw", "rad", 0.003, |s, _| s.pose.yaw_rad),
    ("wheel speed", "rad/s", 0.05, |s, k| s.wheel_rad_per_s[k]),
    ("motor current", "A", 0.03, |s, k| s.current_a[k]),
    ("gyro", "rad/s", 0.006, |s, _| s.gyro_z_rad_per_s),
    ("forward acceleration", "m/s²", 0.05, |s, _| s.accel_x_m_per_s2),
    ("battery", "V", 0.03, |s, _| s.bus_v),
    ("steering", "rad", 0.002, |s, _| s.steering_rad),
];
/// Seconds of a curve around the largest difference.
const WINDOW_ROWS: usize = 300;

pub fn section(html: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    html.push_str(
        "<h2>Every effect, switched on and off</h2><p class=\"key\"><i class=\"nominal\"></i> nominal <i class=\"changed\"></i> with the effect. \
         Each is shown in the manoeuvre and the channel in which it stands out most over the sensors' noise.</p>",
    );
    for (hook, title) in [
        (Hook::Command, "Commands"),
        (Hook::Actuator, "Actuators"),
        (Hook::Contact, "Wheel and floor"),
        (Hook::Body, "Body"),
        (Hook::Sensor, "Sensors"),
    ] {
        let _ = write!(html, "<h3>{title}</h3><div class=\"cards\">");
        for entry in LIBRARY.iter().filter(|entry| entry.hook == hook) {
            card(html, entry)?;
        }
        html.push_str("</div>");
    }
    Ok(())
}

/// The pair of traces that shows an effect best.
struct Shown {
    strength: f64,
    manoeuvre: &'static str,
    channel: &'static Channel,
    plain: Vec<ReplayRow>,
    changed: Vec<ReplayRow>,
}

fn card(html: &mut String, entry: &EffectEntry) -> Result<(), Box<dyn std::error::Error>> {
    let chassis = match entry.needs {
        Needs::Steering | Needs::StandardWheel => "rwd",
        Needs::Caster => "diff2",
        _ => "omni4",
    };
    let robot = reference(chassis)?;
    let mut effect = Effect::sized(entry, &robot, |(_, large)| large);
    if entry.name == "low_friction_patch" {
        effect.parameters.insert("x".to_owned(), Some(0.4));
    }
    let mut best: Option<Shown> = None;
    for name in manoeuvre::FOR_EFFECTS {
        let plain = manoeuvre::run(&robot, &[], name)?;
        let changed = manoeuvre::run(&robot, std::slice::from_ref(&effect), name)?;
        for channel in &CHANNELS {
            let strength = plain.iter().zip(&changed).fold(0.0, |sum, (a, b)| {
                let change = (channel.3)(&a.state, 0) - (channel.3)(&b.state, 0);
                sum + (change / channel.2).powi(2)
            });
            if best.as_ref().is_none_or(|best| strength > best.strength) {
                best = Some(Shown {
                    strength,
                    manoeuvre: name,
                    channel,
                    plain: plain.clone(),
                    changed: changed.clone(),
                });
            }
        }
    }
    let Some(Shown {
        manoeuvre: name,
        channel,
        plain,
        changed,
        ..
    }) = best
    else {
        return Ok(());
    };
    let largest = (0..plain.len()).fold(0, |at, k| {
        if change(channel, &plain, &changed, k) > change(channel, &plain, &changed, at) {
            k
        } else {
            at
        }
    });
    let from = largest.saturating_sub(WINDOW_ROWS / 2).min(plain.len() - WINDOW_ROWS);
    let curve = |rows: &[ReplayRow]| -> Vec<(f64, f64)> {
        rows[from..from + WINDOW_ROWS]
            .iter()
            .map(|row| (row.time_s, (channel.3)(&row.state, 0)))
            .collect()
    };
    let (a, b) = (manoeuvre::path(&plain), manoeuvre::path(&changed));
    let values: Vec<String> = entry
        .parameters
        .iter()
        .map(|parameter| {
            format!(
                "{} {}",
                parameter.name,
                value(effect.value(parameter.name), parameter.unit)
            )
        })
        .collect();
    let _ = write!(
        html,
        "<article><h4><code>{}</code></h4><p>{}</p><p class=\"small\">{} on <b>{chassis}</b>, {}</p><div class=\"pair\">{}{}</div></article>",
        entry.name,
        entry.law.replace('<', "&lt;"),
        values.join(", "),
        manoeuvre::title(name),
        chart::paths(&[("nominal", &a), ("changed", &b)], 150.0, 130.0),
        chart::curves(
            &[("nominal", curve(&plain)), ("changed", curve(&changed))],
            &format!("{}, {}", channel.0, channel.1),
            240.0,
            130.0
        ),
    );
    Ok(())
}

fn change(channel: &Channel, a: &[ReplayRow], b: &[ReplayRow], k: usize) -> f64 {
    ((channel.3)(&a[k].state, 0) - (channel.3)(&b[k].state, 0)).abs()
}

fn value(value: f64, unit: &str) -> String {
    let rounded = (value * 1e4).round() / 1e4;
    if unit == "1" {
        format!("{rounded}")
    } else {
        format!("{rounded} {unit}")
    }
}
