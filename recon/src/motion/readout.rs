//! Readout time of a frame's rows: the value with the least reprojection error.
//!
//! A rolling shutter bends the reconstruction of a turning camera, and leaves a small reprojection error, which depends
//! on the readout. Observations are brought to the instants of their frames' middle rows ([`RollingShutter`]) with a
//! few readouts, the reconstruction is adjusted to each, and a parabola through the squared errors gives the best one.

use nalgebra::Point2;

use super::partial_reconstruction::{FINAL, PartialReconstruction};
use crate::bundle::LensFreedom;
use crate::features::FeatureTrack;
use crate::rolling_shutter::RollingShutter;

/// Step between the readouts that are tried, on both sides of the best so far; a share of the time between frames.
const STEP: f64 = 0.05;
/// Largest extrapolation to a better readout, in steps.
const FARTHEST_STEPS: f64 = 2.0;
/// Largest readout: rows are read before the next frame begins.
const LONGEST: f64 = 1.0;
/// Shift of the rows by a readout below which it is not estimated, pixels.
const LEAST_SHIFT_PX: f64 = 0.1;
/// Least relative decrease of the squared error; less may be chance.
const LEAST_GAIN: f64 = 0.1;
/// Number of repetitions of the search: poses follow the readout only step by step.
const SEARCHES: usize = 6;
/// Rounds of polish with a better readout.
const ROUNDS: usize = 2;
/// Number of points used for the search of the readout; all are adjusted once it is found.
const POINTS: usize = 700;

/// Finds the readout of a nearly polished reconstruction, brings its tracks to the middle rows' instants and its poses
/// near the adjusted ones; 0 where there is none.
pub(super) fn settle(partial: &mut PartialReconstruction<'_>, lens: LensFreedom) -> f64 {
    let fast =
        RollingShutter::new(1.0, &partial.poses, partial.intrinsics.height).shift_px(&partial.intrinsics);
    let least = LEAST_SHIFT_PX / fast.max(f64::MIN_POSITIVE);
    if STEP < least {
        return 0.0;
    }
    let square = |partial: &PartialReconstruction<'_>| partial.noise_px().powi(2);
    let some = some_of(partial);
    let Some(mut best) = adjusted(&some, &some, 0.0, lens, ROUNDS) else { return 0.0 };
    let (none, mut readout) = (square(&best), 0.0);
    for _ in 0..SEARCHES {
        let around =
            [-STEP, STEP].map(|step| adjusted(&some, &best, readout + step, lens, 1).as_ref().map(square));
        let [Some(low), Some(high)] = around else { break };
        let Some(step) = lowest(low, square(&best), high) else { break };
        if step.abs() < least {
            break;
        }
        let farther = (readout + step).clamp(-LONGEST, LONGEST);
        let Some(better) =
            adjusted(&some, &best, farther, lens, ROUNDS).filter(|b| square(b) < square(&best))
        else {
            break;
        };
        (best, readout) = (better, farther);
    }
    if square(&best) > (1.0 - LEAST_GAIN) * none {
        return 0.0;
    }
    let posed = PartialReconstruction { poses: best.poses, intrinsics: best.intrinsics, ..partial.clone() };
    *partial = rectified(partial, &posed, readout);
    readout
}

/// Every n-th track that has a point, from all parts of the capture.
fn some_of<'a>(partial: &PartialReconstruction<'a>) -> PartialReconstruction<'a> {
    let known: Vec<usize> = (0..partial.points.len()).filter(|t| partial.points[*t].is_some()).collect();
    let kept = known.iter().step_by(known.len().div_ceil(POINTS).max(1));
    let (tracks, points): (Vec<FeatureTrack>, _) =
        kept.map(|t| (partial.tracks[*t].clone(), partial.points[*t])).unzip();
    PartialReconstruction { tracks: tracks.into(), points, ..partial.clone() }
}

/// Position of the lowest point, given the squared errors a step before, here and a step after; `None` where nothing is
/// lower than here.
fn lowest(low: f64, here: f64, high: f64) -> Option<f64> {
    let curvature = low - 2.0 * here + high;
    let downhill = STEP * (low - high).signum();
    if curvature <= 0.0 {
        return (low.min(high) < here).then_some(downhill);
    }
    let away = 0.5 * STEP * (low - high) / curvature;
    away.is_finite().then(|| away.clamp(-FARTHEST_STEPS * STEP, FARTHEST_STEPS * STEP))
}

/// `posed` adjusted to the tracks of `filmed` with a readout.
fn adjusted<'a>(
    filmed: &PartialReconstruction<'a>,
    posed: &PartialReconstruction<'a>,
    readout: f64,
    lens: LensFreedom,
    rounds: usize,
) -> Option<PartialReconstruction<'a>> {
    let mut adjusted = rectified(filmed, posed, readout);
    adjusted.polish(lens, rounds, FINAL)?;
    Some(adjusted)
}

