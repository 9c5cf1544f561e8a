//! Record of a room's earlier runs that the next run continues: ids, frame numbers and the zero of the times.
//!
//! `OUT/service.json` holds the zero of the room's times and the next free id. It is written, and synchronised to the
//! disk, before an id is used: however a program ends, ids go on above the highest one in any file. To do so seldom, ids
//! are reserved by the block. The number of the last frame stands in the files of the last day.

use std::path::{Path, PathBuf};
use std::time::Duration;

use calib::files::read_text;
use mot::jsonl::{self, FrameLine};
use serde::{Deserialize, Serialize};
use shell::files::FolderLock;

use super::Day;
use super::day::days_in;
use crate::events::Clock;
use crate::tracks::last_line;
use crate::{Error, PersonEstimate, Result};

/// Name of the file in the room's folder.
const FILE: &str = "service.json";
/// Number of ids that are reserved at once.
const BLOCK: u32 = 50;
/// Longest wait for an earlier run to end.
const LONGEST_WAIT: Duration = Duration::from_mins(1);

/// State of a room's folder.
#[derive(Debug)]
pub struct RoomJournal {
    out: PathBuf,
    content: Content,
    /// The first id above all that this run has used.
    free_id: u32,
    next_frame: u32,
    zero_s: f64,
    /// The last line before this run, and the day in whose folder it stands.
    last: Option<(Day, FrameLine)>,
    /// Unlocked when it is dropped.
    _lock: FolderLock,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    /// Time of day of the times' zero, RFC 3339.
    zero: String,
    /// First id that no file has.
    next_id: u32,
}

impl RoomJournal {
    /// Opens a room's folder for a run that begins today; waits until an earlier run has ended.
    ///
    /// # Errors
    /// A folder that cannot be written, that another run does not leave, or whose state cannot be used.
    pub fn open(out: &Path, today: Day) -> Result<Self> {
        std::fs::create_dir_all(out).map_err(Error::io(out))?;
        let path = out.join(FolderLock::NAME);
        let lock = FolderLock::take_file(&path, out, "tracker serve", LONGEST_WAIT)?;
        let path = out.join(FILE);
        let last = last_frame_line(out)?;
        let content = if path.exists() {
            serde_json::from_str(&read_text(&path)?).map_err(|e| {
                let problem = format!("{e}; move the folder away to begin anew");
                Error::content(&path, format!("line {}", e.line()), problem)
            })?
        } else if let Some((day, _)) = &last {
            let problem =
                format!("is missing, though there are rows of {day}; put it back, or move the folder away");
            return Err(Error::content(&path, "whole file", problem));
        } else {
            Content { zero: format!("{today}T00:00:00Z"), next_id: 1 }
        };
        let zero = Clock::parse(&content.zero).map_err(|problem| Error::content(&path, "zero", problem))?;
        let mut journal = Self {
            free_id: content.next_id,
            next_frame: last.as_ref().map_or(1, |(_, last)| last.frame.saturating_add(1)),
            zero_s: zero.unix_s(),
            last,
            out: out.to_owned(),
            content,
            _lock: lock,
        };
        journal.reserve()?;
        Ok(journal)
    }

    /// Folder of the room.
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// First id of this run.
    pub fn next_id(&self) -> u32 {
        self.free_id
    }

    /// Number of this run's first frame.
    pub fn next_frame(&self) -> u32 {
        self.next_frame
    }

    /// Zero of the room's times, seconds since 1970: a midnight, UTC.
    pub fn zero_s(&self) -> f64 {
        self.zero_s
    }

    /// Clock whose zero is the room's.
    pub fn clock(&self) -> Clock {
        let since = Duration::try_from_secs_f64(self.zero_s).unwrap_or_default();
        Clock::of_system(std::time::UNIX_EPOCH + since)
    }

    /// The last line that earlier runs have written; `None` in a new folder.
    pub fn last(&self) -> Option<&FrameLine> {
        self.last.as_ref().map(|(_, line)| line)
    }

    /// Folder of that line.
    pub fn last_folder(&self) -> Option<PathBuf> {
        self.last.as_ref().map(|(day, _)| day.folder(&self.out))
    }

    /// Makes sure that no later run gives these people's ids to others. Call it before they are written.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn use_ids(&mut self, people: &[PersonEstimate]) -> Result<()> {
        self.use_id(people.iter().map(|person| person.id.0).max().unwrap_or(0))
    }

    /// Makes sure that no later run uses this id.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(super) fn use_id(&mut self, highest: u32) -> Result<()> {
        self.free_id = self.free_id.max(highest.saturating_add(1));
        if self.free_id > self.content.next_id { self.reserve() } else { Ok(()) }
    }

    /// Gives the ids back that were reserved and not used.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn close(mut self) -> Result<()> {
        self.content.next_id = self.free_id;
        self.write()
    }

    fn reserve(&mut self) -> Result<()> {
        self.content.next_id = self.free_id.saturating_add(BLOCK);
        self.write()
    }

    fn write(&self) -> Result<()> {
        let path = self.out.join(FILE);
        let text = serde_json::to_string(&self.content)
            .map_err(|e| Error::content(&path, "whole file", format!("cannot be written ({e})")))?;
        Ok(calib::files::write_atomic(&path, (text + "\n").as_bytes())?)
    }
}

