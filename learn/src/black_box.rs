//! The rival: a network without physics, on the same inputs.
//!
//! It learns how twist and wheel speeds change from what the robot does and is told, is driven at 60 Hz from the measured
//! start, and its pose is the integral of its twist. It is trained over many steps as well: gradients run back through
//! all steps of a window (Werbos 1990), against the measured twists, wheel speeds and gyro.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;
use twin::MAX_WHEELS;
use twin::free::RobotState;
use twin::pose::Pose;
use twin::replay::{HeldCommand, Tick};
use twin::residual::Quantity;
use twin::robot::Robot;
use twin::twist::BodyTwist;

use crate::adam::Adam;
use crate::inputs::{Eye, Frame, Watch};
use crate::network::{Network, Pass, uniform};
use crate::rollout::{Moment, Predictor};
use crate::train::Settings;
use crate::window::{Reading, Window};

/// Control ticks of a step.
const STEP_TICKS: u64 = 2;
const STEP_S: f64 = STEP_TICKS as f64 / 120.0;
const TWIST: usize = 3;
/// Most windows it is trained on; gradients through every step cost more than those of the residual.
const MOST_WINDOWS: usize = 400;
/// A state beyond this many deviations is held there: a network that runs away stays finite.
const FARTHEST: f64 = 8.0;
/// Largest size of a gradient of one batch.
const LARGEST_GRADIENT: f64 = 5.0;

/// A trained network.
#[derive(Debug, Clone)]
pub struct BlackBox {
    robot: Robot,
    network: Network,
    frame: Frame,
    /// Wheels that it predicts.
    wheels: Vec<usize>,
    /// Of the state: mean, deviation and change a second per unit of the outputs.
    mean: Vec<f64>,
    deviation: Vec<f64>,
    rate: Vec<f64>,
}

/// Steps of a window with what the backward pass needs.
struct Trail {
    states: Vec<Vec<f64>>,
    poses: Vec<Pose>,
    passes: Vec<Pass>,
}

impl BlackBox {
    /// Trains it; the weights with the least loss on the validation windows are kept, and that loss. `None` when no input varies.
    ///
    /// - `robot`: gives the meaning of the quantities; none of its physics is used but the nominal geometry.
    pub fn trained(
        robot: &Robot,
        eyes: &[Eye],
        train: &[Window],
        validation: &[Window],
        settings: &Settings,
        go_on: &mut dyn FnMut(usize, f64) -> bool,
    ) -> Option<(BlackBox, f64)> {
        // Quantities that only the twin could give it on the way are left out.
        let eyes: Vec<Eye> = eyes
            .iter()
            .filter(|eye| eye.quantity != Quantity::Steering)
            .copied()
            .collect();
        let thinned = |windows: &[Window]| -> Vec<Window> {
            let stride = windows.len().div_ceil(MOST_WINDOWS).max(1);
            windows.iter().step_by(stride).cloned().collect()
        };
        let (train, validation) = (thinned(train), thinned(validation));
        let mut own = BlackBox::untrained(robot, &eyes, &train, settings)?;
        let loss = |own: &BlackBox, windows: &[Window]| {
            windows.iter().map(|w| own.loss(w, None)).sum::<f64>() / windows.len().max(1) as f64
        };
        let mut best = own.network.clone();
        let (mut least, mut kept) = (loss(&own, &validation), 0);
        let mut adam = Adam::new(best.parameters().len());
        let mut random = Pcg64Mcg::seed_from_u64(settings.seed ^ 0x6261_636b);
        let mut order: Vec<usize> = (0..train.len()).collect();
        for epoch in 1..=settings.epochs {
            for place in (1..order.len()).rev() {
                order.swap(place, ((uniform(&mut random) * (place + 1) as f64) as usize).min(place));
            }
            let share = epoch as f64 / settings.epochs as f64;
            let rate = settings.rate * 0.5 * (1.0 + libm::cos(core::f64::consts::PI * share));
            for batch in order.chunks(settings.batch.max(1)) {
                let mut gradient = vec![0.0; best.parameters().len()];
                for number in batch {
                    own.loss(&train[*number], Some(&mut gradient));
                }
                let size = gradient.iter().map(|g| g * g).sum::<f64>().sqrt() / batch.len() as f64;
                let shrink = if size > LARGEST_GRADIENT {
                    LARGEST_GRADIENT / size
                } else {
                    1.0
                };
                gradient.iter_mut().for_each(|g| *g *= shrink / batch.len() as f64);
                if gradient.iter().all(|g| g.is_finite()) {
                    adam.step(own.network.parameters_mut(), &gradient, rate, settings.decay);
                }
            }
            let now = loss(&own, &validation);
            if now < least {
                (least, kept) = (now, epoch);
                best.clone_from(&own.network);
            }
            if epoch > kept + settings.patience || !go_on(epoch, now) {
                break;
            }
        }
        own.network = best;
        Some((own, least))
    }

