//! Outputs of a run that lasts: a folder a day, ids and frames that go on over the ends of runs.

use std::path::Path;
use std::time::SystemTime;

use scenes::room::Room;

use super::{Day, RoomJournal};
use crate::events::Clock;
use crate::film::Film;
use crate::run::{Output, ProcessedMoment};
use crate::source::utc_s;
use crate::{Moment, Result};

/// Builder of the outputs that write into the folder of a day.
pub type BeginOutputs<'a> = Box<dyn FnOnce(&Path) -> Result<Vec<Box<dyn Output + 'a>>> + 'a>;

/// Outputs of a room, and the folder of the day.
///
/// Times of moments become seconds since the room's zero, a midnight (UTC) that stays the same, and frames go on where
/// the run before ended: files of one folder, and of several, never contradict each other.
pub struct DailyOutputs<'a> {
    journal: RoomJournal,
    /// Builder of the outputs; `None` once they have begun, with the first moment.
    begin: Option<BeginOutputs<'a>>,
    outputs: Vec<Box<dyn Output + 'a>>,
    day: Option<Day>,
}

impl<'a> DailyOutputs<'a> {
    /// Outputs in the journal's folder. `begin` makes them for the first day's folder.
    pub fn new(journal: RoomJournal, begin: BeginOutputs<'a>) -> Self {
        Self { journal, begin: Some(begin), outputs: Vec::new(), day: None }
    }

    /// Goes on in the folder of the day, if it is another one.
    fn reach(&mut self, day: Day) -> Result<()> {
        if self.day == Some(day) {
            return Ok(());
        }
        let folder = day.folder(self.journal.out());
        if let Some(begin) = self.begin.take() {
            self.outputs = begin(&folder)?;
        } else {
            tracing::info!("a new day: {}", folder.display());
            self.outputs.iter_mut().try_for_each(|output| output.move_to(&folder))?;
        }
        self.day = Some(day);
        Ok(())
    }
}

impl Output for DailyOutputs<'_> {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let now_s = followed.utc_s.unwrap_or_else(|| utc_s(SystemTime::now()));
        // A clock that is set back does not open an earlier day again.
        let day = self.day.map_or(Day::of(now_s), |day| day.max(Day::of(now_s)));
        self.reach(day)?;
        self.journal.use_ids(followed.people)?;
        let moment = Moment {
            frame: followed.moment.frame.saturating_add(self.journal.next_frame() - 1),
            time_s: now_s - self.journal.zero_s(),
            ..followed.moment
        };
        let followed = ProcessedMoment { moment, ..*followed };
        self.outputs.iter_mut().try_for_each(|output| output.put(&followed))
    }

    fn replace_room(&mut self, room: &Room) -> Result<()> {
        self.outputs.iter_mut().try_for_each(|output| output.replace_room(room))
    }

    fn finish(self: Box<Self>) -> Result<()> {
        let mut finished = Ok(());
        for output in self.outputs {
            finished = finished.and(output.finish());
        }
        finished.and(self.journal.close())
    }
}

/// Function that starts a film in a folder.
pub type StartFilm<'a> = Box<dyn Fn(&Path) -> Result<Film> + 'a>;

/// Films of a run that lasts: a folder `film-HHMMSS` (UTC) for each start and each day, so that none is overwritten.
pub struct DailyFilm<'a> {
    start: StartFilm<'a>,
    film: Option<Film>,
}

impl<'a> DailyFilm<'a> {
    /// Beginning of the names of the folders.
    pub const PREFIX: &'static str = "film-";

    /// Films in the folder of a day; `start` starts them in a folder.
    ///
    /// # Errors
    /// Films that cannot be written.
    pub fn new(folder: &Path, start: StartFilm<'a>) -> Result<Self> {
        let film = Some(start(&Self::folder(folder))?);
        Ok(Self { start, film })
    }

    /// Completes the films in the folder of a day that a killed run has left, and tells of those that it cannot.
    pub fn complete(folder: &Path) {
        let entries = |folder: &Path| std::fs::read_dir(folder).into_iter().flatten().flatten();
        let starts =
            entries(folder).filter(|entry| entry.file_name().to_string_lossy().starts_with(Self::PREFIX));
        for film in starts.flat_map(|start| entries(&start.path().join("overlay"))) {
            if let Err(error) = calib::video::complete_film(&film.path()) {
                tracing::warn!("{error}");
            }
        }
    }

    fn folder(folder: &Path) -> std::path::PathBuf {
        let now = Clock::of_system(SystemTime::now()).at(0.0);
        // 2026-11-27T10:15:30.000Z.
        let time: String = now.chars().skip(11).take(8).filter(|c| *c != ':').collect();
        folder.join(format!("{}{time}", Self::PREFIX))
    }
}

impl Output for DailyFilm<'_> {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        self.film.as_mut().map_or(Ok(()), |film| Output::put(film, followed))
    }

    fn move_to(&mut self, folder: &Path) -> Result<()> {
        let finished = self.film.take().map_or(Ok(()), Film::finish);
        self.film = Some((self.start)(&Self::folder(folder))?);
        finished
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.film.map_or(Ok(()), Film::finish)
    }
}
