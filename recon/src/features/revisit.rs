//! Search for lost features that come into view again.
//!
//! Following from frame to frame ends a track where the camera turns away, where a frame is blurred, or where something
//! passes before it. A first reconstruction predicts the position of each feature, and the deformation of its patch, in
//! the frames that did not follow it. Around that prediction the patch is searched by correlation and registered as
//! [`super::track`] does. Ambiguous matches (a repeated pattern, an edge along which the patch slides) are left out.

use nalgebra::{Point2, Vector2};
use rayon::prelude::*;

use super::intensity::Intensity;
use super::probe::{PLACES, STEP_PX};
use super::register::{Patch, Warp};
use super::{FeatureOptions, FeatureTrack};

/// Options of the search for lost features.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RevisitOptions {
    /// Largest distance of a feature from its prediction, pixels.
    pub(crate) search_px: i32,
    /// Least correlation with its first appearance.
    pub(crate) min_correlation: f64,
    /// Least difference in correlation to any other peak within reach.
    pub(crate) min_lead: f32,
}

/// Distance from the best place within which others belong to its peak, pixels.
const PEAK_PX: f64 = 3.5;

/// Tracks completed by the features found again.
///
/// `predict(track, frame)` is the predicted warp in a frame of the patch cut at the track's first observation, if it is
/// visible there.
pub(crate) fn seen_again(
    frames: &[Intensity],
    tracks: &[FeatureTrack],
    predict: impl Fn(usize, usize) -> Option<Warp> + Sync,
    how: &RevisitOptions,
    options: &FeatureOptions,
) -> Vec<FeatureTrack> {
    tracks
        .par_iter()
        .enumerate()
        .with_min_len(4)
        .map(|(index, track)| {
            let mut longer = track.clone();
            let Some(patch) = first_appearance(frames, track, options) else { return longer };
            for (frame, image) in frames.iter().enumerate() {
                if track.observations.iter().any(|(f, _)| *f == frame) {
                    continue;
                }
                let found = predict(index, frame).and_then(|start| look_for(&patch, image, &start, how));
                longer.observations.extend(found.map(|warp| (frame, warp.center)));
            }
            longer.observations.sort_by_key(|(frame, _)| *frame);
            longer
        })
        .collect()
}

fn first_appearance(frames: &[Intensity], track: &FeatureTrack, options: &FeatureOptions) -> Option<Patch> {
    let (frame, center) = *track.observations.first()?;
    let warp = Warp { center, affine: nalgebra::Matrix2::identity() };
    Patch::cut(&frames[frame], &warp, options.patch_radius_px)
}

fn look_for(patch: &Patch, image: &Intensity, start: &Warp, how: &RevisitOptions) -> Option<Warp> {
    let probe = patch.probe(&start.affine);
    let placed = probe.placed(image, &start.center);
    let steps = how.search_px / STEP_PX;
    let mut tried: Vec<(Point2<f64>, f32)> = Vec::with_capacity((2 * steps + 1).pow(2) as usize);
    for y in -steps..=steps {
        for first in (-steps..=steps).step_by(PLACES) {
            let row = placed.row(STEP_PX * first, STEP_PX * y);
            tried.extend((first..=steps).zip(row).filter_map(|(x, correlation)| {
                let aside = Vector2::new(f64::from(STEP_PX * x), f64::from(STEP_PX * y));
                Some((start.center + aside, correlation?))
            }));
        }
    }
    let (best, highest) = *tried.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let rivalled =
        tried.iter().any(|(center, c)| (center - best).norm() > PEAK_PX && *c > highest - how.min_lead);
    if rivalled {
        return None;
    }
    let found = patch.register(image, &Warp { center: best, ..*start })?;
    let near = (found.warp.center - start.center).amax() <= f64::from(how.search_px) + 1.0;
    (near && found.correlation >= how.min_correlation).then_some(found.warp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    /// An irregular texture.
    fn irregular(x: f64, y: f64) -> f64 {
        120.0
            + 30.0 * (0.29 * x + 0.003 * y * y).sin()
            + 25.0 * (0.37 * y - 0.002 * x * x).cos()
            + 20.0 * (0.011 * x * y).sin()
    }

    /// A texture that repeats every 10 pixels.
    fn wallpaper(x: f64, y: f64) -> f64 {
        let turn = std::f64::consts::TAU / 10.0;
        120.0 + 40.0 * (turn * x).sin() + 40.0 * (turn * y).cos()
    }

    /// Follows one feature into frame 1 of 3 and looks for it in frame 2, where the picture has moved by (9.3, −4.6); the
    /// prediction misses that by (5, 3).
    fn again(picture: fn(f64, f64) -> f64, search_px: i32) -> Option<Point2<f64>> {
        let image = |dx: f64, dy: f64| {
            Intensity::from_fn(120, 90, |x, y| picture(x as f64 - dx, y as f64 - dy) as f32)
        };
        let frames = [image(0.0, 0.0), image(1.0, 0.0), image(9.3, -4.6)];
        let home = Point2::new(50.0, 45.0);
        let track = FeatureTrack { observations: vec![(0, home), (1, home + Vector2::x())] };
        let predict = |_, frame| {
            let center = home + Vector2::new(9.3 - 5.0, -4.6 + 3.0);
            (frame == 2).then_some(Warp { center, affine: Matrix2::identity() })
        };
        let how = RevisitOptions { search_px, min_correlation: 0.85, min_lead: 0.05 };
        let found =
            seen_again(&frames, std::slice::from_ref(&track), predict, &how, &FeatureOptions::default());
        assert_eq!(found[0].observations[..2], track.observations[..]);
        found[0].observations.get(2).map(|(frame, pixel)| {
            assert_eq!(*frame, 2);
            *pixel
        })
    }

    #[test]
    fn a_lost_feature_is_found_where_it_is() {
        let found = again(irregular, 12).unwrap();
        assert!((found - Point2::new(59.3, 40.4)).norm() < 0.02, "{found}");
    }

    #[test]
    fn beyond_reach_or_among_its_likes_nothing_is_found() {
        assert!(again(irregular, 2).is_none());
        assert!(again(wallpaper, 12).is_none());
    }
}
