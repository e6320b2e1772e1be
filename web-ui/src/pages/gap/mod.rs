//! The Gap page: what is shown (`data`, `phrase`), how (`ui`: the frame and the runs; `result`: a diagnosis; `plots`: its figures).

pub mod data;
pub mod phrase;
pub mod plots;
pub mod result;
pub mod ui;
