//! Mapping from a pixel of the pinhole twin to the filmed image, by OpenCV's formulas of ordinary lenses and of fisheyes.

use calib::{Distortion, Intrinsics};
use nalgebra::{Point2, Vector2, Vector3};

/// Distance from the image's rim (pixels) or from the lens's fold (fraction of its radius) within which visibility is
/// undecided.
const RIM: f64 = 1e-6;
/// Least determinant of the lens's derivative on the way from the axis to a place that determines its ray. Towards a fold, by
/// the radial or by the tangential part, it goes to zero, and two rays approach each other.
const LEAST_DETERMINANT: f64 = 0.05;
/// Number of places on the way.
const PLACES: u32 = 24;

/// Filmed image of a camera, as seen from its pinhole twin.
pub(super) struct FilmLens {
    intrinsics: Intrinsics,
    twin: Intrinsics,
    fold: f64,
}

/// Filmed place of a pixel of the twin.
pub(super) struct FilmedPlace {
    /// Place in the filmed image plane, pixels; within the image or outside.
    pub(super) place: Point2<f64>,
    /// Whether the film shows it; `None` if undecided.
    pub(super) is_shown: Option<bool>,
    /// Ray of that place: camera frame, z = 1.
    pub(super) ray: Vector3<f64>,
}

impl FilmLens {
    pub(super) fn new(intrinsics: &Intrinsics, twin: &Intrinsics) -> Self {
        Self { intrinsics: intrinsics.clone(), twin: twin.clone(), fold: fold(&intrinsics.distortion) }
    }

    /// Filmed place of a point in the twin's image. Its ray is computed through the lens; where the film shows nothing,
    /// through the twin.
    pub(super) fn of(&self, twin: &Point2<f64>) -> FilmedPlace {
        let k = &self.intrinsics;
        let t = &self.twin;
        let straight = Vector2::new((twin.x - t.cx) / t.fx, (twin.y - t.cy) / t.fy);
        let bent = bend(&k.distortion, &straight);
        let place = Point2::new(k.cx + k.fx * bent.x, k.cy + k.fy * bent.y);
        let radius = straight.norm() / self.fold;
        // Distance inside (negative: outside) in the most critical direction.
        let (right, bottom) = (f64::from(k.width) - 0.5 - place.x, f64::from(k.height) - 0.5 - place.y);
        let inside = (place.x + 0.5).min(place.y + 0.5).min(right).min(bottom).min(1.0 - radius);
        let is_shown = (inside.abs() > RIM).then_some(inside > 0.0);
        let ray = if is_shown == Some(true) && is_determined(&k.distortion, &straight) {
            k.unproject(&place).unwrap_or_else(|| panic!("{:?} gives no ray to {place}", k.distortion))
        } else {
            Vector3::new(straight.x, straight.y, 1.0)
        };
        FilmedPlace { place, is_shown, ray }
    }
}

/// Whether the filmed place of a point on the plane z = 1 is far from every fold, so that it determines the point.
fn is_determined(d: &Distortion, p: &Vector2<f64>) -> bool {
    const STEP: f64 = 1e-6;
    let slope = |at: &Vector2<f64>, step: Vector2<f64>| {
        (bend(d, &(at + step)) - bend(d, &(at - step))) / (2.0 * STEP)
    };
    (1..=PLACES).map(|i| p * (f64::from(i) / f64::from(PLACES))).all(|at| {
        let (u, v) = (slope(&at, Vector2::new(STEP, 0.0)), slope(&at, Vector2::new(0.0, STEP)));
        u.x * v.y - u.y * v.x >= LEAST_DETERMINANT
    })
}

/// Angle from the axis, radians, from which on a fisheye shows nothing.
const FISHEYE_END: f64 = 85.0 * std::f64::consts::PI / 180.0;

fn bend(d: &Distortion, p: &Vector2<f64>) -> Vector2<f64> {
    let [k1, k2, p1, p2, k3] = match d {
        Distortion::BrownConrady(model) => model.coefficients(),
        Distortion::Fisheye(model) => {
            let [k1, k2, k3, k4] = model.coefficients();
            let t = p.norm().atan2(1.0);
            let bent = t + k1 * t.powi(3) + k2 * t.powi(5) + k3 * t.powi(7) + k4 * t.powi(9);
            return p * if t > 0.0 { bent / p.norm() } else { 1.0 };
        }
        Distortion::Rational(_) => panic!("{d:?} is no lens of these scenes"),
    };
    let (x, y, r2) = (p.x, p.y, p.norm_squared());
    let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
    Vector2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

/// Radius from which on the radial part decreases, or a fisheye ends.
fn fold(d: &Distortion) -> f64 {
    match d {
        Distortion::BrownConrady(model) => {
            let [k1, k2, _, _, k3] = model.coefficients();
            let slope = |r: f64| 1.0 + 3.0 * k1 * r.powi(2) + 5.0 * k2 * r.powi(4) + 7.0 * k3 * r.powi(6);
            last_growing(slope, 4.0).unwrap_or(f64::INFINITY)
        }
        Distortion::Fisheye(model) => {
            let [k1, k2, k3, k4] = model.coefficients();
            let slope = |t: f64| {
                1.0 + 3.0 * k1 * t.powi(2)
                    + 5.0 * k2 * t.powi(4)
                    + 7.0 * k3 * t.powi(6)
                    + 9.0 * k4 * t.powi(8)
            };
            last_growing(slope, FISHEYE_END).unwrap_or(FISHEYE_END).tan()
        }
        Distortion::Rational(_) => panic!("{d:?} is no lens of these scenes"),
    }
}

/// Place up to which a slope is positive, found by stepping outwards; `None` if it is as far as `end`.
fn last_growing(slope: impl Fn(f64) -> f64, end: f64) -> Option<f64> {
    const STEP: f64 = 1e-4;
    let steps = (end / STEP) as u32;
    let last = (0..steps).map(|i| f64::from(i) * STEP).find(|r| slope(r + STEP) <= 0.0)?;
    let (mut low, mut high) = (last, last + STEP);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if slope(middle) > 0.0 { low = middle } else { high = middle }
    }
    Some(low)
}
