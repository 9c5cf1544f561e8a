//! Options of the frames' capture times.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::bail;
use calib::video::FrameSource;
use clap::Args;
use shell::ranges::TIME_S;

use crate::gathering::ClockAlignment;
use crate::source::times::DEFAULT_RATE;
use crate::source::{CameraSource, CaptureTimes, Times};

#[derive(Debug, Args)]
#[command(next_help_heading = "Times")]
pub(super) struct ClockArguments {
    /// Capture times of the frames, seconds, a line a frame. FILE for all cameras; NAME=FILE for one, may be repeated
    #[arg(long, value_name = "[NAME=]FILE", conflicts_with = "rate")]
    times: Vec<String>,
    /// Frame rate of all cameras, frames a second, where the sources state none (default then: 25) or a wrong one
    #[arg(long)]
    rate: Option<f64>,
    /// Time from the other cameras' first frame to this camera's, seconds (negative: earlier); may be repeated. auto:
    /// estimated from the people that several cameras see, up to 3 s between recordings, and up to 0.5 s live
    #[arg(long, value_name = "NAME=SECONDS|auto", allow_hyphen_values = true)]
    offset: Vec<Offset>,
}

/// `NAME=SECONDS`, or `auto`.
#[derive(Debug, Clone, PartialEq)]
enum Offset {
    Auto,
    Seconds(GivenOffset),
}

#[derive(Debug, Clone, PartialEq)]
struct GivenOffset {
    camera: String,
    seconds: f64,
}

impl FromStr for Offset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let Some((camera, seconds)) = text.split_once('=').filter(|(camera, _)| !camera.is_empty()) else {
            return Err(format!(
                "`{text}` is neither NAME=SECONDS, with a camera's name before the `=`, nor auto"
            ));
        };
        match seconds.parse() {
            Ok(seconds) if TIME_S.contains(seconds) => {
                Ok(Self::Seconds(GivenOffset { camera: camera.to_owned(), seconds }))
            }
            _ => Err(format!("`{seconds}` is no time; give {TIME_S}, as in {camera}=1.25")),
        }
    }
}

impl ClockArguments {
    /// Whether no option decides the times.
    pub(super) fn is_default(&self) -> bool {
        self.times.is_empty() && self.rate.is_none() && self.offset.is_empty()
    }

    /// Whether the frames' times are given.
    pub(super) fn are_given(&self) -> bool {
        !self.times.is_empty() || self.rate.is_some()
    }

    /// Whether the offsets are to be estimated from the people seen.
    pub(super) fn is_auto(&self) -> bool {
        self.offset.contains(&Offset::Auto)
    }

    /// Files of the capture times.
    pub(super) fn paths(&self) -> impl Iterator<Item = PathBuf> {
        self.times.iter().flat_map(|text| {
            let of_camera = text.split_once('=').map(|(_, path)| PathBuf::from(path));
            [Some(PathBuf::from(text)), of_camera].into_iter().flatten()
        })
    }

    fn given_offsets(&self) -> impl Iterator<Item = &GivenOffset> {
        self.offset.iter().filter_map(|offset| match offset {
            Offset::Seconds(given) => Some(given),
            Offset::Auto => None,
        })
    }

    /// The given alignments of the cameras with these names.
    pub(super) fn alignments(&self, names: &[&str]) -> anyhow::Result<Vec<ClockAlignment>> {
        let given: Vec<&GivenOffset> = self.given_offsets().collect();
        for (i, offset) in given.iter().enumerate() {
            let GivenOffset { camera, seconds } = offset;
            if !names.contains(&camera.as_str()) {
                bail!("--offset {camera}={seconds}: no source has that name; there are {}", names.join(", "));
            }
            if given[..i].iter().any(|earlier| earlier.camera == *camera) {
                bail!("--offset {camera}={seconds}: the camera already has one; give each camera once");
            }
        }
        let offset_s = |name: &&str| given.iter().find(|o| o.camera == **name).map_or(0.0, |o| o.seconds);
        Ok(names
            .iter()
            .map(|name| ClockAlignment { offset_s: offset_s(name), ..ClockAlignment::default() })
            .collect())
    }

