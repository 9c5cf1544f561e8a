//! The options that say when each camera's frames were taken.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::bail;
use clap::Args;
use tracker::source::times::DEFAULT_RATE;
use tracker::source::{CameraSource, Clock, Schedule, Times};

#[derive(Debug, Args)]
#[command(next_help_heading = "Times")]
pub(super) struct ClockArguments {
    /// The time of each frame: seconds, a line a frame. FILE for all cameras; NAME=FILE for one, may be repeated
    #[arg(long, value_name = "[NAME=]FILE", conflicts_with = "rate")]
    times: Vec<String>,
    /// Frames a second of all cameras, where the sources do not say (default then: 25) or say wrong
    #[arg(long)]
    rate: Option<f64>,
    /// A camera's first frame was taken so many seconds after the others' (before them: negative); may be repeated
    #[arg(long, value_name = "NAME=SECONDS", allow_hyphen_values = true)]
    offset: Vec<Offset>,
}

/// `NAME=SECONDS`.
#[derive(Debug, Clone, PartialEq)]
struct Offset {
    camera: String,
    seconds: f64,
}

impl FromStr for Offset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((camera, seconds)) = text.split_once('=').filter(|(camera, _)| !camera.is_empty()) else {
            return Err(format!("`{text}` is not NAME=SECONDS, with a camera's name before the `=`"));
        };
        match seconds.parse() {
            Ok(seconds) if f64::is_finite(seconds) => Ok(Self { camera: camera.to_owned(), seconds }),
            _ => Err(format!("`{seconds}` is no time; give seconds, as in {camera}=1.25")),
        }
    }
}

impl ClockArguments {
    /// When the moments are, and which frames belong to them; a clock for each source.
    pub(super) fn schedule(&self, sources: &[CameraSource]) -> anyhow::Result<Schedule> {
        let is_camera = |name: &str| sources.iter().any(|s| s.name == name);
        let names = || sources.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ");
        for (i, offset) in self.offset.iter().enumerate() {
            let Offset { camera, seconds } = offset;
            if !is_camera(camera) {
                bail!("--offset {camera}={seconds}: no source has that name; there are {}", names());
            }
            if self.offset[..i].iter().any(|earlier| earlier.camera == *camera) {
                bail!("--offset {camera}={seconds}: the camera already has one; give each camera once");
            }
        }
        // A file's name may hold `=`, too.
        let (own, common): (Vec<_>, Vec<_>) = self.times.iter().partition(|text| {
            text.split_once('=').is_some_and(|(name, _)| is_camera(name) && !Path::new(text).exists())
        });
        if common.len() > 1 {
            bail!(
                "--times {}: there is one file for all cameras already; NAME=FILE is for one camera",
                common[1]
            );
        }
        let common = common.first().map(|path| Times::read(Path::new(path))).transpose()?;
        let own_file = |camera: &str| -> anyhow::Result<Option<PathBuf>> {
            let mut files =
                own.iter().filter_map(|text| text.split_once('=')).filter(|(name, _)| *name == camera);
            match (files.next(), files.next()) {
                (_, Some((_, again))) => bail!("--times {camera}={again}: the camera already has a file"),
                (first, None) => Ok(first.map(|(_, path)| PathBuf::from(path))),
            }
        };
        let mut clocks = Vec::new();
        let mut unknown = Vec::new();
        for source in sources {
            let times = match (own_file(&source.name)?, &common, self.rate.or(source.rate())) {
                (Some(path), ..) => Times::read(&path)?,
                (None, Some(common), _) => common.clone(),
                (None, None, rate) => {
                    if rate.is_none() {
                        unknown.push(source.name.as_str());
                    }
                    Times::steady(rate.unwrap_or(DEFAULT_RATE))?
                }
            };
            let offset = self.offset.iter().find(|o| o.camera == source.name);
            clocks.push(Clock { times, offset_s: offset.map_or(0.0, |o| o.seconds) });
        }
        one_rate_where_containers_round(&mut clocks);
        if !unknown.is_empty() {
            tracing::warn!(
                "{} does not say its frame rate; taking {DEFAULT_RATE} frames/s (--rate or --times decide otherwise)",
                unknown.join(", ")
            );
        }
        let schedule = Schedule::new(clocks)?;
        let counts: Vec<Option<usize>> = sources.iter().map(CameraSource::frame_count).collect();
        let moments = schedule.moments(&counts);
        if moments == Some(0) && counts.iter().all(|c| c.is_some_and(|c| c > 0)) {
            bail!(
                "--offset, --times: there is no moment at which all cameras film; leave one out, or mend its offset"
            );
        }
        schedule.check_times(&counts)?;
        if !schedule.is_frame_by_frame() {
            tracing::info!(
                "the cameras differ in rate or start: synchronised by time, at the frames of `{}` from frame {}",
                sources[schedule.lead()].name,
                schedule.first()
            );
        }
        Ok(schedule)
    }
}

/// Rates that containers round differently (29.97 and 30000/1001) are one rate: by the end of an hour they would
/// differ by frames, and frames recorded together would be torn apart.
fn one_rate_where_containers_round(clocks: &mut [Clock]) {
    const SAME: f64 = 1e-3;
    for i in 1..clocks.len() {
        if let (Times::Rate(first), Times::Rate(rate)) = (&clocks[0].times, &clocks[i].times)
            && (rate / first - 1.0).abs() < SAME
        {
            clocks[i].times = clocks[0].times.clone();
        }
    }
}
