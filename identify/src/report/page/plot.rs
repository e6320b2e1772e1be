//! Plots as inline SVG.

use super::{escaped, short};
use crate::report::schema::{FloorMap, Gap};

const WIDTH: f64 = 320.0;
const HEIGHT: f64 = 150.0;
const LEFT: f64 = 8.0;
const BOTTOM: f64 = 22.0;
const TOP: f64 = 22.0;
/// Size of letters, and the width of one over it.
const LETTER: f64 = 11.0;
const WIDTH_OF_LETTER: f64 = 0.55;

fn open(title: &str, height: f64) -> String {
    format!(
        "<figure style=\"margin:0\"><svg viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"{0}\"><text x=\"{LEFT}\" y=\"13\">{0}</text>",
        escaped(title)
    )
}

/// Bars with their values, and a line at a level.
pub(super) fn bars(title: &str, values: &[(String, f64)], level: Option<f64>) -> String {
    let mut svg = open(title, HEIGHT);
    let most = values
        .iter()
        .map(|value| value.1)
        .fold(level.unwrap_or(0.0), f64::max)
        .max(1e-9);
    let step = (WIDTH - 2.0 * LEFT) / values.len().max(1) as f64;
    let span = HEIGHT - TOP - BOTTOM;
    // No label runs into its neighbour's.
    let longest = values
        .iter()
        .map(|value| value.0.chars().count())
        .max()
        .unwrap_or(0)
        .max(1) as f64;
    let letter = LETTER.min(step / (WIDTH_OF_LETTER * (longest + 0.5)));
    for (k, (label, value)) in values.iter().enumerate() {
        let height = span * (value / most).max(0.0);
        let x = LEFT + k as f64 * step;
        svg.push_str(&format!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{height:.1}\" fill=\"var(--blue)\"><title>{}: {}</title></rect>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" style=\"font-size:{letter:.1}px\">{}</text>",
            x + 0.1 * step,
            TOP + span - height,
            0.8 * step,
            escaped(label),
            short(*value),
            x + 0.5 * step,
            HEIGHT - 8.0,
            escaped(label)
        ));
    }
    if let Some(level) = level {
        let y = TOP + span * (1.0 - level / most);
        svg.push_str(&format!(
            "<line x1=\"{LEFT}\" x2=\"{:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"var(--red)\" stroke-dasharray=\"4 3\"/>",
            WIDTH - LEFT
        ));
    }
    svg.push_str("</svg></figure>");
    svg
}

/// The floor from above, cells darker where the gap is larger.
pub(super) fn floor_map(map: &FloorMap) -> String {
    let range = |values: &[f64]| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min) - 0.5 * map.cell_m;
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 0.5 * map.cell_m;
        (low, high)
    };
    let ((x0, x1), (y0, y1)) = (range(&map.x_m), range(&map.y_m));
    let scale = ((WIDTH - 2.0 * LEFT) / (x1 - x0)).min(240.0 / (y1 - y0));
    let height = TOP + scale * (y1 - y0) + BOTTOM;
    let mut svg = open("gap on the floor, x right, y up; dark = large", height);
    let most = map.energy.iter().copied().fold(1.0, f64::max);
    for ((x, y), energy) in map.x_m.iter().zip(&map.y_m).zip(&map.energy) {
        let shade = ((energy - 1.0).max(0.0) / (most - 1.0).max(1e-9)).clamp(0.05, 1.0);
        svg.push_str(&format!(
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"var(--red)\" fill-opacity=\"{shade:.2}\"><title>({x:.1}, {y:.1}): {} of the floor</title></rect>",
            LEFT + scale * (x - 0.5 * map.cell_m - x0),
            TOP + scale * (y1 - y - 0.5 * map.cell_m),
            0.96 * scale * map.cell_m,
            0.96 * scale * map.cell_m,
            short(*energy)
        ));
    }
    svg.push_str(&format!(
        "<text x=\"{LEFT}\" y=\"{0:.1}\">{x0:.1} m</text><text x=\"{1:.1}\" y=\"{0:.1}\" text-anchor=\"end\">{x1:.1} m</text></svg></figure>",
        height - 8.0,
        LEFT + scale * (x1 - x0)
    ));
    svg
}

/// Before, after and floor of a channel over the horizon.
pub(super) fn gap_chart(channel: &str, gaps: &[Gap]) -> String {
    let own: Vec<&Gap> = gaps.iter().filter(|gap| gap.channel == channel).collect();
    let unit = own.first().map_or("", |gap| gap.unit.as_str());
    let mut svg = open(
        &format!("{channel}, {unit}: before (red), after (green), floor (dashed)"),
        HEIGHT,
    );
    let most = own
        .iter()
        .flat_map(|gap| [gap.before, gap.after, gap.floor, gap.high])
        .fold(1e-12, f64::max);
    let span = HEIGHT - TOP - BOTTOM;
    // The scale's own number stands left of the lines.
    let step = (WIDTH - 11.0 * LEFT) / own.len().saturating_sub(1).max(1) as f64;
    let x = |k: usize| 7.0 * LEFT + k as f64 * step;
    let y = |value: f64| TOP + span * (1.0 - value / most);
    let line = |value: &dyn Fn(&Gap) -> f64, style: &str| {
        let points: Vec<String> = own
            .iter()
            .enumerate()
            .map(|(k, gap)| format!("{:.1},{:.1}", x(k), y(value(gap))))
            .collect();
        format!("<polyline points=\"{}\" fill=\"none\" {style}/>", points.join(" "))
    };
    svg.push_str(&line(
        &|gap| gap.floor,
        "stroke=\"var(--soft)\" stroke-dasharray=\"4 3\"",
    ));
    svg.push_str(&line(&|gap| gap.before, "stroke=\"var(--red)\" stroke-width=\"2\""));
    svg.push_str(&line(&|gap| gap.after, "stroke=\"var(--green)\" stroke-width=\"2\""));
    for (k, gap) in own.iter().enumerate() {
        svg.push_str(&format!(
            "<line x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{1:.1}\" y2=\"{2:.1}\" stroke=\"var(--green)\"/>\
             <circle cx=\"{0:.1}\" cy=\"{3:.1}\" r=\"3\" fill=\"var(--red)\"><title>before {4}</title></circle>\
             <circle cx=\"{0:.1}\" cy=\"{5:.1}\" r=\"3\" fill=\"var(--green)\"><title>after {6}</title></circle>\
             <text x=\"{0:.1}\" y=\"{7:.1}\" text-anchor=\"middle\">{8} s</text>",
            x(k),
            y(gap.low),
            y(gap.high),
            y(gap.before),
            short(gap.before),
            y(gap.after),
            short(gap.after),
            HEIGHT - 8.0,
            gap.horizon_s
        ));
    }
    svg.push_str(&format!(
        "<text x=\"2\" y=\"{:.1}\">{}</text></svg></figure>",
        TOP + 4.0,
        short(most)
    ));
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_bars_are_as_small_as_the_longest_needs() {
        let drawn = |label: &str| {
            let values: Vec<(String, f64)> = (0..8).map(|_| (label.to_owned(), 1.0)).collect();
            bars("share", &values, None)
        };
        assert!(drawn("-0.5").contains("font-size:11.0px"));
        let letters = "steering".len() as f64;
        let size = drawn("steering");
        let size = size.split("font-size:").nth(1).and_then(|rest| rest.split("px").next());
        let size: f64 = size.and_then(|size| size.parse().ok()).expect("a size");
        assert!(
            size > 6.0 && size * WIDTH_OF_LETTER * letters < (WIDTH - 2.0 * LEFT) / 8.0,
            "{size}"
        );
    }
}
