//! Pages that a program serves to its own machine: what the zone editor's server and the tracker's have in common.
//!
//! A page of another site must not reach them. So on the loopback the `Host` has to be the loopback's (a name that
//! somebody else's DNS turns to 127.0.0.1 is refused), and no answer may be shown, framed or read elsewhere.
//!
//! * [`listener`] — [`Listener`]: the socket, and the refusal of what is not asked by name. Start here.
//! * [`answer`] — [`Answer`]: what goes back, with the headers that all answers have.
//! * [`page_file`] — [`PageFile`]: a page's own files, part of the program: it works without a network; and the
//!   colours that all pages have.

mod answer;
mod listener;
mod page_file;

pub use answer::Answer;
pub use listener::{ListenError, Listener};
pub use page_file::PageFile;
