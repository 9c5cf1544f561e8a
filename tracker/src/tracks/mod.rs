//! Track files: the output of a run, and the input of the evaluator.
//!
//! * [`TrackFiles`] — writes `tracks.txt`, `boxes/NAME.txt` and `tracks.jsonl`, frame by frame;
//! * [`count`] — probability distribution of the number of people;
//! * [`AgentsFile`] — writes `agents.jsonl`, packet by packet;
//! * [`Persistence`] — files of one run, or lasting ones;
//! * [`Stopwatch`] — `timings.json`;
//! * [`rows`] — reads MOTChallenge rows, floor or image; [`jsonl`] — reads `tracks.jsonl`.

mod agents;
pub mod count;
pub mod jsonl;
mod line_file;
mod persistence;
pub mod rows;
mod timings;
mod write;

pub use agents::AgentsFile;
pub(crate) use line_file::{LineFile, last_line};
pub use persistence::Persistence;
pub use timings::{StageTimes, Stopwatch, Timings};
pub use write::TrackFiles;
