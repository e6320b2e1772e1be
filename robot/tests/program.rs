//! The firmware as a whole: targets, battery and cascade through frames.

mod kit;

use robot::battery::Level;
use robot::firmware::{Firmware, MotorSensors, Received, Sensors, Settings};
use robot::frame::{Aim, Command, Fix, Payload, Region, Target, decode};
use robot::key::Key;
use robot::kinematics::Twist;
use robot::motor_control::{ControlSample, Controller, ControllerSettings, EncoderSettings, Law};

const KEY: Key = Key::new(*b"sixteen byte key");

/// A firmware whose wheels do what they are told at once.
struct Bench {
    firmware: Firmware,
    sensors: Sensors,
    sequence: u32,
    step: u32,
}

impl Bench {
    fn new(settings: Settings) -> Self {
        Self {
            firmware: Firmware::new(settings),
            sensors: Sensors {
                bus_v: 24.0,
                ..Sensors::default()
            },
            sequence: 0,
            step: 0,
        }
    }

    fn now_ms(&self) -> u32 {
        1000 + self.step * 25 / 12
    }

    fn send(&mut self, make: impl Fn(&robot::frame::Header) -> Vec<u8>) -> Received {
        self.sequence += 1;
        let header = kit::header(3, 1, self.sequence, self.now_ms() - 1);
        self.firmware.on_datagram(&make(&header), self.now_ms())
    }

    fn steps(&mut self, count: u32) {
        for _ in 0..count {
            self.step += 1;
            let now_ms = self.now_ms();
            self.firmware.step(now_ms, &self.sensors);
            let speeds = self.firmware.set_point().wheel_rad_per_s;
            for (angle, speed) in self.sensors.wheel_rad.iter_mut().zip(speeds) {
                *angle += speed / 480.0;
            }
            self.sensors.gyro_z_rad_per_s = kit::omni().twist(&speeds, 0.0).yaw_rate_rad_per_s;
            self.sensors.wheel_rad_per_s = speeds;
        }
    }

    fn speed(&self) -> f64 {
        let speeds = self.firmware.set_point().wheel_rad_per_s;
        speeds.iter().fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()))
    }
}

fn drive(speed: f64) -> Command {
    Command {
        enable: true,
        wheel_rad_per_s: [speed; 4],
        ..Command::default()
    }
}

fn ahead() -> Target {
    Target {
        enable: true,
        stop: false,
        clear: false,
        aim: Aim::Twist(Twist {
            forward_m_per_s: 0.4,
            ..Twist::default()
        }),
        speed_cap_m_per_s: 0.4,
        yaw_rate_cap_rad_per_s: 1.0,
        region: Region {
            left_m: -1.0,
            right_m: 0.5,
            bottom_m: -1.0,
            top_m: 1.0,
        },
        expiry_ms: 100,
    }
}

#[test]
fn a_robot_with_a_target_drives_itself_stays_in_its_region_and_reports() {
    let mut bench = Bench::new(kit::settings(3, KEY));
    bench.steps(48);
    let mut farthest_m: f64 = 0.0;
    for round in 0..480 {
        if round % 12 == 0 {
            let fix = bench.firmware.estimator().estimate();
            let truth = if round == 0 { 0.0 } else { fix.x_m };
            bench.send(|header| {
                let fix = Fix {
                    x_m: truth,
                    exposure_ms: header.clock_ms - 8,
                    position_sd_m: 0.001,
                    yaw_sd_rad: 0.003,
                    ..Fix::default()
                };
                // A fix of 8 ms ago at the present pose: too far ahead by 3 mm at most.
                kit::fix(header, &fix, &KEY)
            });
        }
        bench.send(|header| kit::target(header, &ahead(), &KEY));
        bench.steps(4);
        farthest_m = farthest_m.max(bench.firmware.estimator().estimate().x_m);
    }
    println!("farthest {farthest_m} m of 0.5");
    assert!(farthest_m > 0.4 && farthest_m <= 0.5, "{farthest_m}");
    let mut out = [0; 160];
    let length = bench.firmware.health_report(bench.now_ms(), &mut out);
    let Payload::Health(health) = decode(&out[..length], &KEY).unwrap().payload else {
        panic!("not health")
    };
    let estimate = bench.firmware.estimator().estimate();
    assert!((health.x_m - estimate.x_m).abs() <= 5.1e-5 && health.anchored && health.bounded);
    assert!(
        health.battery == Level::Good && (health.rest_v - 24.035).abs() < 2e-3,
        "{health:?}"
    );
    assert!(health.status.running);
    let length = bench.firmware.counters_report(bench.now_ms(), &mut out);
    let Payload::Counters(counters) = decode(&out[..length], &KEY).unwrap().payload else {
        panic!("not counters")
    };
    assert_eq!(counters, *bench.firmware.counters());
    assert_eq!(counters.accepted + counters.fixes + counters.refused(), bench.sequence);
}

