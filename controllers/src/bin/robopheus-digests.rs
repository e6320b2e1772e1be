//! Prints the digests of every gallery scenario, effect, residual and own controller as JSON, for the comparison of builds:
//! `cargo run --bin robopheus-digests`.

fn main() -> Result<(), serde_json::Error> {
    let mut all = control::gallery::digests();
    all.extend(controllers::gallery::digests());
    println!("{}", serde_json::to_string_pretty(&all)?);
    Ok(())
}
