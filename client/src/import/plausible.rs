//! Could these numbers be what the column map says they are? Judged as they stream by, in constant memory.

use super::unit::{Dimension, dimension};
use anyhow::bail;
use identify::channel::Channel;
use twin::robot::RobotDescription;

/// From one sample to the next, m: no robot, and no tracker of one floor.
const LONGEST_JUMP_M: f64 = 100.0;
/// Speed between poses that no robot of a laboratory has, m/s, and yaw rate, rad/s.
const FASTEST_M_PER_S: f64 = 50.0;
const FASTEST_RAD_PER_S: f64 = 20.0;
/// Steps of a heading in degrees that comes round, taken as radians.
const ROUND_IN_DEGREES: core::ops::Range<f64> = 300.0..400.0;
/// Slower than this, poses stand still, m/s and rad/s.
const MOVING_M_PER_S: f64 = 0.02;
const MOVING_RAD_PER_S: f64 = 0.2;
/// Moving steps from which a share of them counts.
const ENOUGH_STEPS: u64 = 50;
/// Distance and turn that are enough to compare sensors, m and rad.
const ENOUGH_M: f64 = 2.0;
const ENOUGH_RAD: f64 = 1.0;
/// Sensors of the same motion differ by less than this.
const ALIKE: f64 = 4.0;

/// Largest size of a value, with what may be wrong beyond it.
fn limit(channel: Channel) -> Option<(f64, &'static str, &'static str)> {
    Some(match channel {
        Channel::Steering | Channel::CommandSteering => (1.571, "rad", "if it is in degrees, give the unit deg"),
        Channel::Gyro | Channel::CommandYawRate => (70.0, "rad/s", "if it is in degrees, give the unit deg/s"),
        Channel::WheelSpeed(_) | Channel::CommandWheel(_) => (1000.0, "rad/s", "if it is in rpm, give the unit rpm"),
        _ => match dimension(channel) {
            Dimension::Speed => (FASTEST_M_PER_S, "m/s", "if it is in mm/s, give the unit mm/s"),
            Dimension::Current => (1000.0, "A", "if it is in mA, give the unit mA"),
            Dimension::Voltage => (1000.0, "V", "if it is in mV, give the unit mV"),
            Dimension::Acceleration => (500.0, "m/s2", "if it is in mg, give the unit mg"),
            Dimension::Length => (1e6, "m", "if it is in mm, give the unit mm"),
            _ => return None,
        },
    })
}

/// One column as it goes by.
#[derive(Debug, Clone, Default)]
struct Watch {
    samples: u64,
    first: f64,
    moves: bool,
    last: Option<(f64, f64)>,
    /// Steps that move, those too fast, and the first of these.
    moving: u64,
    too_fast: u64,
    first_fast: Option<(u64, f64)>,
    /// Sum of |steps|, sum of steps, integral of |value| and of the value over time.
    path: f64,
    net: f64,
    size_integral: f64,
    integral: f64,
}

/// All columns.
#[derive(Debug, Clone)]
pub struct Plausibility {
    columns: Vec<(Channel, String)>,
    watches: Vec<Watch>,
}

impl Plausibility {
    /// - `columns`: what is written, with their names.
    pub fn new(columns: Vec<(Channel, String)>) -> Plausibility {
        Plausibility {
            watches: vec![Watch::default(); columns.len()],
            columns,
        }
    }

    /// Takes a value in the bundle's unit, a yaw before it is wrapped.
    ///
    /// - Errors: a value that cannot be meant, with line, limit and remedy.
    pub fn see(&mut self, column: usize, line: u64, time_s: f64, value: f64) -> anyhow::Result<()> {
        let (channel, from) = &self.columns[column];
        let watch = &mut self.watches[column];
        if let Some((largest, unit, remedy)) = limit(*channel)
            && value.abs() > largest
        {
            bail!(
                "line {line}, column {from:?}: {} is {value:.6} {unit}; up to {largest} {unit} are possible; {remedy}",
                channel.name()
            );
        }
        if watch.samples == 0 {
            watch.first = value;
        }
        watch.moves |= value != watch.first;
        watch.samples += 1;
        if let Some((before_s, before)) = watch.last {
            let (step, dt_s) = (value - before, time_s - before_s);
            if dt_s > 0.0 {
                watch.step(*channel, from, line, step, dt_s, value)?;
            }
        }
        watch.last = Some((time_s, value));
        Ok(())
    }

