//! Track files: the output of a run, and the input of the evaluator. Their readers are in [`mot`].
//!
//! * [`TrackFiles`] — writes `tracks.txt`, `boxes/NAME.txt` and `tracks.jsonl`, frame by frame;
//! * [`AgentsFile`] — writes `agents.jsonl`, packet by packet;
//! * [`Persistence`] — files of one run, or lasting ones;
//! * [`Stopwatch`] — `timings.json`.

mod agents;
mod line_file;
mod lines;
mod persistence;
mod timings;
mod write;

use std::path::{Path, PathBuf};

pub use agents::AgentsFile;
pub(crate) use line_file::{LineFile, last_line};
pub(crate) use lines::frame_line;
pub use lines::person_line;
pub use persistence::Persistence;
pub use timings::{StageTimes, Stopwatch, Timings};
pub use write::TrackFiles;

/// Files of a finished run that other commands read, and its folder: what their outputs must not take the place of.
pub fn files_of_run(out: &Path) -> Vec<PathBuf> {
    const NAMES: [&str; 11] = [
        "tracks.txt",
        "tracks.jsonl",
        "timings.json",
        "agents.jsonl",
        "events.jsonl",
        "counts.csv",
        "heat.csv",
        "heat.png",
        "groups.csv",
        "plan.png",
        "experiment.json",
    ];
    let mut files: Vec<PathBuf> = NAMES.iter().map(|name| out.join(name)).collect();
    for folder in ["boxes", "overlay"] {
        let entries = std::fs::read_dir(out.join(folder)).into_iter().flatten().flatten();
        files.extend(entries.map(|entry| entry.path()));
    }
    files.push(out.to_owned());
    files
}
