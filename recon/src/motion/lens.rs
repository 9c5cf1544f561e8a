//! Estimate of the lens from a capture, combined with prior knowledge.
//!
//! A wrong lens bends the reconstructed space. Prior knowledge of it is a measurement with a standard deviation;
//! combined with the capture's estimate it gives `θ = θ₀ + P (P + C)⁻¹ (θ_capture − θ₀)` for `θ = (ln f, k1, k2)` with
//! the covariances `P` of the prior and `C` of the capture ([`crate::bundle::LensEvidence`]). An unknown lens takes
//! that estimate. Given intrinsics are kept unless refining them is asked for and the capture contradicts them clearly:
//! a rolling shutter looks like a lens error, too.

use calib::Intrinsics;
use nalgebra::{Matrix3, Point2, Point3, Vector3};

use super::partial_reconstruction::{FINAL, PartialReconstruction};
use crate::bundle::{LensEvidence, LensFreedom};

/// Standard deviations of `ln f`, `k1` and `k2` of given intrinsics: those of a calibration at another focus, or of
/// another device of the kind.
const GIVEN_SIGMA: [f64; 3] = [0.01, 0.1, 0.1];
/// Standard deviations of an unknown lens that is no fisheye.
const UNKNOWN_SIGMA: [f64; 3] = [1.0, 0.1, 0.1];
/// Squared distance, in standard deviations of three parameters, that chance exceeds once in twenty: above it the lens
/// is adjusted for a closer check.
const WORTH_A_LOOK: f64 = 7.81;
/// The same for once in a thousand: the capture clearly contradicts given intrinsics.
const CLEAR: f64 = 16.27;
/// Shift of pixels in the image's corner below which two lenses count as the same.
const ALIKE_PX: f64 = 1.0;
/// Tangent of the angle from the axis up to which lenses are compared: 75°. Farther out a fisheye magnifies what no capture
/// determines.
const FARTHEST_TAN: f64 = 3.73;
/// Number of places between the corner and half of the way to the axis.
const HALF_STEPS: u32 = 50;
/// Rounds of polish with a new lens.
const ROUNDS: usize = 2;

/// Origin of a motion's intrinsics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LensOrigin {
    /// Given, and not contradicted by the capture.
    Given,
    /// Given and kept, though the capture contradicts them clearly.
    Contradicted,
    /// Given, contradicted clearly by the capture, and refined on request.
    Refined,
    /// Not given; estimated from the capture.
    Estimated,
}

/// Result of the lens estimation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Settled {
    pub(super) origin: LensOrigin,
    /// Warning where the capture contradicts given intrinsics that are kept.
    pub(super) doubt: Option<String>,
    /// Relative standard deviation of the focal length, where it was estimated and is determined.
    pub(super) focal_sigma: Option<f64>,
}

