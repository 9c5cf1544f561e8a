//! A service: rooms that are followed day after day, and the people who walk between them.
//!
//! One room:
//!
//! * [`Day`] — a day of the calendar (UTC), which names the folder of its files; [`remove_older`] — the retention.
//! * [`RoomJournal`] — what a room's run has to know of the runs before it: ids, frames, the zero of its times.
//! * [`DailyOutputs`] — the outputs of a run that lasts: a folder a day.
//!
//! The site:
//!
//! * [`DoorMatcher`] — who went out through a door and came in through its twin. Start here: a pure state machine.
//! * [`SiteIds`] — site-wide ids of the people of all rooms.
//! * [`SiteFiles`] — `people.jsonl` and `events.jsonl` of the site.

mod daily_outputs;
mod day;
mod door_matcher;
#[cfg(test)]
mod midnight_tests;
#[cfg(test)]
mod passage_tests;
mod room_journal;
mod site_files;
mod site_ids;

pub use daily_outputs::{BeginOutputs, DailyFilm, DailyOutputs, StartFilm};
pub use day::{Day, remove_older};
pub use door_matcher::{DoorMatcher, DoorOptions, Looks, Passage};
pub use room_journal::RoomJournal;
pub use site_files::SiteFiles;
pub use site_ids::{Door, DoorSide, PersonKey, SiteIds, SitePerson};
