//! The controllers of one robot's motors, in step with its physics.

use super::{ControlSample, Controller, Motion};
use crate::command::WheelCommand;
use crate::free::integrate;
use crate::model::Model;
use crate::robot::Motor;
use crate::state::BodyState;
use crate::{PHYSICS_PERIOD_S, PHYSICS_RATE_HZ};

/// The controllers of all driven wheels, sampled together.
#[derive(Debug, Clone)]
pub(crate) struct Drives {
    /// By lane, driven ones only.
    controllers: Vec<(usize, Controller)>,
    samples_per_step: u32,
    steps_per_sample: u32,
    /// Physics steps since the last sample, for rates below that of the physics.
    phase: u32,
}

impl Drives {
    /// `None` where the description leaves the control out.
    pub(crate) fn new(motor: Option<&Motor>, model: &Model) -> Option<Drives> {
        let motor = motor?;
        let rate_hz = motor.controller.as_ref()?.sample_rate_hz;
        let lanes = (0..model.lanes).filter(|lane| model.driven[*lane]);
        Some(Drives {
            controllers: lanes.map(|lane| (lane, Controller::new(motor))).collect(),
            samples_per_step: (rate_hz / PHYSICS_RATE_HZ).max(1),
            steps_per_sample: (PHYSICS_RATE_HZ / rate_hz).max(1),
            phase: 0,
        })
    }

    /// Takes over wheels in motion, with the currents in the state.
    pub(crate) fn take_over(&mut self, model: &Model, state: &BodyState) {
        let Some(motor) = &model.motor else { return };
        for (lane, controller) in &mut self.controllers {
            let lane = *lane;
            controller.take_over(&Motion {
                wheel_rad: encoder_rad(model, state, lane),
                wheel_rad_per_s: model.encoder_speed(state, lane),
                current_a: state.current[lane],
                voltage_v: state.current[lane] / model.per_ohm[lane]
                    + model.torque_per_current[lane] * state.wheel[lane],
                bus_v: motor.supply_v,
            });
        }
    }

    /// Sets the voltages where a sample is due.
    fn sample(&mut self, model: &Model, state: &mut BodyState, command: &WheelCommand) {
        let due = self.phase == 0;
        self.phase = (self.phase + 1) % self.steps_per_sample;
        let Some(motor) = model.motor.as_ref().filter(|_| due) else {
            return;
        };
        for (lane, controller) in &mut self.controllers {
            let lane = *lane;
            state.voltage[lane] = controller.step(&ControlSample {
                command_rad_per_s: command.wheel_rad_per_s[model.wheel_of_lane[lane]],
                wheel_rad_per_s: model.encoder_speed(state, lane),
                encoder_count: controller.count_at(encoder_rad(model, state, lane)),
                current_a: state.current[lane],
                bus_v: motor.supply_v,
            });
        }
    }

    /// Numbers that the next step depends on.
    pub(crate) fn words(&self) -> impl Iterator<Item = f64> + '_ {
        let controllers = self.controllers.iter().flat_map(|(_, controller)| controller.words());
        core::iter::once(f64::from(self.phase)).chain(controllers)
    }

    pub(crate) fn word_count(&self) -> usize {
        1 + self
            .controllers
            .iter()
            .map(|(_, controller)| controller.word_count())
            .sum::<usize>()
    }

    /// Inverse of [`Drives::words`]; `words` must be as many.
    pub(crate) fn restore(&mut self, words: &[f64]) {
        self.phase = words[0] as u32 % self.steps_per_sample;
        let mut rest = &words[1..];
        for (_, controller) in &mut self.controllers {
            let (own, after) = rest.split_at(controller.word_count());
            controller.restore(own);
            rest = after;
        }
    }
}

/// Angle that the encoder of a wheel counts, as a view shows it.
fn encoder_rad(model: &Model, state: &BodyState, lane: usize) -> f64 {
    model.encoder[lane] * (state.angle[lane] + model.gear_place_rad[lane])
}

/// One physics step of 1/480 s with all samples that fall into it.
pub(crate) fn substep(
    drives: &mut Drives,
    model: &Model,
    state: &mut BodyState,
    command: &WheelCommand,
    refinement: u32,
) {
    let period_s = PHYSICS_PERIOD_S / f64::from(drives.samples_per_step * refinement);
    for _ in 0..drives.samples_per_step {
        drives.sample(model, state, command);
        for _ in 0..refinement {
            integrate(model, state, command, period_s);
        }
    }
}
