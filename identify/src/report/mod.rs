//! What a diagnosis says, as a document and as a page.

mod page;
pub mod schema;
mod words;

pub use page::page;
pub use schema::{Report, Verdict};
pub use words::{effect_sentence, plain, told_by_no_run, verdict_sentence};
