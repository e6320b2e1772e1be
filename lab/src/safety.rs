//! When a run may drive, when it must hold still and when it is over: a pure state machine, asked once per tick.
//!
//! It does not avoid collisions; the safety filter in `control` does. It decides whether there may be motion at all.
//! Whatever ends a run stays the reason: the first ending wins and is never left.

use crate::ladder::{Consequence, Finding};
use api::run::{Fault, RunState, Whose};

/// Without a tracker frame for this long no robot moves.
pub const TRACKER_HOLD_US: i64 = 100_000;
/// Without a tracker frame for this long the run fails.
pub const TRACKER_FAIL_US: i64 = 1_000_000;
/// Without a believable pose of one robot for this long the run fails.
pub const POSE_FAIL_US: i64 = 1_000_000;
/// Without telemetry from one robot for this long the run fails; the robot latches itself off after the same time.
pub const ROBOT_SILENT_US: i64 = 500_000;
/// The lab gives up this long before the service may hand the run to someone else.
pub const LEASE_MARGIN_US: i64 = 1_000_000;

/// What one robot looks like at a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RobotHealth {
    /// Age of the newest telemetry frame.
    pub telemetry_age_us: i64,
    /// Age of the newest believed pose.
    pub pose_age_us: i64,
    /// It says that it has latched itself off without a stop: it heard nothing for so long, and no set-point moves it any more. A robot
    /// that stopped for a reason of its own tells that as a finding.
    pub deaf: bool,
}

/// What the state machine looks at.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    pub now_us: i64,
    /// Age of the newest tracker frame, whatever it shows.
    pub tracker_age_us: i64,
    pub robots: &'a [RobotHealth],
    pub signals: Signals,
    /// All robots reached their last target and stayed there.
    pub team_finished: bool,
    /// Robots hold each other for good.
    pub team_stuck: bool,
    /// The user's own controller cannot go on.
    pub team_faulty: bool,
    /// The experiment's time is over.
    pub time_over: bool,
}

/// What reaches the loop from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Signals {
    /// Protective stop pressed and not cleared.
    pub protective_stop: bool,
    /// The process is asked to end.
    pub shutdown: bool,
    /// The service says that this attempt is no longer current.
    pub stale_epoch: bool,
    /// Someone wants this run to stop.
    pub cancel: bool,
    /// The lab must be still from this moment on unless a heartbeat moves it.
    pub lease_until_us: i64,
    /// The recorder failed: what is not recorded does not drive.
    pub recorder_failed: bool,
    /// Robot of the run (index in the experiment) in the gravest state; none while all are well.
    pub robot_finding: Option<(usize, Finding)>,
}

/// Permission for one tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Permission {
    /// Commands of the team may go out.
    Drive,
    /// Stop commands, and carry on when the reason passes.
    Hold,
    /// Stop commands, for good.
    Ended(Ending),
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    Finished,
    ProtectiveStop,
    LabStopped,
    StaleEpoch,
    LeaseLost,
    RecorderFailed,
    /// Index of the robot in the experiment.
    RobotSilent(usize),
    /// Index of the robot in the experiment: it hears nothing, though it may be heard.
    RobotDeaf(usize),
    /// Index of the robot in the experiment, and what is wrong with it.
    RobotUnfit(usize, Finding),
    TrackerSilent,
    /// Index of the robot in the experiment.
    PoseLost(usize),
    Cancelled,
    Deadlock,
    /// The user's own controller cannot go on.
    ControllerFault,
}

/// See the module.
#[derive(Debug, Clone, Default)]
pub struct Safety {
    ending: Option<Ending>,
}

impl Safety {
    /// Decides on this tick.
    pub fn tick(&mut self, inputs: &Inputs) -> Permission {
        if self.ending.is_none() {
            self.ending = find_ending(inputs);
        }
        match self.ending {
            Some(ending) => Permission::Ended(ending),
            None if inputs.tracker_age_us > TRACKER_HOLD_US => Permission::Hold,
            None => Permission::Drive,
        }
    }
}

