//! The quick laboratory: runs of the service on the emulated robots in virtual time.
//!
//! To the service it is a laboratory like any other: it registers, claims runs, reports states, records and hands archives in.
//! Pilot, filter, link, firmware and plant are those of the emulated laboratory; only clock, sockets and pictures are not
//! there, so a run of 20 s takes a second or two, however busy the machine is. [`shelf`] is where robots and floor are changed
//! between runs, [`run`] carries one run out.

pub mod run;
pub mod shelf;
