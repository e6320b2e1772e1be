//! The two sets of colours, chosen for contrast of at least 4.5:1 between ink and ground.

use egui::Color32;

/// Colours of robots; they repeat after so many.
pub const ROBOT_INKS: usize = 6;

/// Colours by meaning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Palette {
    pub dark: bool,
    pub ground: Color32,
    pub raised: Color32,
    pub sunken: Color32,
    pub stripe: Color32,
    pub line: Color32,
    pub ink: Color32,
    pub faint_ink: Color32,
    pub control: Color32,
    pub control_hover: Color32,
    pub accent: Color32,
    pub accent_soft: Color32,
    pub on_accent: Color32,
    pub good: Color32,
    pub warning: Color32,
    pub error: Color32,
    pub floor: Color32,
    pub grid: Color32,
    pub grid_strong: Color32,
    pub wall: Color32,
    /// The twin, wherever it stands beside a measurement.
    pub twin: Color32,
    /// Measurements, wherever they stand beside the twin.
    pub physical: Color32,
    /// The +-75 mm band around a path.
    pub band: Color32,
    robots: [Color32; ROBOT_INKS],
}

/// What a coloured word or mark means.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Tone {
    #[default]
    Neutral,
    Active,
    Good,
    Warning,
    Error,
}

impl Palette {
    /// Colour of a robot by its place in the experiment; repeats after six.
    pub const fn robot(&self, index: usize) -> Color32 {
        self.robots[index % self.robots.len()]
    }

    /// Colour of what a controller draws, by its number: those of the robots, then the twin's, then grey.
    pub const fn note(&self, colour: u8) -> Color32 {
        match colour as usize {
            at if at < self.robots.len() => self.robots[at],
            6 => self.twin,
            _ => self.faint_ink,
        }
    }

    pub const fn tone(&self, tone: Tone) -> Color32 {
        match tone {
            Tone::Neutral => self.faint_ink,
            Tone::Active => self.accent,
            Tone::Good => self.good,
            Tone::Warning => self.warning,
            Tone::Error => self.error,
        }
    }
}

const fn rgb(hex: u32) -> Color32 {
    Color32::from_rgb((hex >> 16) as u8, (hex >> 8) as u8, hex as u8)
}

pub const fn palette(dark: bool) -> Palette {
    if dark { DARK } else { LIGHT }
}

const LIGHT: Palette = Palette {
    dark: false,
    ground: rgb(0xf5_f6_f8),
    raised: rgb(0xff_ff_ff),
    sunken: rgb(0xff_ff_ff),
    stripe: rgb(0xec_ef_f3),
    line: rgb(0xd3_d9_e1),
    ink: rgb(0x1d_25_30),
    faint_ink: rgb(0x5b_66_75),
    control: rgb(0xff_ff_ff),
    control_hover: rgb(0xe9_f0_fb),
    accent: rgb(0x1f_5f_d0),
    accent_soft: rgb(0xd6_e4_fb),
    on_accent: rgb(0xff_ff_ff),
    good: rgb(0x1a_7f_37),
    warning: rgb(0x9a_61_00),
    error: rgb(0xb3_26_1e),
    floor: rgb(0xff_ff_ff),
    grid: rgb(0xec_ef_f3),
    grid_strong: rgb(0xd9_df_e7),
    wall: rgb(0x4a_55_65),
    twin: rgb(0x8a_3f_fc),
    physical: rgb(0x1f_5f_d0),
    band: rgb(0xdd_ef_e1),
    robots: [
        rgb(0x1f_5f_d0),
        rgb(0xc2_41_0c),
        rgb(0x0f_76_6e),
        rgb(0xa2_1c_af),
        rgb(0x85_4d_0e),
        rgb(0x47_55_69),
    ],
};

const DARK: Palette = Palette {
    dark: true,
    ground: rgb(0x14_18_1e),
    raised: rgb(0x1c_22_2b),
    sunken: rgb(0x0f_13_18),
    stripe: rgb(0x1b_21_29),
    line: rgb(0x36_3f_4c),
    ink: rgb(0xe6_ea_f0),
    faint_ink: rgb(0x98_a3_b2),
    control: rgb(0x22_29_33),
    control_hover: rgb(0x2c_36_45),
    accent: rgb(0x6e_a8_ff),
    accent_soft: rgb(0x24_3b_5e),
    on_accent: rgb(0x0b_14_22),
    good: rgb(0x5f_d0_7f),
    warning: rgb(0xf2_b8_4b),
    error: rgb(0xff_8a_80),
    floor: rgb(0x19_1f_27),
    grid: rgb(0x22_29_33),
    grid_strong: rgb(0x2f_38_45),
    wall: rgb(0x98_a3_b2),
    twin: rgb(0xc4_9b_ff),
    physical: rgb(0x6e_a8_ff),
    band: rgb(0x1f_3a_2a),
    robots: [
        rgb(0x6e_a8_ff),
        rgb(0xff_9d_6b),
        rgb(0x4f_d1_c5),
        rgb(0xe8_92_f0),
        rgb(0xe0_b8_5c),
        rgb(0xa8_b3_c2),
    ],
};