    /// The next value does not follow the last.
    pub fn cut(&mut self) {
        for watch in &mut self.watches {
            watch.last = None;
        }
    }

    fn of(&self, wanted: Channel) -> Option<(&str, &Watch)> {
        let at = self.columns.iter().position(|(channel, _)| *channel == wanted)?;
        Some((&self.columns[at].1, &self.watches[at]))
    }

    /// What is only known at the end: refusals as an error, what is merely strange as lines.
    pub fn judge(&self, robot: &RobotDescription) -> anyhow::Result<Vec<String>> {
        let mut remarks = Vec::new();
        for ((channel, from), watch) in self.columns.iter().zip(&self.watches) {
            let name = channel.name();
            if watch.samples == 0 {
                remarks.push(format!("column {from:?}: no sample in any row; {name} stays empty"));
            } else if watch.samples > 1 && !watch.moves && !channel.is_command() && *channel != Channel::CameraId {
                remarks.push(format!(
                    "column {from:?}: {name} is constant at {} in all {} samples; is the sensor connected?",
                    watch.first, watch.samples
                ));
            }
            if let Some((line, rate)) = watch.first_fast {
                let (unit, most, remedy) = if *channel == Channel::PoseYaw {
                    ("rad/s", FASTEST_RAD_PER_S, "if it is in degrees, give the unit deg")
                } else {
                    ("m/s", FASTEST_M_PER_S, "if it is in millimetres, give the unit mm")
                };
                let share = watch.too_fast as f64 / watch.moving.max(1) as f64;
                let text = format!(
                    "column {from:?}: {name} moves at {rate:.0} {unit} in line {line}, and faster than {most} {unit} in {} of {} moving steps",
                    watch.too_fast, watch.moving
                );
                if share > 0.5 && watch.moving > ENOUGH_STEPS {
                    bail!("{text}; {remedy}");
                }
                remarks.push(format!("{text}; diagnose leaves single jumps of a tracker out"));
            }
        }
        self.turning(&mut remarks)?;
        self.rolling(robot, &mut remarks);
        let unsensed = |k: usize| {
            self.of(Channel::CommandWheel(k)).is_none()
                && self.of(Channel::WheelSpeed(k)).is_none()
                && self.of(Channel::CommandForward).is_none()
        };
        for (k, wheel) in robot.wheels.iter().enumerate() {
            if wheel.driven && unsensed(k) {
                remarks.push(format!(
                    "wheel {k} is driven and has neither set-point nor speed; is this the robot of the log?"
                ));
            }
        }
        Ok(remarks)
    }

    /// Gyro against heading.
    fn turning(&self, remarks: &mut Vec<String>) -> anyhow::Result<()> {
        let (Some((yaw_from, yaw)), Some((gyro_from, gyro))) = (self.of(Channel::PoseYaw), self.of(Channel::Gyro))
        else {
            return Ok(());
        };
        let (turned, integrated) = (yaw.net, gyro.integral);
        if turned.abs() < ENOUGH_RAD || integrated.abs() < ENOUGH_RAD {
            return Ok(());
        }
        let ratio = integrated / turned;
        if ratio.abs() > 20.0 {
            bail!(
                "column {gyro_from:?}: the gyro turns {:.0} times as much as the poses; at most 20 times is possible; if it is in degrees, give the unit deg/s",
                ratio.abs()
            );
        }
        if ratio.abs() < 0.05 {
            bail!(
                "column {yaw_from:?}: the poses turn {:.0} times as much as the gyro; at most 20 times is possible; if they are in degrees, give the unit deg",
                1.0 / ratio.abs()
            );
        }
        if ratio < 0.0 && yaw.path < 3.0 * turned.abs() {
            remarks.push(format!(
                "column {gyro_from:?}: the gyro turns the other way than the poses; counter-clockwise is positive, the gain -1 turns it round"
            ));
        } else if !(1.0 / ALIKE..ALIKE).contains(&ratio.abs()) {
            remarks.push(format!(
                "column {gyro_from:?}: the gyro turns {ratio:.2} times as much as the poses; up to {ALIKE} times is usual; check its unit"
            ));
        }
        Ok(())
    }

