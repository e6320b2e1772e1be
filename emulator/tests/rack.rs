//! The rack: robots charge there, and their own battery monitor lets them go again.

mod bench;

use bench::{Bench, reference};
use emulator::faults::{FaultKind, FaultRequest};
use emulator::hidden::Hidden;
use emulator::laboratory::Placement;
use robot::battery::Level;

const HERE: Placement = Placement {
    number: 1,
    x_m: 0.0,
    y_m: 0.0,
    yaw_rad: 0.0,
};

/// Virtual time without commands: charge and level of the first robot at the end.
fn wait(bench: &mut Bench, seconds: f64) -> Level {
    bench.drive_for(seconds, |_| None);
    bench.laboratory.units()[0].firmware().battery().level()
}

#[test]
fn a_low_robot_recovers_on_the_rack_and_not_on_the_floor() {
    let mut bench = Bench::new(&reference(), Hidden::neutral(), 1);
    bench.laboratory.place(&[HERE]).unwrap();
    let low = FaultRequest {
        number: 1,
        kind: FaultKind::LowBattery { charge: 0.125 },
    };
    bench.laboratory.set_fault(low).unwrap();
    assert_eq!(wait(&mut bench, 4.0), Level::Low);
    assert_eq!(wait(&mut bench, 20.0), Level::Low, "nothing charges on the floor");
    bench.laboratory.place(&[]).unwrap();
    bench.laboratory.place(&[HERE]).unwrap();
    assert_eq!(wait(&mut bench, 4.0), Level::Low, "being carried charges nothing");
    bench.laboratory.place(&[]).unwrap();
    // Low ends at 0.945 + 0.015 of 24 V, of which the monitor adds 0.1 ohm * 0.35 A itself; open circuit on the straight part
    // of the curve: 24 (0.98 + 0.1 (charge - 0.5)) = 23.005, so at a charge of 0.2854, (0.2854 - 0.125) * 900 s = 144 s away.
    assert_eq!(wait(&mut bench, 140.0), Level::Low);
    assert_eq!(wait(&mut bench, 25.0), Level::Good);
    bench.laboratory.place(&[HERE]).unwrap();
    assert_eq!(
        wait(&mut bench, 4.0),
        Level::Good,
        "the charge comes along to the floor"
    );
}