/// Settles the lens of a polished reconstruction. `given`: whether its intrinsics were given; `refine`: whether these
/// may be changed.
pub(super) fn settle(partial: &mut PartialReconstruction<'_>, given: bool, refine: bool) -> Settled {
    let origin = if given { LensOrigin::Given } else { LensOrigin::Estimated };
    let unchanged = Settled { origin, doubt: None, focal_sigma: None };
    let speaks = |change: &Vector3<f64>, covariance: &Matrix3<f64>, least: f64| {
        distance(change, covariance).is_some_and(|d| d >= least)
    };
    if given {
        // One linear step is cheap, and suffices for most captures.
        match partial.lens_evidence(LensFreedom::FocalRadial) {
            Some(LensEvidence { step, covariance }) if speaks(&step, &covariance, WORTH_A_LOOK) => {}
            _ => return unchanged,
        }
    }
    // Prior knowledge of an unknown lens is that it does not bend.
    let before = if given { partial.intrinsics.clone() } else { partial.intrinsics.without_distortion() };
    let mut adjusted = partial.clone();
    adjusted.polish(LensFreedom::FocalRadial, ROUNDS, FINAL);
    let Some(LensEvidence { covariance, .. }) = adjusted.lens_evidence(LensFreedom::FocalRadial) else {
        return unchanged;
    };
    let moved = change(&before, &adjusted.intrinsics);
    if given && (!speaks(&moved, &covariance, CLEAR) || alike(&before, &adjusted.intrinsics)) {
        return unchanged;
    }
    if given && !refine {
        let doubt = contradicted(&before, &adjusted.intrinsics, covariance[(0, 0)].sqrt());
        return Settled { origin: LensOrigin::Contradicted, doubt: Some(doubt), focal_sigma: None };
    }
    let known = Matrix3::from_diagonal(
        &Vector3::from(if given { GIVEN_SIGMA } else { UNKNOWN_SIGMA }).map(|sigma| sigma * sigma),
    );
    let Some((moved, covariance)) = together(&known, &moved, &covariance) else { return unchanged };
    adjusted.intrinsics = changed(&before, &moved);
    if adjusted.intrinsics.validate().is_err() || adjusted.polish(LensFreedom::Fixed, ROUNDS, FINAL).is_none()
    {
        return unchanged;
    }
    *partial = adjusted;
    let origin = if given { LensOrigin::Refined } else { LensOrigin::Estimated };
    Settled { origin, doubt: None, focal_sigma: Some(covariance[(0, 0)].max(0.0).sqrt()) }
}

fn contradicted(given: &Intrinsics, found: &Intrinsics, sigma: f64) -> String {
    let ([given_k1, given_k2], [k1, k2]) = (given.distortion.leading(), found.distortion.leading());
    format!(
        "its capture speaks against its intrinsics, which give a focal length of {:.1} px, k1 {given_k1:.3}, k2 {given_k2:.3}; \
         in the capture these are {:.1} ± {:.1} px, {k1:.3}, {k2:.3}; calibrate it anew at this focus, or try --refine-intrinsics",
        given.fx,
        found.fx,
        sigma * found.fx
    )
}

/// Combination of a measured change, with its covariance, and the prior of no change: the best estimate, and its
/// covariance.
fn together(
    known: &Matrix3<f64>,
    measured: &Vector3<f64>,
    covariance: &Matrix3<f64>,
) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let gain = known * (known + covariance).try_inverse()?;
    Some((gain * measured, (Matrix3::identity() - gain) * known))
}

/// `δᵀ C⁻¹ δ`.
fn distance(change: &Vector3<f64>, covariance: &Matrix3<f64>) -> Option<f64> {
    Some(change.dot(&covariance.cholesky()?.solve(change)))
}

/// Tells whether two lenses agree, to within [`ALIKE_PX`], in the corner of the picture; in a corner that reaches farther than
/// [`FARTHEST_TAN`] from the axis, at the last place on the way to it that does not.
fn alike(a: &Intrinsics, b: &Intrinsics) -> bool {
    let corner = Point2::origin();
    let axis = Point2::new(a.cx, a.cy);
    let place =
        (0..=HALF_STEPS).map(|i| corner + (axis - corner) * (f64::from(i) / f64::from(2 * HALF_STEPS)));
    let mut seen = place.filter_map(|place| Some((place, a.unproject(&place)?)));
    let farthest = seen.find(|(_, ray)| ray.xy().norm() <= FARTHEST_TAN * ray.z);
    let of_b = farthest.and_then(|(place, ray)| Some((place, b.project(&Point3::from(ray))?)));
    of_b.is_some_and(|(place, pixel)| (pixel - place).norm() < ALIKE_PX)
}

/// Change from one lens to another, in `(ln f, k1, k2)`.
fn change(from: &Intrinsics, to: &Intrinsics) -> Vector3<f64> {
    let ([k1, k2], [to_k1, to_k2]) = (from.distortion.leading(), to.distortion.leading());
    Vector3::new((to.fx / from.fx).ln(), to_k1 - k1, to_k2 - k2)
}

