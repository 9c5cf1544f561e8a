//! Pictures of single frames: from the film, or drawn on the reference image where no film was made.

use std::path::Path;
use std::sync::Arc;

use calib::video::FrameSource;
use image::RgbImage;
use image::imageops::{self, FilterType};
use mot::jsonl::{FrameLine, PersonLine};

use super::recording::RunRecording;
use crate::film::{FilmOptions, Painter, Shot};
use crate::prepared_room::{PreparationOptions, PreparedRoom};
use crate::{PersonEstimate, Result};

/// One picture for each of `wanted` (increasing indices of frames), as far as the film reaches.
///
/// # Errors
/// A film or reference image that exists but cannot be read.
pub(super) fn stills(
    recording: &RunRecording,
    camera: &str,
    wanted: &[usize],
) -> Result<Vec<(usize, RgbImage)>> {
    match recording.film(camera) {
        Some(film) => {
            // The film has all frames.
            let filmed: Vec<usize> = wanted.iter().map(|index| index * recording.every).collect();
            let stills = from_film(&film.display().to_string(), &filmed)?;
            Ok(stills.into_iter().map(|(index, picture)| (index / recording.every, picture)).collect())
        }
        None => drawn(recording, camera, wanted),
    }
}

fn from_film(film: &str, wanted: &[usize]) -> Result<Vec<(usize, RgbImage)>> {
    let mut source = FrameSource::open(film)?;
    let (width, height) = source.size();
    let mut picture = RgbImage::new(width, height);
    let mut stills = Vec::new();
    let mut index = 0;
    for frame in wanted {
        while index < *frame && source.skip() {
            index += 1;
        }
        // A film may end early when its run was stopped.
        if index < *frame || !source.read(&mut picture)? {
            break;
        }
        stills.push((index, picture.clone()));
        index += 1;
    }
    Ok(stills)
}

fn drawn(recording: &RunRecording, camera: &str, wanted: &[usize]) -> Result<Vec<(usize, RgbImage)>> {
    let options = PreparationOptions { cameras: vec![camera.to_owned()], ..PreparationOptions::default() };
    let room = PreparedRoom::prepare(&recording.room, &recording.room_dir, &options)?;
    let reference = recording.room.camera(camera)?.reference.as_ref();
    let image = match reference.map(|r| recording.room_dir.join(r)).filter(|path| path.exists()) {
        Some(path) => Some(picture(&path)?),
        None => None,
    };
    let options = FilmOptions::default();
    let (width, height) = options.panel_px(&room.cameras[0]);
    let image = image.map(|image| Arc::new(imageops::resize(&image, width, height, FilterType::Triangle)));
    let shot = Shot { image, mask: None };
    let mut painter = Painter::new(&room, 0, &options);
    let paint = |index: &usize| {
        let frame = recording.frames.get(*index)?;
        Some((*index, painter.paint(frame.frame, frame.time, &shot, &estimates(frame, camera))))
    };
    Ok(wanted.iter().filter_map(paint).collect())
}

fn picture(path: &Path) -> Result<RgbImage> {
    Ok(calib::picture::read(path)?.into_rgb8())
}

/// Estimates of a line for one camera's painter.
fn estimates(frame: &FrameLine, camera: &str) -> Vec<PersonEstimate> {
    let estimate = |person: &PersonLine| PersonEstimate {
        id: person.id,
        x_m: person.x,
        y_m: person.y,
        z_m: 0.0,
        radius_m: person.radius,
        height_m: person.height,
        vx: person.vx,
        vy: person.vy,
        sigma_m: person.sigma,
        confidence: person.confidence,
        visible: vec![person.visible.get(camera).copied().unwrap_or(0.0)],
    };
    frame.people.iter().map(estimate).collect()
}
