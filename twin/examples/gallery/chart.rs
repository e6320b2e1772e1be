//! Small drawings as inline SVG.

use std::fmt::Write as _;

/// Distance of grid lines of a path, m.
const GRID_M: f64 = 0.5;
const MARGIN: f64 = 8.0;

fn polyline(points: impl Iterator<Item = (f64, f64)>, class: &str) -> String {
    let mut text = format!("<polyline class=\"{class}\" points=\"");
    for (x, y) in points {
        let _ = write!(text, "{x:.1},{y:.1} ");
    }
    text + "\"/>"
}

/// Paths over the floor at one scale; x to the right, y up.
pub fn paths(lines: &[(&str, &[(f64, f64)])], width: f64, height: f64) -> String {
    let (mut low, mut high) = ([0.0_f64; 2], [0.0_f64; 2]);
    for (x, y) in lines.iter().flat_map(|(_, line)| line.iter()) {
        low = [low[0].min(*x), low[1].min(*y)];
        high = [high[0].max(*x), high[1].max(*y)];
    }
    let span = [(high[0] - low[0]).max(0.6), (high[1] - low[1]).max(0.6)];
    let scale = ((width - 2.0 * MARGIN) / span[0]).min((height - 2.0 * MARGIN) / span[1]);
    let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let place = |x: f64, y: f64| {
        (
            0.5 * width + scale * (x - middle[0]),
            0.5 * height - scale * (y - middle[1]),
        )
    };
    let mut svg = format!("<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\">");
    let reach = [0.5 * width / scale, 0.5 * height / scale];
    let mut k = ((middle[0] - reach[0]) / GRID_M).ceil();
    while k * GRID_M <= middle[0] + reach[0] {
        let (x, _) = place(k * GRID_M, 0.0);
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"0\" y2=\"{height}\"/>"
        );
        k += 1.0;
    }
    let mut k = ((middle[1] - reach[1]) / GRID_M).ceil();
    while k * GRID_M <= middle[1] + reach[1] {
        let (_, y) = place(0.0, k * GRID_M);
        let _ = write!(
            svg,
            "<line class=\"grid\" y1=\"{y:.1}\" y2=\"{y:.1}\" x1=\"0\" x2=\"{width}\"/>"
        );
        k += 1.0;
    }
    for (class, line) in lines {
        svg += &polyline(line.iter().map(|(x, y)| place(*x, *y)), class);
    }
    let (x, y) = place(0.0, 0.0);
    let _ = write!(
        svg,
        "<circle class=\"start\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/></svg>"
    );
    svg
}

/// Two curves over time with the range of their values.
pub fn curves(lines: &[(&str, Vec<(f64, f64)>)], unit: &str, width: f64, height: f64) -> String {
    let values = || lines.iter().flat_map(|(_, line)| line.iter());
    let low = values().fold(f64::INFINITY, |low, point| low.min(point.1));
    let high = values().fold(f64::NEG_INFINITY, |high, point| high.max(point.1));
    let (low, high) = if high - low < 1e-9 {
        (low - 1.0, high + 1.0)
    } else {
        (low, high)
    };
    let start = values().fold(f64::INFINITY, |start, point| start.min(point.0));
    let end = values().fold(f64::NEG_INFINITY, |end, point| end.max(point.0));
    let (left, top, right, bottom) = (46.0, 8.0, width - 6.0, height - 18.0);
    let place = |t: f64, value: f64| {
        (
            left + (right - left) * (t - start) / (end - start),
            bottom - (bottom - top) * (value - low) / (high - low),
        )
    };
    let mut svg = format!("<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\">");
    for value in [low, high] {
        let (_, y) = place(start, value);
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{left}\" x2=\"{right}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 4.0,
            y + 4.0,
            number(value)
        );
    }
    for (t, anchor) in [(start, "start"), (end, "end")] {
        let (x, _) = place(t, low);
        let _ = write!(
            svg,
            "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{t:.1} s</text>",
            height - 4.0
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{unit}</text>",
        0.5 * (left + right),
        height - 4.0
    );
    for (class, line) in lines {
        svg += &polyline(line.iter().map(|(t, value)| place(*t, *value)), class);
    }
    svg + "</svg>"
}

fn number(value: f64) -> String {
    let size = value.abs();
    if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 1.0 {
        format!("{value:.1}")
    } else if size >= 0.01 || size == 0.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.4}")
    }
}
