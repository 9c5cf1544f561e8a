//! Errors of captures that determine no motion, with what to film instead.

use super::{MotionOptions, MotionReport};
use crate::capture::Capture;
use crate::features::FeatureReport;
use crate::{Error, Result};

/// Least median number of features that must be carried from a frame to the next.
const MIN_CARRIED: usize = 30;

/// Checks that tracking found enough features.
pub(super) fn features(camera: &str, report: &FeatureReport, frames: usize) -> Result<()> {
    let mut carried = report.carried.clone();
    carried.sort_unstable();
    let typical = carried.get(carried.len() / 2).copied().unwrap_or(0);
    if typical < MIN_CARRIED {
        return Err(Error::capture(
            camera,
            format!(
                "only {typical} features (median over {frames} frames) can be followed from one frame to the next, \
                 at least {MIN_CARRIED} are needed; film with more light, slower, and with textured things in view"
            ),
        ));
    }
    Ok(())
}

/// Error when no two frames show the same things from different places.
pub(super) fn no_start(camera: &str) -> Error {
    Error::capture(
        camera,
        "no two frames share enough features seen from different places; move the camera sideways (not only turn it) \
         by about a tenth of the distance to the room's far side, slowly, keeping the same things in view",
    )
}

/// Error when the reference frame has no pose.
pub(super) fn reference_missing(capture: &Capture) -> Error {
    let number = capture.sampled.number(capture.reference);
    Error::capture(
        &capture.name,
        format!(
            "the reference frame (frame {number}) could not be placed among the others; is it of this capture? bring the \
             camera to its final pose slowly, and let it rest there for the last frames"
        ),
    )
}

/// Checks that the reference frame shows the same things as the others: a few chance matches suffice for a wrong pose.
///
/// `seen`: number of inlier points of each frame.
pub(super) fn reference(capture: &Capture, seen: &[usize]) -> Result<()> {
    /// Least share of the median number of points.
    const LEAST_SHARE: f64 = 0.1;
    let mut sorted = seen.to_vec();
    sorted.sort_unstable();
    let typical = sorted.get(sorted.len() / 2).copied().unwrap_or(0);
    let least = (LEAST_SHARE * typical as f64).max(MIN_CARRIED as f64);
    if (seen[capture.reference] as f64) < least { Err(reference_missing(capture)) } else { Ok(()) }
}

/// Checks that the result is reliable.
pub(super) fn motion(
    camera: &str,
    frames: usize,
    noise_px: f64,
    report: &MotionReport,
    options: &MotionOptions,
) -> Result<()> {
    if report.points == 0 || (report.registered as f64) < options.min_registered * frames as f64 {
        return Err(Error::capture(
            camera,
            format!(
                "only {} of {frames} frames could be placed ({} points); film slower and without blur, and keep \
                 things in view from frame to frame",
                report.registered, report.points
            ),
        ));
    }
    if noise_px > options.max_noise_px {
        return Err(Error::capture(
            camera,
            format!(
                "the reprojection error stays at {noise_px:.1} px (at most {:.1}); is the intrinsics file this \
                 camera's, at this resolution and zoom, and did nothing move in the room while filming?",
                options.max_noise_px
            ),
        ));
    }
    if report.explained_share < options.min_explained {
        return Err(Error::capture(
            camera,
            format!(
                "only {:.0} % of what was followed stands still (at least {:.0} % must): people or things move through the \
                 capture; film the room while it is empty and nothing in it moves",
                100.0 * report.explained_share,
                100.0 * options.min_explained
            ),
        ));
    }
    if report.parallax_deg < options.min_parallax_deg {
        return Err(Error::capture(
            camera,
            format!(
                "too little translation: points are seen from directions only {:.2}° apart (at least {:.1}° are \
                 needed); move the camera sideways by about a tenth of the distance to the room's far side instead of \
                 only turning it",
                report.parallax_deg, options.min_parallax_deg
            ),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{LensOrigin, Starts};

    #[test]
    fn moving_scenes_are_named_before_their_consequences() {
        let options = MotionOptions::default();
        let report = |explained_share| MotionReport {
            features: FeatureReport::default(),
            starts: Starts { factorization_px: 0.5, two_views_px: 0.5 },
            registered: 20,
            points: 500,
            observations: 4000,
            rms_px: 0.3,
            parallax_deg: 0.2,
            explained_share,
            readout: 0.0,
            lens: LensOrigin::Given,
            focal_sigma: None,
            doubts: Vec::new(),
        };
        let said = |share| motion("hall", 20, 0.2, &report(share), &options).unwrap_err().to_string();
        assert!(said(0.45).contains("45 %") && said(0.45).contains("empty"), "{}", said(0.45));
        assert!(said(0.9).contains("sideways"), "{}", said(0.9));
        let sound = MotionReport { parallax_deg: 4.0, ..report(0.9) };
        assert!(motion("hall", 20, 0.2, &sound, &options).is_ok());
    }
}
