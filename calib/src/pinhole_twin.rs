//! The pinhole twin of a camera: the picture without distortion that keeps what was filmed.
//!
//! Straightened, the picture of a barrel-shaped lens reaches farther than its own frame, and that of a fisheye farther than
//! any: a ray at the angle θ from the axis lands at `f tan θ`. The twin keeps the focal lengths, and with them the scale in the
//! middle, and its frame is the box around all that the lens shows, with two bounds. It reaches at most
//! [`FARTHEST_DEG`] from the axis on each side, since what lies farther out is stretched beyond use; and it has at most
//! [`MOST_PIXELS`] times the pixels of the filmed picture, for which its focal lengths become smaller where need be.

use nalgebra::{Point2, Vector2};

use crate::{Distortion, Intrinsics};

/// Angle from the axis up to which the twin reaches to the left, right, top and bottom, degrees.
const FARTHEST_DEG: f64 = 65.0;
/// Largest number of the twin's pixels, in parts of the filmed picture's.
const MOST_PIXELS: f64 = 2.0;
/// Number of places on each border of the picture at which its reach is looked at.
const PLACES: u32 = 32;
/// Halvings of the way from the middle to a place without a ray, to find the last place with one.
const HALVINGS: usize = 24;

impl Intrinsics {
    /// The same camera without distortion, of the same matrix and size; its picture is not that of [`Self::pinhole`].
    #[must_use]
    pub fn without_distortion(&self) -> Self {
        Self { distortion: Distortion::NONE, ..self.clone() }
    }

    /// The pinhole twin: the camera without distortion whose image [`crate::undistort`] makes of this one's.
    ///
    /// Its frame is as large as what was filmed asks for, up to 130° across and down and twice the pixels. A camera without
    /// distortion is its own twin.
    #[must_use]
    pub fn pinhole(&self) -> Self {
        if self.distortion.is_none() {
            return self.without_distortion();
        }
        let farthest = FARTHEST_DEG.to_radians().tan();
        let (mut low, mut high) = (Vector2::zeros(), Vector2::zeros());
        for pixel in self.border() {
            let reach = self.reach(&pixel).map(|side| side.clamp(-farthest, farthest));
            (low, high) = (reach.inf(&low), reach.sup(&high));
        }
        let size = Vector2::new(self.fx, self.fy).component_mul(&(high - low));
        let most = MOST_PIXELS * f64::from(self.width) * f64::from(self.height);
        let scale = (most / size.product()).sqrt().min(1.0);
        // A lens that shows nothing but its axis still has a picture.
        let side = |length: f64| ((scale * length).ceil() as u32).max(1);
        let (fx, fy) = (scale * self.fx, scale * self.fy);
        Self {
            width: side(size.x),
            height: side(size.y),
            fx,
            fy,
            cx: -low.x * fx - 0.5,
            cy: -low.y * fy - 0.5,
            distortion: Distortion::NONE,
        }
    }

    /// Places around the picture's outer edge.
    fn border(&self) -> impl Iterator<Item = Point2<f64>> {
        let (right, bottom) = (f64::from(self.width) - 0.5, f64::from(self.height) - 0.5);
        (0..=PLACES).map(|i| f64::from(i) / f64::from(PLACES)).flat_map(move |part| {
            let (u, v) = (part * (right + 0.5) - 0.5, part * (bottom + 0.5) - 0.5);
            [(u, -0.5), (u, bottom), (-0.5, v), (right, v)].map(|(u, v)| Point2::new(u, v))
        })
    }

    /// Place on the plane z = 1 that a pixel shows, or the last that has a ray on the way to it from the axis.
    fn reach(&self, pixel: &Point2<f64>) -> Vector2<f64> {
        if let Some(ray) = self.unproject(pixel) {
            return ray.xy();
        }
        let axis = Point2::new(self.cx, self.cy);
        let (mut seen, mut beyond, mut reach) = (0.0, 1.0, Vector2::zeros());
        for _ in 0..HALVINGS {
            let part = 0.5 * (seen + beyond);
            match self.unproject(&(axis + (pixel - axis) * part)) {
                Some(ray) => (seen, reach) = (part, ray.xy()),
                None => beyond = part,
            }
        }
        reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Fisheye, Rational};
    use nalgebra::Point3;

