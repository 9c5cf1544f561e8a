//! Files of a run's events: `events.jsonl`, `counts.csv`, `heat.csv`, `heat.png`, `groups.csv`.

use std::path::{Path, PathBuf};

use calib::files::write_atomic;
use mot::jsonl::{self, FrameLine};
use scenes::room::Room;
use shell::options::check_numbers;
use shell::ranges::SECONDS;

use super::event::EVENTS;
use super::groups::{self, Groups};
use super::heat::HeatMap;
use super::open_visits::{OpenVisits, last_row};
use super::tally::CountRows;
use super::{Event, EventOptions, Events};
use crate::tracks::{LineFile, Persistence};
use crate::{Error, Result};

/// Names of the other files.
pub(super) const COUNTS: &str = "counts.csv";
pub(super) const GROUPS: &str = "groups.csv";
const HEAT: &str = "heat.csv";
/// Interval at which heat map and groups of lasting files are written, seconds.
const EXTRAS_EVERY_S: f64 = 60.0;
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
        Ok(check_numbers(
            [("counts_every_s", self.counts_every_s)],
            |seconds| (0.1..=SECONDS.most).contains(&seconds),
            &format!("at least 0.1 seconds, and at most {}", SECONDS.most),
        )?)
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
    /// Stays that have begun and not ended.
    open: OpenVisits,
    persistence: Persistence,
    /// Rows of `groups.csv` of an earlier run in the same folder.
    earlier_groups: String,
    /// Time at which heat map and groups were written last, seconds.
    extras_s: f64,
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
            counts_file: LineFile::new(out.join(COUNTS)).with_header(CountRows::HEADER),
            heat: HeatMap::default(),
            groups: Groups::default(),
            out: out.to_owned(),
            room: room.clone(),
            room_dir: room_dir.to_owned(),
            last_s: None,
            open: OpenVisits::default(),
            persistence: Persistence::default(),
            earlier_groups: String::new(),
            extras_s: f64::NEG_INFINITY,
        })
    }

    /// The same files, kept in this way. Where an interrupted run left people in the folder's events, they have
    /// disappeared with its last line.
    ///
    /// # Errors
    /// Earlier files that cannot be read, or events that cannot be written.
    pub fn kept(mut self, persistence: &Persistence) -> Result<Self> {
        self.file = self.file.kept(persistence);
        self.counts_file = self.counts_file.kept(persistence);
        self.persistence = persistence.clone();
        if persistence.continues() {
            self.resume()?;
        }
        Ok(self)
    }

    /// The same files after those of an interrupted run in another folder: what was open there has ended there.
    ///
    /// # Errors
    /// Earlier files that cannot be read, or events that cannot be written.
    pub fn after(self, earlier: Option<&Path>) -> Result<Self> {
        if let Some(earlier) = earlier.filter(|earlier| *earlier != self.out) {
            OpenVisits::end_in(earlier, &self.persistence)?;
        }
        Ok(self)
    }

    /// Goes on after the files that are in the folder.
    fn resume(&mut self) -> Result<()> {
        let read = |name: &str| {
            let path = self.out.join(name);
            if path.exists() {
                calib::files::read_text(&path).map_err(Error::from)
            } else {
                Ok(String::new())
            }
        };
        self.earlier_groups =
            read(GROUPS)?.lines().skip(1).fold(String::new(), |rows, row| rows + row + "\n");
        self.heat.add_csv(&read(HEAT)?);
        let open = OpenVisits::read(&self.out)?;
        if open.len() == 0 {
            return Ok(());
        }
        tracing::info!("{} people who were there before the interruption have disappeared", open.len());
        self.counts.begin_with(&open.begun());
        let ended = open.ended(last_row(&self.out)?.as_ref());
        self.append(&ended)?;
        self.counts.wait(&ended);
        Ok(())
    }

    /// Completes the files, and goes on in another folder with the same people.
    ///
    /// # Errors
    /// A file that cannot be written, or geometry that cannot be drawn.
    pub fn move_to(&mut self, out: &Path) -> Result<()> {
        if let Some(last_s) = self.last_s {
            let rows = self.counts.finish(last_s, &[]);
            self.counts_file.append(&rows)?;
            self.counts.pause();
        }
        self.write_extras()?;
        self.write_picture()?;
        self.heat = HeatMap::default();
        self.groups = Groups::default();
        self.earlier_groups.clear();
        out.clone_into(&mut self.out);
        if self.persistence.continues() {
            self.open.write(out)?;
        }
        self.file.move_to(out.join(EVENTS));
        self.counts_file.move_to(out.join(COUNTS));
        Ok(())
    }

    /// Goes on with the zones, regions and lines of a changed room; nobody is lost. Returns the events of stays in areas
    /// that the room no longer has.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn replace_room(&mut self, room: &Room) -> Result<Vec<Event>> {
        let events = self.events.replace_room(room);
        self.append(&events)?;
        self.counts.wait(&events);
        self.counts.replace_room(room);
        self.room = room.clone();
        Ok(events)
    }

    /// Takes the next line of `tracks.jsonl`; returns the events that are decided now.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn step(&mut self, line: &FrameLine) -> Result<Vec<Event>> {
        let events = self.events.step(line);
        self.append(&events)?;
        let rows = self.counts.step(line.time, &events);
        self.counts_file.append(&rows)?;
        self.heat.step(line);
        self.groups.step(line);
        self.last_s = Some(line.time);
        if self.persistence.continues() && line.time - self.extras_s >= EXTRAS_EVERY_S {
            self.extras_s = line.time;
            self.write_extras()?;
        }
        Ok(events)
    }

    /// Completes the files.
    ///
    /// # Errors
    /// A file that cannot be written, or geometry that cannot be drawn.
    pub fn finish(mut self) -> Result<()> {
        let events = self.events.finish();
        self.append(&events)?;
        let rows = self.last_s.map_or_else(String::new, |last_s| self.counts.finish(last_s, &events));
        self.counts_file.append(&rows)?;
        self.write_extras()?;
        self.write_picture()
    }

    /// Writes what is known of the heat map and the groups.
    fn write_extras(&self) -> Result<()> {
        write_atomic(&self.out.join(HEAT), self.heat.csv().as_bytes())?;
        let groups = groups::csv(&self.groups.clone().finish());
        let (header, rows) = groups.split_once('\n').unwrap_or((&groups, ""));
        let text = format!("{header}\n{}{rows}", self.earlier_groups);
        Ok(write_atomic(&self.out.join(GROUPS), text.as_bytes())?)
    }

    fn write_picture(&self) -> Result<()> {
        let picture = self.heat.picture(&self.room, &self.room_dir)?;
        Ok(calib::picture::write(&self.out.join(HEAT_PICTURE), &picture)?)
    }

    fn append(&mut self, events: &[Event]) -> Result<()> {
        let path = self.out.join(EVENTS);
        let lines = events.iter().map(|event| event.text(&path)).collect::<Result<String>>()?;
        for event in events {
            self.open.add(event);
        }
        self.file.append(&lines)
    }
}

/// Folder in which new event files are finished.
const BESIDE: &str = ".events";

/// Writes the event files of a finished run, from its `tracks.jsonl`, line by line; the same bytes as during the run. They
/// replace older ones once all of them are complete.
///
/// # Errors
/// Names the file and the line that cannot be used; older files then stay.
pub fn of_run(out: &Path, room_dir: &Path, options: &EventFileOptions) -> Result<()> {
    // A run that cannot be read is named before a folder is made in it.
    let room = Room::read(room_dir)?;
    let lines = jsonl::lines(&out.join("tracks.jsonl"))?;
    // The name is always the same, so that what a killed program has left is replaced.
    let _ = std::fs::remove_dir_all(out.join(BESIDE));
    let beside = tempfile::Builder::new().prefix(BESIDE).rand_bytes(0).tempdir_in(out);
    let beside = beside.map_err(Error::io(out))?;
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
    lines: impl Iterator<Item = mot::Result<FrameLine>>,
    folder: &Path,
    room: &Room,
    room_dir: &Path,
    options: &EventFileOptions,
) -> Result<()> {
    let mut files = EventFiles::new(folder, room, room_dir, options)?;
    for line in lines {
        let _ = files.step(&line?)?;
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
