//! `report.html`: one file that needs nothing else. The sentence first, then where, what, how sure, before and after, and
//! what these runs cannot tell.

mod plot;

use super::schema::{Report, Untestable, Verdict};
use plot::{bars, floor_map, gap_chart};

const STYLE: &str = "
:root{--ink:#1b1f24;--soft:#5b6570;--line:#d9dee3;--back:#fff;--card:#f6f8fa;--blue:#2563c9;--red:#c43d2f;--green:#2b8a4b}
@media(prefers-color-scheme:dark){:root{--ink:#e8eaed;--soft:#9aa4af;--line:#353c44;--back:#15181c;--card:#1d2227;--blue:#6ea3ff;--red:#ff8373;--green:#63c987}}
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--back);max-width:62rem;margin:2rem auto;padding:0 1rem}
h1{font-size:1.6rem;margin:.2rem 0}h2{font-size:1.15rem;margin:2.2rem 0 .6rem;border-bottom:1px solid var(--line)}
.verdict{display:inline-block;padding:.1rem .7rem;border-radius:1rem;color:#fff;font-weight:600;background:var(--soft)}
.confirmed{background:var(--green)}.unexplained{background:var(--red)}.partial,.ambiguous{background:#b26a00}
.card{background:var(--card);border:1px solid var(--line);border-radius:.5rem;padding:.8rem 1rem;margin:.6rem 0}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(19rem,1fr));gap:1rem}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}td,th{text-align:left;padding:.25rem .6rem;border-bottom:1px solid var(--line)}
td.n,th.n{text-align:right}.soft{color:var(--soft)}svg{width:100%;height:auto}svg text{fill:var(--soft);font-size:11px}
details summary{cursor:pointer;color:var(--blue)}";

/// Text that may stand in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

fn words(name: &str) -> String {
    escaped(&name.replace('_', " "))
}

/// A number with three digits that count.
fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else if size >= 1.0 {
        format!("{value:.2}")
    } else if size >= 0.1 {
        format!("{value:.3}")
    } else if size >= 0.001 {
        format!("{value:.4}")
    } else {
        format!("{value:.1e}")
    }
}

/// A number at an axis.
fn tick(value: f64) -> String {
    if value.abs() >= 10.0 {
        format!("{value:.0}")
    } else if value.abs() >= 1.0 {
        format!("{value:.1}")
    } else {
        format!("{value:.2}")
    }
}

fn verdict_word(verdict: Verdict) -> (&'static str, &'static str) {
    match verdict {
        Verdict::Confirmed => ("confirmed", "confirmed"),
        Verdict::Partial => ("partial", "partly explained"),
        Verdict::Ambiguous => ("ambiguous", "ambiguous"),
        Verdict::Unexplained => ("unexplained", "unexplained"),
        Verdict::NoDiscrepancy => ("no_discrepancy", "no discrepancy"),
    }
}

/// The page.
pub fn page(report: &Report) -> String {
    let (class, word) = verdict_word(report.verdict);
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{robot}: {word}</title><style>{STYLE}</style></head><body>\
         <p class=\"soft\">Diagnosis of {robot}</p><h1>{sentence}</h1><p><span class=\"verdict {class}\">{word}</span></p>",
        robot = escaped(&report.robot),
        sentence = escaped(&report.sentence),
    );
    html.push_str(&place(report));
    html.push_str(&effects(report));
    html.push_str(&gaps(report));
    html.push_str(&next(report));
    html.push_str(&lists(report));
    html.push_str(&data(report));
    html.push_str("</body></html>\n");
    html
}

fn place(report: &Report) -> String {
    let place = &report.place;
    let mut html = format!("<h2>Where</h2><p>{}</p><div class=\"grid\">", escaped(&place.sentence));
    let shares: Vec<(String, f64)> = place
        .channels
        .iter()
        .zip(&place.shares)
        .map(|(channel, share)| (channel.clone(), 100.0 * share))
        .collect();
    html.push_str(&bars("share of the gap by channel, %", &shares, None));
    if !place.floor_map.x_m.is_empty() {
        html.push_str(&floor_map(&place.floor_map));
    }
    for region in &place.regions {
        let bins: Vec<(String, f64)> = region
            .edges
            .windows(2)
            .zip(&region.energy)
            .map(|(edge, energy)| (tick(0.5 * (edge[0] + edge[1])), *energy))
            .collect();
        let title = format!(
            "{} over {}, {}; 1 = floor",
            region.channel, region.variable, region.unit
        );
        html.push_str(&bars(&title, &bins, Some(1.0)));
    }
    html.push_str("</div>");
    if !place.segments.is_empty() {
        let list: Vec<String> = place
            .segments
            .iter()
            .take(40)
            .map(|s| format!("{} {:.1} to {:.1} s", escaped(&s.run), s.from_s, s.to_s))
            .collect();
        html.push_str(&format!(
            "<details><summary>{} stretches of time above three times the floor</summary><p class=\"soft\">{}</p></details>",
            place.segments.len(),
            list.join("; ")
        ));
    }
    html
}

