//! The closed loop in virtual time.

mod distance;
mod settings;
mod voice;
mod ward;
mod watch;

pub(crate) use distance::STRANGER_RADIUS_M;
pub use distance::Separation;
#[cfg(test)]
pub(crate) use distance::outside_m;
pub use settings::RigSettings;
pub use voice::{Said, SaidWhat};
pub use ward::{Report, Ward};
pub use watch::StopWatch;

use crate::{Air, Light, Scene};
use anyhow::{Result, anyhow};
use api::arena::Arena;
use control::law::Law;
use control::scenario::{FieldProblem, Scenario};
use control::team::Team;
use emulator::Laboratory;
use emulator::keys::Keys;
use emulator::laboratory::Placement;
use emulator::unit::Reception;
use lab::chorus::{Chorus, hears_groups};
use lab::commander::{Commander, Still};
use lab::ear::{Ear, Heard};
use lab::estimator::{PoseSample, PoseTrack};
use lab::localisation::Fuser;
use lab::pilot::{Outlet, Pilot, PilotRobot};
use lab::record::{Record, Telemetry};
use lab::robot_limits::RobotLimits;
use lab::safety::{Ending, Signals};
use robot::frame::TELEMETRY_MAX_CHARACTERS;
use robot::key::Key;
use sandbox::start::REHEARSAL_PATIENCE;
use voice::Voice;

/// Any key does: nobody else is in the air.
const KEY_HEX: &str = "000102030405060708090a0b0c0d0e0f";
const PLANT_HZ: i64 = 480;
const PLANT_TICKS_PER_TICK: i64 = 4;
/// Telemetry frames for each health frame.
const TICKS_PER_HEALTH: i64 = 12;
/// Frames without motion before the run: clocks get known, robots get seen.
const PREPARE_TICKS: i64 = 60;

/// See the module.
#[derive(Debug)]
pub struct Rig {
    pub laboratory: Laboratory,
    pub light: Light,
    pub up: Air,
    pub down: Air,
    /// What the loop is told from outside.
    pub signals: Signals,
    /// Number and pose of the robots on the floor that are not in the run.
    pub strangers: Vec<(u16, [f64; 3])>,
    /// Every order of the pilot, when somebody wants to know.
    pub said: Option<Vec<Said>>,
    /// Robots tell their health, and the laboratory judges it, when this is there.
    pub ward: Option<Ward>,
    /// Everything the laboratory wrote down, unless [`Self::keep_records`] is off.
    pub records: Vec<Record>,
    pub keep_records: bool,
    pilot: Pilot,
    commanders: Vec<Commander>,
    /// Of this tick's groups, when the robots hear groups.
    chorus: Option<Chorus>,
    /// Robot's clock in its newest frame.
    heard_ms: Vec<u32>,
    ears: Vec<Ear>,
    fuser: Fuser,
    key: Key,
    numbers: Vec<u8>,
    radii_m: Vec<f64>,
    arena: Arena,
    phase: i64,
    begin_us: i64,
    plant_ticks: i64,
    motion_plant_tick: i64,
    separation: Separation,
    watches: Vec<StopWatch>,
    ended: Option<Ending>,
}

impl Rig {
    /// Robots stand at their starts, are seen and heard; the next tick is the first of the run.
    pub fn new(scene: &Scene, settings: &RigSettings) -> Result<Self> {
        let scenario = scene.scenario()?;
        let team = Team::new(&scenario).map_err(refused)?;
        Self::with_team(scene, settings, &scenario, team)
    }

    /// As [`Self::new`] under a law that is not the experiment's.
    pub fn with_law(scene: &Scene, settings: &RigSettings, law: Box<dyn Law>) -> Result<Self> {
        let scenario = scene.scenario()?;
        let team = Team::with_law(&scenario, law).map_err(refused)?;
        Self::with_team(scene, settings, &scenario, team)
    }

    /// As [`Self::new`] for a scenario made elsewhere, with the models that it names.
    pub fn with_scenario(scene: &Scene, settings: &RigSettings, scenario: &Scenario) -> Result<Self> {
        // In virtual time there is no deadline that an own controller could miss.
        let team = sandbox::start::team(scenario, REHEARSAL_PATIENCE).map_err(refused)?;
        Self::with_team(scene, settings, scenario, team)
    }