    /// Refuses an offset, which must be given to the gatherer.
    pub(super) fn refuse_offsets(&self) -> anyhow::Result<()> {
        if !self.offset.is_empty() {
            bail!("--offset: a station has its camera's own clock; give it to `tracker run --stations`");
        }
        Ok(())
    }

    /// Capture times and alignment of each source.
    pub(super) fn clocks(&self, sources: &[CameraSource]) -> anyhow::Result<Clocks> {
        let names: Vec<&str> = sources.iter().map(|s| s.name.as_str()).collect();
        let alignments = self.alignments(&names)?;
        let is_camera = |name: &str| names.contains(&name);
        // A file's name may contain `=`, too.
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
        let (mut times, mut files) = (Vec::new(), Vec::new());
        for source in sources {
            let name = source.sources().next().map_or(source.name.as_str(), FrameSource::name);
            let file = match (own_file(&source.name)?, &common) {
                (Some(path), _) => Some(Times::read(&path)?),
                (None, common) => common.clone(),
            };
            if source.is_live() && file.is_some() {
                bail!("--times: camera `{}` is live, its frames have no lines; leave it out", source.name);
            }
            if source.is_live() && self.rate.is_some() {
                tracing::warn!("--rate: camera `{}` is live, and timed as its frames come", source.name);
            }
            files.push(file.clone());
            let given = match file {
                Some(file) => Some(file),
                None => self.rate.map(Times::steady).transpose()?,
            };
            times.push(match (given, source.rate()) {
                (Some(given), _) => CaptureTimes::given(name, given),
                (None, Some(rate_hz)) => CaptureTimes::presentation(name, rate_hz),
                (None, None) => {
                    if !source.is_live() {
                        tracing::warn!(
                            "{} does not say its frame rate; taking {DEFAULT_RATE} frames/s (--rate or --times decide \
                             otherwise)",
                            source.name
                        );
                    }
                    CaptureTimes::given(name, Times::steady(DEFAULT_RATE)?)
                }
            });
        }
        let clocks = Clocks { times, alignments };
        clocks.check_files(sources, &files)?;
        Ok(clocks)
    }
}

/// Capture times of each source, on its own clock, and the alignments between the clocks.
pub(super) struct Clocks {
    times: Vec<CaptureTimes>,
    alignments: Vec<ClockAlignment>,
}

impl Clocks {
    /// Frame rate of the fastest source, frames a second.
    pub(super) fn lead_rate(&self) -> f64 {
        self.times.iter().map(CaptureTimes::mean_rate).fold(0.0, f64::max)
    }

    /// Approximate number of moments; `None` where it cannot be known.
    pub(super) fn moments(&self, sources: &[CameraSource]) -> Option<usize> {
        let mut shortest_s = f64::INFINITY;
        for (source, times) in sources.iter().zip(&self.times) {
            shortest_s = shortest_s.min(source.frame_count()? as f64 / times.mean_rate());
        }
        Some((shortest_s * self.lead_rate()).round() as usize)
    }

    /// Checks that every file of times has a line for every frame of the run. A file may end early where the run does.
    fn check_files(&self, sources: &[CameraSource], files: &[Option<Times>]) -> anyhow::Result<()> {
        let mut end_s = f64::INFINITY;
        let mut short = Vec::new();
        for (camera, (source, file)) in sources.iter().zip(files).enumerate() {
            let Some(frames) = source.frame_count().filter(|frames| *frames > 0) else { continue };
            let last_s = match file {
                Some(file) if file.check_count(frames).is_err() => {
                    short.push((camera, file, frames));
                    continue;
                }
                // A header may promise a few frames more than there are lines.
                Some(file) => file.of(u32::try_from(frames)?).ok().or(file.end_s()).unwrap_or(f64::INFINITY),
                None => (frames - 1) as f64 / self.times[camera].mean_rate(),
            };
            end_s = end_s.min(last_s + self.alignments[camera].offset_s);
        }
        for (camera, file, frames) in short {
            let file_end_s = file.end_s().unwrap_or(f64::INFINITY) + self.alignments[camera].offset_s;
            if file_end_s < end_s {
                file.check_count(frames)?;
            }
        }
        Ok(())
    }

    /// Times and alignments, one of each for every source.
    pub(super) fn into_parts(self) -> (Vec<CaptureTimes>, Vec<ClockAlignment>) {
        (self.times, self.alignments)
    }
}
