//! What the laboratory believes of frames that claim to come from a robot: damaged, forged, repeated, recorded earlier. Every
//! datagram counts exactly once.

use lab::clock_map::link_clock_ms;
use lab::ear::{Ear, RESTART_US, Refusal};
use lab::link_statistics::LinkStatistics;
use robot::frame::{
    Command, Counters, FrameError, Header, Status, Telemetry, encode_command, encode_counters, encode_telemetry,
};
use robot::key::Key;

const KEY: Key = Key::new(*b"sixteen byte key");
const PERIOD_US: i64 = 8_000;
/// Way to the robot, its wait for the next frame, and the way back.
const ROUND_MS: u32 = 12;

/// A robot whose frames come in order; `speed` tells them apart.
struct Robot {
    epoch: u32,
    sequence: u32,
    /// Robot's clock less the laboratory's.
    clock_ms: u32,
}

impl Robot {
    const fn new(epoch: u32) -> Self {
        Self {
            epoch,
            sequence: 0,
            clock_ms: 77_000,
        }
    }

    fn header(&mut self, now_us: i64) -> Header {
        self.sequence += 1;
        Header {
            robot: 3,
            epoch: self.epoch,
            sequence: self.sequence,
            tick: 0,
            clock_ms: link_clock_ms(now_us) + self.clock_ms,
            echo_ms: link_clock_ms(now_us) - ROUND_MS,
        }
    }

    /// A frame that arrives at `now_us`.
    fn frame(&mut self, now_us: i64, stopped: bool) -> Vec<u8> {
        let header = self.header(now_us);
        telemetry(&header, stopped, &KEY)
    }

    /// Speaks for so long; all frames are heard, and come back as an adversary would have recorded them.
    fn talk(&mut self, ear: &mut Ear, now_us: &mut i64, frames: usize) -> Vec<Vec<u8>> {
        let mut record = Vec::new();
        for _ in 0..frames {
            *now_us += PERIOD_US;
            let frame = self.frame(*now_us, false);
            ear.hear(&frame, &KEY, *now_us).expect("a good frame");
            record.push(frame);
        }
        record
    }
}

fn telemetry(header: &Header, stopped: bool, key: &Key) -> Vec<u8> {
    let telemetry = Telemetry {
        status: Status {
            running: !stopped,
            stopped,
            latched: stopped,
            clock_known: true,
            ..Status::default()
        },
        ..Telemetry::default()
    };
    let mut out = [0; 160];
    let length = encode_telemetry(header, &telemetry, key, &mut out);
    out[..length].to_vec()
}

fn total(statistics: &LinkStatistics) -> u64 {
    statistics.received + statistics.late + statistics.refused + statistics.replayed
}

const START_US: i64 = 3_600_000_000;

#[test]
fn damaged_cut_and_forged_frames_are_refused_and_counted_once_each() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    robot.talk(&mut ear, &mut now_us, 20);
    now_us += PERIOD_US;
    let good = robot.frame(now_us, true);
    let mut datagrams = 20;
    for bit in 0..good.len() * 8 {
        let mut damaged = good.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(
            matches!(ear.hear(&damaged, &KEY, now_us), Err(Refusal::Decode(_))),
            "bit {bit}"
        );
        datagrams += 1;
        assert_eq!(ear.statistics().refused, datagrams - 20);
    }
    for length in 0..good.len() {
        assert!(
            matches!(ear.hear(&good[..length], &KEY, now_us), Err(Refusal::Decode(_))),
            "{length} characters"
        );
        datagrams += 1;
    }
    let header = robot.header(now_us);
    let forged = telemetry(&header, true, &Key::new([9; 16]));
    assert_eq!(ear.hear(&forged, &KEY, now_us), Err(Refusal::Decode(FrameError::Mac)));
    datagrams += 1;
    let seen = ear.statistics();
    assert_eq!((seen.received, seen.late, seen.replayed), (20, 0, 0));
    assert_eq!((seen.refused, total(&seen)), (datagrams - 20, datagrams));
    // The good one is still as good as before.
    assert!(ear.hear(&good, &KEY, now_us).is_ok());
}

