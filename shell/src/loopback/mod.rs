//! Pages that a program serves to its own machine: the common part of the editor's server and the tracker's.
//!
//! A page of another site must not reach these servers. So on the loopback the `Host` has to be the loopback's (a name
//! that a foreign DNS server resolves to 127.0.0.1 is refused), an `Origin` has to be the server's own, and no answer may
//! be shown, framed or read elsewhere. Other machines need a token, if the server has one.
//!
//! * [`listener`] — [`Listener`]: the socket, and the refusal of requests for a foreign host name. Start here.
//! * [`access`] — [`AccessToken`]: the token of a server that other machines can reach, and its certificate.
//! * [`connections`] — the limit of the connections, and the deadlines of their requests.
//! * [`authority`] — host and port of `Host` and `Origin`, compared exactly.
//! * [`protection`] — [`Protection`]: both, as a command's options name them.
//! * [`answer`] — [`Answer`]: the answers, with the headers that all of them carry.
//! * [`json_body`] — [`JsonBody`]: the bodies of requests that change or query something.
//! * [`page_file`] — [`PageFile`]: a page's own files, compiled into the program, so that pages work without a network;
//!   and the colours that all pages share.

mod access;
mod answer;
mod authority;
mod connections;
mod json_body;
mod listener;
mod page_file;
mod protection;

pub use access::AccessToken;
pub use answer::Answer;
pub use json_body::JsonBody;
pub use listener::{ListenError, Listener};
pub use page_file::PageFile;
pub use protection::Protection;
