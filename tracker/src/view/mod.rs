//! A run while it goes on: a page in the browser with each camera's pictures as the film has them.
//!
//! Nobody who watches can hold the run up, and without watchers nothing is drawn for them. The page asks for a moment
//! other than the one it shows, and is answered when there is one; then it fetches the pictures, and asks again. So a
//! picture is drawn and encoded when somebody waits for it; whoever is slow sees fewer. From the run to the browser:
//!
//! * [`screens`] — [`Screens`]: what there is to see now; the newest picture takes the older one's place. Start here.
//! * [`drawer`] — [`Drawer`]: draws what somebody waits for, where no film is made whose pictures could be shown.
//! * [`server`] — [`Server`]: answers the page, until the run has ended and its watchers have been told.

mod drawer;
mod screens;
mod server;
#[cfg(test)]
mod tests;

pub use drawer::Drawer;
pub use screens::Screens;
pub use server::Server;
