//! One adversarial run on the emulated plant, made from numbers between 0 and 1: so that it can be drawn, and searched.

use crate::hostile::{Hostile, WISH_GENES};
use crate::liar::{Liar, lying_model};
use crate::walkers::Walkers;
use crate::{AirSettings, LightSettings, Rig, RigSettings, Scene, SceneRobot};
use anyhow::{Result, anyhow};
use api::arena::{Contents, FixedObstacle};
use control::interaction::Settings;
use control::law::Law;
use control::team::Team;
use emulator::hidden::{FrictionPatch, Hidden, HiddenFloor, HiddenRobot, Wear};
use emulator::noise::Noise;
use twin::robot::Robot;

/// Chassis of the examples.
pub const CHASSIS: [&str; 6] = ["omni4", "diff2", "diff4", "fwd", "rwd", "awd"];
/// Numbers for the whole run, and for each robot.
pub const COMMON_GENES: usize = 18;
pub const ROBOT_GENES: usize = 3 + WISH_GENES;
/// Circle of every robot of a [`Scene`].
pub(crate) const RADIUS_M: f64 = 0.25;
/// Gap between robots, and to walls, at the start.
const START_GAP_M: f64 = 0.03;
const HALF_ARENA_M: [f64; 2] = [2.0, 1.5];
const TICKS_PER_S: f64 = 120.0;
/// Friction of the robots' descriptions.
const NOMINAL_FRICTION: f64 = 0.8;

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Attack {
    pub chassis: Vec<&'static str>,
    pub seed: u64,
    /// [`COMMON_GENES`], then [`ROBOT_GENES`] for each robot, then one: the motors' lag.
    pub genes: Vec<f64>,
    pub seconds: f64,
    /// Robots drive at walls only.
    pub walls_only: bool,
    /// Half of what the law says is garbage, and a tenth of the ticks is late.
    pub liar: bool,
    /// What stands in the arena, and who walks through it; besides the genes.
    pub furniture: Vec<FixedObstacle>,
    pub walkers: Walkers,
}

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    pub robots_m: f64,
    pub walls_m: f64,
    /// To what stands in the arena.
    pub obstacles_m: f64,
    /// To who walks through it.
    pub strangers_m: f64,
    /// Fastest that any robot was.
    pub fastest_m_per_s: f64,
    /// The run ended by itself before its time.
    pub ended: bool,
}

impl Outcome {
    pub const NONE: Self = Self {
        robots_m: f64::INFINITY,
        walls_m: f64::INFINITY,
        obstacles_m: f64::INFINITY,
        strangers_m: f64::INFINITY,
        fastest_m_per_s: 0.0,
        ended: false,
    };

    /// Smallest distance to anything that is the filter's alone to keep: each other, walls and what stands.
    pub fn least_m(&self) -> f64 {
        self.robots_m.min(self.walls_m).min(self.obstacles_m)
    }
}

impl Attack {
    /// Everything at random: chassis, places, wishes, delays, losses, errors, floor, load, faults.
    pub fn random(seed: u64, number: u64, robots: usize, seconds: f64) -> Self {
        let mut random = Noise::new(seed, 0x0A77_AC00_0000 ^ number);
        let pick = |random: &mut Noise| {
            let place = (random.uniform() * CHASSIS.len() as f64) as usize;
            CHASSIS.get(place).copied().unwrap_or("omni4")
        };
        Self {
            chassis: (0..robots).map(|_| pick(&mut random)).collect(),
            seed: seed ^ number.wrapping_mul(0x9E37_79B9),
            genes: (0..=COMMON_GENES + ROBOT_GENES * robots)
                .map(|_| random.uniform())
                .collect(),
            seconds,
            walls_only: false,
            liar: false,
            furniture: Vec::new(),
            walkers: Walkers::default(),
        }
    }

    fn gene(&self, place: usize) -> f64 {
        self.genes.get(place).copied().unwrap_or(0.5).clamp(0.0, 1.0)
    }

    fn of_robot(&self, robot: usize, place: usize) -> f64 {
        self.gene(COMMON_GENES + ROBOT_GENES * robot + place)
    }