#[test]
fn the_laboratorys_own_frames_thrown_back_at_it_change_nothing() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    robot.talk(&mut ear, &mut now_us, 400);
    let before = ear
        .clone()
        .hear(&robot.frame(now_us + PERIOD_US, false), &KEY, now_us + PERIOD_US);
    robot.sequence -= 1;
    for sequence in [1_u32, 401, 90_000] {
        let header = Header {
            robot: 3,
            epoch: 9,
            sequence,
            tick: 1,
            clock_ms: link_clock_ms(now_us),
            echo_ms: 0,
        };
        let mut out = [0; 96];
        let length = encode_command(&header, &Command::default(), &KEY, &mut out);
        assert_eq!(ear.hear(&out[..length], &KEY, now_us), Err(Refusal::NotTelemetry));
    }
    let seen = ear.statistics();
    assert_eq!((seen.received, seen.refused, total(&seen)), (400, 3, 403));
    // Its time on the laboratory's clock is what it would have been.
    now_us += PERIOD_US;
    assert_eq!(ear.hear(&robot.frame(now_us, false), &KEY, now_us), before);
}

#[test]
fn copies_and_overtaken_frames_are_not_used() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    let record = robot.talk(&mut ear, &mut now_us, 50);
    // The last, and the one of 0.3 s before.
    for frame in [&record[49], &record[10]] {
        assert_eq!(ear.hear(frame, &KEY, now_us), Err(Refusal::OutOfOrder));
    }
    let (first, second) = (robot.frame(now_us + 1000, false), robot.frame(now_us + 2000, false));
    assert!(ear.hear(&second, &KEY, now_us + 3000).is_ok());
    assert_eq!(ear.hear(&first, &KEY, now_us + 4000), Err(Refusal::OutOfOrder));
    let seen = ear.statistics();
    assert_eq!((seen.received, seen.late, seen.lost, total(&seen)), (51, 3, 1, 54));
}

#[test]
fn recorded_frames_are_never_used_again_however_old_they_are() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    let record = robot.talk(&mut ear, &mut now_us, 3000);
    let (mut heard, mut datagrams) = (3000, 3000);
    // In the midst of the robot's own frames, one after the other and from the newest to the oldest.
    for old in record.iter().chain(record.iter().rev()) {
        now_us += PERIOD_US;
        assert!(ear.hear(old, &KEY, now_us).is_err());
        assert!(ear.hear(&robot.frame(now_us, false), &KEY, now_us).is_ok());
        heard += 1;
        datagrams += 2;
    }
    let seen = ear.statistics();
    assert_eq!((seen.received, seen.refused, total(&seen)), (heard, 0, datagrams));
    assert_eq!((seen.late, seen.replayed), (0, 6000));
    // Nor while the robot is silent, for a second or an hour.
    for silence_us in [RESTART_US, 60_000_000, 3_600_000_000] {
        let later_us = now_us + silence_us;
        for old in &record {
            assert!(ear.hear(old, &KEY, later_us).is_err(), "{silence_us}");
        }
    }
}

#[test]
fn frames_from_before_a_restart_are_not_used_although_they_lie_ahead() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    let record = robot.talk(&mut ear, &mut now_us, 5000);
    now_us += 3 * RESTART_US;
    robot.sequence = 0;
    robot.talk(&mut ear, &mut now_us, 10);
    for old in &record[10..] {
        assert!(ear.hear(old, &KEY, now_us).is_err());
    }
    assert_eq!(ear.statistics().replayed, 4990);
    robot.talk(&mut ear, &mut now_us, 10);
}

