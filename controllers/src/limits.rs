//! What a program may use. Counted, so that the limits are part of the result: equal natively and in the browser.

/// Operations of a script in one tick. `cargo xtask bench controllers` says how long loops take that use all of them.
pub const SCRIPT_OPERATIONS: u64 = 20_000;
/// Operations of a script's `start`.
pub const SCRIPT_START_OPERATIONS: u64 = 200_000;
/// Functions of a script that call each other.
pub const SCRIPT_CALL_DEPTH: usize = 32;
/// Longest text of a script. An operation may copy a whole text, array or map, so these three bound the time and the memory of
/// one operation.
pub const SCRIPT_STRING_BYTES: usize = 8 * 1024;
/// Most values in an array, those of arrays in it included.
pub const SCRIPT_ARRAY_VALUES: usize = 2_000;
/// Most entries of a map, those of maps in it included.
pub const SCRIPT_MAP_ENTRIES: usize = 500;
/// Deepest nesting of what a script keeps from tick to tick.
pub const SCRIPT_STATE_DEPTH: usize = 32;
/// Deepest nesting of expressions.
pub const SCRIPT_EXPRESSION_DEPTH: usize = 48;
/// Functions and variables of a script.
pub const SCRIPT_NAMES: usize = 256;

/// Fuel of a module in one tick: about one for each instruction.
pub const MODULE_FUEL: u64 = 400_000;
/// Fuel of a module's `buffer`, once.
pub const MODULE_START_FUEL: u64 = 4_000_000;
/// Fuel that a call of the host costs besides the instruction.
pub const HOST_CALL_FUEL: u64 = 50;
/// Bytes that one fuel copies or fills.
pub const BYTES_PER_FUEL: u32 = 8;
/// Linear memory.
pub const MODULE_MEMORY_BYTES: usize = 64 * 1024 * 1024;
/// Value stack.
pub const MODULE_STACK_BYTES: usize = 512 * 1024;
/// Functions that call each other.
pub const MODULE_CALL_DEPTH: usize = 1_000;
/// Entries of the table.
pub const MODULE_TABLE_ENTRIES: usize = 10_000;

/// Multiplications and additions of a policy's network for the whole team in one tick; a step of `Tanh`, `Sigmoid` and their
/// like counts as [`CURVE_OPERATIONS`].
pub const POLICY_OPERATIONS: u64 = 1_000_000;
pub const CURVE_OPERATIONS: u64 = 20;
/// Nodes of its graph.
pub const POLICY_NODES: usize = 256;
/// Most values that one node gives.
pub const POLICY_WIDTH: usize = 4_096;

/// Log of one tick, control characters left out.
pub const LOG_BYTES_PER_TICK: usize = 64 * 1024;
/// Log of a whole run; what is beyond is left out.
pub const LOG_BYTES_PER_RUN: usize = 4 * 1024 * 1024;
/// Longest line of the log and longest text on the arena.
pub const LINE_BYTES: usize = 1_000;
/// Log lines and drawings of one tick.
pub const NOTES_PER_TICK: usize = 256;
/// A robot that has not finished may be told nothing for so many ticks in a row.
pub const SILENT_TICKS: u32 = 60;
/// As many answers in a row may come late.
pub const LATE_TICKS: u32 = 30;
