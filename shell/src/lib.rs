//! The outside of the project's programs: what a person reads, sees and opens, whatever the program computes.
//!
//! * [`console`] — begin and end of a program: log, progress, one line of error, exit status. Start here.
//! * [`canvas`] — drawing: shapes and text over pictures.
//! * [`loopback`] — pages that a program serves to its own machine.
#![forbid(unsafe_code)]

pub mod canvas;
pub mod console;
pub mod loopback;