    /// As [`Self::new`] with a team made elsewhere for the scenario.
    pub fn with_team(scene: &Scene, settings: &RigSettings, scenario: &Scenario, team: Team) -> Result<Self> {
        let limits: Vec<RobotLimits> = control::team::robots(scenario)
            .map_err(refused)?
            .iter()
            .map(RobotLimits::of)
            .collect();
        let robots = scene.robots()?;
        let keys: Vec<String> = (1..=250).map(|number| format!("\"{number}\":\"{KEY_HEX}\"")).collect();
        let keys = Keys::parse(&format!("{{{}}}", keys.join(",")))?;
        let key = Key::from_hex(KEY_HEX).ok_or_else(|| anyhow!("the key is no key"))?;
        // Only the robots of the run, in its order.
        let mut description = scene.laboratory.clone();
        description.robots = robots.iter().map(|robot| (*robot).clone()).collect();
        let mut laboratory = Laboratory::new(&description, settings.hidden.clone(), &keys, settings.seed)?;
        let starts = scenario.experiment.robots.iter().zip(&robots);
        let placements: Vec<Placement> = starts
            .map(|(wanted, robot)| Placement {
                number: robot.number,
                x_m: wanted.start.x_m,
                y_m: wanted.start.y_m,
                yaw_rad: wanted.start.yaw_rad,
            })
            .collect();
        laboratory.place(&placements)?;
        let duration_ticks = (scenario.experiment.duration_s * 120.0).round() as i64;
        let mut rig = Self {
            laboratory,
            light: Light::new(settings.light, robots.len(), settings.seed),
            up: Air::new(settings.up, settings.seed, 1).overheard(settings.audited),
            down: Air::new(settings.down, settings.seed, 2),
            signals: Signals {
                protective_stop: false,
                shutdown: false,
                stale_epoch: false,
                cancel: false,
                lease_until_us: i64::MAX,
                recorder_failed: false,
                robot_finding: None,
            },
            strangers: Vec::new(),
            said: settings.audited.then(Vec::new),
            ward: settings.health.then(|| Ward::new(robots.len())),
            chorus: None,
            records: Vec::new(),
            keep_records: true,
            commanders: robots
                .iter()
                .map(|robot| Commander::new(robot.number, key, driven(&robot.description), 1, 1))
                .collect(),
            heard_ms: vec![0; robots.len()],
            ears: vec![Ear::default(); robots.len()],
            fuser: Fuser::new(1)?,
            key,
            numbers: robots.iter().map(|robot| robot.number).collect(),
            radii_m: robots.iter().map(|robot| robot.bounding_radius_m).collect(),
            arena: scene.laboratory.arena.clone(),
            phase: settings.phase.rem_euclid(PLANT_TICKS_PER_TICK),
            begin_us: settings.begin_us,
            plant_ticks: 0,
            motion_plant_tick: 0,
            separation: Separation::NONE,
            watches: vec![StopWatch::new(settings.begin_us); robots.len()],
            ended: None,
            // Replaced below, once the robots are seen.
            pilot: Pilot::new(Team::new(scenario).map_err(refused)?, Vec::new(), 0, settings.begin_us),
        };
        let seen = rig.prepare(&limits)?;
        let pilot = Pilot::new(team, seen, duration_ticks, rig.now_us()).looking_ahead(settings.looks_ahead);
        rig.pilot = if settings.learns {
            pilot
        } else {
            pilot.without_learning()
        };
        rig.motion_plant_tick = rig.plant_ticks;
        rig.begin_to_speak();
        Ok(rig)
    }

    /// Microseconds of the laboratory's clock.
    pub fn now_us(&self) -> i64 {
        self.begin_us + self.plant_ticks * 1_000_000 / PLANT_HZ
    }

    /// Control ticks since the motion began.
    pub fn slot(&self) -> i64 {
        (self.plant_ticks - self.motion_plant_tick) / PLANT_TICKS_PER_TICK
    }

    /// How the run ended; `None` while it goes on.
    pub fn ended(&self) -> Option<Ending> {
        self.ended
    }

    /// Smallest distances since the motion began.
    pub fn separation(&self) -> Separation {
        self.separation
    }

