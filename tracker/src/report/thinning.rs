//! Frames of a run, thinned where they are many: a day of ten people has ten million estimates, and no page shows them all.

use std::collections::BTreeSet;
use std::path::Path;

use mot::jsonl::{self, FrameLine};

use crate::Result;

/// Most estimates that are kept, people and frames together: some hundred megabytes.
pub(super) const MOST_ESTIMATES: usize = 500_000;

/// Frames of `tracks.jsonl`, evenly spaced.
#[derive(Debug, Clone, Default)]
pub(super) struct ThinnedFrames {
    /// Every `every`-th frame, from the first on.
    pub(super) kept: Vec<FrameLine>,
    /// Distance of two kept frames; a power of 2, and 1 where all are kept.
    pub(super) every: usize,
    /// Number of all frames.
    pub(super) count: usize,
    /// Time of the last of all frames, seconds.
    pub(super) last_s: f64,
    /// Cameras that are named by any frame.
    pub(super) cameras: BTreeSet<String>,
}

impl ThinnedFrames {
    /// Reads a file line by line, and keeps at most `most` estimates.
    ///
    /// # Errors
    /// Those of [`jsonl::read`].
    pub(super) fn read(path: &Path, most: usize) -> Result<Self> {
        let mut frames = Self { every: 1, ..Self::default() };
        let mut estimates = 0;
        for line in jsonl::lines(path)? {
            frames.take(line?, &mut estimates);
            while estimates > most && frames.kept.len() > 1 {
                frames.halve();
                estimates = frames.kept.iter().map(estimates_of).sum();
            }
        }
        Ok(frames)
    }

    fn take(&mut self, line: FrameLine, estimates: &mut usize) {
        self.last_s = line.time;
        for name in line.people.iter().flat_map(|person| person.visible.keys()) {
            if !self.cameras.contains(name) {
                self.cameras.insert(name.clone());
            }
        }
        if self.count.is_multiple_of(self.every) {
            *estimates += estimates_of(&line);
            self.kept.push(line);
        }
        self.count += 1;
    }

    /// Keeps every second of the kept frames.
    fn halve(&mut self) {
        let mut index = 0;
        self.kept.retain(|_| {
            index += 1;
            index % 2 == 1
        });
        self.every *= 2;
    }
}

fn estimates_of(line: &FrameLine) -> usize {
    1 + line.people.len()
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;

    /// File of `count` frames with two people each.
    fn file(folder: &Path, count: u32) -> std::path::PathBuf {
        let mut text = String::new();
        for frame in 1..=count {
            let person = |id: u32| {
                format!(
                    r#"{{"id":{id},"x":1,"y":1,"radius":0.2,"height":1.7,"vx":0,"vy":0,"sigma":[0,0],"confidence":1,"visible":{{"cam{}":1}}}}"#,
                    frame / 90
                )
            };
            let time = f64::from(frame) / 10.0;
            let _ =
                writeln!(text, r#"{{"frame":{frame},"time":{time},"people":[{},{}]}}"#, person(1), person(2));
        }
        let path = folder.join("tracks.jsonl");
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn few_frames_are_all_kept_and_many_are_thinned_evenly() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), 100);
        let whole = ThinnedFrames::read(&path, 300).unwrap();
        assert_eq!((whole.kept.clone(), whole.every), (jsonl::read(&path).unwrap(), 1));
        for most in [1, 20, 100, 299] {
            let thinned = ThinnedFrames::read(&path, most).unwrap();
            assert!(3 * thinned.kept.len() <= most.max(3), "{most}: {} frames", thinned.kept.len());
            assert!(thinned.kept.iter().eq(whole.kept.iter().step_by(thinned.every)), "{most}");
            // Number, last time and cameras are those of all frames, not of the kept ones.
            assert_eq!((thinned.count, thinned.last_s, thinned.cameras.len()), (100, 10.0, 2));
        }
    }
}
