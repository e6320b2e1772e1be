//! What the cameras' processes tell, without rendering: true poses with error, delay, loss and lies.

use emulator::noise::Noise;
use lab::camera::sighting::Sighting;
use localise::{FloorPose, Observation, Rejections};

/// What the localisation does to poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSettings {
    /// Pictures for each 120 Hz tick: 1 is 120 Hz, 2 is 60 Hz.
    pub ticks_per_picture: i64,
    /// Mid-exposure to arrival, shortest and longest.
    pub delay_us: [i64; 2],
    /// Standard deviation of a coordinate; cut off at three of them.
    pub noise_m: f64,
    pub noise_rad: f64,
    /// Constant error of each robot's position, in a direction of its own.
    pub bias_m: f64,
    /// Share of sightings that are missing.
    pub loss: f64,
}

impl Default for LightSettings {
    /// As measured on rendered pictures, with a calibration error of 1 mm.
    fn default() -> Self {
        Self {
            ticks_per_picture: 1,
            delay_us: [4000, 9000],
            noise_m: 0.000_3,
            noise_rad: 0.002,
            bias_m: 0.001,
            loss: 0.0,
        }
    }
}

/// Lies of the localisation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lies {
    /// No picture arrives.
    pub dark: bool,
    /// The same picture again and again, with new times.
    pub frozen: bool,
    /// This robot's tag is not seen.
    pub hidden: Option<u16>,
    /// These two robots are seen as each other.
    pub swapped: Option<[u16; 2]>,
    /// This robot is seen that far away.
    pub jump: Option<(u16, [f64; 2])>,
    /// This robot's pose stays where it was while the pictures go on.
    pub stuck: Option<(u16, [f64; 3])>,
}

/// See the module.
#[derive(Debug, Clone)]
pub struct Light {
    pub settings: LightSettings,
    pub lies: Lies,
    random: Noise,
    /// Direction of each robot's bias.
    bias_rad: Vec<f64>,
    sequence: u64,
    last: Option<Observation>,
    on_their_way: Vec<(i64, Sighting)>,
}

impl Light {
    /// - `robots`: how many.
    pub fn new(settings: LightSettings, robots: usize, seed: u64) -> Self {
        let mut random = Noise::new(seed, 0x0011_6417);
        Self {
            settings,
            lies: Lies::default(),
            bias_rad: (0..robots).map(|_| random.uniform() * std::f64::consts::TAU).collect(),
            random,
            sequence: 0,
            last: None,
            on_their_way: Vec::new(),
        }
    }

    /// A picture is taken.
    ///
    /// - `poses`: number, x, y, yaw of every robot on the floor.
    pub fn expose(&mut self, now_us: i64, poses: &[(u16, [f64; 3])]) {
        self.sequence += 1;
        let mut observation = match (&self.last, self.lies.frozen) {
            (Some(last), true) => last.clone(),
            _ => self.picture(poses),
        };
        observation.sequence = self.sequence;
        observation.exposure_us = now_us;
        self.last = Some(observation.clone());
        if self.lies.dark {
            return;
        }
        let [least, most] = self.settings.delay_us;
        let delay_us = least + (self.random.uniform() * (most - least) as f64) as i64;
        // First in, first out: no picture overtakes another of its camera.
        let before_us = self.on_their_way.last().map_or(i64::MIN, |(due_us, _)| *due_us);
        let due_us = (now_us + delay_us).max(before_us);
        let sighting = Sighting {
            camera: "cam-0".to_owned(),
            received_us: now_us + delay_us / 2,
            located_us: due_us,
            observation,
        };
        self.on_their_way.push((due_us, sighting));
    }

    /// Hands over what is due.
    pub fn deliver(&mut self, now_us: i64, mut take: impl FnMut(&Sighting)) {
        while self.on_their_way.first().is_some_and(|(due_us, _)| *due_us <= now_us) {
            let (_, sighting) = self.on_their_way.remove(0);
            take(&sighting);
        }
    }

    fn picture(&mut self, poses: &[(u16, [f64; 3])]) -> Observation {
        let mut seen = Vec::with_capacity(poses.len());
        for (place, (robot, pose)) in poses.iter().enumerate() {
            if self.lies.hidden == Some(*robot) || self.random.uniform() < self.settings.loss {
                continue;
            }
            seen.push(self.sight(place, *robot, *pose));
        }
        seen.sort_by_key(|pose| pose.robot);
        Observation {
            sequence: 0,
            exposure_us: 0,
            digest: self.sequence,
            poses: seen,
            implausible: 0,
            rejections: Rejections::default(),
        }
    }

    fn sight(&mut self, place: usize, robot: u16, pose: [f64; 3]) -> FloorPose {
        let LightSettings {
            noise_m,
            noise_rad,
            bias_m,
            ..
        } = self.settings;
        let [mut x_m, mut y_m, yaw_rad] = match self.lies.stuck {
            Some((number, stuck)) if number == robot => stuck,
            _ => pose,
        };
        if let Some((number, [dx, dy])) = self.lies.jump
            && number == robot
        {
            (x_m, y_m) = (x_m + dx, y_m + dy);
        }
        let mut noise = |deviation: f64| deviation * self.random.normal().clamp(-3.0, 3.0);
        let bias_rad = self.bias_rad.get(place).copied().unwrap_or_default();
        let variance = (noise_m * noise_m + bias_m * bias_m).max(1e-10);
        FloorPose {
            robot: self.lies.swapped.map_or(robot, |[one, other]| match robot {
                number if number == one => other,
                number if number == other => one,
                number => number,
            }),
            x_m: x_m + bias_m * bias_rad.cos() + noise(noise_m),
            y_m: y_m + bias_m * bias_rad.sin() + noise(noise_m),
            yaw_rad: localise::wrap_rad(yaw_rad + noise(noise_rad)),
            covariance: [
                [variance, 0.0, 0.0],
                [0.0, variance, 0.0],
                [0.0, 0.0, (noise_rad * noise_rad).max(1e-8)],
            ],
            residual_px: 0.1,
        }
    }
}
