//! An own controller on the Compose page, besides its text, which is part of the experiment.

/// What the panel at the left shows while the law is an own controller.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Side {
    #[default]
    Settings,
    Program,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Program {
    pub side: Side,
    /// The last script, while a module or another law is in its place.
    pub kept: Option<String>,
    /// Where the module in the experiment came from.
    pub module: Option<ModuleFile>,
    /// Why the last file was not taken, in words.
    pub refusal: Option<String>,
    /// What is wrong with the program, as the last rehearsal told.
    pub mistake: Option<Mistake>,
    /// Place in the gallery of an example that waits for a yes.
    pub example_asked: Option<usize>,
    /// Name of the next number, as far as it is typed.
    pub number_name: String,
}

/// A WebAssembly module as a person knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModuleFile {
    pub name: String,
    pub bytes: usize,
    /// Lower-case hexadecimal.
    pub sha256: String,
}

/// Why a program was refused or could not go on.
#[derive(Debug, Clone, PartialEq)]
pub struct Mistake {
    /// Line and column in the script, from 1; none where it has no place.
    pub place: Option<[u32; 2]>,
    /// Moment of the rehearsal; none when it did not begin.
    pub at_s: Option<f64>,
    pub text: String,
}