/// The last line of the last day that has one. Its frame is the last of any track file: they are written one after the
/// other, so that another may be ahead.
fn last_frame_line(out: &Path) -> Result<Option<(Day, FrameLine)>> {
    for day in days_in(out)?.into_iter().rev() {
        let folder = day.folder(out);
        let path = folder.join(jsonl::NAME);
        let Some(text) = last_line(&path)? else { continue };
        let mut line: FrameLine = serde_json::from_str(&text).map_err(|e| {
            let problem = format!("is no frame as `tracker run` writes it ({e}); remove it");
            Error::content(&path, "last line", problem)
        })?;
        let mut others = vec![folder.join("tracks.txt")];
        if let Ok(boxes) = std::fs::read_dir(folder.join("boxes")) {
            others.extend(boxes.flatten().map(|entry| entry.path()));
        }
        for other in others {
            let row = last_line(&other)?;
            let frame = row.and_then(|row| row.split(',').next().and_then(|frame| frame.parse().ok()));
            line.frame = line.frame.max(frame.unwrap_or(0));
        }
        return Ok(Some((day, line)));
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn today() -> Day {
        "2026-11-27".parse().unwrap()
    }

    fn line(frame: u32) -> String {
        format!("{{\"frame\":{frame},\"time\":3.5,\"people\":[],\"clock\":\"2026-11-27T00:00:03.500Z\"}}\n")
    }

    #[test]
    fn ids_go_on_above_all_that_were_used_however_a_run_ends() {
        let out = tempfile::tempdir().unwrap();
        let mut highest = 0;
        for (used, is_clean) in [(3, false), (0, false), (130, false), (2, true), (1, true), (7, false)] {
            let mut journal = RoomJournal::open(out.path(), today()).unwrap();
            assert!(journal.next_id() > highest, "{} after {highest}", journal.next_id());
            let first = journal.next_id();
            for id in first..first + used {
                journal.use_ids(&[PersonEstimate::standing(id, 0.0, 0.0)]).unwrap();
                highest = highest.max(id);
            }
            if is_clean {
                journal.close().unwrap();
                let next = RoomJournal::open(out.path(), today()).unwrap().next_id();
                assert_eq!(next, first + used, "a clean end leaves no gap");
            }
        }
    }

    #[test]
    fn frames_and_times_go_on_after_the_last_row_of_any_file() {
        let out = tempfile::tempdir().unwrap();
        let journal = RoomJournal::open(out.path(), today()).unwrap();
        assert_eq!((journal.next_frame(), journal.next_id()), (1, 1));
        assert!((journal.zero_s() - today().begin_s()).abs() < 1e-6);
        drop(journal);
        let folder = today().folder(out.path());
        std::fs::create_dir_all(folder.join("boxes")).unwrap();
        std::fs::create_dir_all("2026-11-28".parse::<Day>().unwrap().folder(out.path())).unwrap();
        std::fs::write(folder.join("tracks.jsonl"), line(41) + &line(42) + "{\"frame\":43,\"ti").unwrap();
        std::fs::write(folder.join("boxes/a.txt"), "44,1,1,1,5,5,1,-1,-1,-1\n45,1").unwrap();
        // The zero stays that of the first day.
        let journal = RoomJournal::open(out.path(), "2026-12-24".parse().unwrap()).unwrap();
        assert_eq!((journal.next_frame(), journal.last().unwrap().frame), (45, 44));
        assert!((journal.zero_s() - today().begin_s()).abs() < 1e-6);
        assert_eq!(journal.clock().at(3.5), "2026-11-27T00:00:03.500Z");
    }

    #[test]
    fn a_folder_that_cannot_be_continued_is_named_with_the_mend() {
        let out = tempfile::tempdir().unwrap();
        let folder = today().folder(out.path());
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("tracks.jsonl"), line(1)).unwrap();
        let said = || RoomJournal::open(out.path(), today()).unwrap_err().to_string();
        assert!(said().contains("service.json") && said().contains("2026-11-27"), "{}", said());
        std::fs::write(out.path().join(FILE), "{\"zero\":\"now\",\"next_id\":1}").unwrap();
        assert!(said().contains("service.json: zero") && said().lines().count() == 1, "{}", said());
        std::fs::write(out.path().join(FILE), "").unwrap();
        assert!(said().contains("service.json: line 1"), "{}", said());
        std::fs::write(folder.join("tracks.jsonl"), "no frame\n").unwrap();
        assert!(said().contains("tracks.jsonl: last line"), "{}", said());
    }
}
