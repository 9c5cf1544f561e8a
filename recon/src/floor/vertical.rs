//! Which way is up, from all level planes: of a floor that is mostly covered less is known than of the table on it.
//!
//! A plane tilted by the small vector t moves a point at x from its mean by t · x. Residuals hang together over some
//! length a (where a capture's space is bent, its surfaces are bent with it), so that a plane of area A is worth
//! `n = max(1, A / a²)` observations. With the points' covariance S and the residuals' variance r², what plane k knows of
//! its tilt is `Λ = n S / r²`. Things are level only within σ; the floor is what level means:
//!
//! ```text
//! C_floor = Λ_floor⁻¹          C_k = Λ_k⁻¹ + σ² I          t = (Σ C_k⁻¹)⁻¹ Σ C_k⁻¹ t_k
//! ```
//!
//! with tilts as seen from the floor (`t_floor = 0`). Sloped desks and roofs have no say: of the planes that face up or
//! down to within some angle, level ones are taken to be q times as many as sloped ones, and those to slope anywhere in
//! the solid angle Ω about the floor's normal. The largest plane is asked first; one is the more likely level where, with t
//! and its covariance `(Σ C⁻¹)⁻¹` of those that have voted before, and `C = C_k + (Σ C⁻¹)⁻¹`,
//!
//! ```text
//! (t_k − t)ᵀ C⁻¹ (t_k − t)  <  2 ln (q Ω / 2π √det C)
//! ```

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

use super::{Fit, FloorOptions};

/// Of planes that are almost level so many are level for each that slopes.
const LEVEL_TO_SLOPED: f64 = 10.0;

/// The upward normal that the floor and all planes parallel to it agree on, and how many these are.
///
/// # Arguments
/// `planes`: any planes, the largest first; those hardly above one that has voted are the same again. `size`: the room's.
pub(super) fn vote(floor: &Fit, planes: &[&Fit], size: f64, options: &FloorOptions) -> (Vector3<f64>, usize) {
    let up = floor.plane.normal;
    let alone = (up, 1);
    let apart = 4.0 * options.thickness * size;
    let patch = (options.correlated * size).powi(2);
    let Some(across) = tangents(&up) else { return alone };
    // What has been said so far of the tilt, and how well it is known.
    let Some(mut so_far) = covariance(floor, &across, patch) else { return alone };
    let Some(mut information) = so_far.try_inverse() else { return alone };
    let mut tilt = Vector2::zeros();
    let unlevel = Matrix2::identity() * options.level_sigma_deg.to_radians().powi(2);
    let widest = options.normal_spread_deg.to_radians();
    let (mut heights, mut voters) = (vec![0.0], 1);
    for plane in planes {
        let height = up.dot(&(plane.mean - floor.mean));
        let facing = plane.plane.normal.dot(&up);
        let same = heights.iter().any(|other: &f64| (height - other).abs() < apart);
        if same || facing.abs() < widest.cos() {
            continue;
        }
        // Smaller planes at this height are parts of it, and of what lies beside it.
        heights.push(height);
        // A ceiling faces down.
        let its = across.transpose() * plane.plane.normal * facing.signum();
        let Some(own) = covariance(plane, &across, patch).map(|c| c + unlevel) else { continue };
        if !is_level(&(its - tilt), &(own + so_far), widest) {
            continue;
        }
        let Some(known) = own.try_inverse() else { continue };
        let Some(together) = (information + known).try_inverse() else { continue };
        tilt = together * (information * tilt + known * its);
        information += known;
        so_far = together;
        voters += 1;
    }
    ((up + across * tilt).normalize(), voters)
}

/// Whether a plane whose tilt against level ones is known with this covariance is likelier level than sloped, given that
/// it tilts by no more than `widest` (radians).
fn is_level(tilt: &Vector2<f64>, covariance: &Matrix2<f64>, widest: f64) -> bool {
    let Some(known) = covariance.try_inverse() else { return false };
    let sloped = std::f64::consts::PI * widest.powi(2);
    let odds = LEVEL_TO_SLOPED * sloped / (std::f64::consts::TAU * covariance.determinant().sqrt());
    tilt.dot(&(known * tilt)) < 2.0 * odds.ln()
}

