//! Data of the page, read from the run, its room and the truth.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use image::RgbImage;
use mot::eval::{EvalOptions, Evaluation, align};
use mot::jsonl::{FrameLine, PersonLine};
use mot::rows::RowFile;
use nalgebra::Point2;
use scenes::room::Room;

use super::thinning::{MOST_ESTIMATES, ThinnedFrames};
use super::{ReportSources, belonging};
use crate::events::stats::DayStats;
use crate::events::{self, EventFileOptions};
use crate::silhouette::{Body, contour};
use crate::tracks::Timings;
use crate::{Error, Result, TrackId};

/// Trajectory of a person, metres on the floor.
pub(super) type Trajectory = Vec<Point2<f64>>;

/// Data of a run.
#[derive(Debug, Clone)]
pub(super) struct RunRecording {
    /// Folder that `tracker run` wrote.
    pub(super) run: PathBuf,
    /// Room directory.
    pub(super) room_dir: PathBuf,
    /// Room.
    pub(super) room: Room,
    /// Cameras that took part, in the room's order.
    pub(super) cameras: Vec<String>,
    /// Estimates of the frames that are shown: every [`Self::every`]-th one.
    pub(super) frames: Vec<FrameLine>,
    /// Distance of two frames that are shown.
    pub(super) every: usize,
    /// Number of all frames of the run.
    pub(super) frame_count: usize,
    /// Time of the last frame of the run, seconds.
    last_s: f64,
    /// Time per stage; `None` for a run that did not finish.
    pub(super) timings: Option<Timings>,
    /// People who came and went, by place.
    pub(super) day: DayStats,
    /// Heat map over the floor plan; `None` where nobody was there.
    pub(super) heat: Option<RgbImage>,
    /// Evaluation against the truth, if that is known.
    pub(super) evaluation: Option<Evaluation>,
    /// True trajectories, in the run's room; stretches without a gap.
    pub(super) truth_paths: Vec<Trajectory>,
}

/// Predicted visibility of a person in a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PersonVisibility {
    /// Visible fraction of the silhouette in the image.
    pub(super) visible: f64,
    /// Whether any part of the body would be in the image without occlusion.
    pub(super) is_in_view: bool,
}

impl RunRecording {
    /// Reads the sources.
    ///
    /// # Errors
    /// Names the file and the place in it.
    pub(super) fn read(sources: &ReportSources) -> Result<Self> {
        let room = Room::read(&sources.room)?;
        let thinned = ThinnedFrames::read(&sources.run.join("tracks.jsonl"), MOST_ESTIMATES)?;
        let ThinnedFrames { kept: frames, every, count: frame_count, last_s, cameras: named } = thinned;
        let timings_path = sources.run.join("timings.json");
        let timings = timings_path.exists().then(|| Timings::read(&timings_path)).transpose()?;
        let took_part = |name: &str| {
            film_path(&sources.run, name).exists()
                || sources.run.join("boxes").join(format!("{name}.txt")).exists()
                || named.contains(name)
        };
        let cameras: Vec<String> =
            room.cameras.iter().map(|c| c.name.clone()).filter(|name| took_part(name)).collect();
        if cameras.is_empty() {
            return Err(Error::content(
                &sources.room,
                "cameras",
                format!("none of them took part in {}; give the room of that run", sources.run.display()),
            ));
        }
        belonging::check(&sources.run, (&named, &frames), &room, &sources.room)?;
        let (day, heat) = events_of(sources)?;
        let (evaluation, truth_paths) = match &sources.truth {
            Some(truth) => {
                let (evaluation, paths) = judge(sources, truth)?;
                (Some(evaluation), paths)
            }
            None => (None, Vec::new()),
        };
        let frames_have_people = frames.iter().any(|frame| !frame.people.is_empty());
        Ok(Self {
            run: sources.run.clone(),
            room_dir: sources.room.clone(),
            room,
            cameras,
            frames,
            every,
            frame_count,
            last_s,
            timings,
            day,
            heat: heat.filter(|_| frames_have_people),
            evaluation,
            truth_paths,
        })
    }

