//! What the specification asks for, row by row.

/// How a metric is read.
#[derive(Clone, Copy)]
pub(super) enum Reading {
    Rate,
    /// Small is good; the one-sided bound counts.
    Limit,
    Median,
    Mean,
}

pub(super) struct Row {
    pub metric: &'static str,
    pub says: &'static str,
    pub must: &'static str,
    pub aim: &'static str,
    pub reading: Reading,
}

const fn row(metric: &'static str, says: &'static str, must: &'static str, aim: &'static str, reading: Reading) -> Row {
    Row {
        metric,
        says,
        must,
        aim,
        reading,
    }
}

use Reading::{Limit, Mean, Median, Rate};

pub(super) const ROWS: &[Row] = &[
    row(
        "right_first",
        "right name first, single detectable effect",
        "85 %",
        "95 %",
        Rate,
    ),
    row(
        "right_first_exact",
        "and by its own name and wheel, not one that changes the runs alike",
        "",
        "",
        Rate,
    ),
    row("in_set", "true name inside the returned set", "95 %", "98 %", Rate),
    row(
        "in_set_loud",
        "the same, of effects that show at twice a sensor's noise and more",
        "",
        "",
        Rate,
    ),
    row("in_set_middle", "of those between once and twice", "", "", Rate),
    row("in_set_faint", "of those below", "", "", Rate),
    row("set_size", "mean set size", "1.5", "", Mean),
    row("named_nothing_there", "any name on no-effect data", "2 %", "1 %", Limit),
    row(
        "wrong_confirmed",
        "sets with a confirmed name that is not true (single, none, pair, unknown)",
        "5 %",
        "2 %",
        Limit,
    ),
    row(
        "wrong_under_confirmed_verdict",
        "the same where the verdict is confirmed too (all kinds)",
        "",
        "",
        Limit,
    ),
    row(
        "confirmed_name_wrong",
        "of the confirmed names (all kinds)",
        "",
        "",
        Limit,
    ),
    row(
        "unknown_left_open",
        "effect outside the library reported unexplained or partial",
        "70 %",
        "90 %",
        Rate,
    ),
    row(
        "unexcited_not_named",
        "unexcited effect untestable or absent",
        "95 %",
        "99 %",
        Rate,
    ),
    row(
        "unexcited_listed_untestable",
        "of these listed as untestable",
        "",
        "",
        Rate,
    ),
    row(
        "wrong_confirmed_poor",
        "poorly excited: wrong confirmed",
        "5 %",
        "2 %",
        Limit,
    ),
    row("parameter_error", "parameter error, median", "10 %", "3 %", Median),
    row("covered", "95 % intervals that cover", "90-98 %", "", Rate),
    row(
        "explained_one",
        "explained fraction on locked runs, one effect, median",
        "0.8",
        "0.95",
        Median,
    ),
    row("explained_two", "the same, two effects", "0.7", "0.9", Median),
    row(
        "locked_worse",
        "locked runs made worse by > 5 % in any channel (sets)",
        "2 %",
        "0",
        Limit,
    ),
    row(
        "locked_worse_above_floor",
        "the same, of rows that are above the references' floor then",
        "",
        "",
        Limit,
    ),
    row(
        "locked_worse_surely",
        "and what it was before is outside the 95 % interval of what it is now",
        "",
        "",
        Limit,
    ),
    row("both_named", "two effects: both named", "60 %", "80 %", Rate),
    row("one_named", "two effects: at least one", "90 %", "98 %", Rate),
    row(
        "patch_centre",
        "patch centre within 0.15 m (of the patches named)",
        "80 %",
        "95 %",
        Rate,
    ),
    row("right_channel", "right channel first", "80 %", "95 %", Rate),
    row(
        "halves_same_verdict",
        "same verdict on two disjoint halves",
        "85 %",
        "95 %",
        Rate,
    ),
    row("halves_same_names", "and the same names", "", "", Rate),
    row(
        "explained_many",
        "no references, 4-6 effects: explained fraction, median",
        "0.7",
        "0.9",
        Median,
    ),
    row(
        "named_of_many",
        "no references, 4-6 effects: effects named",
        "50 %",
        "75 %",
        Rate,
    ),
    row(
        "wrong_confirmed_many",
        "no references, 4-6 effects: sets with a wrong confirmed name",
        "5 %",
        "2 %",
        Limit,
    ),
    row(
        "right_first_shifted",
        "references driven otherwise: right name first",
        "5 points",
        "2 points",
        Rate,
    ),
    row(
        "in_set_shifted",
        "references driven otherwise: inside the set",
        "5 points",
        "2 points",
        Rate,
    ),
    row(
        "wrong_confirmed_shifted",
        "references driven otherwise: wrong confirmed",
        "5 points",
        "2 points",
        Limit,
    ),
    row(
        "wrong_confirmed_closed",
        "closed-loop task data only: wrong confirmed",
        "2 %",
        "1 %",
        Limit,
    ),
    row(
        "right_first_closed",
        "closed-loop task data only: right name first",
        "",
        "",
        Rate,
    ),
    row(
        "gap_rose",
        "three rounds: gap rises from a round to the next",
        "0",
        "0",
        Limit,
    ),
    row(
        "accepted_then_removed",
        "three rounds: effects accepted and later removed",
        "5 %",
        "1 %",
        Limit,
    ),
    row(
        "undetectable_named",
        "single effects that do not show: any name",
        "",
        "",
        Rate,
    ),
    row(
        "detectable_called_untestable",
        "single effects that show and are called untestable",
        "",
        "",
        Rate,
    ),
];
