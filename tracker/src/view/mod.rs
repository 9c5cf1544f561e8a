//! Live view of a run: a web page with each camera's pictures as in the film.
//!
//! Viewers never slow the tracker: pictures are dropped when a viewer is slow, and nothing is drawn without viewers.
//! The page requests a moment other than the one that it shows, and gets an answer when there is one; then it fetches
//! the pictures, and requests again. A picture is thus drawn and encoded only when a viewer waits for it. From the run
//! to the browser:
//!
//! * [`screens`] — [`Screens`]: the present state of the page; a new picture replaces the older one. Start here.
//! * [`drawer`] — [`LiveDrawer`]: draws pictures that a viewer waits for, where there is no film with pictures to show.
//! * [`server`] — [`Server`]: serves the page until the run has ended and its viewers have been informed.

mod drawer;
mod screens;
mod server;
#[cfg(test)]
mod tests;

pub use drawer::LiveDrawer;
pub use screens::Screens;
pub use server::Server;
