//! Construction of stations from opened sources: backgrounds, observers, and their demands.

use std::path::Path;

use anyhow::{Context, bail};
use calib::video::FrameSource;
use image::RgbImage;
use rayon::prelude::*;

use super::background::BackgroundArguments;
use crate::Error;
use crate::doctor::views::EmptyScene;
use crate::film::FilmOptions;
use crate::foreground::health::Health;
use crate::foreground::{Foreground, InitialBackground};
use crate::method::Needs;
use crate::prepared_room::{PreparedCamera, PreparedRoom};
use crate::source::{CameraSource, CaptureTimes, Detections, VideoSource};
use crate::station::{
    LiveBoxStation, LiveStation, Masks, Observer, Pace, PictureDemand, PoseFollower, RecordedStation,
    Station, Work,
};

/// Options of the films or the page, and the demand for their pictures.
#[derive(Clone)]
pub(super) struct Drawing<'a> {
    pub(super) looks: &'a FilmOptions,
    pub(super) demand: PictureDemand,
}

/// Builder of a run's stations.
pub(super) struct StationBuilder<'a> {
    pub(super) room: &'a PreparedRoom,
    pub(super) background: &'a BackgroundArguments,
    pub(super) needs: Needs,
    pub(super) drawing: Drawing<'a>,
    /// Playback speed of recordings: beside live cameras the recorded speed.
    pub(super) pace: Pace,
    /// Folder of the run, for the pose of a camera that turns; `None` where nothing is written.
    pub(super) out: Option<&'a Path>,
}

/// A station and its empty scene.
pub(super) struct Built {
    pub(super) station: Station,
    /// Empty scene of its camera, in the pinhole image, if the method needs it and it is known.
    pub(super) empty_scene: Option<RgbImage>,
    /// Empty scene that a recording's background begins with, as it was filmed but for its size.
    pub(super) backdrop: Option<EmptyScene>,
}

