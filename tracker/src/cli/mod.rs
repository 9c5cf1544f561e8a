//! The program's subcommands: each maps its options onto the library's, one to one.

pub(crate) mod eval;