/// The first reason to end, gravest first.
fn find_ending(inputs: &Inputs) -> Option<Ending> {
    let signals = inputs.signals;
    let silent = || {
        inputs
            .robots
            .iter()
            .position(|robot| robot.telemetry_age_us > ROBOT_SILENT_US)
    };
    let deaf = || inputs.robots.iter().position(|robot| robot.deaf);
    let lost = || inputs.robots.iter().position(|robot| robot.pose_age_us > POSE_FAIL_US);
    let unfit = |consequence| {
        let found = signals.robot_finding;
        found.filter(|(_, finding)| finding.consequence() == consequence)
    };
    if signals.protective_stop {
        Some(Ending::ProtectiveStop)
    } else if signals.shutdown {
        Some(Ending::LabStopped)
    } else if signals.stale_epoch {
        Some(Ending::StaleEpoch)
    } else if inputs.now_us >= signals.lease_until_us {
        Some(Ending::LeaseLost)
    } else if signals.recorder_failed {
        Some(Ending::RecorderFailed)
    } else if let Some((robot, finding)) = unfit(Consequence::Stop) {
        Some(Ending::RobotUnfit(robot, finding))
    } else if let Some(robot) = silent() {
        Some(Ending::RobotSilent(robot))
    } else if let Some(robot) = deaf() {
        Some(Ending::RobotDeaf(robot))
    } else if inputs.tracker_age_us > TRACKER_FAIL_US {
        Some(Ending::TrackerSilent)
    } else if let Some(robot) = lost() {
        Some(Ending::PoseLost(robot))
    } else if let Some((robot, finding)) = unfit(Consequence::EndRun) {
        Some(Ending::RobotUnfit(robot, finding))
    } else if signals.cancel {
        Some(Ending::Cancelled)
    } else if inputs.team_faulty {
        Some(Ending::ControllerFault)
    } else if inputs.team_finished || inputs.time_over {
        Some(Ending::Finished)
    } else if inputs.team_stuck {
        Some(Ending::Deadlock)
    } else {
        None
    }
}

