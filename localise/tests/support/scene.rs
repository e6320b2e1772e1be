//! Cameras, planes and tags of the test pictures.

use localise::{Camera, CameraDocument, Distortion, FORMAT};

use super::Random;

/// A camera as it really is.
#[derive(Clone)]
pub struct Truth {
    pub size: [usize; 2],
    pub focal: [f64; 2],
    pub centre: [f64; 2],
    /// k1 k2 k3 p1 p2
    pub lens: [f64; 5],
    pub position: [f64; 3],
    pub rotation: [[f64; 3]; 3],
}

impl Truth {
    fn bend(&self, x: f64, y: f64) -> [f64; 2] {
        let [k1, k2, k3, p1, p2] = self.lens;
        let r2 = x * x + y * y;
        let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// Pixel of a point in the camera frame.
    pub fn pixel(&self, at: [f64; 3]) -> Option<[f64; 2]> {
        let (x, y) = (at[0] / at[2], at[1] / at[2]);
        (at[2] > 0.1 && x.hypot(y) < 1.1).then(|| {
            let [a, b] = self.bend(x, y);
            [self.focal[0] * a + self.centre[0], self.focal[1] * b + self.centre[1]]
        })
    }

    /// Direction of a pixel by fixed-point iteration.
    pub fn direction(&self, pixel: [f64; 2]) -> [f64; 2] {
        let target = [
            (pixel[0] - self.centre[0]) / self.focal[0],
            (pixel[1] - self.centre[1]) / self.focal[1],
        ];
        let mut at = target;
        for _ in 0..200 {
            let bent = self.bend(at[0], at[1]);
            let miss = [target[0] - bent[0], target[1] - bent[1]];
            at = [at[0] + miss[0], at[1] + miss[1]];
            if miss[0].abs() + miss[1].abs() < 1e-10 {
                break;
            }
        }
        at
    }

    pub fn document(&self) -> CameraDocument {
        let [k1, k2, k3, p1, p2] = self.lens;
        CameraDocument {
            format: FORMAT.to_owned(),
            camera: "cam-0".to_owned(),
            width_px: self.size[0],
            height_px: self.size[1],
            focal_px: self.focal,
            centre_px: self.centre,
            distortion: Distortion { k1, k2, k3, p1, p2 },
            position_m: self.position,
            rotation: self.rotation,
            rms_px: 0.0,
        }
    }

    pub fn camera(&self) -> Camera {
        self.document().check().expect("the test's camera is possible")
    }

    /// World plane z = `height_m` as this camera sees it.
    pub fn floor(&self, height_m: f64) -> Plane {
        let from = [-self.position[0], -self.position[1], height_m - self.position[2]];
        Plane {
            rotation: self.rotation,
            shift: self
                .rotation
                .map(|row| row[0] * from[0] + row[1] * from[1] + row[2] * from[2]),
        }
    }
}

/// Camera from plane: x, y in the plane.
#[derive(Clone, Copy, PartialEq)]
pub struct Plane {
    pub rotation: [[f64; 3]; 3],
    pub shift: [f64; 3],
}

impl Plane {
    pub fn camera_from_plane(&self, at: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| {
            let row = self.rotation[i];
            row[0] * at[0] + row[1] * at[1] + row[2] * at[2] + self.shift[i]
        })
    }

    /// Place in the plane where a direction meets it.
    pub fn meet(&self, direction: [f64; 2]) -> [f64; 2] {
        let d = [direction[0], direction[1], 1.0];
        // Direction and camera in the plane's frame: R^T d, -R^T t.
        let back = |v: [f64; 3], axis: usize| (0..3).map(|row| self.rotation[row][axis] * v[row]).sum::<f64>();
        let length = back(self.shift, 2) / back(d, 2);
        [
            length * back(d, 0) - back(self.shift, 0),
            length * back(d, 1) - back(self.shift, 1),
        ]
    }
}

/// Light, body and camera of a picture.
#[derive(Clone)]
pub struct Style {
    pub floor: f32,
    pub black: f32,
    pub white: f32,
    pub body: f32,
    /// Radius of the robot under the tag.
    pub body_m: f64,
    pub blur_px: f32,
    pub noise: f32,
    /// 0 even, 1 the darkest corner at half the light.
    pub uneven: f32,
    pub exposure_s: f64,
}

impl Default for Style {
    fn default() -> Style {
        Style {
            floor: 140.0,
            black: 25.0,
            white: 215.0,
            body: 70.0,
            body_m: 0.16,
            blur_px: 0.7,
            noise: 3.0,
            uneven: 0.6,
            exposure_s: 0.004,
        }
    }
}

/// A tag, or a square that only looks like one, and how it moves.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub bits: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    pub edge_m: f64,
    pub velocity: [f64; 2],
    pub yaw_rate: f64,
}