/// The lens after a [`change`].
fn changed(from: &Intrinsics, by: &Vector3<f64>) -> Intrinsics {
    let mut to = from.clone();
    to.fx *= by.x.exp();
    to.fy *= by.x.exp();
    to.distortion = to.distortion.bent([by.y, by.z]);
    to
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Fisheye;

    #[test]
    fn precise_measurements_count_more() {
        let squares = |sigma: [f64; 3]| Matrix3::from_diagonal(&Vector3::from(sigma).map(|s| s * s));
        let measured = Vector3::new(0.03, -0.2, 0.1);
        // One parameter is known four times better than measured, one equally well, one four times worse.
        let (best, covariance) =
            together(&squares([0.01, 0.1, 0.4]), &measured, &squares([0.04, 0.1, 0.1])).unwrap();
        let wanted = Vector3::new(0.03 / 17.0, -0.2 / 2.0, 0.1 * 16.0 / 17.0);
        assert!((best - wanted).norm() < 1e-12, "{best}");
        // 1/σ² = 1/σ₁² + 1/σ₂²
        for (k, [a, b]) in [[0.01_f64, 0.04], [0.1, 0.1], [0.4, 0.1]].into_iter().enumerate() {
            let sum = a.powi(-2) + b.powi(-2);
            assert!((covariance[(k, k)] * sum - 1.0).abs() < 1e-9, "{covariance}");
        }
    }

    #[test]
    fn lenses_are_alike_where_their_corners_are() {
        let lens = Intrinsics::from_horizontal_fov(641, 481, 60.0);
        // The corner lies 400 px from the principal point: a share of 1/500 of the focal length moves it by 0.8.
        let by = |ln_f: f64, k1: f64| changed(&lens, &Vector3::new(ln_f, k1, 0.0));
        assert!(alike(&lens, &by(0.002, 0.0)) && !alike(&lens, &by(0.003, 0.0)));
        assert!(!alike(&lens, &by(0.0, 0.05)));
    }

    #[test]
    fn fisheyes_are_compared_where_captures_determine_them() {
        let lens = |f: f64| Intrinsics {
            distortion: Fisheye::from([0.0; 4]).into(),
            fx: f,
            fy: f,
            ..Intrinsics::from_horizontal_fov(641, 481, 60.0)
        };
        // An equidistant fisheye: at 75° from the axis, 340 px from the principal point, a share s of the focal length shifts by
        // 340 s. In the corner, at 88°, the comparison would be by the tangent.
        assert!(alike(&lens(260.0), &lens(260.1)) && alike(&lens(260.1), &lens(260.0)));
        assert!(!alike(&lens(260.0), &lens(262.6)) && !alike(&lens(262.6), &lens(260.0)));
        // θ⁹ is 11.3 at 75° and 34.8 at 85°, where rays end: shifts of 0.6 and 1.8 px.
        let of_the_rim =
            |k4: f64| Intrinsics { distortion: Fisheye::from([0.0, 0.0, 0.0, k4]).into(), ..lens(260.0) };
        assert!(alike(&lens(260.0), &of_the_rim(2e-4)) && !alike(&lens(260.0), &of_the_rim(4e-4)));
    }

    #[test]
    fn a_change_leads_where_it_was_taken_from() {
        let mut from = Intrinsics::from_horizontal_fov(640, 480, 60.0);
        from.distortion = [0.0, 0.02, 0.0, 0.0, 0.0].into();
        let by = Vector3::new(-0.03, 0.05, -0.07);
        let to = changed(&from, &by);
        assert!((change(&from, &to) - by).norm() < 1e-12);
        assert!((to.fx / from.fx - (-0.03_f64).exp()).abs() < 1e-12, "{to:?}");
        assert!((to.fx / to.fy - 1.0).abs() < 1e-12, "{to:?}");
    }
}
