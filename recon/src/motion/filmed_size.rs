//! Refinement of a motion by the pictures as they were filmed, where those are larger than the ones that are worked on.
//!
//! Features are followed, and their motion is estimated, at the working size ([`crate::working_size`]). The film is then read once
//! more, picture by picture: each observation of a known point is registered in its filmed picture against the patch of the
//! track's first one, from the place that the working size gives. Patches show the same piece of surface as at the working
//! size, so they have more pixels. Observations that are not found so (of a blurred frame, for example) stay as they are, with
//! the precision that they have beside the refined ones, and the whole is adjusted again.

use nalgebra::{Matrix2, Point2};
use rayon::prelude::*;

use super::partial_reconstruction::{FINAL, PartialReconstruction};
use super::revisit::carried_patch;
use super::two_views::median;
use crate::bundle::LensFreedom;
use crate::capture::{Capture, LargerPictures};
use crate::features::{FeatureOptions, FeatureTrack, FilmedPatch, Warp};
use crate::rolling_shutter::RollingShutter;
use crate::working_size::WorkingSize;
use crate::{Error, Result};

/// Largest distance between a feature's places at the two sizes, pixels of the working size.
const REACH_PX: f64 = 1.0;
/// Rounds of estimating the precision of what was not refined, and of adjustment.
const ROUNDS: usize = 2;
/// Least precision of an observation that was not refined, beside those that were.
const LEAST_PRECISION: f64 = 0.01;

/// One observation of a track.
struct Sighting {
    track: usize,
    /// Index in the track.
    place: usize,
}

/// Patch of a track, and the index of the observation at which it was cut.
#[derive(Clone)]
struct CutPatch {
    patch: FilmedPatch,
    place: usize,
}

/// Refines a polished reconstruction; does nothing where the pictures were worked on as filmed. `readout` as of
/// [`super::readout`].
///
/// # Errors
/// A film that cannot be read again, or that has changed.
pub(super) fn refine(
    partial: &mut PartialReconstruction<'_>,
    capture: &Capture,
    readout: f64,
    lens: LensFreedom,
    options: &FeatureOptions,
) -> Result<()> {
    let Some(LargerPictures { file: film, .. }) = &capture.larger else { return Ok(()) };
    let shutter = RollingShutter::new(readout, &partial.poses, partial.intrinsics.height);
    let search = Search { partial, shutter, size: film.size(), options };
    let mut sightings = search.sightings(capture.frames.len());
    let mut patches: Vec<Option<CutPatch>> = vec![None; partial.tracks.len()];
    let (mut refined, mut frame) = (Vec::new(), 0);
    film.each_frame(film.size().filmed, &mut |picture| {
        let seen = sightings.get_mut(frame).map(std::mem::take).unwrap_or_default();
        let found: Vec<Found> = seen
            .par_iter()
            .map(|at| search.look_for(patches[at.track].as_ref(), frame, at, &picture))
            .collect();
        for (Sighting { track, place }, found) in seen.into_iter().zip(found) {
            match found {
                Found::First(patch) => {
                    patches[track] = Some(CutPatch { patch, place });
                    refined.push((track, place, None));
                }
                Found::Again(pixel) => refined.push((track, place, Some(pixel))),
                Found::Nothing => {}
            }
        }
        frame += 1;
        Ok(())
    })?;
    if frame != capture.frames.len() {
        return Err(Error::capture(
            &capture.name,
            "its film has changed while it was worked on; build it again",
        ));
    }
    let coarse_px = partial.noise_px();
    let mut tracks: Vec<FeatureTrack> = partial.tracks.to_vec();
    let mut is_refined: Vec<Vec<bool>> = tracks.iter().map(|t| vec![false; t.observations.len()]).collect();
    for (track, place, pixel) in &refined {
        is_refined[*track][*place] = true;
        if let Some(pixel) = pixel {
            tracks[*track].observations[*place].1 = *pixel;
        }
    }
    partial.tracks = tracks.into();
    for _ in 0..ROUNDS {
        // The same at every observation that was refined, and one for all others. No noise, or nothing refined, gives no ratio.
        let ratio = refined_noise_px(partial, &is_refined) / coarse_px;
        let coarse = if ratio.is_finite() { ratio.powi(2).clamp(LEAST_PRECISION, 1.0) } else { 1.0 };
        let precision = |refined: &bool| if *refined { 1.0 } else { coarse };
        partial.precisions = is_refined.iter().map(|of| of.iter().map(precision).collect()).collect();
        partial.polish(lens, 2, FINAL);
    }
    tracing::info!(
        "{}: {} of {} observations refined at {} × {}, noise {:.3} px of the working size instead of {coarse_px:.3}",
        capture.name,
        refined.len(),
        is_refined.iter().map(Vec::len).sum::<usize>(),
        film.size().filmed.0,
        film.size().filmed.1,
        refined_noise_px(partial, &is_refined),
    );
    Ok(())
}

/// Noise of a refined pixel coordinate, as of [`PartialReconstruction::noise_px`].
fn refined_noise_px(partial: &PartialReconstruction<'_>, is_refined: &[Vec<bool>]) -> f64 {
    let mut errors = Vec::new();
    for ((track, point), is_refined) in partial.tracks.iter().zip(&partial.points).zip(is_refined) {
        let Some(point) = point else { continue };
        let refined = track.observations.iter().zip(is_refined).filter(|(_, is_refined)| **is_refined);
        errors.extend(refined.filter_map(|((frame, pixel), _)| partial.error_px(*frame, point, pixel)));
    }
    median(&errors).unwrap_or(f64::INFINITY) / (2.0 * 2.0_f64.ln()).sqrt()
}

