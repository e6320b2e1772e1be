//! Prints the digests of every gallery scenario, effect and residual as JSON, for the comparison of builds:
//! `cargo run -p control --example digests`.

fn main() -> Result<(), serde_json::Error> {
    println!("{}", serde_json::to_string_pretty(&control::gallery::digests())?);
    Ok(())
}