    fn camera(fov_deg: f64, distortion: impl Into<Distortion>) -> Intrinsics {
        Intrinsics { distortion: distortion.into(), ..Intrinsics::from_horizontal_fov(640, 480, fov_deg) }
    }

    fn fisheye(half_angle_deg: f64) -> Intrinsics {
        let focal = 320.0 / half_angle_deg.to_radians();
        Intrinsics { fx: focal, fy: focal, ..camera(60.0, Fisheye::from([0.0; 4])) }
    }

    /// Share of the pixels with a ray whose ray the twin shows.
    fn kept(k: &Intrinsics) -> f64 {
        let twin = k.pinhole();
        let pixels = (0..640 * 480).step_by(97).map(|i| Point2::new(f64::from(i % 640), f64::from(i / 640)));
        let shown = |pixel: Point2<f64>| {
            let ray = k.unproject(&pixel)?;
            Some(twin.project(&Point3::from(ray)).is_some_and(|p| twin.contains(&p)))
        };
        let shown: Vec<bool> = pixels.filter_map(shown).collect();
        shown.iter().filter(|shown| **shown).count() as f64 / shown.len() as f64
    }

    #[test]
    fn a_pinhole_is_its_own_twin() {
        let k = camera(80.0, Distortion::NONE);
        assert_eq!(k.pinhole(), k);
        let even = camera(80.0, Rational::from([0.0; 8]));
        assert_eq!(even.pinhole(), k);
    }

    #[test]
    fn the_twin_keeps_what_an_ordinary_lens_films() {
        for (fov_deg, numbers) in [
            (70.0, [-0.35, 0.12, 0.0, 0.0, 0.0]),
            (80.0, [-0.1, 0.01, 1e-3, -2e-3, 0.0]),
            (60.0, [0.15, 0.02, 0.0, 0.0, 0.0]),
        ] {
            let k = camera(fov_deg, numbers);
            let twin = k.pinhole();
            assert!(kept(&k) > 0.999, "{}: {twin:?}", kept(&k));
            assert!(twin.width * twin.height <= 2 * 640 * 480 + 3000, "{twin:?}");
            // No wider than what was filmed: each border touches it.
            let corner = k.unproject(&Point2::new(-0.5, -0.5)).unwrap();
            let (left, top) = (-(twin.cx + 0.5) / twin.fx, -(twin.cy + 0.5) / twin.fy);
            assert!(left >= corner.x.min(left + 0.2) - 0.2 && top > -2.2, "{left} {top} {corner}");
        }
        // The frame of old lost a part of this one.
        let wide = camera(90.0, [-0.25, 0.05, 0.0, 0.0, 0.0]);
        let old = wide.without_distortion();
        let corner = Point3::from(wide.unproject(&Point2::new(2.0, 240.0)).unwrap());
        assert!(!old.contains(&old.project(&corner).unwrap()));
        assert!(wide.pinhole().contains(&wide.pinhole().project(&corner).unwrap()));
    }

    #[test]
    fn the_twin_of_a_fisheye_is_bounded_in_angle_and_pixels() {
        let k = fisheye(70.0);
        let twin = k.pinhole();
        assert!(twin.width * twin.height <= 2 * 640 * 480 + 3000, "{twin:?}");
        let side =
            |angle_deg: f64| twin.project(&Point3::new(angle_deg.to_radians().tan(), 0.0, 1.0)).unwrap();
        assert!(twin.contains(&side(64.9)) && !twin.contains(&side(65.3)), "{twin:?}");
        assert!(kept(&k) > 0.75, "{}", kept(&k));
        // A lens that folds within its picture reaches as far as it has rays.
        let folding = camera(100.0, [-0.3, 0.0, 0.0, 0.0, 0.0]);
        assert!(folding.unproject(&Point2::new(-0.5, -0.5)).is_none());
        let twin = folding.pinhole();
        let fold = folding.distortion.max_radius();
        assert!(f64::from(twin.width) <= 2.0 * fold * twin.fx + 2.0 && kept(&folding) > 0.999, "{twin:?}");
    }
}
