//! The page of `recon picks --page`: from captures to a room without typing a pixel.
//!
//! A person picks the same physical points in two reference pictures side by side, gives the scale by clicking, saves
//! `room.toml`, builds, and goes on to the zones. The page only draws; cameras' geometry is the server's. From outside to
//! inside:
//!
//! * [`server`] — [`Server`]: dispatches the page's requests; it listens by [`shell::loopback`]. Start here.
//! * [`session`] — the project that is picked: pictures, picks, saving.
//! * [`state`] — how far its captures and its build are.
//! * [`work`] — what takes minutes, on threads of its own: the captures, proposals, the build.
//! * [`geometry`] — residuals and epipolar lines.
//! * [`page`] — the page's own files; some are the zone editor's.

mod geometry;
mod page;
mod server;
mod session;
mod state;
#[cfg(test)]
mod tests;
mod work;

pub use server::Server;
pub use session::Session;