    /// Places from the genes, pushed apart until no two circles are too close.
    pub fn starts(&self) -> Vec<[f64; 3]> {
        let reach = HALF_ARENA_M.map(|half| half - RADIUS_M - START_GAP_M);
        let spread = |robot, axis: usize| reach[axis] * (2.0 * self.of_robot(robot, axis) - 1.0);
        let count = self.chassis.len();
        let mut places: Vec<[f64; 2]> = (0..count).map(|robot| [spread(robot, 0), spread(robot, 1)]).collect();
        let apart_m = 2.0 * RADIUS_M + START_GAP_M;
        for round in 0..400 {
            if !push_apart(&mut places, apart_m, reach, round) {
                let turned = |(robot, [x, y]): (usize, &[f64; 2])| {
                    [*x, *y, std::f64::consts::TAU * (self.of_robot(robot, 2) - 0.5)]
                };
                return places.iter().enumerate().map(turned).collect();
            }
        }
        // As dense as that: four columns of three.
        let cell = |robot: usize| [-1.5 + (robot % 4) as f64, -1.0 + (robot / 4) as f64];
        (0..count)
            .map(|robot| {
                [
                    cell(robot)[0],
                    cell(robot)[1],
                    std::f64::consts::TAU * (self.of_robot(robot, 2) - 0.5),
                ]
            })
            .collect()
    }

    fn settings(&self) -> RigSettings {
        let us = |value: f64| value as i64;
        let delays = |least_us: f64, width_us: i64| [us(least_us), us(least_us) + width_us];
        // Up to 59 ms of the light and 21 ms of the air: 80 ms. On a slower link robots do not know the clock and stand.
        let light = delays(4000.0 + 51_000.0 * self.gene(2), 4000);
        let up = delays(1000.0 + 15_000.0 * self.gene(3), 5000);
        let share = 0.3 * self.gene(0);
        let burst_s = 0.01 + 0.09 * self.gene(16);
        let bursts = self.gene(1) > 0.5;
        let frames_per_s = TICKS_PER_S * self.chassis.len() as f64;
        let air = AirSettings {
            delay_us: up,
            loss: if bursts { 0.0 } else { share },
            burst: if bursts { share / (frames_per_s * burst_s) } else { 0.0 },
            burst_us: us(burst_s * 1e6),
            copies: 0.02,
        };
        RigSettings {
            seed: self.seed,
            hidden: self.hidden(),
            light: LightSettings {
                ticks_per_picture: 1,
                delay_us: light,
                // Cut off at three deviations on two axes: 1 mm, with the bias at most 5 mm.
                noise_m: 0.000_23 * self.gene(5),
                noise_rad: 0.002,
                bias_m: 0.004 * self.gene(4),
                loss: 0.05 * self.gene(17),
            },
            up: air,
            down: AirSettings {
                delay_us: [1000, 5000],
                ..air
            },
            phase: us(4.0 * self.gene(12)).min(3),
            ..RigSettings::default()
        }
    }

    /// Friction down to 0.3 and 0.21 on a patch, up to 60 % more mass, motors up to 0.15 s late and weaker, play, a battery
    /// that gives way.
    fn hidden(&self) -> Hidden {
        let mut hidden = Hidden::neutral();
        let hard = self.gene(6);
        let patch = FrictionPatch {
            x_m: 4.0 * (self.gene(7) - 0.5),
            y_m: 3.0 * (self.gene(8) - 0.5),
            radius_m: 0.5,
            friction_scale: 1.0 - 0.3 * self.gene(9),
        };
        let floor = HiddenFloor {
            friction_scale: 1.0 - (1.0 - 0.3 / NOMINAL_FRICTION) * hard,
            patches: vec![patch],
            ..HiddenFloor::default()
        };
        hidden.floors.insert("lab-floor".to_owned(), floor);
        let load = 1.0 + 0.6 * self.gene(10);
        let worn = self.gene(11);
        let lag_s = 0.15 * self.gene(COMMON_GENES + ROBOT_GENES * self.chassis.len());
        for (robot, chassis) in self.chassis.iter().enumerate() {
            let body = HiddenRobot {
                mass_scale: load,
                yaw_inertia_scale: load,
                torque_constant_scale: vec![1.0 - 0.15 * worn; 4],
                coulomb_scale: 1.0 + 0.6 * worn,
                half_backlash_rad: 0.01 * worn,
                battery_resistance_ohm: 0.15 * worn,
                wear: Wear {
                    motor_lag_s: lag_s,
                    ..Wear::default()
                },
                ..HiddenRobot::default()
            };
            hidden.robots.insert(format!("{chassis}-{:02}", robot + 1), body);
        }
        hidden
    }

