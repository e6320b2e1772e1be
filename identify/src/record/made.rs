//! Records of tests, made by hand.

use super::{Cell, Chain, PoseCell, Quantity, Record, Window};

/// A cell at a time, with an activity; it measured 0.
pub fn cell(quantity: Quantity, time_s: f64, activity: f64) -> Cell {
    Cell {
        quantity,
        time_s,
        measured: 0.0,
        activity,
        samples: (0, 0),
    }
}

/// A pose at the origin.
pub fn pose(time_s: f64) -> PoseCell {
    PoseCell {
        time_s,
        x_m: 0.0,
        y_m: 0.0,
        yaw_rad: 0.0,
        samples: (0, 0),
    }
}

/// A window of 2 s after a run-in of 0.5 s; without cells and poses while rolling it has no such chain.
pub fn window(drive: Vec<Cell>, rolling: Vec<Cell>, poses: Vec<PoseCell>) -> Window {
    let rolling = Chain {
        cells: rolling,
        poses,
        ..Chain::default()
    };
    Window {
        start_s: 0.0,
        from_s: 0.5,
        to_s: 2.5,
        elapsed_s: 0.0,
        start: twin::free::Start::default(),
        drive: Chain {
            cells: drive,
            ..Chain::default()
        },
        rolling: (!rolling.is_empty()).then_some(rolling),
        wheel_angle_rad: Vec::new(),
        load: Vec::new(),
        trust: 1.0,
    }
}

/// A run of these windows.
pub fn record(windows: Vec<Window>) -> Record {
    Record {
        name: "run".to_owned(),
        windows,
        input: None,
        supply_ratio: 1.0,
        largest_command_rad_per_s: 0.0,
        outliers: 0,
        skipped: 0,
    }
}

/// A run of one window with cells of one quantity, 0.05 s apart.
pub fn series(quantity: Quantity, cells: usize) -> Record {
    let cells = (0..cells).map(|k| cell(quantity, 0.05 * k as f64, 0.0)).collect();
    record(vec![window(cells, Vec::new(), Vec::new())])
}
