//! Days of the calendar, UTC, and folders that are named by them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::SystemTime;

use crate::events::{civil_from_days, days_from_civil};
use crate::source::utc_s;
use crate::{Error, Result};

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// A day, UTC: days since 1970-01-01. Written as `2026-11-27`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Day(i64);

impl Day {
    /// The day of a time, seconds since 1970.
    pub fn of(utc_s: f64) -> Self {
        Self((utc_s / DAY_S).floor() as i64)
    }

    /// The present day.
    pub fn today() -> Self {
        Self::of(utc_s(SystemTime::now()))
    }

    /// Its beginning, seconds since 1970.
    pub fn begin_s(self) -> f64 {
        self.0 as f64 * DAY_S
    }

    /// The day so many days before this one.
    #[must_use]
    pub fn before(self, days: u32) -> Self {
        Self(self.0 - i64::from(days))
    }

    /// Folder of the day in a folder of days.
    pub fn folder(self, out: &Path) -> PathBuf {
        out.join(self.to_string())
    }
}

impl fmt::Display for Day {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (year, month, day) = civil_from_days(self.0);
        write!(f, "{year:04}-{month:02}-{day:02}")
    }
}

impl FromStr for Day {
    type Err = ();

    /// Reads exactly what is written: `2026-11-27`.
    fn from_str(text: &str) -> std::result::Result<Self, ()> {
        let mut parts = text.split('-').map(|part| part.parse::<i64>().map_err(drop));
        let mut next = || parts.next().unwrap_or(Err(()));
        let (year, month, day) = (next()?, next()?, next()?);
        if !((0..10_000).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day)) {
            return Err(());
        }
        let found = Self(days_from_civil(year, month, day));
        // A date that the calendar does not have, or another way of writing, is another text.
        if found.to_string() == text { Ok(found) } else { Err(()) }
    }
}

/// Days that have a folder in `out`, ascending.
///
/// # Errors
/// A folder that cannot be read; one that does not exist has no days.
pub(super) fn days_in(out: &Path) -> Result<Vec<Day>> {
    let entries = match std::fs::read_dir(out) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(Error::io(out)(e)),
    };
    let mut days = Vec::new();
    for entry in entries {
        let entry = entry.map_err(Error::io(out))?;
        // A link may lead anywhere: it is not of this program.
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        days.extend(
            entry.file_name().to_str().filter(|_| is_folder).and_then(|name| name.parse::<Day>().ok()),
        );
    }
    days.sort_unstable();
    Ok(days)
}

/// Removes the folders of days before `first` in `out`, or of each only the entries whose names begin with `prefix`.
/// Everything whose name is no date stays. Returns the days.
///
/// # Errors
/// The first folder that cannot be read or removed; the others are removed all the same.
pub fn remove_older(out: &Path, first: Day, prefix: Option<&str>) -> Result<Vec<Day>> {
    let mut removed = Vec::new();
    let mut failed = Ok(());
    for day in days_in(out)?.into_iter().filter(|day| *day < first) {
        let folder = day.folder(out);
        let done = match prefix {
            None => std::fs::remove_dir_all(&folder).map(|()| true).map_err(Error::io(&folder)),
            Some(prefix) => remove_entries(&folder, prefix),
        };
        match done {
            Ok(true) => removed.push(day),
            Ok(false) => {}
            Err(error) => failed = failed.and(Err(error)),
        }
    }
    failed.map(|()| removed)
}

/// Removes the folders in `folder` whose names begin with `prefix`; returns whether there were some.
fn remove_entries(folder: &Path, prefix: &str) -> Result<bool> {
    let mut any = false;
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let entry = entry.map_err(Error::io(folder))?;
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_folder && entry.file_name().to_string_lossy().starts_with(prefix) {
            std::fs::remove_dir_all(entry.path()).map_err(Error::io(&entry.path()))?;
            any = true;
        }
    }
    Ok(any)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        // `date -u -d @1700000000`: 2023-11-14 22:13:20.
        let day = Day::of(1_700_000_000.0);
        assert_eq!((day.to_string(), "2023-11-14".parse()), ("2023-11-14".to_owned(), Ok(day)));
        assert!((day.begin_s() - (1_700_000_000.0 - 22.0 * 3600.0 - 13.0 * 60.0 - 20.0)).abs() < 1e-6);
        assert_eq!(Day::of(day.begin_s() - 0.001).to_string(), "2023-11-13");
        assert_eq!("2024-03-01".parse::<Day>().unwrap().before(1).to_string(), "2024-02-29");
        for text in
            ["2023-02-29", "2023-1-1", "23-01-01", "2023-13-01", "film", "2023-11-14-", "", "+2023-11-14"]
        {
            assert_eq!(text.parse::<Day>(), Err(()), "{text}");
        }
    }

    #[test]
    fn only_dated_folders_before_the_first_day_are_removed() {
        let out = tempfile::tempdir().unwrap();
        let made = |name: &str| {
            let folder = out.path().join(name).join("film-101530/overlay");
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(folder.join("cam0.mp4"), "x").unwrap();
        };
        for name in ["2026-11-01", "2026-11-20", "2026-11-26", "2026-11-27", "2026-1-1", "mine"] {
            made(name);
        }
        std::fs::write(out.path().join("2026-11-02"), "a file").unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink(elsewhere.path(), out.path().join("2026-11-03")).unwrap();
        let day = |text: &str| text.parse::<Day>().unwrap();
        let films = remove_older(out.path(), day("2026-11-26"), Some("film-")).unwrap();
        assert_eq!(films, [day("2026-11-01"), day("2026-11-20")]);
        assert!(
            out.path().join("2026-11-20").is_dir() && !out.path().join("2026-11-20/film-101530").exists()
        );
        assert_eq!(remove_older(out.path(), day("2026-11-20"), None).unwrap(), [day("2026-11-01")]);
        let mut names: Vec<String> = std::fs::read_dir(out.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        let left = ["2026-1-1", "2026-11-02", "2026-11-03", "2026-11-20", "2026-11-26", "2026-11-27", "mine"];
        assert_eq!(names, left);
        assert_eq!(remove_older(&out.path().join("missing"), day("2026-11-20"), None).unwrap(), []);
    }
}