impl Place {
    pub fn tag(id: u16, x_m: f64, y_m: f64, yaw_rad: f64) -> Place {
        Place {
            bits: localise::code(id).expect("a tag of the family"),
            x_m,
            y_m,
            yaw_rad,
            edge_m: 0.16,
            velocity: [0.0; 2],
            yaw_rate: 0.0,
        }
    }

    /// The tag as it lies at a moment of the exposure.
    pub fn shader(&self, time_s: f64, style: &Style) -> Shader {
        let (sine, cosine) = (self.yaw_rad + self.yaw_rate * time_s).sin_cos();
        let [x, y] = [
            self.x_m + self.velocity[0] * time_s,
            self.y_m + self.velocity[1] * time_s,
        ];
        let mut values = [[style.white; 10]; 10];
        for row in 0..8 {
            for column in 0..8 {
                let inner = (1..7).contains(&column) && (1..7).contains(&row);
                let white = inner && (self.bits >> (35 - ((row - 1) * 6 + column - 1))) & 1 == 1;
                values[row + 1][column + 1] = if white { style.white } else { style.black };
            }
        }
        Shader {
            centre: [x as f32, y as f32],
            turn: [cosine as f32, sine as f32],
            modules_per_m: (8.0 / self.edge_m) as f32,
            body_m2: (style.body_m * style.body_m) as f32,
            around: [style.body, style.floor],
            values,
        }
    }
}

/// Grey values around one tag at one moment.
pub struct Shader {
    centre: [f32; 2],
    turn: [f32; 2],
    modules_per_m: f32,
    body_m2: f32,
    around: [f32; 2],
    /// Rows from the top, with the white rim.
    values: [[f32; 10]; 10],
}

impl Shader {
    /// Whether a pixel belongs to this tag, with room for the blur: the rest is left to the neighbours.
    pub fn covers(&self, at: [f32; 2]) -> bool {
        let (dx, dy) = (at[0] - self.centre[0], at[1] - self.centre[1]);
        let [cosine, sine] = self.turn;
        let (x, y) = (cosine * dx + sine * dy, cosine * dy - sine * dx);
        x.abs().max(y.abs()) * self.modules_per_m < 6.0 || dx.hypot(dy) < self.body_m2.sqrt() + 0.02
    }

    pub fn shade(&self, at: [f32; 2]) -> f32 {
        let (dx, dy) = (at[0] - self.centre[0], at[1] - self.centre[1]);
        let [cosine, sine] = self.turn;
        let (x, y) = (cosine * dx + sine * dy, cosine * dy - sine * dx);
        // Casts cut towards zero; the rim's outer edge is at 5 modules.
        let column = 5.0 + x * self.modules_per_m;
        let row = 5.0 - y * self.modules_per_m;
        if column >= 0.0 && row >= 0.0 && column < 10.0 && row < 10.0 {
            return self.values[row as usize][column as usize];
        }
        self.around[usize::from(dx * dx + dy * dy >= self.body_m2)]
    }
}

/// Row by row codes of the first tags, from the family's published pictures.
pub const CODES_PUBLISHED: [u64; 4] = [0xd5d628584, 0xd97f18b49, 0xdd280910e, 0xe479e9c98];

/// One of two cameras 2.8 m over a floor of 4 m x 3 m: the picture's long side along y, 0.2 m overlap, a little askew.
pub fn camera_over_half(right: bool) -> Truth {
    let tilt: f64 = if right { -0.03 } else { 0.03 };
    let (s, c) = tilt.sin_cos();
    Truth {
        size: [640, 480],
        focal: [490.0, 489.0],
        centre: [322.3, 238.1],
        lens: [-0.28, 0.07, 0.0, 0.0006, -0.0004],
        position: [if right { 0.95 } else { -0.95 }, 0.02, 2.8],
        // x of the picture is world y, y of the picture world x, turned by the tilt around world y.
        rotation: [[0.0, 1.0, 0.0], [c, 0.0, s], [s, 0.0, -c]],
    }
}

/// `count` tags with ids from `first` at random on the half of the floor, at least 0.42 m apart.
pub fn spread_out(random: &mut Random, right: bool, first: u16, count: u16) -> Vec<Place> {
    let mut out: Vec<Place> = Vec::new();
    while out.len() < usize::from(count) {
        let x = random.between(-1.88, 0.08);
        let x = if right { -x } else { x };
        let y = random.between(-1.38, 1.38);
        if out.iter().any(|other| (other.x_m - x).hypot(other.y_m - y) < 0.42) {
            continue;
        }
        let mut place = Place::tag(first + out.len() as u16, x, y, random.between(-3.0, 3.2));
        let (speed, heading) = (random.between(0.0, 0.8), random.between(0.0, 6.25));
        place.velocity = [speed * heading.cos(), speed * heading.sin()];
        place.yaw_rate = random.between(-2.0, 2.0);
        out.push(place);
    }
    out
}
