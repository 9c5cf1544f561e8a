//! The commands that need tracks alone, one a file: each maps its options onto the library's, one to one.
// Doc comments of arguments are help texts, in which [[zone]] is a table of a file.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod eval;
mod flags;
pub mod link;