    pub fn pilot(&self) -> &Pilot {
        &self.pilot
    }

    /// To let ticks come too late, for example.
    pub fn pilot_mut(&mut self) -> &mut Pilot {
        &mut self.pilot
    }

    /// One for each robot.
    pub fn watches(&self) -> &[StopWatch] {
        &self.watches
    }

    /// The laboratory starts anew: another process that knows nothing of the robots, with a run of its own.
    ///
    /// - `epoch`, `sequence`: of its first frames.
    /// - Errors: robots that are not seen or do not answer.
    pub fn restart(&mut self, scene: &Scene, epoch: u32, sequence: u32) -> Result<()> {
        let scenario = scene.scenario()?;
        let described = control::team::robots(&scenario).map_err(refused)?;
        let limits: Vec<RobotLimits> = described.iter().map(RobotLimits::of).collect();
        for commander in &mut self.commanders {
            commander.begin_epoch(epoch, sequence);
        }
        self.ears.fill(Ear::default());
        self.heard_ms.fill(0);
        self.fuser = Fuser::new(1)?;
        let seen = self.prepare(&limits)?;
        let team = Team::new(&scenario).map_err(refused)?;
        let duration_ticks = (scenario.experiment.duration_s * 120.0).round() as i64;
        self.pilot = Pilot::new(team, seen, duration_ticks, self.now_us());
        self.motion_plant_tick = self.plant_ticks;
        self.ended = None;
        self.begin_to_speak();
        Ok(())
    }

    /// As at the start of a run in the laboratory; the emulated robots all read groups.
    fn begin_to_speak(&mut self) {
        let robots = self.commanders.iter().map(|commander| (commander.epoch(), true));
        self.chorus = hears_groups(robots).then(|| Chorus::with_room_for(self.commanders.len()));
    }

    /// Of all robots.
    pub fn key(&self) -> Key {
        self.key
    }

    /// Number of each robot and positions in its description's `wheels` of the driven ones.
    pub fn driven(&self) -> Vec<(u8, Vec<usize>)> {
        let robots = self.laboratory.units().iter().map(emulator::unit::Unit::robot);
        robots.map(|robot| (robot.number, driven(&robot.description))).collect()
    }

    /// To make frames of one's own: what a forger or an old laboratory would send.
    pub fn commander(&self, place: usize) -> Option<&Commander> {
        self.commanders.get(place)
    }

    /// True poses, x, y, yaw.
    pub fn poses(&self) -> Vec<[f64; 3]> {
        let units = self.laboratory.units().iter();
        units
            .map(|unit| {
                unit.on_floor().map_or([f64::NAN; 3], |body| {
                    let pose = body.pose();
                    [pose.x_m, pose.y_m, pose.yaw_rad]
                })
            })
            .collect()
    }

    /// True speed of a robot, m/s.
    pub fn speed_m_per_s(&self, place: usize) -> f64 {
        let body = self.laboratory.units().get(place).and_then(|unit| unit.on_floor());
        body.map_or(0.0, |body| {
            let [vx, vy] = body.velocity_m_per_s();
            vx.hypot(vy)
        })
    }

    /// One control tick and the plant's ticks after it; `true` while the run goes on.
    pub fn tick(&mut self) -> bool {
        if self.ended.is_some() {
            return false;
        }
        let now_us = self.now_us();
        let slot = self.slot();
        self.receive(now_us);
        let mut voice = Voice {
            commanders: &mut self.commanders,
            heard_ms: &self.heard_ms,
            up: &mut self.up,
            chorus: self.chorus.as_mut(),
            said: self.said.as_mut(),
            now_us,
        };
        self.ended = self
            .pilot
            .tick(slot, now_us, self.signals, &mut voice, &mut self.records);
        if !self.keep_records {
            self.records.clear();
        }
        self.plant_ticks();
        self.ended.is_none()
    }

    /// Ticks until the run ends, at most for `seconds`.
    pub fn run_for(&mut self, seconds: f64) {
        let ticks = (seconds * 120.0).round() as i64;
        for _ in 0..ticks {
            if !self.tick() {
                return;
            }
        }
    }

