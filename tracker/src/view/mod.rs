//! Live view of a run: a web page with the plan and the room in 3-D, the people in them, what happens, and each camera's
//! pictures as in the film.
//!
//! Viewers never slow the tracker: frames and pictures are dropped when the page's thread or a viewer is slow, no picture
//! is drawn without viewers, and the threads of the page have the lowest priority. The page requests what comes after
//! what it shows, and gets an answer when there is something; then it fetches the pictures, and requests again. A picture
//! is thus drawn and encoded only when a viewer waits for it. From the run to the browser:
//!
//! * [`feed`] — [`LiveFeed`]: sends people, counts and events of each frame to the page. Start here.
//! * [`screens`] — [`Screens`]: the present pictures; a new one replaces the older one.
//! * [`drawer`] — [`LiveDrawer`]: draws pictures that a viewer waits for, where there is no film with pictures to show.
//! * [`room_page`] — [`RoomPage`]: what the page is told about the room once.
//! * [`server`] — [`Server`]: serves the page until the run has ended and its viewers have been informed.

mod drawer;
mod feed;
#[cfg(test)]
mod page_tests;
mod room_page;
mod screens;
mod server;
#[cfg(test)]
mod tests;

pub use drawer::LiveDrawer;
pub(crate) use feed::FeedInput;
pub use feed::LiveFeed;
pub use room_page::RoomPage;
pub use screens::Screens;
pub use server::Server;

/// Gives the calling thread, and those that it starts, the lowest priority.
fn yield_to_tracker() {
    const LOWEST: i32 = 19;
    // Without it the page works as well.
    let _ = rustix::process::setpriority_process(None, LOWEST);
}
