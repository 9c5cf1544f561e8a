//! Options of background subtraction, shared by the subcommands that need it.

use std::path::{Path, PathBuf};

use anyhow::bail;
use calib::Intrinsics;
use calib::video::FrameSource;
use calib::vision::AdaptiveKind;
use clap::Args;
use image::RgbImage;
use shell::ranges::INTERVAL_S;

use shell::files::paths_of;

use crate::Error;
use crate::doctor::pose_watch::pictures_before_turn;
use crate::foreground::backdrop::Backdrop;
use crate::foreground::lights::{self, LEAST_FRAMES};
use crate::foreground::{ForegroundOptions, InitialBackground};
use crate::source::{NamedSource, VideoSource, sampling};

/// Source of the background.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Choice {
    Auto,
    Median,
    Adaptive(AdaptiveKind),
    Clip(NamedSource),
}

fn parse(text: &str) -> Result<Choice, String> {
    Ok(match text {
        "auto" => Choice::Auto,
        "median" => Choice::Median,
        "online" | "mog2" => Choice::Adaptive(AdaptiveKind::Mog2),
        "knn" => Choice::Adaptive(AdaptiveKind::Knn),
        _ => Choice::Clip(
            text.parse()
                .map_err(|_| format!("`{text}` is none of auto, median, online, mog2, knn, NAME=PATH"))?,
        ),
    })
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Foreground")]
pub(super) struct BackgroundArguments {
    /// Background model: the recording's own median over time, in each of its lights (median), a model learnt during the
    /// run by OpenCV (online = mog2, knn), or a clip or picture of the empty room for one camera (NAME=PATH, may be
    /// repeated). auto: median for recordings; online for streams, starting from the room's reference picture of the
    /// camera if there is one
    #[arg(long, value_parser = parse, default_value = "auto", value_name = "KIND|NAME=PATH")]
    background: Vec<Choice>,
    /// Leave shadows and reflections in the masks
    #[arg(long)]
    keep_shadows: bool,
    /// Do not compensate changes of exposure and white balance
    #[arg(long)]
    no_exposure: bool,
    /// Time after which a thing that stands still becomes background, seconds
    #[arg(long, default_value_t = 120.0, value_name = "SECONDS")]
    absorb: f32,
}

impl BackgroundArguments {
    /// Options of the foreground masks.
    pub(super) fn options(&self) -> ForegroundOptions {
        let mut options = ForegroundOptions { exposure: !self.no_exposure, ..ForegroundOptions::default() };
        options.pixels.absorb_s = self.absorb;
        if self.keep_shadows {
            options.shadows = None;
        }
        options
    }

    /// Files of the empty room.
    pub(super) fn paths(&self) -> impl Iterator<Item = PathBuf> {
        self.background.iter().flat_map(|choice| match choice {
            Choice::Clip(clip) => paths_of(&clip.spec),
            _ => Vec::new(),
        })
    }

    /// Checks that every clip belongs to one of these cameras, none of which has masks already, and that the other
    /// values are valid.
    pub(super) fn check_names(&self, videos: &[NamedSource], masks: &[NamedSource]) -> anyhow::Result<()> {
        if let Some(problem) = INTERVAL_S.defect(f64::from(self.absorb)) {
            bail!("--absorb {problem}");
        }
        let kinds = self.background.iter().filter(|c| !matches!(c, Choice::Clip(_))).count();
        if kinds > 1 {
            bail!("--background: give one kind for all cameras, and NAME=PATH for single ones");
        }
        for choice in &self.background {
            if let Choice::Clip(clip) = choice
                && masks.iter().any(|m| m.name == clip.name)
            {
                bail!(
                    "--background {0}={1}: --masks {0} is there already, and takes the place of a background; leave one out",
                    clip.name,
                    clip.spec
                );
            }
            if let Choice::Clip(clip) = choice
                && !videos.iter().any(|v| v.name == clip.name)
            {
                let names: Vec<&str> = videos.iter().map(|v| v.name.as_str()).collect();
                bail!(
                    "--background {}={}: no --video has that name; there are {}",
                    clip.name,
                    clip.spec,
                    names.join(", ")
                );
            }
        }
        Ok(())
    }

    /// Whether no kind of background was requested.
    pub(super) fn is_auto(&self) -> bool {
        self.background.iter().all(|choice| matches!(choice, Choice::Auto | Choice::Clip(_)))
    }

    /// Initial background of a camera's foreground model, at the size of its masks. A recording is sampled for its
    /// empty scene. `filmed` is the size of the camera's pictures.
    pub(super) fn start(
        &self,
        camera: &str,
        video: &VideoSource,
        filmed: (u32, u32),
        size: (u32, u32),
    ) -> anyhow::Result<InitialBackground> {
        Ok(self.starts(camera, video, filmed, size, None)?.before_turn)
    }

    /// [`Self::start`] of a camera that may turn within its recording; `lens` is that of the masks' size.
    pub(super) fn starts(
        &self,
        camera: &str,
        video: &VideoSource,
        filmed: (u32, u32),
        size: (u32, u32),
        lens: Option<&Intrinsics>,
    ) -> anyhow::Result<Backgrounds> {
        let alone = |before_turn| Backgrounds { before_turn, after_turn: None };
        let recording = match video {
            VideoSource::Recorded(source) if source.is_recording() => Some(source.name()),
            _ => None,
        };
        let clip = self.background.iter().find_map(|choice| match choice {
            Choice::Clip(clip) if clip.name == camera => Some(clip.spec.as_str()),
            _ => None,
        });
        if let Some(clip) = clip {
            let (width, height) = FrameSource::open(clip)?.size();
            if (width, height) != filmed {
                return Err(Error::content(
                    Path::new(clip),
                    "frame 1",
                    format!(
                        "is {width} × {height} pixels, but the images of camera `{camera}` are {} × {}; give --background \
                         {camera} a clip of that size",
                        filmed.0, filmed.1
                    ),
                )
                .into());
            }
            return Ok(alone(learnt(clip, size)?));
        }
        let kind = self.background.iter().find(|c| !matches!(c, Choice::Clip(_))).unwrap_or(&Choice::Auto);
        match (kind, recording) {
            (Choice::Adaptive(kind), _) => Ok(alone(InitialBackground::Nothing(*kind))),
            (_, Some(recording)) => learnt_of_poses(recording, size, lens),
            (Choice::Median, None) => bail!(
                "--background median: camera `{camera}` is a stream; use online, or NAME=PATH with a clip"
            ),
            _ => Ok(alone(InitialBackground::Nothing(AdaptiveKind::default()))),
        }
    }
}

/// Backgrounds of one camera.
pub(super) struct Backgrounds {
    /// Initial background.
    pub(super) before_turn: InitialBackground,
    /// Empty scene after the camera turned, where its recording shows that it does.
    pub(super) after_turn: Option<Backdrop>,
}

/// Background of a recording; where the camera turns in it, one before and one after the turn: the median of both would
/// be neither.
fn learnt_of_poses(
    recording: &str,
    size: (u32, u32),
    lens: Option<&Intrinsics>,
) -> anyhow::Result<Backgrounds> {
    let frames = sampling::spread(recording, size)?;
    let turned_at = match lens {
        Some(lens) => pictures_before_turn(&frames, lens)?,
        None => frames.len(),
    };
    let (before, after) = frames.split_at(turned_at);
    let after_turn = if after.len() >= LEAST_FRAMES { Some(Backdrop::learn(after)?) } else { None };
    let before = if before.len() >= LEAST_FRAMES { before } else { &frames };
    let before_turn = empty_scene(before)?;
    if let InitialBackground::Backdrops(scenes) = &before_turn
        && scenes.len() > 1
    {
        tracing::info!(
            "{recording}: its light changes; {} empty scenes are used, each in its light",
            scenes.len()
        );
    }
    Ok(Backgrounds { before_turn, after_turn })
}

fn learnt(recording: &str, size: (u32, u32)) -> anyhow::Result<InitialBackground> {
    empty_scene(&sampling::spread(recording, size)?)
}

/// Empty scene of frames that are spread over a recording, in each of its lights.
fn empty_scene(frames: &[RgbImage]) -> anyhow::Result<InitialBackground> {
    Ok(InitialBackground::Backdrops(lights::learn(frames)?))
}
