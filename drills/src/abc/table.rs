//! The table of the experiments, beside the paper's figures.

use super::experiment::{LESS_THAN_A, LESS_THAN_A_PLUS, Outcome};

const PIXELS_PER_M: f64 = 400.0;

/// Prints everything; `true` when B and C hold everywhere.
pub fn print(outcomes: &[Outcome]) -> bool {
    println!(
        "Experiments A, A+, B, C. mm; `path`: RMS (largest) distance to the active piece of the path; band +-75 mm (30 px)."
    );
    println!("Paper: A leaves the band by far (> 91 px = 228 mm, > 120 px = 300 mm); C about 300 % better.");
    let head = [
        "chassis", "floor", "course", "speed", "A twin", "A plant", "A+", "usual", "C", "no bias", "nominal", "A/C",
        "A+/C", "C time", "",
    ];
    println!();
    line(&head.map(str::to_owned));
    let mut holds = true;
    for outcome in outcomes {
        for round in &outcome.rounds {
            let path = |figures: &super::drive::Figures| {
                let mark = if figures.finished { "" } else { "!" };
                format!("{:.1} ({:.0}){mark}", 1e3 * figures.rms_m, 1e3 * figures.largest_m)
            };
            holds &= round.holds();
            line(&[
                outcome.chassis.clone(),
                outcome.floor.to_string(),
                format!("{} {}", round.course, round.round),
                format!("{:.2}", outcome.setting.speed_m_per_s),
                path(&outcome.twin),
                path(&round.a),
                path(&round.a_plus),
                path(&round.usual),
                path(&round.c),
                path(&round.c_without_bias),
                path(&round.c_nominal),
                format!("{:.1}", round.against_a()),
                format!("{:.1}", round.against_a_plus()),
                format!("{:.0}", 1e3 * round.c.time_rms_m.unwrap_or(f64::NAN)),
                verdict(round.holds(), round.c.inside()),
            ]);
        }
    }
    println!();
    println!(
        "B: position 2 s ahead of unseen runs, RMS, mm: nominal twin -> named effects -> with the residual; run to run"
    );
    for outcome in outcomes {
        for gap in &outcome.gaps {
            holds &= gap.holds();
            println!(
                "{:<7} {:<5} {:<6} {:.2} m/s  {:>7.1} -> {:>6.1} -> {:>6.1}   run to run {:>6.1}   {:>5.1} x  {}",
                outcome.chassis,
                outcome.floor,
                gap.course,
                gap.speed_m_per_s,
                1e3 * gap.before_m,
                1e3 * gap.named_m,
                1e3 * gap.after_m,
                1e3 * gap.repeatability_m,
                gap.before_m / gap.after_m,
                if gap.holds() { "holds" } else { "MISSED" }
            );
        }
    }
    let rounds = || outcomes.iter().flat_map(|outcome| &outcome.rounds);
    let gaps = || outcomes.iter().flat_map(|outcome| &outcome.gaps);
    println!();
    println!(
        "C inside the band, >= {LESS_THAN_A} x below A and >= {LESS_THAN_A_PLUS} x below A+: {} of {}; B: {} of {}; A inside the band: {} of {}; largest of A {:.0} px, of C {:.0} px",
        rounds().filter(|round| round.holds()).count(),
        rounds().count(),
        gaps().filter(|gap| gap.holds()).count(),
        gaps().count(),
        rounds().filter(|round| round.a.inside()).count(),
        rounds().count(),
        PIXELS_PER_M * rounds().map(|round| round.a.largest_m).fold(0.0, f64::max),
        PIXELS_PER_M * rounds().map(|round| round.c.largest_m).fold(0.0, f64::max),
    );
    holds
}

fn verdict(holds: bool, inside: bool) -> String {
    match (holds, inside) {
        (true, _) => "holds",
        (false, true) => "MISSED",
        (false, false) => "LEFT THE BAND",
    }
    .to_owned()
}

fn line(cells: &[String; 15]) {
    let widths = [7, 5, 7, 5, 9, 11, 11, 11, 11, 11, 11, 5, 5, 6, 6];
    let cells = cells.iter().zip(widths);
    let text: Vec<String> = cells.map(|(cell, width)| format!("{cell:<width$}")).collect();
    println!("{}", text.join(" ").trim_end());
}