    /// As the laboratory does between runs: it listens, and robots stay awake and still.
    pub fn idle_for(&mut self, seconds: f64) {
        for _ in 0..(seconds * 120.0).round() as i64 {
            let now_us = self.now_us();
            self.receive(now_us);
            self.say_still(Still::Rest, now_us);
            self.records.clear();
            self.plant_ticks();
        }
    }

    /// To every robot in a frame of its own: groups are for runs.
    fn say_still(&mut self, still: Still, now_us: i64) {
        let mut voice = Voice {
            commanders: &mut self.commanders,
            heard_ms: &self.heard_ms,
            up: &mut self.up,
            chorus: None,
            said: self.said.as_mut(),
            now_us,
        };
        for place in 0..self.numbers.len() {
            voice.still(place, still, 0);
        }
    }

    /// The world goes on without the laboratory's process: killed, stopped or asleep.
    pub fn sleep_for(&mut self, seconds: f64) {
        for _ in 0..(seconds * 120.0).round() as i64 {
            self.plant_ticks();
        }
    }

    fn prepare(&mut self, limits: &[RobotLimits]) -> Result<Vec<PilotRobot>> {
        let mut tracks: Vec<PoseTrack> = limits.iter().map(|limits| PoseTrack::new(limits.motion)).collect();
        let mut telemetry: Vec<Option<Telemetry>> = vec![None; limits.len()];
        for _ in 0..PREPARE_TICKS {
            let now_us = self.now_us();
            let Self {
                light,
                fuser,
                down,
                ears,
                heard_ms,
                key,
                numbers,
                ..
            } = self;
            light.deliver(now_us, |sighting| {
                let frame = fuser.take(0, sighting, now_us);
                for pose in frame.iter().flat_map(|frame| &frame.poses) {
                    let place = numbers.iter().position(|number| *number == pose.number);
                    if let Some(track) = place.and_then(|place| tracks.get_mut(place)) {
                        let sample = PoseSample {
                            exposure_us: sighting.observation.exposure_us,
                            x_m: pose.x_m,
                            y_m: pose.y_m,
                            yaw_rad: pose.yaw_rad,
                        };
                        track.observe(sample, pose.velocity);
                    }
                }
            });
            down.deliver(now_us, |place, bytes| {
                if let (Some(ear), Some(slot)) = (ears.get_mut(place), telemetry.get_mut(place))
                    && let Ok(heard) = ear.hear(bytes, key, now_us)
                {
                    if let Some(heard_ms) = heard_ms.get_mut(place) {
                        *heard_ms = heard.robot_clock_ms;
                    }
                    *slot = Some(heard);
                }
            });
            self.say_still(Still::Release, now_us);
            self.plant_ticks();
        }
        let parts = tracks.into_iter().zip(telemetry).zip(limits).zip(&self.numbers);
        parts
            .map(|(((track, telemetry), limits), number)| {
                let telemetry = telemetry.ok_or_else(|| anyhow!("robot {number} does not answer"))?;
                if track.newest().is_none() {
                    return Err(anyhow!("robot {number} is not seen"));
                }
                let name = format!("robot {number}");
                Ok(PilotRobot::new(*number, name, track, telemetry, limits))
            })
            .collect()
    }

    /// Poses and telemetry that have arrived.
    fn receive(&mut self, now_us: i64) {
        let Self {
            light,
            fuser,
            down,
            ears,
            heard_ms,
            key,
            pilot,
            records,
            ward,
            ..
        } = self;
        light.deliver(now_us, |sighting| {
            if let Some(frame) = fuser.take(0, sighting, now_us) {
                pilot.see(&frame, now_us, records);
            }
        });
        down.deliver(now_us, |place, bytes| {
            match ears.get_mut(place).map(|ear| ear.listen(bytes, key, now_us)) {
                Some(Ok(Heard::Motion(telemetry))) => {
                    if let Some(heard_ms) = heard_ms.get_mut(place) {
                        *heard_ms = telemetry.robot_clock_ms;
                    }
                    pilot.hear(telemetry, records);
                }
                Some(Ok(Heard::Health(health))) => {
                    if let Some(ward) = ward {
                        ward.take(place, &health, now_us);
                    }
                }
                _ => {}
            }
        });
        if let Some(ward) = &self.ward {
            self.signals.robot_finding = ward.finding();
        }
    }