#[test]
fn targets_end_by_their_time_and_wheel_commands_take_over() {
    let mut bench = Bench::new(kit::settings(3, KEY));
    bench.steps(48);
    for round in 0..90 {
        if round == 0 {
            bench.send(|header| {
                let fix = Fix {
                    exposure_ms: header.clock_ms,
                    ..Fix::default()
                };
                kit::fix(header, &fix, &KEY)
            });
        }
        bench.send(|header| kit::target(header, &ahead(), &KEY));
        bench.steps(4);
    }
    let cruising = bench.speed();
    assert!(cruising > 5.0, "{cruising}");
    bench.steps(38);
    assert!((bench.speed() - cruising).abs() < 1e-9, "87 ms after the last target");
    bench.steps(24);
    assert!(bench.speed() < cruising - 0.5, "137 ms after the last target");
    bench.send(|header| kit::command(header, &drive(3.0), &KEY));
    bench.steps(48);
    assert!((bench.speed() - 3.0).abs() < 1e-9, "{}", bench.speed());
}

#[test]
fn an_empty_battery_stops_a_robot_and_holds_it() {
    let mut bench = Bench::new(kit::settings(3, KEY));
    let drive_for = |bench: &mut Bench, rounds: u32, clear: bool| {
        for _ in 0..rounds {
            let command = Command { clear, ..drive(5.0) };
            bench.send(|header| kit::command(header, &command, &KEY));
            bench.steps(4);
        }
    };
    drive_for(&mut bench, 120, false);
    assert_eq!(bench.speed(), 5.0);
    bench.sensors.bus_v = 21.0;
    drive_for(&mut bench, 500, false);
    assert_eq!(bench.firmware.findings().battery, Level::Critical);
    assert_eq!(bench.speed(), 5.0, "the way to the dock is still open");
    bench.sensors.bus_v = 18.0;
    drive_for(&mut bench, 500, true);
    assert_eq!(bench.firmware.findings().battery, Level::Empty);
    assert_eq!(bench.speed(), 0.0);
    assert!(bench.firmware.watchdog().is_stopped());
    bench.sensors.bus_v = 24.0;
    drive_for(&mut bench, 500, false);
    assert_eq!(bench.speed(), 0.0, "a stop stays until it is cleared");
    drive_for(&mut bench, 120, true);
    assert_eq!(bench.speed(), 5.0);
}

