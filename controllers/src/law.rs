//! A program as a control law: the team drives by it as by any other, behind acceleration limit and safety filter.

use control::law::{
    Body, Demand, Driver, Fault, FaultKind, Law, Note, OWN, Observation, Request, RobotObservation, Standing,
};
use twin::command::WheelCommand;
use twin::robot::Robot;
use twin::twist::BodyTwist;

use crate::answer::{Answer, Motion, Order};
use crate::limits::{LATE_TICKS, LOG_BYTES_PER_RUN, SILENT_TICKS};
use crate::program::{Program, Reply};
use crate::ranges::Surroundings;
use crate::view::View;

/// Yaw rate for each radian of heading error where the driver turns a robot.
const YAW_GAIN_PER_S: f64 = 3.0;

/// See the module.
#[derive(Debug)]
pub struct OwnLaw {
    program: Box<dyn Program>,
    robots: Vec<Robot>,
    surroundings: Surroundings,
    drivers: Vec<Driver>,
    /// Ticks in a row in which a robot was told nothing.
    silent: Vec<u32>,
    view: View,
    answer: Answer,
    fault: Option<Fault>,
    late_ticks: u32,
    log_bytes: usize,
}

impl OwnLaw {
    /// - `robots`: as described, in the order of the experiment.
    pub fn new(program: Box<dyn Program>, robots: Vec<Robot>, surroundings: Surroundings) -> OwnLaw {
        OwnLaw {
            program,
            drivers: vec![Driver::default(); robots.len()],
            silent: vec![0; robots.len()],
            robots,
            surroundings,
            view: View::default(),
            answer: Answer::default(),
            fault: None,
            late_ticks: 0,
            log_bytes: 0,
        }
    }

    fn ask(&mut self) -> Result<(), Fault> {
        let tick = self.view.tick;
        self.answer.clear(self.robots.len());
        match self.program.step(&self.view, &mut self.answer)? {
            Reply::InTime => self.late_ticks = 0,
            Reply::Late => {
                self.late_ticks += 1;
                self.answer.clear(self.robots.len());
                if self.late_ticks > LATE_TICKS {
                    let reason = format!("no answer for {} ticks", self.late_ticks);
                    return Err(Fault::new(FaultKind::Silent, Some(tick), reason));
                }
                return Ok(());
            }
        }
        for (robot, (say, silent)) in self.answer.robots.iter().zip(&mut self.silent).enumerate() {
            *silent = match say.order {
                None if !say.finished => *silent + 1,
                _ => 0,
            };
            if *silent > SILENT_TICKS {
                let reason = format!("robot {robot} was told nothing for {silent} ticks and has not finished");
                return Err(Fault::new(FaultKind::Silent, Some(tick), reason));
            }
            if let Some(order) = &say.order {
                let bad = |reason| Fault::new(FaultKind::BadCommand, Some(tick), reason);
                order.check(robot).map_err(bad)?;
            }
        }
        self.keep_log_short();
        Ok(())
    }

    fn keep_log_short(&mut self) {
        let used = &mut self.log_bytes;
        self.answer.notes.retain(|note| match note {
            Note::Log { text } => {
                *used += text.len();
                *used <= LOG_BYTES_PER_RUN
            }
            _ => true,
        });
    }

    fn twist(&mut self, place: usize, order: &Order, seen: &RobotObservation, body: &Body) -> BodyTwist {
        match order.motion {
            Motion::Twist([forward_m_per_s, left_m_per_s, yaw_rate_rad_per_s]) => BodyTwist {
                forward_m_per_s,
                left_m_per_s,
                yaw_rate_rad_per_s,
            },
            Motion::Velocity(velocity) => {
                let request = Request {
                    velocity,
                    way: velocity,
                    yaw_rad: order.yaw_rad,
                    stops: false,
                };
                self.drivers[place].twist(body.drive, seen, &request, YAW_GAIN_PER_S)
            }
            Motion::Wheels(wheels) => {
                let mut command = WheelCommand {
                    steering_rad: order.steering_rad.unwrap_or(0.0),
                    ..WheelCommand::default()
                };
                for (to, from) in command.wheel_rad_per_s.iter_mut().zip(wheels) {
                    *to = from;
                }
                self.robots[place].twist_of_wheels(&command)
            }
        }
    }
}

impl Law for OwnLaw {
    fn name(&self) -> &'static str {
        OWN
    }

    fn step(&mut self, observation: &Observation<'_>, demands: &mut [Demand]) {
        if self.fault.is_some() {
            self.answer.notes.clear();
            return;
        }
        self.view.update(observation, &self.surroundings);
        if let Err(fault) = self.ask() {
            self.fault = Some(fault);
            return;
        }
        for (place, demand) in demands.iter_mut().enumerate().take(self.robots.len()) {
            let say = self.answer.robots[place];
            let (seen, body) = (&observation.robots[place], &observation.bodies[place]);
            demand.finished = say.finished;
            demand.target = say.target_m.unwrap_or([seen.pose.x_m, seen.pose.y_m]);
            if let Some(order) = say.order {
                demand.twist = self.twist(place, &order, seen, body);
            }
        }
    }

    fn standing(&self) -> Standing<'_> {
        match &self.fault {
            Some(fault) => Standing::Faulty(fault),
            None if self.late_ticks > 0 => Standing::Late,
            None => Standing::Answered,
        }
    }

    fn notes(&self) -> &[Note] {
        &self.answer.notes
    }
}