    fn law(&self) -> Box<dyn Law> {
        let wishes = (0..self.chassis.len()).map(|robot| std::array::from_fn(|place| self.of_robot(robot, 3 + place)));
        let law = Hostile::new(wishes.collect(), HALF_ARENA_M.map(|half| 2.0 * half));
        let standing = self
            .furniture
            .iter()
            .map(|obstacle| [obstacle.pose.x_m, obstacle.pose.y_m]);
        let law = law.also_at(standing.chain(self.walkers.places_m()).collect());
        let law = if self.walls_only { law.at_walls() } else { law };
        if self.liar {
            Box::new(Liar::new(law, self.seed))
        } else {
            Box::new(law)
        }
    }

    /// The run.
    pub fn run(&self) -> Result<Outcome> {
        self.run_watched(false, |_| {})
    }

    /// Arena and robots, ready to run.
    ///
    /// - `audited`: the rig notes every order and every frame.
    pub(crate) fn begin(&self, audited: bool) -> Result<(Scene, Rig)> {
        let starts = self.starts();
        let robots: Vec<SceneRobot> = starts
            .iter()
            .map(|start| SceneRobot {
                start: *start,
                goal: [start[0], start[1]],
            })
            .collect();
        let mut scene = Scene::mixed(&self.chassis, &robots, self.seconds)?;
        if !self.furniture.is_empty() {
            scene.laboratory.arena.contents = Some(Contents {
                fixed: self.furniture.clone(),
                ..Contents::default()
            });
        }
        let rig = self.rig(&scene, audited)?;
        Ok((scene, rig))
    }

    /// A liar's robots are corrected by models that lie as well, in every second run.
    fn rig(&self, scene: &Scene, audited: bool) -> Result<Rig> {
        let settings = RigSettings {
            audited,
            ..self.settings()
        };
        if !self.liar || self.seed.is_multiple_of(2) {
            return Rig::with_law(scene, &settings, self.law());
        }
        let scenario = scene.scenario()?;
        let refused = |problems| anyhow!("{problems:?}");
        let described = control::team::robots(&scenario).map_err(refused)?;
        let models: Vec<Robot> = described
            .iter()
            .enumerate()
            .map(|(place, robot)| lying_model(robot, self.seed ^ (place as u64 * 7919)))
            .collect::<Result<_>>()?;
        let team = Team::with_law(&scenario, self.law()).map_err(refused)?;
        let team = team.with_interaction(&models, Settings::default());
        Rig::with_team(scene, &settings, &scenario, team)
    }

    /// The run, looked at after every control tick.
    ///
    /// - `keep_records`: the rig keeps what the laboratory wrote down for `look`, which may take it.
    pub fn run_watched(&self, keep_records: bool, mut look: impl FnMut(&mut Rig)) -> Result<Outcome> {
        let mut walkers = self.walkers.clone();
        let (_, mut rig) = self.begin(false)?;
        rig.keep_records = keep_records;
        let fault = Fault::of(self);
        let mut late = Noise::new(self.seed, 0x01A7E);
        let mut fastest_m_per_s: f64 = 0.0;
        let ticks = (self.seconds * TICKS_PER_S) as i64;
        for tick in 0..ticks {
            fault.set(&mut rig, tick as f64 / TICKS_PER_S);
            rig.strangers = walkers.step(&rig.poses(), RADIUS_M);
            if self.liar && late.uniform() < 0.1 {
                rig.pilot_mut().overdue(1 + u32::from(late.uniform() < 0.5));
            }
            if !rig.tick() {
                break;
            }
            look(&mut rig);
            if tick % 12 == 0 {
                let speeds = (0..self.chassis.len()).map(|robot| rig.speed_m_per_s(robot));
                fastest_m_per_s = speeds.fold(fastest_m_per_s, f64::max);
            }
        }
        let separation = rig.separation();
        Ok(Outcome {
            robots_m: separation.robots_m,
            walls_m: separation.walls_m,
            obstacles_m: separation.obstacles_m,
            strangers_m: separation.strangers_m,
            fastest_m_per_s,
            ended: rig.ended().is_some() && rig.slot() < ticks - 1,
        })
    }
}