    fn untrained(robot: &Robot, eyes: &[Eye], train: &[Window], settings: &Settings) -> Option<BlackBox> {
        let described = &robot.description().wheels;
        let wheels: Vec<usize> = (0..described.len())
            .filter(|k| described[*k].kind != "caster")
            .collect();
        let count = TWIST + wheels.len();
        let mut own = BlackBox {
            robot: robot.clone(),
            network: Network::new(&[1, 1], 0),
            frame: Frame::of(&[], core::iter::empty()).0,
            wheels,
            mean: vec![0.0; count],
            deviation: vec![1.0; count],
            rate: vec![1.0; count],
        };
        // Along the measured motion: inputs as they were, and how the state changed.
        let (mut rows, mut states, mut rates) = (Vec::new(), Vec::new(), Vec::new());
        for window in train {
            let measured = own.measured(window);
            let mut watch = Watch::new(robot, eyes);
            let commands = own.commands(window);
            for (time_s, state) in &measured {
                let number = ((time_s / STEP_S) as usize).min(commands.len() - 1);
                watch.take(&own.tick(state, &window.start.pose, &commands[number], number));
                watch.inputs(&mut rows);
            }
            for pair in measured.windows(2) {
                let step_s = pair[1].0 - pair[0].0;
                rates.push(
                    pair[1]
                        .1
                        .iter()
                        .zip(&pair[0].1)
                        .map(|(b, a)| (b - a) / step_s)
                        .collect::<Vec<f64>>(),
                );
            }
            states.extend(measured.into_iter().map(|(_, state)| state));
        }
        if states.is_empty() || rates.is_empty() {
            return None;
        }
        let (frame, _) = Frame::of(eyes, rows.chunks_exact(eyes.len()));
        if frame.eyes.is_empty() {
            return None;
        }
        for k in 0..count {
            let number = states.len() as f64;
            own.mean[k] = states.iter().map(|s| s[k]).sum::<f64>() / number;
            let spread = states
                .iter()
                .map(|s| (s[k] - own.mean[k]) * (s[k] - own.mean[k]))
                .sum::<f64>()
                / number;
            own.deviation[k] = spread.sqrt().max(1e-3);
            own.rate[k] = (rates.iter().map(|r| r[k] * r[k]).sum::<f64>() / rates.len() as f64)
                .sqrt()
                .max(1e-3);
        }
        let mut sizes = vec![frame.eyes.len()];
        sizes.extend(&settings.hidden);
        sizes.push(count);
        own.network = Network::new(&sizes, settings.seed);
        own.frame = frame;
        Some(own)
    }

