//! The vertical from planes whose tilt is known.

use super::*;
use crate::floor::Plane;
use approx::assert_relative_eq;
use nalgebra::{Matrix3, Point3, Rotation3};

const SIZE: f64 = 2.0;

/// A rectangle `size` (x, y) of standard deviations about (0, 0, `height`), tilted about y by `tilt_deg`, with
/// residuals `rms`.
fn rectangle(size: [f64; 2], height: f64, tilt_deg: f64, rms: f64) -> PlaneFit {
    let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), tilt_deg.to_radians());
    let normal = turned * Vector3::z();
    let spread = Matrix3::from_diagonal(&Vector3::new(size[0].powi(2), size[1].powi(2), rms.powi(2)));
    let mean = Point3::new(0.0, 0.0, height);
    PlaneFit {
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

/// Consensus as [`super::super::find`] computes it: with each plane taken to be level.
fn vote(floor: &PlaneFit, planes: &[&PlaneFit], options: &FloorOptions) -> ConsensusResult {
    let voices = VerticalConsensus::new(floor, planes, &[], SIZE, options);
    let ups = std::iter::once(&floor).chain(planes).map(|p| p.plane.normal * p.plane.normal.z.signum());
    ups.filter_map(|up| voices.consensus(&up)).reduce(|a, b| if b.area > a.area { b } else { a }).unwrap()
}

fn tilt_deg(normal: &Vector3<f64>) -> f64 {
    normal.x.atan2(normal.z).to_degrees()
}

#[test]
fn each_plane_counts_as_what_is_known_of_it() {
    // Sine and tangent of a degree differ by less than the tolerance.
    let floor = rectangle([0.3, 0.6], 0.0, 0.0, 0.012);
    let table = rectangle([0.6, 0.4], 0.7, 1.0, 0.009);
    let patches = |fit: &PlaneFit| (fit.area / (0.3 * SIZE).powi(2)).sqrt();
    assert!(patches(&floor) > 2.0 && patches(&table) > 2.0);
    let sigma = [0.012 / 0.3 / patches(&floor), 0.009 / 0.6 / patches(&table)];
    for level_deg in [0.0, 0.5, 1.5] {
        let own = sigma[1].powi(2) + f64::to_radians(level_deg).powi(2);
        let expected_deg = (1.0 / own) / (1.0 / own + 1.0 / sigma[0].powi(2));
        let agreed = vote(&floor, &[&table], &options(level_deg));
        assert_eq!((agreed.level, agreed.plumb), (2, 0));
        assert_relative_eq!(tilt_deg(&agreed.up), expected_deg, epsilon = 2e-3);
        assert_relative_eq!(agreed.up.y, 0.0, epsilon = 1e-12);
        assert!(agreed.area < floor.area + table.area);
    }
    let level = rectangle([0.6, 0.4], 0.7, 0.0, 0.009);
    let agreed = vote(&floor, &[&level], &options(0.5));
    assert_relative_eq!(agreed.area, floor.area + level.area, epsilon = 1e-9);
    // Less than a patch counts as one observation.
    let whole = FloorOptions { correlated: 10.0, ..options(0.0) };
    let expected_deg = 1.0 / (1.0 + (0.009f64 / 0.6 * 0.3 / 0.012).powi(2));
    assert_relative_eq!(tilt_deg(&vote(&floor, &[&table], &whole).up), expected_deg, epsilon = 2e-3);
    // Points that were moved onto their plane keep stereo's own deviation alone.
    let exact = PlaneFit { rms: 0.0, sigma_squared: 0.009f64.powi(2), ..table.clone() };
    assert_eq!(vote(&floor, &[&exact], &options(0.5)), vote(&floor, &[&table], &options(0.5)));
}

#[test]
fn a_ceiling_has_a_say_and_a_plane_only_once() {
    let floor = rectangle([0.3, 0.6], 0.0, 0.0, 0.012);
    let ceiling = rectangle([0.6, 0.4], 2.4, 1.5, 0.009);
    let below =
        PlaneFit { plane: Plane { normal: -ceiling.plane.normal, distance: -2.4 }, ..ceiling.clone() };
    let once = vote(&floor, &[&ceiling], &options(0.5));
    assert!(once.level == 2 && tilt_deg(&once.up) > 0.5);
    assert_eq!(vote(&floor, &[&below], &options(0.5)), once);
    assert_eq!(vote(&floor, &[&floor, &ceiling, &ceiling], &options(0.5)), once);
}

#[test]
fn a_wall_says_how_its_normal_leans_and_nothing_else() {
    let floor = rectangle([0.3, 0.3], 0.0, 0.0, 0.012);
    let patches = |fit: &PlaneFit| fit.area / (0.3 * SIZE).powi(2);
    let wall = rectangle([0.8, 0.5], 1.2, 91.0, 0.009);
    let level_deg: f64 = 0.5;
    let own = (0.009_f64 / 0.8).powi(2) / patches(&wall) + level_deg.to_radians().powi(2);
    let floors = (0.012_f64 / 0.3).powi(2) / patches(&floor);
    // Expected tilt: that of a floor tilted by a degree.
    let expected_deg = (1.0 / own) / (1.0 / own + 1.0 / floors);
    let agreed = vote(&floor, &[&wall], &options(level_deg));
    assert_eq!((agreed.level, agreed.plumb), (1, 1));
    assert_relative_eq!(tilt_deg(&agreed.up), expected_deg, epsilon = 2e-3);
    assert_relative_eq!(agreed.up.y, 0.0, epsilon = 1e-12);
    // From behind it is the same wall, and it counts once.
    let behind = PlaneFit {
        plane: Plane { normal: -wall.plane.normal, distance: -wall.plane.distance },
        ..wall.clone()
    };
    assert_eq!(vote(&floor, &[&behind], &options(level_deg)), agreed);
    assert_eq!(vote(&floor, &[&wall, &behind], &options(level_deg)), agreed);
    // A leaning board does not count, nor does a wall of which only a level line is seen.
    for wall in [rectangle([0.8, 0.5], 1.2, 102.0, 0.004), rectangle([0.0, 0.5], 1.2, 91.0, 0.004)] {
        let alone = vote(&floor, &[&wall], &options(level_deg));
        assert_eq!((alone.up, alone.plumb), (Vector3::z(), 0));
    }
}

#[test]
fn sloped_planes_do_not_affect_the_vertical() {
    let floor = rectangle([1.5, 1.0], 0.0, 0.0, 0.01);
    let is_alone = |agreed: ConsensusResult| agreed.up == Vector3::z() && agreed.level == 1;
    for tilt_deg in [4.0, 12.0, 60.0] {
        let desk = rectangle([0.7, 0.4], 0.7, tilt_deg, 0.004);
        assert!(is_alone(vote(&floor, &[&desk], &options(0.5))), "{tilt_deg}°");
    }
    // The level part of a desk: its slope combined with another surface.
    let desk = rectangle([0.7, 0.4], 0.7, 12.0, 0.004);
    let part = rectangle([0.4, 0.3], 0.72, 0.1, 0.004);
    assert_eq!(vote(&floor, &[&part], &options(0.5)).level, 2);
    assert!(is_alone(vote(&floor, &[&desk, &part], &options(0.5))));
    // The tilt of a line is undetermined, also for a floor that is a line.
    let line = rectangle([0.7, 0.0], 0.7, 0.5, 0.004);
    assert!(is_alone(vote(&floor, &[&line], &options(0.5))));
    let table = rectangle([0.7, 0.5], 0.7, 0.5, 0.004);
    let strip = rectangle([0.7, 0.0], 0.0, 0.0, 0.004);
    assert!(is_alone(vote(&strip, &[&table], &options(0.5))));
    let up = table.plane.normal;
    assert_eq!(
        VerticalConsensus::new(&strip, &[&table], &[], SIZE, &options(0.5)).consensus(&up).unwrap().up,
        up
    );
}

#[test]
fn planes_that_contradict_a_large_one_are_excluded_even_with_an_uncertain_floor() {
    let floor = rectangle([0.15, 0.6], 0.0, 0.0, 0.014);
    let table = rectangle([0.6, 0.4], 0.7, -2.0, 0.012);
    let seat = rectangle([0.2, 0.2], 1.0, 9.0, 0.012);
    assert_eq!(vote(&floor, &[&seat], &options(0.5)).level, 2);
    let without = vote(&floor, &[&table], &options(0.5));
    assert_eq!(without.level, 2);
    assert_eq!(vote(&floor, &[&table, &seat], &options(0.5)), without);
}

#[test]
fn a_plane_is_true_where_that_is_likelier_than_a_slope() {
    let widest: f64 = 0.4;
    for sigma in [0.005_f64, 0.02, 0.05] {
        let variance = sigma.powi(2);
        let level =
            TiltConstraint::level(Vector2::zeros(), &(Matrix2::identity() * variance), 1.0, widest).unwrap();
        let plumb = TiltConstraint::plumb(&Vector2::new(0.6, -0.8), 0.0, variance, 1.0, widest).unwrap();
        for step in 1..100 {
            let tilt = 0.003 * f64::from(step);
            let bell = (-0.5 * (tilt / sigma).powi(2)).exp();
            // There are ten level planes for each that slopes anywhere in a circle, and ten plumb ones for each
            // that leans within as much to both sides.
            let is_level = 10.0 * bell / (std::f64::consts::TAU * variance)
                > 1.0 / (std::f64::consts::PI * widest.powi(2));
            let is_plumb = 10.0 * bell / (std::f64::consts::TAU.sqrt() * sigma) > 0.5 / widest;
            let at = Vector2::new(0.6 * tilt, -0.8 * tilt);
            assert_eq!((level.agrees(&at), plumb.agrees(&at)), (is_level, is_plumb), "{tilt} of {sigma}");
            assert!(plumb.agrees(&Vector2::new(0.8 * tilt, 0.6 * tilt)), "along a wall nothing is said");
        }
    }
}
