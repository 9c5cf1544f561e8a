//! User interface of the project's programs: terminal, drawings and local web pages.
//!
//! * [`console`] — start and end of a program: log, progress, one line of error, exit status. Start here.
//! * [`canvas`] — drawing: shapes and text over pictures.
//! * [`loopback`] — pages that a program serves to its own machine.
#![forbid(unsafe_code)]

pub mod canvas;
pub mod console;
pub mod loopback;
