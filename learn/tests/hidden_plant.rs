//! A plant with a drag that the effect library does not have: on runs that stay locked the learned residual beats physics
//! alone and the network without physics.

#[path = "support/plants.rs"]
mod plants;
#[path = "support/threads.rs"]
mod threads;

use learn::inputs::Sight;
use learn::session::{Request, learn};
use threads::Threads;

#[test]
fn physics_with_the_residual_beats_both_on_locked_runs() {
    let driven = plants::driven("diff2", "air_drag", 30, 3, 7);
    let mut request = Request::new(&driven.runs);
    request.references = &driven.references;
    request.sights = vec![Sight::Motion];
    let outcome = learn(&Threads, &request).unwrap_or_else(|problem| panic!("{problem}"));
    let report = &outcome.report;
    assert!(report.useful, "{}", report.table());
    for horizon_s in [0.5, 2.0] {
        let figure = report.figure("position", horizon_s).unwrap();
        let with = figure.residual.unwrap();
        assert!(with < 0.9 * figure.physics, "{}", report.table());
        assert!(with < 0.9 * figure.black_box.unwrap(), "{}", report.table());
        assert!(figure.samples > 20);
    }
}
