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