#[test]
fn an_older_epoch_is_refused_and_a_newer_one_begins_anew() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    robot.talk(&mut ear, &mut now_us, 100);
    robot.epoch = 4;
    now_us += PERIOD_US;
    let refused = ear.hear(&robot.frame(now_us, true), &KEY, now_us);
    assert_eq!(refused, Err(Refusal::OldEpoch { newest: 5, found: 4 }));
    // A robot may count anew in a new epoch.
    (robot.epoch, robot.sequence) = (6, 0);
    robot.talk(&mut ear, &mut now_us, 10);
    let seen = ear.statistics();
    assert_eq!((seen.received, seen.replayed, total(&seen)), (110, 1, 111));
}

#[test]
fn a_robot_switched_off_and_on_is_heard_again_within_a_second() {
    // After long, after short, with and without its epoch; and at once where its frames cannot be taken for overtaken ones.
    for (frames, epoch, off_us, limit_us) in [
        (5000, 5, 20_000, 0),
        (300, 5, 20_000, RESTART_US),
        (5000, 2, 20_000, RESTART_US),
        (300, 2, 5_000_000, 0),
    ] {
        let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
        robot.talk(&mut ear, &mut now_us, frames);
        let last_us = now_us;
        (robot.sequence, robot.epoch, robot.clock_ms) = (0, epoch, 500);
        now_us += off_us;
        let back_us = now_us;
        while ear.hear(&robot.frame(now_us, false), &KEY, now_us).is_err() {
            assert!(now_us - last_us < RESTART_US, "{frames} {epoch}");
            now_us += PERIOD_US;
        }
        assert!(
            now_us - back_us <= limit_us,
            "{frames} {epoch}: {} us",
            now_us - back_us
        );
        robot.talk(&mut ear, &mut now_us, 10);
    }
}

#[test]
fn who_has_just_started_listens_to_nothing_recorded() {
    let mut robot = Robot::new(5);
    let recorded = robot.frame(START_US, true);
    let mut ear = Ear::default();
    assert_eq!(ear.hear(&recorded, &KEY, START_US + 60_000_000), Err(Refusal::Replayed));
    // A host that was started again counts its clock from 0: the echo lies ahead.
    assert_eq!(ear.hear(&recorded, &KEY, 60_000_000), Err(Refusal::Replayed));
    // A robot that refuses the laboratory's epoch answers without an echo: that it is there may be known.
    let header = Header {
        echo_ms: 0,
        ..robot.header(START_US)
    };
    assert!(
        ear.hear(&telemetry(&header, false, &KEY), &KEY, START_US + 60_000_000)
            .is_ok()
    );
    assert_eq!(total(&ear.statistics()), 3);
}

#[test]
fn a_robot_that_hears_nothing_any_more_is_still_heard() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    robot.talk(&mut ear, &mut now_us, 100);
    let echo_ms = robot.header(now_us).echo_ms;
    for _ in 0..2000 {
        now_us += PERIOD_US;
        let header = Header {
            echo_ms,
            ..robot.header(now_us)
        };
        assert!(ear.hear(&telemetry(&header, false, &KEY), &KEY, now_us).is_ok());
    }
    // Even after it was out of reach for a minute.
    robot.sequence += 7000;
    now_us += 60_000_000;
    let header = Header {
        echo_ms,
        ..robot.header(now_us)
    };
    assert!(ear.hear(&telemetry(&header, false, &KEY), &KEY, now_us).is_ok());
}

#[test]
fn counters_and_health_keep_the_same_order() {
    let (mut ear, mut robot, mut now_us) = (Ear::default(), Robot::new(5), START_US);
    robot.talk(&mut ear, &mut now_us, 10);
    let mut out = [0; 160];
    let header = robot.header(now_us);
    let length = encode_counters(&header, &Counters::default(), &KEY, &mut out);
    assert!(ear.listen(&out[..length], &KEY, now_us).is_ok());
    assert_eq!(ear.listen(&out[..length], &KEY, now_us), Err(Refusal::OutOfOrder));
}