    /// Plant and firmware for one control period.
    fn plant_ticks(&mut self) {
        for part in 0..PLANT_TICKS_PER_TICK {
            self.plant_ticks += 1;
            let now_us = self.now_us();
            let Self {
                up,
                laboratory,
                watches,
                ..
            } = self;
            up.deliver(now_us, |place, bytes| {
                if let (Some(unit), Some(watch)) = (laboratory.unit_mut(place), watches.get_mut(place))
                    && unit.receive(bytes, now_us) == Reception::Commander
                {
                    *watch = watch.heard(now_us);
                }
            });
            self.laboratory.tick(now_us);
            self.measure();
            self.watch(now_us);
            if part == self.phase {
                self.look_and_report(now_us);
            }
        }
    }

    fn watch(&mut self, now_us: i64) {
        for (watch, unit) in self.watches.iter_mut().zip(self.laboratory.units()) {
            watch.step(unit, now_us);
        }
    }

    /// A picture, and telemetry of every robot.
    fn look_and_report(&mut self, now_us: i64) {
        let tick = self.plant_ticks / PLANT_TICKS_PER_TICK;
        if tick % self.light.settings.ticks_per_picture.max(1) == 0 {
            let poses: Vec<(u16, [f64; 3])> = self
                .numbers
                .iter()
                .map(|number| u16::from(*number))
                .zip(self.poses())
                .filter(|(_, pose)| pose.iter().all(|part| part.is_finite()))
                .chain(self.strangers.iter().copied())
                .collect();
            self.light.expose(now_us, &poses);
        }
        for place in 0..self.numbers.len() {
            let mut out = [0; TELEMETRY_MAX_CHARACTERS];
            let Some(unit) = self.laboratory.unit_mut(place) else {
                continue;
            };
            let length = unit.telemetry(now_us, &mut out);
            send(&mut self.down, place, out.get(..length), now_us);
            if self.ward.is_some() && (tick + place as i64) % TICKS_PER_HEALTH == 0 {
                let length = unit.health_report(now_us, &mut out);
                send(&mut self.down, place, out.get(..length), now_us);
            }
        }
    }

    fn measure(&mut self) {
        let poses = self.poses();
        self.separation
            .measure(&poses, &self.radii_m, &self.arena, &self.strangers);
    }
}

fn send(down: &mut Air, place: usize, characters: Option<&[u8]>, now_us: i64) {
    if let Some(characters) = characters.filter(|characters| !characters.is_empty()) {
        down.send(place, characters, now_us);
    }
}

/// Positions in `wheels` of the driven wheels.
fn driven(robot: &api::robot::RobotDescription) -> Vec<usize> {
    let wheels = robot.wheels.iter().enumerate();
    wheels
        .filter(|(_, wheel)| wheel.driven)
        .map(|(place, _)| place)
        .collect()
}

fn refused(problems: Vec<FieldProblem>) -> anyhow::Error {
    anyhow!("{problems:?}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneRobot;

    #[test]
    fn four_robots_swap_corners_and_end_where_they_should() {
        let corners = [[-1.2, -0.8], [1.2, -0.8], [1.2, 0.8], [-1.2, 0.8]];
        let robots: Vec<SceneRobot> = (0..4)
            .map(|k| SceneRobot {
                start: [corners[k][0], corners[k][1], 0.0],
                goal: corners[(k + 2) % 4],
            })
            .collect();
        let scene = Scene::new("omni4", &robots, 40.0).expect("a scene");
        let mut rig = Rig::new(&scene, &RigSettings::default()).expect("a rig");
        rig.run_for(45.0);
        assert_eq!(rig.ended(), Some(Ending::Finished));
        for (pose, robot) in rig.poses().iter().zip(&robots) {
            let off_m = (pose[0] - robot.goal[0]).hypot(pose[1] - robot.goal[1]);
            assert!(off_m < 0.05, "{off_m} m from the goal");
        }
        let Separation { robots_m, walls_m, .. } = rig.separation();
        println!("separation: robots {robots_m:.3} m, walls {walls_m:.3} m");
        assert!(robots_m > 0.0 && walls_m > 0.0);
    }
}