fn effects(report: &Report) -> String {
    if report.effects.is_empty() {
        return String::new();
    }
    let mut html = "<h2>What</h2>".to_owned();
    for (rank, effect) in report.effects.iter().enumerate() {
        html.push_str(&format!(
            "<div class=\"card\"><b>{}. {}</b> <span class=\"soft\">({})</span><p>{}</p><p class=\"soft\">Gain {} on the runs, \
             {} of it on runs that it was not fitted to; chance gives {}. Best in {:.0} % of half-splits.</p>",
            rank + 1,
            words(&effect.name),
            escaped(&effect.status),
            escaped(&effect.sentence),
            short(effect.evidence.gain),
            short(effect.evidence.gain_validation),
            short(effect.evidence.threshold),
            100.0 * effect.evidence.stability
        ));
        if !effect.excluded.is_empty() {
            html.push_str("<details><summary>what was excluded</summary><table>");
            for other in &effect.excluded {
                html.push_str(&format!(
                    "<tr><td>{}</td><td>{}</td></tr>",
                    words(&other.name),
                    escaped(&other.because)
                ));
            }
            html.push_str("</table></details>");
        }
        html.push_str("</div>");
    }
    html
}

fn gaps(report: &Report) -> String {
    if report.gap.is_empty() {
        return "<h2>Before and after</h2><p>No runs were held back: there is no proof on unused data. Give more runs or --locked.</p>"
            .to_owned();
    }
    let mut html = "<h2>Before and after, on runs that were not used</h2>".to_owned();
    html.push_str("<div class=\"grid\">");
    let mut channels: Vec<&str> = report.gap.iter().map(|gap| gap.channel.as_str()).collect();
    channels.dedup();
    for channel in channels {
        html.push_str(&gap_chart(channel, &report.gap));
    }
    html.push_str("</div><details><summary>numbers</summary><table><tr><th>channel</th><th class=\"n\">horizon, s</th><th class=\"n\">floor</th><th class=\"n\">before</th><th class=\"n\">after</th><th class=\"n\">95 %</th><th>unit</th><th class=\"n\">explained</th></tr>");
    for gap in &report.gap {
        html.push_str(&format!(
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{} to {}</td><td>{}</td><td class=\"n\">{}</td></tr>",
            escaped(&gap.channel),
            gap.horizon_s,
            short(gap.floor),
            short(gap.before),
            short(gap.after),
            short(gap.low),
            short(gap.high),
            escaped(&gap.unit),
            gap.explained_fraction
                .filter(|_| gap.before > 1.5 * gap.floor)
                .map_or_else(|| "at the floor".to_owned(), |share| format!("{:.0} %", 100.0 * share)),
        ));
    }
    html.push_str("</table></details>");
    html
}

fn next(report: &Report) -> String {
    report.next_experiment.as_ref().map_or_else(String::new, |next| {
        format!(
            "<h2>Next experiment</h2><div class=\"card\"><b>{}</b>, {} s: {}<p class=\"soft\">{}</p></div>",
            words(next.experiment["manoeuvre"].as_str().unwrap_or("")),
            next.experiment["duration_s"],
            escaped(next.experiment["what"].as_str().unwrap_or("")),
            escaped(&next.why)
        )
    })
}

fn lists(report: &Report) -> String {
    let mut html =
        "<h2>What these runs cannot tell</h2><table><tr><th>effect</th><th>why</th><th>shown by</th></tr>".to_owned();
    let manoeuvre = |open: &Untestable| open.run_this["manoeuvre"].as_str().map(words);
    for open in &report.untestable {
        let Some(manoeuvre) = manoeuvre(open) else { continue };
        html.push_str(&format!(
            "<tr><td>{}</td><td>{}</td><td class=\"soft\">{manoeuvre}</td></tr>",
            words(&open.name),
            escaped(&open.because),
        ));
    }
    html.push_str("</table>");
    let others = report.untestable.iter().filter(|open| manoeuvre(open).is_none());
    let others: Vec<String> = others.map(|open| words(&open.name)).collect();
    if !others.is_empty() {
        let line = format!(
            "<p class=\"soft\">The robot has no part that these act on: {}.</p>",
            others.join(", ")
        );
        html.push_str(&line);
    }
    html.push_str("<details><summary>tested and rejected</summary><table>");
    for other in &report.rejected {
        html.push_str(&format!(
            "<tr><td>{}</td><td>{}</td></tr>",
            words(&other.name),
            escaped(&other.because)
        ));
    }
    html.push_str("</table></details><details><summary>absorbed as calibration</summary><table>");
    for other in &report.absorbed {
        let values: Vec<String> = other
            .parameters
            .iter()
            .filter_map(|p| Some(format!("{} {} {}", words(&p.name), short(p.value?), escaped(&p.unit))))
            .collect();
        html.push_str(&format!(
            "<tr><td>{}</td><td>{}</td></tr>",
            words(&other.name),
            values.join(", ")
        ));
    }
    html.push_str("</table></details>");
    html
}

fn data(report: &Report) -> String {
    let mut html =
        "<h2>Data</h2><table><tr><th>run</th><th>role</th><th class=\"n\">windows</th><th>SHA-256</th></tr>".to_owned();
    for run in &report.data {
        html.push_str(&format!(
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"soft\">{}</td></tr>",
            escaped(&run.path),
            escaped(&run.role),
            run.blocks,
            escaped(run.sha256.get(..12).unwrap_or(&run.sha256))
        ));
    }
    html.push_str("</table>");
    if !report.remarks.is_empty() {
        let remarks: Vec<String> = report
            .remarks
            .iter()
            .map(|remark| format!("<li>{}</li>", escaped(remark)))
            .collect();
        html.push_str(&format!("<ul class=\"soft\">{}</ul>", remarks.join("")));
    }
    html.push_str(&format!(
        "<p class=\"soft\">Floor from {}; model {}; seed {}; library {}.</p>",
        escaped(&report.floor_source),
        escaped(report.model.id.get(..12).unwrap_or("")),
        report.seed,
        escaped(&report.library_version)
    ));
    html
}