    /// Rims against poses.
    fn rolling(&self, robot: &RobotDescription, remarks: &mut Vec<String>) {
        let (Some((_, x)), Some((_, y)), Some((_, yaw))) = (
            self.of(Channel::PoseX),
            self.of(Channel::PoseY),
            self.of(Channel::PoseYaw),
        ) else {
            return;
        };
        // Between the longer side and both together.
        let driven_m = (x.path * x.path + y.path * y.path).sqrt();
        for (k, wheel) in robot.wheels.iter().enumerate() {
            let (Some((from, speed)), Some(radius_m)) = (self.of(Channel::WheelSpeed(k)), wheel.radius_m) else {
                continue;
            };
            let rolled_m = radius_m * speed.size_integral;
            let arm_m = (wheel.x_m * wheel.x_m + wheel.y_m * wheel.y_m).sqrt();
            let most_m = driven_m + arm_m * yaw.path;
            if most_m > ENOUGH_M && rolled_m > ALIKE * most_m {
                remarks.push(format!(
                    "column {from:?}: wheel {k} rolls {rolled_m:.1} m while the robot moves {most_m:.1} m; up to {ALIKE} times is usual; check unit and wheel radius {radius_m} m"
                ));
            }
            if driven_m > ENOUGH_M && rolled_m < driven_m / ALIKE {
                remarks.push(format!(
                    "column {from:?}: wheel {k} rolls {rolled_m:.1} m while the robot moves {driven_m:.1} m; at least a {ALIKE}th is usual; check unit and wheel radius {radius_m} m"
                ));
            }
        }
    }
}

impl Watch {
    fn step(
        &mut self,
        channel: Channel,
        from: &str,
        line: u64,
        step: f64,
        dt_s: f64,
        value: f64,
    ) -> anyhow::Result<()> {
        self.size_integral += value.abs() * dt_s;
        self.integral += value * dt_s;
        let (step, moving, fastest) = match channel {
            Channel::PoseX | Channel::PoseY => {
                if step.abs() > LONGEST_JUMP_M {
                    bail!(
                        "line {line}, column {from:?}: {} jumps by {:.1} m from one sample to the next; up to {LONGEST_JUMP_M} m are possible; check its unit, or cut the runs there (--cut-by)",
                        channel.name(),
                        step.abs()
                    );
                }
                (step, MOVING_M_PER_S, FASTEST_M_PER_S)
            }
            Channel::PoseYaw => {
                if ROUND_IN_DEGREES.contains(&step.abs()) {
                    bail!(
                        "line {line}, column {from:?}: pose_yaw_rad steps by {:.1} rad from one sample to the next; a whole turn is 6.283 rad; it is in degrees, give the unit deg",
                        step.abs()
                    );
                }
                // Whole turns where it is wrapped.
                let turns = (step / core::f64::consts::TAU).round();
                let wrapped = if turns.abs() <= 1.0 {
                    step - turns * core::f64::consts::TAU
                } else {
                    step
                };
                (wrapped, MOVING_RAD_PER_S, FASTEST_RAD_PER_S)
            }
            _ => return Ok(()),
        };
        self.path += step.abs();
        self.net += step;
        let rate = step.abs() / dt_s;
        self.moving += u64::from(rate > moving);
        if rate > fastest {
            self.too_fast += 1;
            self.first_fast.get_or_insert((line, rate));
        }
        Ok(())
    }
}