#[test]
fn the_cascade_of_the_firmware_is_the_controller_itself() {
    let motor = ControllerSettings {
        law: Law::Cascade {
            speed_kp_a_s_per_rad: 0.5,
            speed_ki_a_per_rad: 2.5,
            current_kp_v_per_a: 0.12,
            current_ki_v_per_a_s: 360.0,
            current_limit_a: 9.0,
        },
        sample_rate_hz: 1920,
        computation_delay_samples: 1,
        encoder: Some(EncoderSettings {
            ticks_per_rev: 4096,
            window_samples: 8,
        }),
    };
    let mut firmware = Firmware::new(Settings {
        motor,
        ..kit::settings(3, KEY)
    });
    assert_eq!(firmware.motor_samples_per_step(), 4);
    let mut alone = Controller::new(motor, 0);
    let mut count = 0;
    for step in 0..240 {
        let now_ms = 1000 + step * 2;
        if step % 4 == 0 {
            let header = kit::header(3, 1, step / 4 + 1, now_ms - 1);
            firmware.on_datagram(&kit::command(&header, &drive(6.0), &KEY), now_ms);
        }
        for sample in 0..4 {
            let current_a = 0.01 * f64::from(step % 37);
            let sensors = MotorSensors {
                wheel_rad_per_s: [0.0; 4],
                encoder_count: [count; 4],
                current_a: [current_a; 4],
                bus_v: 24.0,
            };
            let voltages = if sample == 0 {
                let all = Sensors {
                    encoder_count: [count; 4],
                    current_a: [current_a; 4],
                    bus_v: 24.0,
                    ..Sensors::default()
                };
                firmware.step(now_ms, &all).motor_v
            } else {
                firmware.motor_step(&sensors)
            };
            let wanted = alone.step(&ControlSample {
                command_rad_per_s: firmware.set_point().wheel_rad_per_s[0],
                encoder_count: count,
                current_a,
                bus_v: 24.0,
                ..ControlSample::default()
            });
            assert_eq!(
                voltages.map(f64::to_bits),
                [wanted.to_bits(); 4],
                "step {step}.{sample}"
            );
            count += (step / 30) as i32;
        }
    }
}

#[test]
fn a_slow_motor_control_holds_its_voltage_between_samples() {
    let motor = ControllerSettings {
        sample_rate_hz: 120,
        ..kit::settings(3, KEY).motor
    };
    let mut bench = Bench::new(Settings {
        motor,
        ..kit::settings(3, KEY)
    });
    bench.send(|header| kit::command(header, &drive(5.0), &KEY));
    bench.send(|header| kit::command(header, &drive(5.0), &KEY));
    let mut changes = Vec::new();
    let mut last = [0.0; 4];
    for step in 0..48 {
        bench.step += 1;
        let now_ms = bench.now_ms();
        let voltages = bench.firmware.step(now_ms, &bench.sensors).motor_v;
        if voltages != last {
            changes.push(step);
        }
        last = voltages;
    }
    assert!(
        changes.len() > 5 && changes.windows(2).all(|pair| (pair[1] - pair[0]) % 4 == 0),
        "{changes:?}"
    );
}

#[test]
fn smoothed_set_points_follow_a_first_order_lag() {
    // wheels that do not turn: a pure gain of 1 V s/rad shows the set-point that the controller gets
    let law = Law::SpeedPi {
        kp_v_s_per_rad: 1.0,
        ki_v_per_rad: 0.0,
    };
    let told_and_got = |smoothing_s| {
        let mut settings = kit::settings(3, KEY);
        settings.motor.law = law;
        settings.smoothing_s = smoothing_s;
        let mut bench = Bench::new(settings);
        let mut both = Vec::new();
        for step in 0..480 {
            if step % 4 == 0 {
                let got = bench.send(|header| kit::command(header, &drive(6.0), &KEY));
                assert_eq!(got, Received::Accepted);
            }
            bench.step += 1;
            let now_ms = bench.now_ms();
            let volts = bench.firmware.step(now_ms, &bench.sensors).motor_v[0];
            both.push((bench.firmware.set_point().wheel_rad_per_s[0], volts));
        }
        both
    };
    let at_once = told_and_got(0.0);
    assert!(at_once.iter().all(|(told, volts)| told.to_bits() == volts.to_bits()));
    assert_eq!(at_once.last().map(|(told, _)| *told), Some(6.0));
    let lag_s = 0.05;
    let share = 1.0 - libm::exp(-1.0 / 480.0 / lag_s);
    let mut exact = 0.0;
    for (step, (told, volts)) in told_and_got(lag_s).into_iter().enumerate() {
        exact += share * (told - exact);
        assert!((volts - exact).abs() < 0.02 * 6.0, "step {step}: {volts} and {exact}");
    }
}
