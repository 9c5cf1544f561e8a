//! Files of a run's events: `events.jsonl`, `counts.csv`, `heat.csv`, `heat.png`, `groups.csv`.

use std::path::{Path, PathBuf};

use calib::files::write_atomic;
use scenes::room::Room;

use super::groups::{self, Groups};
use super::heat::HeatMap;
use super::tally::CountRows;
use super::{EventOptions, Events};
use crate::tracks::LineFile;
use crate::tracks::jsonl::{self, FrameLine};
use crate::{Error, Result};

/// Names of the files.
pub(super) const EVENTS: &str = "events.jsonl";
pub(super) const COUNTS: &str = "counts.csv";
pub(super) const GROUPS: &str = "groups.csv";
const HEAT: &str = "heat.csv";
pub(crate) const HEAT_PICTURE: &str = "heat.png";

/// Options of the event files.
#[derive(Debug, Clone, PartialEq)]
pub struct EventFileOptions {
    /// Options of the detector.
    pub events: EventOptions,
    /// Interval of the rows of `counts.csv`, seconds.
    pub counts_every_s: f64,
}

impl Default for EventFileOptions {
    fn default() -> Self {
        Self { events: EventOptions::default(), counts_every_s: 60.0 }
    }
}

impl EventFileOptions {
    /// Checks the options.
    ///
    /// # Errors
    /// [`Error::Option`] that names the field.
    pub fn validate(&self) -> Result<()> {
        if self.counts_every_s.is_finite() && self.counts_every_s >= 0.1 {
            return Ok(());
        }
        let problem = format!("is {}; give at least 0.1 seconds", self.counts_every_s);
        Err(Error::option("counts_every_s", problem))
    }
}

/// Writers of a run's event files. Events and counts are passed to the operating system as they are decided; the heat
/// map and the groups are written at the end.
pub struct EventFiles {
    events: Events,
    file: LineFile,
    counts: CountRows,
    counts_file: LineFile,
    heat: HeatMap,
    groups: Groups,
    out: PathBuf,
    room: Room,
    room_dir: PathBuf,
    last_s: Option<f64>,
}

impl EventFiles {
    /// Files in the folder `out` of a run in a room that was read from `room_dir`.
    ///
    /// # Errors
    /// Options that are not valid.
    pub fn new(out: &Path, room: &Room, room_dir: &Path, options: &EventFileOptions) -> Result<Self> {
        options.validate()?;
        Ok(Self {
            events: Events::new(room, options.events.clone()),
            file: LineFile::new(out.join(EVENTS)),
            counts: CountRows::new(room, options.counts_every_s, options.events.settle_s()),
            counts_file: LineFile::new(out.join(COUNTS)),
            heat: HeatMap::default(),
            groups: Groups::default(),
            out: out.to_owned(),
            room: room.clone(),
            room_dir: room_dir.to_owned(),
            last_s: None,
        })
    }

    /// Takes the next line of `tracks.jsonl`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn step(&mut self, line: &FrameLine) -> Result<()> {
        let events = self.events.step(line);
        self.append(&events)?;
        let header = if self.last_s.is_none() { CountRows::HEADER } else { "" };
        let rows = self.counts.step(line.time, &events);
        if !header.is_empty() || !rows.is_empty() {
            self.counts_file.append(&(header.to_owned() + &rows))?;
        }
        self.heat.step(line);
        self.groups.step(line);
        self.last_s = Some(line.time);
        Ok(())
    }

    /// Completes the files.
    ///
    /// # Errors
    /// A file that cannot be written, or geometry that cannot be drawn.
    pub fn finish(mut self) -> Result<()> {
        let events = self.events.finish();
        self.append(&events)?;
        let rows = match self.last_s {
            Some(last_s) => self.counts.finish(last_s, &events),
            None => CountRows::HEADER.to_owned(),
        };
        self.counts_file.append(&rows)?;
        write_atomic(&self.out.join(HEAT), self.heat.csv().as_bytes())?;
        write_atomic(&self.out.join(GROUPS), groups::csv(&self.groups.finish()).as_bytes())?;
        let picture = self.heat.picture(&self.room, &self.room_dir)?;
        Ok(calib::picture::write(&self.out.join(HEAT_PICTURE), &picture)?)
    }

    fn append(&mut self, events: &[super::Event]) -> Result<()> {
        let path = self.out.join(EVENTS);
        let lines = events.iter().map(|event| event.text(&path)).collect::<Result<String>>()?;
        self.file.append(&lines)
    }
}

/// Writes the event files of a finished run, from its `tracks.jsonl`, line by line; the same bytes as during the run. They
/// replace older ones once all of them are complete.
///
/// # Errors
/// Names the file and the line that cannot be used; older files then stay.
pub fn of_run(out: &Path, room_dir: &Path, options: &EventFileOptions) -> Result<()> {
    // A run that cannot be read is named before a folder is made in it.
    let room = Room::read(room_dir)?;
    let lines = jsonl::lines(&out.join("tracks.jsonl"))?;
    let beside = tempfile::Builder::new().prefix(".events-").tempdir_in(out).map_err(Error::io(out))?;
    write_files(lines, beside.path(), &room, room_dir, options)?;
    for name in [HEAT, HEAT_PICTURE, GROUPS, COUNTS, EVENTS] {
        let target = out.join(name);
        std::fs::rename(beside.path().join(name), &target).map_err(Error::io(&target))?;
    }
    Ok(())
}

/// Writes the event files of the finished run in `out` to another folder.
///
/// # Errors
/// Names the file and the line that cannot be used.
pub(crate) fn derive(out: &Path, folder: &Path, room_dir: &Path, options: &EventFileOptions) -> Result<()> {
    let lines = jsonl::lines(&out.join("tracks.jsonl"))?;
    write_files(lines, folder, &Room::read(room_dir)?, room_dir, options)
}

fn write_files(
    lines: impl Iterator<Item = Result<FrameLine>>,
    folder: &Path,
    room: &Room,
    room_dir: &Path,
    options: &EventFileOptions,
) -> Result<()> {
    let mut files = EventFiles::new(folder, room, room_dir, options)?;
    for line in lines {
        files.step(&line?)?;
    }
    files.finish()
}

/// Removes the event files of an earlier run: they do not belong to new tracks in the same folder.
pub(crate) fn remove(out: &Path) -> Result<()> {
    for name in [HEAT, HEAT_PICTURE, GROUPS, COUNTS, EVENTS] {
        let path = out.join(name);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io(&path)(e)),
            _ => {}
        }
    }
    Ok(())
}

/// Whether a folder has the event files of a finished run.
pub(crate) fn are_in(folder: &Path) -> bool {
    [EVENTS, COUNTS, HEAT_PICTURE].iter().all(|name| folder.join(name).is_file())
}