/// `posed` with the rectified tracks of `filmed`.
fn rectified<'a>(
    filmed: &PartialReconstruction<'a>,
    posed: &PartialReconstruction<'a>,
    readout: f64,
) -> PartialReconstruction<'a> {
    let shutter = RollingShutter::new(readout, &posed.poses, posed.intrinsics.height);
    let at_once = |(frame, pixel): &(usize, Point2<f64>)| {
        let rectified = shutter.rectified(&posed.intrinsics, *frame, pixel);
        (*frame, rectified.unwrap_or(*pixel))
    };
    let tracks: Vec<FeatureTrack> = filmed
        .tracks
        .iter()
        .map(|track| FeatureTrack { observations: track.observations.iter().map(at_once).collect() })
        .collect();
    PartialReconstruction { tracks: tracks.into(), ..posed.clone() }
}

#[cfg(test)]
mod tests {
    use calib::Intrinsics;
    use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const FRAMES: usize = 16;
    const NOISE_PX: f64 = 0.2;

    /// Motion of a hand, over time in frames: it sways and never turns evenly.
    fn hand(time: f64) -> Isometry3<f64> {
        let turn =
            Vector3::new((0.8 * time).sin(), (0.6 * time + 1.0).sin(), 0.3 * (0.9 * time).cos()) * 0.12;
        let moved =
            Vector3::new(0.4 * (0.35 * time).sin(), 0.2 * (0.5 * time).cos(), 0.1 * (0.3 * time).sin());
        Isometry3::from_parts(Translation3::from(moved), UnitQuaternion::from_scaled_axis(turn))
    }

    /// Film of a camera in that hand, each row at its own time; its points do not move.
    fn filmed(readout: f64) -> (Vec<FeatureTrack>, Vec<Option<Point3<f64>>>, Intrinsics) {
        let lens = Intrinsics::from_horizontal_fov(640, 480, 65.0);
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let noise = Normal::new(0.0, NOISE_PX).unwrap();
        let (mut tracks, mut points) = (Vec::new(), Vec::new());
        for _ in 0..220 {
            let place = Point3::new(
                rng.random_range(-2.0..2.0),
                rng.random_range(-1.5..1.5),
                rng.random_range(2.5..6.0),
            );
            let mut observations = Vec::new();
            for frame in 0..FRAMES {
                let mut row = 239.5;
                let mut pixel = None;
                for _ in 0..30 {
                    let time = frame as f64 + readout * ((row + 0.5) / 480.0 - 0.5);
                    pixel = lens.project(&(hand(time) * place)).filter(|p| lens.contains(p));
                    let Some(at) = pixel else { break };
                    row = at.y;
                }
                let jitter = nalgebra::Vector2::new(noise.sample(&mut rng), noise.sample(&mut rng));
                observations.extend(pixel.map(|pixel| (frame, pixel + jitter)));
            }
            if observations.len() > 3 {
                tracks.push(FeatureTrack { observations });
                points.push(Some(place));
            }
        }
        (tracks, points, lens)
    }

    #[test]
    fn the_readout_of_a_film_is_found_and_its_poses_with_it() {
        for readout in [0.3, -0.2, 0.0] {
            let (tracks, points, lens) = filmed(readout);
            let mut partial = PartialReconstruction::new(&tracks, lens, FRAMES);
            partial.poses = (0..FRAMES).map(|frame| Some(hand(frame as f64))).collect();
            partial.points = points;
            partial.polish(LensFreedom::Fixed, ROUNDS, FINAL).unwrap();
            let noise = partial.noise_px();
            let found = settle(&mut partial, LensFreedom::Fixed);
            partial.polish(LensFreedom::Fixed, ROUNDS, FINAL).unwrap();
            if readout == 0.0 {
                assert!(found.abs() < f64::EPSILON, "{found} where all rows were read at once");
                continue;
            }
            // The camera's translation within a frame is not corrected, and biases the readout.
            assert!((found / readout - 1.0).abs() < 0.15, "{found} for {readout}");
            assert!(partial.noise_px() < 0.8 * noise, "{} px, before {noise}", partial.noise_px());
        }
    }

    #[test]
    fn the_lowest_point_of_a_parabola_is_found() {
        for at in [-0.09, 0.0, 0.02, 0.07] {
            let square = |x: f64| 0.2 + 3.0 * (x - at).powi(2);
            let found = lowest(square(-STEP), square(0.0), square(STEP)).unwrap();
            assert!((found - at).abs() < 1e-9, "{found} for {at}");
        }
        // Far away it moves towards the minimum by a bounded step; on a ridge, downhill.
        assert!((lowest(2.0, 1.0, 0.01).unwrap() - FARTHEST_STEPS * STEP).abs() < 1e-9);
        assert!((lowest(0.5, 1.0, 0.4).unwrap() - STEP).abs() < 1e-9);
        assert!(lowest(1.0, 1.0, 1.0).is_none() && lowest(1.0, f64::NAN, 1.0).is_none());
    }
}