    /// Measured states at the middles of the bins where everything was measured.
    fn measured(&self, window: &Window) -> Vec<(f64, Vec<f64>)> {
        let twists = window
            .samples
            .iter()
            .filter(|sample| sample.reading == Reading::Forward);
        let near = |reading: Reading, time_s: f64| {
            let mut found = window.samples.iter().filter(|sample| sample.reading == reading);
            found
                .find(|sample| (sample.time_s - time_s).abs() < 0.06)
                .map(|sample| sample.value)
        };
        let state = |time_s: f64| -> Option<Vec<f64>> {
            let mut state = vec![
                near(Reading::Forward, time_s)?,
                near(Reading::Left, time_s)?,
                near(Reading::YawRate, time_s)?,
            ];
            for wheel in &self.wheels {
                // A wheel that nobody measures counts as rolling at its start speed.
                let start = window.start.wheel_rad_per_s[*wheel];
                state.push(near(Reading::Wheel(*wheel), time_s).unwrap_or(start));
            }
            Some(state)
        };
        twists
            .filter_map(|sample| Some((sample.time_s, state(sample.time_s)?)))
            .collect()
    }

    /// Set-points in force at every step.
    fn commands(&self, window: &Window) -> Vec<HeldCommand> {
        let mut held = window.before;
        window.earlier.iter().for_each(|row| held.apply(&self.robot, row));
        let steps = (window.end_s() / STEP_S) as usize + 2;
        let mut next = 0;
        (0..steps)
            .map(|step| {
                let now_s = step as f64 * STEP_S;
                while next < window.rows.len() && window.rows[next].time_s <= now_s + 1e-5 {
                    held.apply(&self.robot, &window.rows[next]);
                    next += 1;
                }
                held
            })
            .collect()
    }

    fn tick(&self, state: &[f64], pose: &Pose, held: &HeldCommand, number: usize) -> Tick {
        let mut wheel_rad_per_s = [0.0; MAX_WHEELS];
        for (wheel, speed) in self.wheels.iter().zip(&state[TWIST..]) {
            wheel_rad_per_s[*wheel] = *speed;
        }
        let none = [0.0; MAX_WHEELS];
        Tick {
            number: number as u64 * STEP_TICKS,
            state: RobotState {
                pose: *pose,
                twist: BodyTwist {
                    forward_m_per_s: state[0],
                    left_m_per_s: state[1],
                    yaw_rate_rad_per_s: state[2],
                },
                wheel_rad_per_s,
                wheel_rad: none,
                current_a: none,
                voltage_v: none,
                bus_v: 0.0,
                steering_rad: held.command().steering_rad,
                gyro_z_rad_per_s: state[2],
                accel_x_m_per_s2: 0.0,
                accel_y_m_per_s2: 0.0,
            },
            command: held.command(),
        }
    }

    fn drive(&self, window: &Window) -> Trail {
        let start = &window.start;
        let twist = &start.twist;
        let mut state = vec![twist.forward_m_per_s, twist.left_m_per_s, twist.yaw_rate_rad_per_s];
        state.extend(self.wheels.iter().map(|wheel| start.wheel_rad_per_s[*wheel]));
        let mut pose = start.pose;
        let mut trail = Trail {
            states: Vec::new(),
            poses: Vec::new(),
            passes: Vec::new(),
        };
        let mut watch = Watch::with_period(&self.robot, &self.frame.eyes, STEP_TICKS as usize);
        let (mut inputs, mut normalised) = (Vec::new(), Vec::new());
        for (number, held) in self.commands(window).iter().enumerate() {
            watch.take(&self.tick(&state, &pose, held, number));
            inputs.clear();
            watch.inputs(&mut inputs);
            self.frame.normalised(&inputs, &mut normalised);
            let mut pass = Pass::default();
            let outputs = self.network.forward(&normalised, &mut pass);
            trail.states.push(state.clone());
            trail.poses.push(pose);
            let (sin, cos) = libm::sincos(pose.yaw_rad + 0.5 * STEP_S * state[2]);
            pose.x_m += STEP_S * (state[0] * cos - state[1] * sin);
            pose.y_m += STEP_S * (state[0] * sin + state[1] * cos);
            pose.yaw_rad += STEP_S * state[2];
            for k in 0..state.len() {
                let reach = FARTHEST * self.deviation[k];
                let moved = state[k] + STEP_S * self.rate[k] * outputs[k];
                state[k] = moved.max(self.mean[k] - reach).min(self.mean[k] + reach);
            }
            trail.passes.push(pass);
        }
        trail
    }

