//! User interface of the project's programs: terminal, drawings and local web pages.
//!
//! * [`console`] — start and end of a program: log, progress, one line of error, exit status. Start here.
//! * [`family_arguments`] — the command line of a family of commands.
//! * [`program`] — the program as it was called: a short one, or all in one.
//! * [`plain_text`] — text of files and names, made safe for a terminal.
//! * [`files`] — files that are written whole or not at all, and never in place of an input.
//! * [`ranges`] — the ranges of numbers in files and options.
//! * [`options`] — checks of options, and the flags under which the command line knows them.
//! * [`canvas`] — drawing: shapes and text over pictures.
//! * [`loopback`] — pages that a program serves to its own machine.
#![forbid(unsafe_code)]

pub mod canvas;
pub mod console;
mod family;
pub mod files;
pub mod loopback;
pub mod options;
pub mod plain_text;
pub mod program;
pub mod ranges;
