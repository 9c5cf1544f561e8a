//! The room's editor: a page in the browser on which a person draws zones, regions, lines and the walkable floor on the
//! floor plan or in the image of a camera, and which shows them in all others meanwhile.
//!
//! The page only draws. The server computes an outline in an image, with the lens's distortion and the furniture that
//! hides it, and the floor point that a pixel shows, so that there is one camera model. From outside to inside:
//!
//! * [`server`] — [`Server`]: refuses foreign requests, and dispatches the page's; it listens by
//!   [`shell::loopback`]. Start here.
//! * [`session`] — the room that is edited: loading, queries, saving.
//! * [`walls`] — the room's walls, to which corners snap; [`outline`] — an outline on the floor, as lines in an image.
//! * [`picture`] — the plan and the cameras' images; [`page`] — the page's own files, some of which `recon picks --page`
//!   has, too.

mod outline;
mod page;
mod picture;
mod server;
mod session;
#[cfg(test)]
mod tests;
mod walls;

pub use page::{CONTROLS_STYLE, ROWS_SCRIPT, SERVER_SCRIPT, SHAPES_SCRIPT};
pub use server::Server;
pub use session::Session;