/// Two unit vectors across a unit vector.
fn tangents(up: &Vector3<f64>) -> Option<Matrix3x2<f64>> {
    let first = up.cross(&Vector3::ith(up.iamin(), 1.0)).try_normalize(0.0)?;
    Some(Matrix3x2::from_columns(&[first, up.cross(&first)]))
}

/// Covariance of a plane's tilt along `across`, residuals being one observation a `patch` (an area); `None` when its
/// points lie on a line.
fn covariance(fit: &Fit, across: &Matrix3x2<f64>, patch: f64) -> Option<Matrix2<f64>> {
    // Where planes were made exact, stereo's own noise tells what the residuals no longer do.
    let variance = fit.rms.powi(2).max(fit.sigma_squared) / (fit.area / patch).max(1.0);
    let spread: Matrix2<f64> = across.transpose() * fit.spread * across;
    spread.try_inverse().map(|inverse| inverse * variance).filter(|c| c.iter().all(|v| v.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::floor::Plane;
    use approx::assert_relative_eq;
    use nalgebra::{Matrix3, Point3, Rotation3};

    const SIZE: f64 = 2.0;

    /// A rectangle `size` (x, y) of standard deviations about (0, 0, `height`), tilted about y by `tilt_deg`, its points
    /// off by `rms`.
    fn rectangle(size: [f64; 2], height: f64, tilt_deg: f64, rms: f64) -> Fit {
        let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), tilt_deg.to_radians());
        let normal = turned * Vector3::z();
        let spread = Matrix3::from_diagonal(&Vector3::new(size[0].powi(2), size[1].powi(2), rms.powi(2)));
        let mean = Point3::new(0.0, 0.0, height);
        Fit {
            plane: Plane { normal, distance: normal.dot(&mean.coords) },
            area: 12.0 * size[0] * size[1],
            rms,
            sigma_squared: 0.0,
            mean,
            spread: turned * spread * turned.transpose(),
        }
    }

    fn options(level_sigma_deg: f64) -> FloorOptions {
        FloorOptions { level_sigma_deg, ..FloorOptions::default() }
    }

    fn tilt_deg(normal: &Vector3<f64>) -> f64 {
        normal.x.atan2(normal.z).to_degrees()
    }

    #[test]
    fn each_plane_counts_as_what_is_known_of_it() {
        // Sine and tangent of a degree differ by less than what is asked.
        let floor = rectangle([0.3, 0.6], 0.0, 0.0, 0.012);
        let table = rectangle([0.6, 0.4], 0.7, 1.0, 0.009);
        let patches = |fit: &Fit| (fit.area / (0.3 * SIZE).powi(2)).sqrt();
        assert!(patches(&floor) > 2.0 && patches(&table) > 2.0);
        let sigma = [0.012 / 0.3 / patches(&floor), 0.009 / 0.6 / patches(&table)];
        for level_deg in [0.0, 0.5, 1.5] {
            let own = sigma[1].powi(2) + f64::to_radians(level_deg).powi(2);
            let expected_deg = (1.0 / own) / (1.0 / own + 1.0 / sigma[0].powi(2));
            let (normal, voters) = vote(&floor, &[&table], SIZE, &options(level_deg));
            assert_eq!(voters, 2);
            assert_relative_eq!(tilt_deg(&normal), expected_deg, epsilon = 2e-3);
            assert_relative_eq!(normal.y, 0.0, epsilon = 1e-12);
        }
        // Less than a patch is one observation.
        let whole = FloorOptions { correlated: 10.0, ..options(0.0) };
        let expected_deg = 1.0 / (1.0 + (0.009f64 / 0.6 * 0.3 / 0.012).powi(2));
        assert_relative_eq!(tilt_deg(&vote(&floor, &[&table], SIZE, &whole).0), expected_deg, epsilon = 2e-3);
        // Where planes were made exact, nothing but stereo's own deviation is left to go by.
        let exact = Fit { rms: 0.0, sigma_squared: 0.009f64.powi(2), ..table.clone() };
        assert_eq!(
            vote(&floor, &[&exact], SIZE, &options(0.5)),
            vote(&floor, &[&table], SIZE, &options(0.5))
        );
    }

    #[test]
    fn a_ceiling_has_a_say_and_a_plane_only_once() {
        let floor = rectangle([0.3, 0.6], 0.0, 0.0, 0.012);
        let ceiling = rectangle([0.6, 0.4], 2.4, 1.5, 0.009);
        let below = Fit { plane: Plane { normal: -ceiling.plane.normal, distance: -2.4 }, ..ceiling.clone() };
        let once = vote(&floor, &[&ceiling], SIZE, &options(0.5));
        assert!(once.1 == 2 && tilt_deg(&once.0) > 0.5);
        assert_eq!(vote(&floor, &[&below], SIZE, &options(0.5)), once);
        assert_eq!(vote(&floor, &[&floor, &ceiling, &ceiling], SIZE, &options(0.5)), once);
    }

    #[test]
    fn what_is_not_level_has_no_say() {
        let floor = rectangle([1.5, 1.0], 0.0, 0.0, 0.01);
        for tilt_deg in [4.0, 12.0, 60.0, 90.0] {
            let desk = rectangle([0.7, 0.4], 0.7, tilt_deg, 0.004);
            assert_eq!(vote(&floor, &[&desk], SIZE, &options(0.5)), (Vector3::z(), 1), "{tilt_deg}°");
        }
        // The level part of a desk is what its slope and something else make together.
        let desk = rectangle([0.7, 0.4], 0.7, 12.0, 0.004);
        let part = rectangle([0.4, 0.3], 0.72, 0.1, 0.004);
        assert_eq!(vote(&floor, &[&part], SIZE, &options(0.5)).1, 2);
        assert_eq!(vote(&floor, &[&desk, &part], SIZE, &options(0.5)), (Vector3::z(), 1));
        // Too little is known of a line's tilt, and of a floor that is a line.
        let line = rectangle([0.7, 0.0], 0.7, 0.5, 0.004);
        assert_eq!(vote(&floor, &[&line], SIZE, &options(0.5)), (Vector3::z(), 1));
        let table = rectangle([0.7, 0.5], 0.7, 0.5, 0.004);
        let strip = rectangle([0.7, 0.0], 0.0, 0.0, 0.004);
        assert_eq!(vote(&strip, &[&table], SIZE, &options(0.5)), (Vector3::z(), 1));
    }

    #[test]
    fn what_contradicts_a_large_plane_has_no_say_however_little_is_known_of_the_floor() {
        let floor = rectangle([0.15, 0.6], 0.0, 0.0, 0.014);
        let table = rectangle([0.6, 0.4], 0.7, -2.0, 0.012);
        let seat = rectangle([0.2, 0.2], 1.0, 9.0, 0.012);
        assert_eq!(vote(&floor, &[&seat], SIZE, &options(0.5)).1, 2);
        let without = vote(&floor, &[&table], SIZE, &options(0.5));
        assert_eq!(without.1, 2);
        assert_eq!(vote(&floor, &[&table, &seat], SIZE, &options(0.5)), without);
    }

    #[test]
    fn a_plane_is_level_where_that_is_likelier_than_a_slope() {
        let widest: f64 = 0.4;
        for sigma in [0.005_f64, 0.02, 0.05] {
            // Densities of both at a tilt t: 10 exp(−t²/2σ²) / 2πσ² against 1 / (π · widest²).
            let density = |tilt: f64| {
                10.0 * (-0.5 * (tilt / sigma).powi(2)).exp() / (std::f64::consts::TAU * sigma.powi(2))
            };
            let slope = 1.0 / (std::f64::consts::PI * widest.powi(2));
            for step in 1..100 {
                let tilt = 0.003 * f64::from(step);
                let level = is_level(
                    &Vector2::new(0.6 * tilt, -0.8 * tilt),
                    &(Matrix2::identity() * sigma.powi(2)),
                    widest,
                );
                assert_eq!(level, density(tilt) > slope, "{tilt} of {sigma}");
            }
        }
    }
}