/// Something that breaks for a while: half of the runs have one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fault {
    kind: usize,
    robot: usize,
    from_s: f64,
    until_s: f64,
}

impl Fault {
    pub(crate) fn of(attack: &Attack) -> Self {
        let count = attack.chassis.len();
        let from_s = attack.seconds * attack.gene(14);
        Self {
            kind: (8.0 * attack.gene(13)) as usize,
            robot: ((attack.gene(15) * 7.0).fract() * count as f64) as usize,
            from_s,
            until_s: from_s + 0.45 * attack.gene(15),
        }
    }

    pub(crate) fn set(&self, rig: &mut Rig, now_s: f64) {
        let on = (self.from_s..self.until_s).contains(&now_s);
        match self.kind {
            0 => rig.up.cut_for = on.then_some(self.robot),
            1 => rig.up.cut = on,
            2 => rig.light.lies.hidden = on.then_some(self.robot as u16 + 1),
            3 => rig.light.lies.dark = on,
            _ => {}
        }
    }
}

/// One round of pushing; `true` while two are too close.
fn push_apart(places: &mut [[f64; 2]], apart_m: f64, reach: [f64; 2], round: usize) -> bool {
    let mut close = false;
    for i in 0..places.len() {
        for j in 0..i {
            let (Some(&a), Some(&b)) = (places.get(i), places.get(j)) else {
                continue;
            };
            let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
            let distance_m = dx.hypot(dy);
            if distance_m >= apart_m {
                continue;
            }
            close = true;
            // A little to the side, another way every round: nothing stays wedged in a row.
            let tilt = 0.3 * ((round + i + j) as f64 * 2.4).sin();
            let [nx, ny] = if distance_m > 1e-6 {
                [dx / distance_m, dy / distance_m]
            } else {
                [1.0, 0.0]
            };
            let push = 0.55 * (apart_m - distance_m) + 1e-4;
            let (px, py) = (push * (nx - tilt * ny), push * (ny + tilt * nx));
            if let Some(place) = places.get_mut(i) {
                *place = [
                    (a[0] + px).clamp(-reach[0], reach[0]),
                    (a[1] + py).clamp(-reach[1], reach[1]),
                ];
            }
            if let Some(place) = places.get_mut(j) {
                *place = [
                    (b[0] - px).clamp(-reach[0], reach[0]),
                    (b[1] - py).clamp(-reach[1], reach[1]),
                ];
            }
        }
    }
    close
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_apart_and_inside_whatever_the_genes() {
        for number in 0..300 {
            let attack = Attack::random(1, number, 1 + (number % 10) as usize, 1.0);
            let starts = attack.starts();
            for (i, a) in starts.iter().enumerate() {
                assert!(a[0].abs() <= 2.0 - RADIUS_M && a[1].abs() <= 1.5 - RADIUS_M, "{a:?}");
                for b in &starts[..i] {
                    assert!((a[0] - b[0]).hypot(a[1] - b[1]) >= 2.0 * RADIUS_M + START_GAP_M - 1e-9);
                }
            }
        }
    }

    #[test]
    fn the_same_attack_ends_the_same() {
        let attack = Attack::random(3, 7, 3, 2.0);
        let once = attack.run().expect("a run");
        assert_eq!(once, attack.run().expect("a run"));
        assert!(once.fastest_m_per_s > 0.1, "{once:?}");
    }
}
