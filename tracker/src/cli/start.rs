//! `--start`: the time of day at which a run's time is zero.

use std::path::Path;
use std::str::FromStr;
use std::time::SystemTime;

use anyhow::{Context, bail};

use crate::events::Clock;
use crate::source::NamedSource;

/// Source of the time of day.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    Given(Clock),
    /// The first video's time of recording.
    File,
    /// The system's time.
    Now,
}

impl FromStr for Start {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "file" => Ok(Self::File),
            "now" => Ok(Self::Now),
            text => Clock::parse(text).map(Self::Given).map_err(|e| format!("{e}; or `file`, or `now`")),
        }
    }
}

impl Start {
    pub(super) fn clock(self, videos: &[NamedSource]) -> anyhow::Result<Clock> {
        match self {
            Self::Given(clock) => Ok(clock),
            Self::Now => Ok(Clock::of_system(SystemTime::now())),
            Self::File => match videos.first() {
                Some(video) if Path::new(&video.spec).is_file() => of_file(Path::new(&video.spec)),
                Some(video) => bail!("file: {} is no file; give the time itself, or `now`", video.spec),
                None => bail!("file: there is no --video; give the time itself"),
            },
        }
    }
}

/// Time at which a file was recorded: its container's, else the file system's.
fn of_file(path: &Path) -> anyhow::Result<Clock> {
    if let Some(text) = calib::video::creation_time(path)?
        && let Ok(clock) = Clock::parse(&text)
    {
        return Ok(clock);
    }
    let metadata = path.metadata().with_context(|| path.display().to_string())?;
    let made = metadata.created().or_else(|_| metadata.modified());
    let clock = Clock::of_system(made.with_context(|| path.display().to_string())?);
    tracing::warn!(
        "--start file: {} states no time of recording; its file was made at {}, which a copy changes",
        path.display(),
        clock.at(0.0)
    );
    Ok(clock)
}