impl Ending {
    /// State and fault to report; `robots` are the names in the order of the experiment.
    pub fn report(self, robots: &[String]) -> (RunState, Option<Fault>) {
        let name = |index: usize| robots.get(index).map_or("a robot", String::as_str);
        let (state, whose, code, message) = match self {
            Self::Finished => return (RunState::Done, None),
            Self::ProtectiveStop => (
                RunState::Interrupted,
                Whose::Operator,
                "protective_stop",
                "The protective stop was pressed.".to_owned(),
            ),
            Self::LabStopped => (
                RunState::Interrupted,
                Whose::Operator,
                "lab_stopped",
                "The laboratory was shut down during the run.".to_owned(),
            ),
            Self::StaleEpoch => (
                RunState::Interrupted,
                Whose::Platform,
                "stale_epoch",
                "The service gave the run to another attempt; this laboratory stopped at once.".to_owned(),
            ),
            Self::LeaseLost => (
                RunState::Interrupted,
                Whose::Platform,
                "lease_lost",
                "The laboratory could not reach the service in time and stopped before its lease ran out.".to_owned(),
            ),
            Self::RecorderFailed => (
                RunState::Failed,
                Whose::Platform,
                "recorder_failed",
                "The laboratory could not write its record to disk and stopped.".to_owned(),
            ),
            Self::RobotSilent(index) => (
                RunState::Failed,
                Whose::Robot,
                "robot_silent",
                format!(
                    "Robot {} sent nothing for more than {} ms.",
                    name(index),
                    ROBOT_SILENT_US / 1000
                ),
            ),
            Self::RobotDeaf(index) => (
                RunState::Failed,
                Whose::Robot,
                "robot_deaf",
                format!(
                    "Robot {} heard no command for {} ms and switched itself off; look at its radio and at what else uses the air.",
                    name(index),
                    ROBOT_SILENT_US / 1000
                ),
            ),
            Self::RobotUnfit(index, finding) => (
                RunState::Failed,
                Whose::Robot,
                finding.code(),
                format!("{}.", finding.words(name(index))),
            ),
            Self::TrackerSilent => (
                RunState::Failed,
                Whose::Platform,
                "tracker_silent",
                format!(
                    "No camera or tracker told anything new for more than {} ms.",
                    TRACKER_FAIL_US / 1000
                ),
            ),
            Self::PoseLost(index) => (
                RunState::Failed,
                Whose::Platform,
                "pose_lost",
                format!(
                    "No camera or tracker had a believable pose of {} for more than {} ms.",
                    name(index),
                    POSE_FAIL_US / 1000
                ),
            ),
            Self::Cancelled => (
                RunState::Cancelled,
                Whose::User,
                "cancelled_by_user",
                "The run was cancelled.".to_owned(),
            ),
            Self::Deadlock => (
                RunState::Failed,
                Whose::User,
                "deadlock",
                "Robots held each other, and no attempt to get them past one another succeeded.".to_owned(),
            ),
            Self::ControllerFault => (
                RunState::Failed,
                Whose::User,
                "controller_fault",
                "The experiment's own controller could not go on.".to_owned(),
            ),
        };
        (
            state,
            Some(Fault {
                whose,
                code: code.to_owned(),
                message,
            }),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FINE: [RobotHealth; 2] = [RobotHealth {
        telemetry_age_us: 9_000,
        pose_age_us: 12_000,
        deaf: false,
    }; 2];
    const QUIET: Signals = Signals {
        protective_stop: false,
        shutdown: false,
        stale_epoch: false,
        cancel: false,
        lease_until_us: i64::MAX,
        recorder_failed: false,
        robot_finding: None,
    };

    fn inputs(robots: &[RobotHealth]) -> Inputs<'_> {
        Inputs {
            now_us: 1_000_000,
            tracker_age_us: 12_000,
            robots,
            signals: QUIET,
            team_finished: false,
            team_stuck: false,
            team_faulty: false,
            time_over: false,
        }
    }

    #[test]
    fn drives_while_everything_is_fresh_and_until_time_is_over() {
        let mut safety = Safety::default();
        assert_eq!(safety.tick(&inputs(&FINE)), Permission::Drive);
        assert_eq!(
            safety.tick(&Inputs {
                time_over: true,
                ..inputs(&FINE)
            }),
            Permission::Ended(Ending::Finished)
        );
        assert_eq!(Ending::Finished.report(&[]), (RunState::Done, None));
    }

    #[test]
    fn a_short_tracker_gap_holds_and_passes_a_long_one_fails() {
        let mut safety = Safety::default();
        let gap = |tracker_age_us| Inputs {
            tracker_age_us,
            ..inputs(&FINE)
        };
        assert_eq!(safety.tick(&gap(TRACKER_HOLD_US)), Permission::Drive);
        assert_eq!(safety.tick(&gap(TRACKER_HOLD_US + 1)), Permission::Hold);
        assert_eq!(safety.tick(&gap(TRACKER_FAIL_US)), Permission::Hold);
        assert_eq!(safety.tick(&gap(9_000)), Permission::Drive);
        assert_eq!(
            safety.tick(&gap(TRACKER_FAIL_US + 1)),
            Permission::Ended(Ending::TrackerSilent)
        );
        assert_eq!(
            safety.tick(&gap(9_000)),
            Permission::Ended(Ending::TrackerSilent),
            "an ending is never left"
        );
    }

    /// Heard, but hearing nothing: to the others it would be a robot that makes room and does not.
    #[test]
    fn a_robot_that_switched_itself_off_ends_the_run() {
        let mut robots = FINE;
        robots[1].deaf = true;
        let mut safety = Safety::default();
        assert_eq!(safety.tick(&inputs(&robots)), Permission::Ended(Ending::RobotDeaf(1)));
        let (state, fault) = Ending::RobotDeaf(1).report(&["omni-01".into(), "omni-02".into()]);
        let fault = fault.expect("a fault");
        assert_eq!(
            (state, fault.whose, fault.code.as_str()),
            (RunState::Failed, Whose::Robot, "robot_deaf")
        );
        assert!(fault.message.contains("omni-02"), "{}", fault.message);
    }

    #[test]
    fn names_the_silent_robot() {
        let mut robots = FINE;
        robots[1].telemetry_age_us = ROBOT_SILENT_US;
        assert_eq!(Safety::default().tick(&inputs(&robots)), Permission::Drive);
        robots[1].telemetry_age_us += 1;
        let mut safety = Safety::default();
        assert_eq!(safety.tick(&inputs(&robots)), Permission::Ended(Ending::RobotSilent(1)));
        let (state, fault) = Ending::RobotSilent(1).report(&["omni-01".into(), "omni-02".into()]);
        let fault = fault.expect("a fault");
        assert_eq!(
            (state, fault.whose, fault.code.as_str()),
            (RunState::Failed, Whose::Robot, "robot_silent")
        );
        assert!(fault.message.contains("omni-02"));
    }

    #[test]
    fn stops_itself_when_the_lease_runs_out() {
        let signals = Signals {
            lease_until_us: 1_000_000,
            ..QUIET
        };
        let ended = Safety::default().tick(&Inputs {
            signals,
            ..inputs(&FINE)
        });
        assert_eq!(ended, Permission::Ended(Ending::LeaseLost));
        let signals = Signals {
            lease_until_us: 1_000_001,
            ..QUIET
        };
        assert_eq!(
            Safety::default().tick(&Inputs {
                signals,
                ..inputs(&FINE)
            }),
            Permission::Drive
        );
    }

    #[test]
    fn each_signal_ends_the_run_and_the_gravest_names_it() {
        let cases = [
            (
                Signals { cancel: true, ..QUIET },
                Ending::Cancelled,
                RunState::Cancelled,
            ),
            (
                Signals {
                    recorder_failed: true,
                    cancel: true,
                    ..QUIET
                },
                Ending::RecorderFailed,
                RunState::Failed,
            ),
            (
                Signals {
                    stale_epoch: true,
                    cancel: true,
                    ..QUIET
                },
                Ending::StaleEpoch,
                RunState::Interrupted,
            ),
            (
                Signals {
                    shutdown: true,
                    stale_epoch: true,
                    ..QUIET
                },
                Ending::LabStopped,
                RunState::Interrupted,
            ),
            (
                Signals {
                    protective_stop: true,
                    shutdown: true,
                    ..QUIET
                },
                Ending::ProtectiveStop,
                RunState::Interrupted,
            ),
        ];
        for (signals, ending, state) in cases {
            let mut safety = Safety::default();
            assert_eq!(
                safety.tick(&Inputs {
                    signals,
                    ..inputs(&FINE)
                }),
                Permission::Ended(ending)
            );
            assert_eq!(safety.tick(&inputs(&FINE)), Permission::Ended(ending));
            assert_eq!(ending.report(&[]).0, state);
        }
    }

    #[test]
    fn a_robot_in_trouble_ends_the_run_and_is_named_and_a_low_battery_does_not() {
        let found = |finding| {
            let signals = Signals {
                robot_finding: Some((1, finding)),
                ..QUIET
            };
            Safety::default().tick(&Inputs {
                signals,
                ..inputs(&FINE)
            })
        };
        assert_eq!(found(Finding::BatteryLow), Permission::Drive);
        for finding in [
            Finding::BatteryCritical,
            Finding::Stalled,
            Finding::SensorFault,
            Finding::BatteryEmpty,
        ] {
            let ending = Ending::RobotUnfit(1, finding);
            assert_eq!(found(finding), Permission::Ended(ending));
            let (state, fault) = ending.report(&["omni-01".into(), "omni-02".into()]);
            let fault = fault.expect("a fault");
            assert_eq!(
                (state, fault.whose, fault.code.as_str()),
                (RunState::Failed, Whose::Robot, finding.code())
            );
            assert!(fault.message.contains("omni-02"), "{}", fault.message);
        }
    }

    #[test]
    fn a_controller_that_cannot_go_on_ends_the_run_as_the_users_fault() {
        let faulty = Inputs {
            team_faulty: true,
            team_finished: true,
            ..inputs(&FINE)
        };
        assert_eq!(
            Safety::default().tick(&faulty),
            Permission::Ended(Ending::ControllerFault)
        );
        let (state, fault) = Ending::ControllerFault.report(&[]);
        let fault = fault.expect("a fault");
        assert_eq!(
            (state, fault.whose, fault.code.as_str()),
            (RunState::Failed, Whose::User, "controller_fault")
        );
    }

    #[test]
    fn a_deadlock_for_good_ends_the_run_and_says_so() {
        let stuck = Inputs {
            team_stuck: true,
            ..inputs(&FINE)
        };
        assert_eq!(Safety::default().tick(&stuck), Permission::Ended(Ending::Deadlock));
        let (state, fault) = Ending::Deadlock.report(&[]);
        assert_eq!(state, RunState::Failed);
        assert_eq!(fault.expect("a fault").code, "deadlock");
    }
}
