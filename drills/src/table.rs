//! The table a drill prints: row, count, seed, figure, what is asked.

/// What one drill reached.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Of the reliability table, for example `S5`.
    pub name: &'static str,
    pub what: String,
    pub count: u64,
    pub seed: u64,
    pub figure: String,
    pub asked: String,
    pub holds: bool,
}

/// Makes the rows of one drill, of what they say, figure, what is asked and whether it holds.
pub fn rows_of(name: &'static str, count: u64, seed: u64) -> impl Fn(&str, String, &str, bool) -> Row {
    move |what, figure, asked, holds| Row {
        name,
        what: what.to_owned(),
        count,
        seed,
        figure,
        asked: asked.to_owned(),
        holds,
    }
}

/// Prints the rows; `true` when all hold.
pub fn print(rows: &[Row]) -> bool {
    let head = ["row", "what", "count", "seed", "figure", "asked", ""];
    let [name, what, count, seed, figure, asked, holds] = head;
    println!("{name:<4} {what:<52} {count:>9} {seed:>5}  {figure:<44} {asked:<26} {holds}");
    for row in rows {
        let Row {
            name,
            what,
            count,
            seed,
            figure,
            asked,
            holds,
        } = row;
        let verdict = if *holds { "holds" } else { "MISSED" };
        println!("{name:<4} {what:<52} {count:>9} {seed:>5}  {figure:<44} {asked:<26} {verdict}");
    }
    rows.iter().all(|row| row.holds)
}