impl StationBuilder<'_> {
    /// Builds the stations in the sources' order; backgrounds are learnt in parallel.
    pub(super) fn build(
        &self,
        sources: Vec<CameraSource>,
        times: Vec<CaptureTimes>,
    ) -> anyhow::Result<Vec<Built>> {
        let made: Vec<anyhow::Result<Built>> =
            sources.into_par_iter().zip(times).map(|(source, times)| self.station(source, times)).collect();
        // All are built before the first failure is reported, so that it is the first camera's.
        made.into_iter().collect()
    }

    fn station(&self, source: CameraSource, times: CaptureTimes) -> anyhow::Result<Built> {
        let rate_hz = source.rate().or_else(|| (!source.is_live()).then(|| times.mean_rate()));
        let film = source.sources().next().map_or(String::new(), |video| video.name().to_owned());
        let CameraSource { name, video, masks, detections } = source;
        let masks = masks.filter(|_| self.needs.masks);
        if self.needs.pictures && video.is_none() {
            let problem = format!("camera `{name}` has no pictures; give --video {name}=PATH");
            return Err(Error::option("--video", problem).into());
        }
        let camera = self.room.camera_index(&name);
        let of_stage = camera.map(|i| &self.room.cameras[i]);
        let of_stage = of_stage.with_context(|| format!("the room has no camera `{name}`"))?;
        let size = of_stage.real_size();
        let filmed_size = (of_stage.filmed.intrinsics.width, of_stage.filmed.intrinsics.height);
        if masks.is_some() && matches!(video, Some(VideoSource::Live(_))) {
            let problem = format!(
                "camera `{name}` is a stream, whose frames no file of masks belongs to; leave one out"
            );
            return Err(Error::option("--masks", problem).into());
        }
        if detections.is_some() && matches!(video, Some(VideoSource::Live(_))) {
            let problem =
                format!("camera `{name}` is a stream, whose frames no boxes belong to; leave one out");
            return Err(Error::option("--detections", problem).into());
        }
        if matches!(detections, Some(Detections::Live(_))) && (video.is_some() || masks.is_some()) {
            let problem = format!(
                "camera `{name}` has a pipe of boxes beside a recording, whose frames they do not belong to; leave \
                 one out, or give --rate or --times to read the pipe to its end"
            );
            return Err(Error::option("--detections", problem).into());
        }
        let is_subtracted = self.needs.masks && masks.is_none();
        let mut after_turn = None;
        let start = match &video {
            Some(video) if is_subtracted || self.needs.empty_scene => {
                let lens = Some(&of_stage.real.intrinsics);
                let learnt = self.background.starts(&name, video, filmed_size, size, lens)?;
                after_turn = learnt.after_turn;
                match learnt.before_turn {
                    InitialBackground::Nothing(kind) if self.background.is_auto() => {
                        let reference =
                            of_stage.reference.as_deref().and_then(|path| reference(path, of_stage));
                        let of_reference =
                            |picture| InitialBackground::Reference { camera: name.clone(), picture };
                        Some(reference.map_or(InitialBackground::Nothing(kind), of_reference))
                    }
                    start => Some(start),
                }
            }
            _ => None,
        };
        let made = match (&masks, &start) {
            (Some(masks), _) => Masks::ready(masks.name()),
            (None, Some(start)) if is_subtracted => {
                let options = self.background.options();
                Masks::Subtracted(Box::new(Foreground::new(size.0, size.1, start.clone(), options)?))
            }
            _ => Masks::Unneeded(Health::default()),
        };
        let record = self.out.map(|out| out.join(format!("moved_{name}.toml")));
        let observer = Observer::new(self.room, &name, made, self.needs)?
            .with_pose_watch(PoseFollower::new(of_stage, record).with_scene(after_turn));
        let drawn = (self.drawing.looks.panel_px(of_stage), self.drawing.demand.clone());
        let work = match (video, detections) {
            (_, Some(Detections::Live(source))) => {
                Work::LiveBoxes(Box::new(LiveBoxStation { source, observer }))
            }
            (Some(VideoSource::Live(source)), _) => {
                Work::Live(Box::new(LiveStation { source, observer, filmed_size, drawn }))
            }
            (video, detections) => {
                let detections = match detections {
                    Some(Detections::Recorded(boxes)) => Some(boxes),
                    _ => None,
                };
                let video = video.and_then(|video| match video {
                    VideoSource::Recorded(source) => Some(source),
                    VideoSource::Live(_) => None,
                });
                let pace = self.pace;
                Work::Recorded(Box::new(RecordedStation {
                    video,
                    masks,
                    detections,
                    times,
                    observer,
                    drawn,
                    pace,
                }))
            }
        };
        let empty = start.as_ref().and_then(InitialBackground::empty_scene);
        let backdrop = empty.filter(|_| of_stage.reference.is_some()).map(|scene| EmptyScene {
            camera: name.clone(),
            film,
            picture: scene.picture.clone(),
        });
        let empty_scene =
            empty.filter(|_| self.needs.empty_scene).map(|scene| of_stage.undistort.image(&scene.picture));
        Ok(Built { station: Station { name, rate_hz, work }, empty_scene, backdrop })
    }
}

/// The room's reference picture of a camera at the working size; `None`, with a warning, where it cannot be used.
fn reference(path: &Path, camera: &PreparedCamera) -> Option<RgbImage> {
    read_reference(path, camera)
        .inspect_err(|error| {
            tracing::warn!("camera `{}`: its background is learnt without a picture: {error:#}", camera.name);
        })
        .ok()
}

fn read_reference(path: &Path, camera: &PreparedCamera) -> anyhow::Result<RgbImage> {
    let spec = path.to_str().with_context(|| format!("{}: is no UTF-8", path.display()))?;
    let mut source = FrameSource::open(spec)?;
    let (filmed, (width, height)) = (&camera.filmed.intrinsics, source.size());
    if (width, height) != (filmed.width, filmed.height) {
        bail!("{spec}: is {width} × {height} pixels, the camera films {} × {}", filmed.width, filmed.height);
    }
    let (width, height) = camera.real_size();
    let mut picture = RgbImage::new(width, height);
    source.advance()?;
    source.picture(&mut picture)?;
    Ok(picture)
}
