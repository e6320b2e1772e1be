//! The plant by itself: step size, energy, rest, bumpers.

mod bench;

use bench::{Bench, every_chassis, forward, reference, wheels};
use emulator::hidden::{Hidden, HiddenFloor, RunVariation};
use emulator::noise::Noise;
use emulator::plant::Pose;
use emulator::plant::arena::{Arena, Occupant};
use emulator::plant::body::{Body, Drive};
use emulator::plant::contents::PlantContents;

const STILL: RunVariation = RunVariation {
    friction: 0.0,
    mass: 0.0,
    torque_constant: 0.0,
    battery_charge: 0.0,
};

fn arena(floor: HiddenFloor) -> Arena {
    Arena {
        width_m: 40.0,
        height_m: 30.0,
        floor,
        contents: PlantContents::default(),
    }
}

fn hidden() -> Hidden {
    Hidden::reference().unwrap()
}

/// Pose after 3 s of voltages that push the robot to its friction limit and turn it.
fn pose_with(robot: &api::robot::LabRobot, substeps: u32) -> Pose {
    let mut body = Body::new(
        &robot.description,
        robot.bounding_radius_m,
        &hidden().robot(&robot.description.name),
        &STILL,
        &mut Noise::new(1, 1),
    )
    .unwrap();
    let arena = arena(hidden().floor("lab-floor"));
    for tick in 0..1440u32 {
        let scale = [1.0, 0.4, -0.6, 0.9][(tick / 360) as usize];
        let volts =
            forward(&robot.description, 1.0).map(|set_point| (set_point * 0.5 * scale + 1.5).clamp(-12.0, 12.0));
        let drive = Drive {
            motor_v: Some(volts),
            steering_rad: 0.3 * scale,
            stuck_wheel: None,
        };
        arena.tick_in(
            &mut [Occupant {
                body: &mut body,
                drive,
                stage: None,
            }],
            substeps,
        );
    }
    body.pose()
}

#[test]
fn halving_the_step_converges_on_every_chassis() {
    let gap_m = |a: Pose, b: Pose| (a.x_m - b.x_m).hypot(a.y_m - b.y_m);
    for robot in &every_chassis().robots {
        let finest = pose_with(robot, 128);
        let gaps = [8, 16, 32].map(|substeps| gap_m(pose_with(robot, substeps), finest));
        let travelled_m = gap_m(finest, Pose::default());
        println!(
            "{}: {gaps:?} m at 8, 16, 32 steps, {travelled_m} m from the start",
            robot.description.name
        );
        assert!(travelled_m > 0.2, "{}: {travelled_m}", robot.description.name);
        assert!(gaps[1] < 1e-3, "{}: {gaps:?}", robot.description.name);
        // Below a tenth of the bound the gaps are chance, and which is larger says nothing.
        assert!(
            gaps[2] < 0.7 * gaps[0].max(1.5e-4),
            "{}: {gaps:?}",
            robot.description.name
        );
    }
}

#[test]
fn a_pushed_robot_only_loses_energy_and_comes_to_rest() {
    for robot in &every_chassis().robots {
        let mut body = Body::new(
            &robot.description,
            robot.bounding_radius_m,
            &Hidden::neutral().robot(""),
            &STILL,
            &mut Noise::new(1, 1),
        )
        .unwrap();
        body.push([1.2, 0.5], 3.0);
        let (arena, drive) = (
            arena(HiddenFloor {
                rolling_resistance: 0.01,
                ..HiddenFloor::default()
            }),
            Drive {
                motor_v: Some([0.0; 4]),
                steering_rad: 0.0,
                stuck_wheel: None,
            },
        );
        let mut before_j = body.energy_j();
        let start_j = before_j;
        for _ in 0..480 * 5 {
            arena.tick(&mut [Occupant {
                body: &mut body,
                drive,
                stage: None,
            }]);
            let now_j = body.energy_j();
            assert!(
                now_j <= before_j + 2e-4 * start_j,
                "{}: {before_j} J, then {now_j} J",
                robot.description.name
            );
            before_j = now_j;
        }
        assert!(
            before_j < 1e-3 * start_j,
            "{}: {before_j} J of {start_j} J left",
            robot.description.name
        );
    }
}

#[test]
fn a_robot_rests_on_a_slope_under_its_firmware() {
    let mut sloping = Hidden::neutral();
    sloping.floors.insert(
        "lab-floor".to_owned(),
        HiddenFloor {
            slope: [3f64.to_radians().tan(), 0.0],
            ..HiddenFloor::default()
        },
    );
    let mut description = reference();
    let mut drift_m = |noisy: bool| {
        if !noisy {
            description.robots[0].description.noise = None;
        }
        let mut bench = Bench::new(&description, sloping.clone(), 3);
        bench.place(&[(1, 0.0, 0.0, 0.4)]);
        bench.drive_for(2.0, |_| wheels([0.0; 4]));
        let settled = bench.pose(0);
        bench.drive_for(10.0, |_| wheels([0.0; 4]));
        (bench.pose(0).x_m - settled.x_m).hypot(bench.pose(0).y_m - settled.y_m)
    };
    // A speed loop with noisy encoders wanders; the contact itself does not creep.
    let (noisy_m, quiet_m) = (drift_m(true), drift_m(false));
    println!("drift in 10 s: {noisy_m} m, {quiet_m} m without sensor noise");
    assert!(noisy_m < 5e-3 && quiet_m < 2e-5, "{noisy_m} {quiet_m}");
}

#[test]
fn bodies_pass_through_neither_walls_nor_one_another() {
    let description = reference();
    let mut bench = Bench::new(&description, hidden(), 5);
    bench.place(&[
        (1, -1.0, 0.05, 0.0),
        (2, 1.0, 0.0, std::f64::consts::PI),
        (3, 0.0, -1.0, -1.5),
        (5, -1.0, 1.0, 1.0),
    ]);
    let mut deepest_m: f64 = 0.0;
    for _ in 0..120 * 5 {
        bench.period(|index| wheels(forward(&description.robots[index].description, 1.2)));
        let standing: Vec<_> = bench
            .laboratory
            .units()
            .iter()
            .filter_map(|unit| unit.on_floor())
            .map(|body| (body.pose(), body.radius_m))
            .collect();
        for (i, (a, radius_a)) in standing.iter().enumerate() {
            deepest_m = deepest_m
                .max(a.x_m.abs() + radius_a - 2.0)
                .max(a.y_m.abs() + radius_a - 1.5);
            for (b, radius_b) in &standing[i + 1..] {
                deepest_m = deepest_m.max(radius_a + radius_b - (a.x_m - b.x_m).hypot(a.y_m - b.y_m));
            }
        }
    }
    println!("deepest bumper {deepest_m} m");
    assert!(deepest_m > 0.0, "nothing touched");
    assert!(deepest_m < 0.01, "{deepest_m}");
}