/// Result of looking for a feature in a filmed picture.
enum Found {
    /// The track's first patch.
    First(FilmedPatch),
    /// The place of that patch in a later frame, rectified, in pixels of the working size.
    Again(Point2<f64>),
    Nothing,
}

/// A reconstruction whose features are sought in filmed pictures.
struct Search<'a> {
    partial: &'a PartialReconstruction<'a>,
    shutter: RollingShutter,
    size: WorkingSize,
    options: &'a FeatureOptions,
}

impl Search<'_> {
    /// Observations of known points in each frame, those that agree with their point.
    fn sightings(&self, frames: usize) -> Vec<Vec<Sighting>> {
        let mut sightings: Vec<Vec<Sighting>> = (0..frames).map(|_| Vec::new()).collect();
        for (track, point) in self.partial.points.iter().enumerate() {
            let Some(point) = point else { continue };
            for (place, (frame, pixel)) in self.partial.tracks[track].observations.iter().enumerate() {
                if self.partial.error_px(*frame, point, pixel).is_some_and(|error| error <= REACH_PX) {
                    sightings[*frame].push(Sighting { track, place });
                }
            }
        }
        sightings
    }

    /// Cuts the track's patch, or registers that of an earlier frame.
    fn look_for(
        &self,
        patch: Option<&CutPatch>,
        frame: usize,
        at: &Sighting,
        picture: &image::RgbImage,
    ) -> Found {
        let observations = &self.partial.tracks[at.track].observations;
        let Some(center) = self.filmed(frame, &observations[at.place].1) else { return Found::Nothing };
        let found = match patch {
            None => FilmedPatch::cut(picture, &center, self.radius_px()).map(Found::First),
            Some(CutPatch { patch, place }) => {
                let carried = carried_patch(self.partial, at.track, *place, frame);
                let affine = carried.map_or(Matrix2::identity(), |warp| warp.affine);
                patch
                    .place(picture, &Warp { center, affine }, REACH_PX * self.size.enlargement())
                    .and_then(|place| self.worked(frame, &place))
                    .map(Found::Again)
            }
        };
        found.unwrap_or(Found::Nothing)
    }

    /// Radius of a patch that shows as much as one of the working size.
    fn radius_px(&self) -> i32 {
        (f64::from(self.options.patch_radius_px) * self.size.enlargement()).round() as i32
    }

    /// Filmed pixel at the place of an observation.
    fn filmed(&self, frame: usize, observed: &Point2<f64>) -> Option<Point2<f64>> {
        Some(self.size.filmed_pixel(&self.shutter.filmed(&self.partial.intrinsics, frame, observed)?))
    }

    /// Rectified pixel of the working size at a filmed place.
    fn worked(&self, frame: usize, filmed: &Point2<f64>) -> Option<Point2<f64>> {
        self.shutter.rectified(&self.partial.intrinsics, frame, &self.size.worked_pixel(filmed))
    }
}

#[cfg(test)]
mod tests {
    use crate::capture::{CaptureFile, ReferenceFrame};
    use crate::motion::{Motion, MotionOptions, estimate};
    use nalgebra::{Isometry3, Point3};
    use synthetic::{CaptureOptions, RoomOptions};

    /// Root mean square angle between the true and the estimated directions in which frames moved from the last one, and turned
    /// against it, radians.
    fn error(motion: &Motion, truth: &[Isometry3<f64>]) -> [f64; 2] {
        let last = truth[truth.len() - 1];
        let (mut moved, mut turned) = (0.0, 0.0);
        for (estimated, truth) in motion.camera_from_world.iter().zip(truth).take(truth.len() - 1) {
            let (estimated, truth) = (estimated.unwrap(), truth * last.inverse());
            let center = |pose: &Isometry3<f64>| (pose.inverse() * Point3::origin()).coords;
            moved += center(&estimated).angle(&center(&truth)).powi(2);
            turned += estimated.rotation.angle_to(&truth.rotation).powi(2);
        }
        [moved, turned].map(|sum| (sum / (truth.len() - 1) as f64).sqrt())
    }

    #[test]
    fn poses_are_more_precise_after_refinement_in_the_filmed_pictures() {
        let room = RoomOptions { image_px: [800, 600], ..RoomOptions::default() }.build().unwrap();
        let camera = &room.room.cameras[0].camera;
        let options = CaptureOptions { frames: 7, ..CaptureOptions::default() };
        let (pictures, truth) = room.capture(camera, &options);
        let folder = tempfile::tempdir().unwrap();
        for (index, picture) in pictures.iter().enumerate() {
            picture.save(folder.path().join(format!("{index}.png"))).unwrap();
        }
        let lens = Some(camera.intrinsics.clone());
        let file = CaptureFile::open("cam", folder.path(), ReferenceFrame::Last, lens).unwrap();
        let mut capture = file.worked_up_to(400).read().unwrap();
        let refined = estimate(&capture, &MotionOptions::default()).unwrap().0;
        capture.larger = None;
        let worked = estimate(&capture, &MotionOptions::default()).unwrap().0;
        let (worked, refined) = (error(&worked, &truth), error(&refined, &truth));
        eprintln!("{worked:?} {refined:?}");
        for (worked, refined) in worked.into_iter().zip(refined) {
            assert!(refined < 0.8 * worked, "{refined} {worked}");
        }
    }
}
