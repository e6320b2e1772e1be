//! Example experiments to start from.

use api::experiment::Experiment;

/// Example experiments to start from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Template {
    RectangleOmni4,
    RectangleDiff2,
    PaperPath,
    SwapCorners,
    OwnController,
}

impl Template {
    pub const ALL: [Self; 5] = [
        Self::RectangleOmni4,
        Self::RectangleDiff2,
        Self::PaperPath,
        Self::SwapCorners,
        Self::OwnController,
    ];

    /// As in the file name under `examples/experiments/`; the last stands under `examples/controllers/`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::RectangleOmni4 => "rectangle-omni4",
            Self::RectangleDiff2 => "rectangle-diff2",
            Self::PaperPath => "paper-path",
            Self::SwapCorners => "swap-corners",
            Self::OwnController => "own-controller",
        }
    }

    pub const fn title(self) -> &'static str {
        match self {
            Self::RectangleOmni4 => "Rectangle path, omnidirectional robot",
            Self::RectangleDiff2 => "Rectangle path, two-wheel robot",
            Self::PaperPath => "Paper's path: feedback against model",
            Self::SwapCorners => "Four robots swap corners",
            Self::OwnController => "Own controller: write it here",
        }
    }

    pub const fn explanation(self) -> &'static str {
        match self {
            Self::RectangleOmni4 => "The paper's path, out and back, on four omni wheels",
            Self::RectangleDiff2 => "The same path on a differential drive",
            Self::PaperPath => {
                "The paper's experiment: first feedback alone, then the same drive corrected by a model of the robot"
            }
            Self::SwapCorners => "Everyone drives to the opposite corner without touching",
            Self::OwnController => "Four robots under a script of your own; the twin drives it as you type",
        }
    }

    const fn text(self) -> &'static str {
        match self {
            Self::RectangleOmni4 => include_str!("../../../examples/experiments/rectangle-omni4.json"),
            Self::RectangleDiff2 => include_str!("../../../examples/experiments/rectangle-diff2.json"),
            Self::PaperPath => include_str!("../../../examples/experiments/paper-path.json"),
            Self::SwapCorners => include_str!("../../../examples/experiments/swap-corners.json"),
            Self::OwnController => include_str!("../../../examples/controllers/avoid-each-other.json"),
        }
    }

    /// The embedded document.
    pub fn experiment(self) -> Experiment {
        serde_json::from_str(self.text()).expect("embedded example is valid; a test reads all of them")
    }
}
