//! Programs of users in a process of their own, asked over a pipe.
//!
//! ```text
//! laboratory, scheduler --PipeProgram--> stdin  | robopheus-controller: limits first, then the program
//!                       <-- in time? --- stdout |
//! ```
//!
//! The parent asks with a deadline and never waits longer; the child gives up everything that it does not need before it reads
//! the program ([`confine`]), is killed when its parent drops it, and
//! ends with its input when the parent dies. The same lines of JSON ([`message`]) are the
//! protocol for programs in any language on a user's own machine.

pub mod confine;
pub mod message;
pub mod pipe;
pub mod serve;
pub mod start;