    /// Mean squared error of twist, wheels and gyro in deviations, and its gradient.
    fn loss(&self, window: &Window, gradient: Option<&mut [f64]>) -> f64 {
        let trail = self.drive(window);
        let steps = trail.states.len();
        let mut slopes = vec![vec![0.0; self.mean.len()]; steps];
        let (mut loss, mut count) = (0.0, 0.0);
        for sample in &window.samples {
            let place = match sample.reading {
                Reading::Forward => Some(0),
                Reading::Left => Some(1),
                Reading::YawRate | Reading::Gyro => Some(2),
                Reading::Wheel(k) => self
                    .wheels
                    .iter()
                    .position(|wheel| *wheel == k)
                    .map(|place| TWIST + place),
            };
            let position = sample.time_s / STEP_S;
            let (step, part) = (position as usize, position.fract());
            let (Some(place), true) = (place, step + 1 < steps) else {
                continue;
            };
            let (a, b) = (trail.states[step][place], trail.states[step + 1][place]);
            let error = (a + part * (b - a) - sample.value) / self.deviation[place];
            loss += error * error;
            count += 1.0;
            slopes[step][place] += 2.0 * (1.0 - part) * error / self.deviation[place];
            slopes[step + 1][place] += 2.0 * part * error / self.deviation[place];
        }
        if count == 0.0 {
            return 0.0;
        }
        if let Some(gradient) = gradient {
            self.back(&trail, &mut slopes, 1.0 / count, gradient);
        }
        loss / count
    }

    /// Runs the slopes of the states back through all steps.
    fn back(&self, trail: &Trail, slopes: &mut [Vec<f64>], share: f64, gradient: &mut [f64]) {
        let first = STEP_TICKS as usize;
        for step in (0..trail.states.len() - 1).rev() {
            let after = slopes[step + 1].clone();
            let of_outputs: Vec<f64> = (0..after.len())
                .map(|k| share * after[k] * STEP_S * self.rate[k])
                .collect();
            let of_inputs = self.network.backward(&trail.passes[step], &of_outputs, gradient);
            for (slope, value) in slopes[step].iter_mut().zip(&after) {
                *slope += value;
            }
            for (k, (eye, slope)) in self.frame.eyes.iter().zip(of_inputs).enumerate() {
                let source = step.saturating_sub(eye.ticks_ago / first);
                let slope = slope / (share * self.frame.scale[k]);
                let state = &trail.states[source];
                let into = &mut slopes[source];
                match eye.quantity {
                    Quantity::Forward => into[0] += slope,
                    Quantity::Left => into[1] += slope,
                    Quantity::YawRate => into[2] += slope,
                    Quantity::YawRateForward => {
                        into[0] += slope * state[2];
                        into[2] += slope * state[0];
                    }
                    Quantity::WheelSpeed => {
                        let place = self.wheels.iter().position(|wheel| Some(*wheel) == eye.wheel);
                        if let Some(place) = place {
                            into[TWIST + place] += slope;
                        }
                    }
                    // Commands do not answer; the place changes slowly and is taken as given.
                    _ => {}
                }
            }
        }
    }
}

impl Predictor for BlackBox {
    fn path(&self, window: &Window) -> Option<Vec<Moment>> {
        let trail = self.drive(window);
        let pairs = trail.states.iter().zip(&trail.poses).enumerate();
        let path: Vec<Moment> = pairs
            .map(|(step, (state, pose))| {
                let tick = self.tick(state, pose, &window.before, step);
                Moment {
                    time_s: step as f64 * STEP_S,
                    x_m: pose.x_m,
                    y_m: pose.y_m,
                    yaw_rad: pose.yaw_rad,
                    twist: [state[0], state[1], state[2]],
                    wheel_rad_per_s: tick.state.wheel_rad_per_s,
                    gyro_rad_per_s: state[2],
                }
            })
            .collect();
        path.iter()
            .all(|m| m.x_m.is_finite() && m.y_m.is_finite())
            .then_some(path)
    }
}
