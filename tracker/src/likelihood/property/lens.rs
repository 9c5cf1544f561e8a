//! Where a film shows what a pixel of the pinhole twin looks at: the textbook's lens (OpenCV's `[k1, k2, p1, p2, k3]`).

use calib::{Distortion, Intrinsics};
use nalgebra::{Point2, Vector2, Vector3};

/// How near the image's rim (in pixels) or the lens's fold (in parts of its radius) it is left open what the lens shows.
const RIM: f64 = 1e-6;
/// From which part of the fold's radius on a filmed place need not tell its ray: two rays come closer and closer there.
const NEAR_FOLD: f64 = 0.98;

/// A camera's film, seen from the twin.
pub(super) struct Lens {
    intrinsics: Intrinsics,
    fold: f64,
}

/// What the lens makes of a pixel of the twin.
pub(super) struct Filmed {
    /// Where in the film; within the image or outside.
    pub(super) place: Point2<f64>,
    /// Whether the film shows it.
    pub(super) is_shown: Option<bool>,
    /// Where the camera looks at that place: camera frame, z = 1.
    pub(super) ray: Vector3<f64>,
}

impl Lens {
    pub(super) fn new(intrinsics: &Intrinsics) -> Self {
        Self { intrinsics: intrinsics.clone(), fold: fold(&intrinsics.distortion) }
    }

    /// The film of a place in the twin's image. Its ray is cast through the lens; where the film shows nothing, through
    /// the twin.
    pub(super) fn of(&self, twin: &Point2<f64>) -> Filmed {
        let k = &self.intrinsics;
        let straight = Vector2::new((twin.x - k.cx) / k.fx, (twin.y - k.cy) / k.fy);
        let bent = bend(&k.distortion, &straight);
        let place = Point2::new(k.cx + k.fx * bent.x, k.cy + k.fy * bent.y);
        let radius = straight.norm() / self.fold;
        // How far inside, negative outside, in the most doubtful direction.
        let (right, bottom) = (f64::from(k.width) - 0.5 - place.x, f64::from(k.height) - 0.5 - place.y);
        let inside = (place.x + 0.5).min(place.y + 0.5).min(right).min(bottom).min(1.0 - radius);
        let is_shown = (inside.abs() > RIM).then_some(inside > 0.0);
        let ray = if is_shown == Some(true) && radius < NEAR_FOLD {
            k.unproject(&place).unwrap_or_else(|| panic!("{:?} gives no ray to {place}", k.distortion))
        } else {
            Vector3::new(straight.x, straight.y, 1.0)
        };
        Filmed { place, is_shown, ray }
    }
}

fn bend(d: &Distortion, p: &Vector2<f64>) -> Vector2<f64> {
    let (x, y, r2) = (p.x, p.y, p.norm_squared());
    let radial = 1.0 + d.k1 * r2 + d.k2 * r2.powi(2) + d.k3 * r2.powi(3);
    Vector2::new(
        x * radial + 2.0 * d.p1 * x * y + d.p2 * (r2 + 2.0 * x * x),
        y * radial + d.p1 * (r2 + 2.0 * y * y) + 2.0 * d.p2 * x * y,
    )
}

/// The radius from which on the radial part falls, found by walking outwards.
fn fold(d: &Distortion) -> f64 {
    const STEP: f64 = 1e-4;
    let grows = |r: f64| 1.0 + 3.0 * d.k1 * r.powi(2) + 5.0 * d.k2 * r.powi(4) + 7.0 * d.k3 * r.powi(6) > 0.0;
    let Some(last) = (0..40_000).map(|i| f64::from(i) * STEP).find(|r| !grows(r + STEP)) else {
        return f64::INFINITY;
    };
    let (mut low, mut high) = (last, last + STEP);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if grows(middle) { low = middle } else { high = middle }
    }
    low
}
