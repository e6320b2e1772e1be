//! The benchmark's workload (`cargo xtask bench controllers`): programs of the gallery and what they see, timed from outside.

use crate::answer::Answer;
use crate::gallery::{MODULE, POLICY, SCRIPTS};
use crate::program::{Program, compile};
use crate::ranges::BEAMS;
use crate::source::Source;
use crate::view::{Chassis, Member, Place, Seen, Setup, View};
use control::law::Fault;

/// Robots that turn any way, each with one target, in an arena of 20 m.
pub fn setup(robots: usize) -> Setup {
    let member = |robot: usize| Member {
        name: format!("robot-{robot}"),
        drive: Chassis::Holonomic,
        turning_radius_m: 0.0,
        radius_m: 0.2,
        targets: vec![Place {
            x_m: 1.0,
            y_m: robot as f64 / 10.0,
            yaw_rad: None,
        }],
    };
    Setup {
        rate_hz: control::TICK_RATE_HZ,
        arena_m: [20.0, 20.0],
        robots: (0..robots).map(member).collect(),
        parameters: vec![("speed_m_per_s".into(), 0.3)],
    }
}

/// The robots of [`setup`] in a column that moves slowly to the right.
pub fn view(robots: usize, tick: u64) -> View {
    let seen = |robot: usize| Seen {
        x_m: -5.0 + 0.001 * tick as f64,
        y_m: robot as f64 / 5.0,
        yaw_rad: 0.3,
        age_s: 0.02,
        forward_m_per_s: 0.1,
        left_m_per_s: 0.0,
        yaw_rate_rad_per_s: 0.0,
        online: true,
        ranges_m: [1.0; BEAMS],
    };
    View {
        tick,
        time_s: tick as f64 / 120.0,
        robots: (0..robots).map(seen).collect(),
    }
}

/// Every program of the gallery, and a name for it.
pub fn programs() -> Vec<(String, Source)> {
    let scripts = SCRIPTS.iter().map(|example| {
        (
            format!("script {}", example.name),
            Source::Script(example.script.into()),
        )
    });
    let others = [
        ("module go_to_point".to_owned(), Source::module(MODULE)),
        ("policy go_to_point".to_owned(), Source::policy(POLICY)),
    ];
    scripts.chain(others).collect()
}

/// One program and its robots.
pub struct Workload {
    program: Box<dyn Program>,
    robots: usize,
    tick: u64,
    answer: Answer,
}

impl Workload {
    /// - Errors: a program that is refused for so many robots.
    pub fn new(source: &Source, robots: usize) -> Result<Workload, Fault> {
        Ok(Workload {
            program: compile(source, &setup(robots))?,
            robots,
            tick: 0,
            answer: Answer::default(),
        })
    }

    /// What the next tick sees; made ahead, so that only [`Workload::step`] is timed.
    pub fn next_view(&mut self) -> View {
        self.tick += 1;
        view(self.robots, self.tick - 1)
    }

    /// One tick.
    ///
    /// - Errors: why the program was stopped.
    pub fn step(&mut self, view: &View) -> Result<(), Fault> {
        self.answer.clear(self.robots);
        self.program.step(view, &mut self.answer).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_program_drives_one_robot_and_ten() {
        for (name, source) in programs() {
            for robots in [1, 10] {
                let mut work = Workload::new(&source, robots).unwrap_or_else(|fault| panic!("{name}: {fault}"));
                for _ in 0..3 {
                    let view = work.next_view();
                    work.step(&view)
                        .unwrap_or_else(|fault| panic!("{name}, {robots}: {fault}"));
                }
                assert_eq!(work.tick, 3);
                assert_eq!(work.answer.robots.len(), robots, "{name}");
            }
        }
    }
}
