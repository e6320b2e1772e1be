//! One page that shows what each chassis and each effect does: `cargo xtask gallery`.
//!
//! `cargo run --release -p twin --example gallery -- PAGE.html`
#![allow(clippy::disallowed_methods, reason = "a program that draws; the library does no IO")]

mod chart;
mod effects;
mod manoeuvre;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use twin::pairing::RobotDocument;
use twin::robot::RobotDescription;

const CHASSIS: [(&str, &str); 7] = [
    ("omni4", "four omni wheels, drives in every direction"),
    (
        "omni4-two-wheel",
        "two of its wheels unpowered: drives along a diagonal, slides out of arcs",
    ),
    ("diff2", "two driven wheels and casters, turns in place"),
    ("diff4", "four fixed wheels, skids round"),
    ("fwd", "front wheels driven and steered"),
    ("rwd", "rear wheels driven, front steered"),
    ("awd", "all wheels driven, front steered"),
];

const STYLE: &str = include_str!("style.css");

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let page = PathBuf::from(std::env::args().nth(1).ok_or("name the page to write")?);
    let mut html = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>Robopheus: what the twin does</title><style>{STYLE}</style></head><body><main>\
         <h1>What the twin does</h1><p class=\"lead\">Every picture is computed by the digital twin ({}). Above, the six chassis and the two-wheel mode of one drive the \
         same manoeuvres; below, every effect of the library at its large size against the nominal robot.</p>",
        twin::VERSION
    );
    chassis_section(&mut html)?;
    effects::section(&mut html)?;
    html.push_str("</main></body></html>\n");
    if let Some(folder) = page.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(&page, html)?;
    println!("{}", page.display());
    Ok(())
}

/// Reference description of a chassis.
pub fn reference(chassis: &str) -> Result<RobotDescription, Box<dyn std::error::Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../examples/robots/{chassis}-tx2.json"));
    let document: RobotDocument = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    Ok(document.robot)
}

fn chassis_section(html: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    html.push_str("<h2>Six chassis and a two-wheel mode, the same manoeuvres</h2><p>Path over the floor, one square is 0.5 m; the dot is the start. Ten seconds each.</p>");
    html.push_str("<table class=\"chassis\"><thead><tr><th></th>");
    for name in manoeuvre::SHOWN {
        let _ = write!(html, "<th>{}</th>", manoeuvre::title(name));
    }
    html.push_str("</tr></thead><tbody>");
    for (chassis, words) in CHASSIS {
        let robot = reference(chassis)?;
        let _ = write!(html, "<tr><th><b>{chassis}</b><small>{words}</small></th>");
        for name in manoeuvre::SHOWN {
            let rows = manoeuvre::run(&robot, &[], name)?;
            let path = manoeuvre::path(&rows);
            let _ = write!(html, "<td>{}</td>", chart::paths(&[("nominal", &path)], 170.0, 130.0));
        }
        html.push_str("</tr>");
    }
    html.push_str("</tbody></table>");
    Ok(())
}
