//! Observations of all stations → moments.

mod port;

pub use port::{Inbox, Port};
