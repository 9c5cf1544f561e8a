//! The zone editor: a page in the browser on which a person draws zones on the floor plan and sees them, meanwhile, in
//! the image of every camera.
//!
//! The page only draws. Where a zone's outline runs in an image, lens and furniture included, and which place of the
//! floor a pixel shows, the server answers, so that there is one camera model. From outside to inside:
//!
//! * [`server`] — [`Server`]: refuses what is not the page's, and finds who answers; it listens by
//!   [`shell::loopback`]. Start here.
//! * [`session`] — the room that is edited: loaded, asked, saved.
//! * [`outline`] — an outline on the floor, as lines in an image.
//! * [`picture`] — the plan and the cameras' images; [`page`] — the page's own files.

mod outline;
mod page;
mod picture;
mod server;
mod session;
#[cfg(test)]
mod tests;

pub use server::Server;
pub use session::Session;