    /// Predicted visibility of a person in a camera.
    pub(super) fn visibility(&self, person: &PersonLine, camera: &str) -> PersonVisibility {
        let visible = person.visible.get(camera).copied().unwrap_or(0.0);
        let body = Body { x_m: person.x, y_m: person.y, radius_m: person.radius, height_m: person.height };
        let is_in_view = visible > 0.0
            || self.room.camera(camera).is_ok_and(|c| contour::bounding_box(&body, &c.camera).is_some());
        PersonVisibility { visible, is_in_view }
    }

    /// First and last time, seconds.
    pub(super) fn span_s(&self) -> (f64, f64) {
        (self.frames.first().map_or(0.0, |frame| frame.time), self.last_s)
    }

    /// Positions and times of each track, by id, in the frames that are shown.
    pub(super) fn tracks(&self) -> BTreeMap<TrackId, Vec<(f64, Point2<f64>)>> {
        let mut tracks: BTreeMap<TrackId, Vec<(f64, Point2<f64>)>> = BTreeMap::new();
        for frame in &self.frames {
            for person in &frame.people {
                tracks.entry(person.id).or_default().push((frame.time, Point2::new(person.x, person.y)));
            }
        }
        tracks
    }

    /// Path of a camera's film, if the run made one.
    pub(super) fn film(&self, camera: &str) -> Option<PathBuf> {
        Some(film_path(&self.run, camera)).filter(|path| path.exists())
    }
}

/// The day and its heat map, from the run's event files; of a run without them, from its tracks.
fn events_of(sources: &ReportSources) -> Result<(DayStats, Option<RgbImage>)> {
    let read = |folder: &Path| -> Result<_> {
        let heat = folder.join(events::HEAT_PICTURE);
        let heat = heat
            .exists()
            .then(|| calib::picture::read(&heat))
            .transpose()?
            .map(image::DynamicImage::into_rgb8);
        Ok((DayStats::read(folder)?, heat))
    };
    if events::are_in(&sources.run) {
        return read(&sources.run);
    }
    let folder = tempfile::tempdir().map_err(Error::io(&std::env::temp_dir()))?;
    events::derive(&sources.run, folder.path(), &sources.room, &EventFileOptions::default())?;
    read(folder.path())
}

fn film_path(run: &Path, camera: &str) -> PathBuf {
    run.join("overlay").join(format!("{camera}.mp4"))
}

/// Evaluation, and true trajectories.
fn judge(sources: &ReportSources, truth: &Path) -> Result<(Evaluation, Vec<Trajectory>)> {
    let alignment = match &sources.truth_room {
        Some(truth_room) => Some(align::between(truth_room, &sources.room)?),
        None => None,
    };
    let room_from_truth = alignment.as_ref().map(|a| a.truth_from_room.inverse());
    let (truth, tracks) = (RowFile::read(truth)?, RowFile::read(&sources.run.join("tracks.txt"))?);
    let mut by_person: BTreeMap<u32, Vec<(u32, Point2<f64>)>> = BTreeMap::new();
    for row in truth.rows.iter().filter(|r| r.confidence != 0.0) {
        if let (Some(id), Some(position)) = (row.id, row.position) {
            let place = room_from_truth.map_or(position, |t| t * position);
            by_person.entry(id).or_default().push((row.frame, place));
        }
    }
    let mut paths = Vec::new();
    for mut places in by_person.into_values() {
        places.sort_by_key(|(frame, _)| *frame);
        let stretches = places.chunk_by(|a, b| b.0 - a.0 <= 2);
        paths.extend(stretches.map(|s| s.iter().map(|(_, place)| *place).collect()));
    }
    let evaluation = Evaluation::of_rows(&truth, &tracks, &EvalOptions::default(), alignment)?;
    Ok((evaluation, paths))
}
