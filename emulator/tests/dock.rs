//! A dock: a charger on the floor, for one robot at one pose.

mod bench;

use api::docks::{Dock, Docks};
use api::experiment::Pose;
use bench::{Bench, reference};
use emulator::faults::{FaultKind, FaultRequest};
use emulator::hidden::Hidden;
use emulator::laboratory::Placement;
use robot::battery::Level;

const DOCK: Pose = Pose {
    x_m: -1.0,
    y_m: 1.0,
    yaw_rad: 3.1,
};

fn bench() -> Bench {
    let mut bench = Bench::new(&reference(), Hidden::neutral(), 1);
    let docks = Docks {
        docks: vec![Dock {
            robot: "omni-01".to_owned(),
            pose: DOCK,
        }],
        ..Docks::default()
    };
    bench.laboratory.set_docks(&docks).unwrap();
    bench
}

fn put(bench: &mut Bench, number: u8, pose: Pose) {
    let Pose { x_m, y_m, yaw_rad } = pose;
    let here = Placement {
        number,
        x_m,
        y_m,
        yaw_rad,
    };
    bench.laboratory.place(&[here]).unwrap();
    let low = FaultRequest {
        number,
        kind: FaultKind::LowBattery { charge: 0.125 },
    };
    bench.laboratory.set_fault(low).unwrap();
}

/// Virtual time without commands: level of a robot at the end.
fn wait(bench: &mut Bench, unit: usize, seconds: f64) -> Level {
    bench.drive_for(seconds, |_| None);
    bench.laboratory.units()[unit].firmware().battery().level()
}

#[test]
fn a_low_robot_recovers_at_its_dock_as_fast_as_on_the_rack() {
    let mut bench = bench();
    // The yaw the other way round the circle is the same yaw.
    let askew = Pose {
        x_m: DOCK.x_m + 0.03,
        y_m: DOCK.y_m - 0.03,
        yaw_rad: DOCK.yaw_rad - std::f64::consts::TAU + 0.1,
    };
    put(&mut bench, 1, askew);
    // As on the rack (`rack.rs`): low ends at a charge of 0.2854, 144 s away at 1/900 a second.
    assert_eq!(wait(&mut bench, 0, 140.0), Level::Low);
    assert_eq!(wait(&mut bench, 0, 25.0), Level::Good);
}

#[test]
fn beside_the_dock_or_at_that_of_another_nothing_charges() {
    let beside = [
        Pose {
            x_m: DOCK.x_m + 0.08,
            ..DOCK
        },
        Pose {
            yaw_rad: DOCK.yaw_rad - 0.2,
            ..DOCK
        },
    ];
    for pose in beside {
        let mut bench = bench();
        put(&mut bench, 1, pose);
        assert!(!bench.laboratory.units()[0].is_on_charger());
        assert_eq!(wait(&mut bench, 0, 170.0), Level::Low, "{pose:?}");
    }
    let mut bench = bench();
    put(&mut bench, 2, DOCK);
    assert_eq!(wait(&mut bench, 1, 170.0), Level::Low, "the charger fits one robot");
}

#[test]
fn a_dock_of_a_robot_that_is_not_here_is_refused() {
    let mut bench = bench();
    let docks = Docks {
        docks: vec![Dock {
            robot: "nobody".to_owned(),
            pose: DOCK,
        }],
        ..Docks::default()
    };
    let error = bench.laboratory.set_docks(&docks).unwrap_err();
    assert!(error.to_string().contains("nobody"), "{error}");
}
