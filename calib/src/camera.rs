//! The pinhole camera with OpenCV's distortion: pixels ↔ rays, world ↔ camera.

use nalgebra::{Isometry3, Matrix2x3, Matrix3, Point2, Point3, Unit, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use shell::ranges::{DISTORTION, LENS_PX, SIDE_PX};

use crate::picture::size_defect;
use crate::{Distortion, Error, Result};

/// Mapping of directions to pixels: image size, focal lengths, principal point, distortion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, x. Pixel (0, 0) is the centre of the top-left pixel.
    pub cx: f64,
    /// Principal point, y.
    pub cy: f64,
    /// Lens distortion.
    pub distortion: Distortion,
}

impl Intrinsics {
    /// An undistorted camera with square pixels, the principal point in the middle and the given horizontal
    /// field of view.
    pub fn from_horizontal_fov(width: u32, height: u32, fov_deg: f64) -> Self {
        let focal = 0.5 * width as f64 / (0.5 * fov_deg.to_radians()).tan();
        Self::centred(width, height, focal, Distortion::NONE)
    }

    /// A camera with square pixels, the principal point in the middle, and a focal length in pixels.
    pub fn centred(width: u32, height: u32, focal_px: f64, distortion: Distortion) -> Self {
        Self {
            width,
            height,
            fx: focal_px,
            fy: focal_px,
            cx: 0.5 * (f64::from(width) - 1.0),
            cy: 0.5 * (f64::from(height) - 1.0),
            distortion,
        }
    }

    /// Builds the intrinsics from OpenCV's 3 × 3 camera matrix.
    ///
    /// # Errors
    /// [`Error::Invalid`] when the matrix is not `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` with positive finite focal
    /// lengths, the image is empty or a coefficient is not finite.
    pub fn from_matrix(
        width: u32,
        height: u32,
        matrix: &Matrix3<f64>,
        distortion: Distortion,
    ) -> Result<Self> {
        let k = matrix;
        let shape = [k[(0, 1)], k[(1, 0)], k[(2, 0)], k[(2, 1)], k[(2, 2)] - 1.0];
        if !shape.iter().all(|v| v.abs() < 1e-9) {
            return Err(Error::Invalid(
                "the camera matrix is not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] (skew is not supported)"
                    .into(),
            ));
        }
        let intrinsics =
            Self { width, height, fx: k[(0, 0)], fy: k[(1, 1)], cx: k[(0, 2)], cy: k[(1, 2)], distortion };
        intrinsics.validate()?;
        Ok(intrinsics)
    }

    /// Checks the invariants that every other method relies on.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an empty image, a focal length that is not positive, or a number that is not finite.
    pub fn validate(&self) -> Result<()> {
        if self.width == 0 || self.height == 0 {
            return Err(Error::Invalid(format!("the image size {} × {} is empty", self.width, self.height)));
        }
        let (width, height) = (self.width, self.height);
        if !SIDE_PX.contains(f64::from(width.max(height))) {
            return Err(Error::Invalid(format!(
                "the image size {width} × {height} is no camera's (at most {} a side)",
                SIDE_PX.most
            )));
        }
        if let Some(problem) = size_defect(width, height) {
            return Err(Error::Invalid(format!("the image {problem}")));
        }
        if !(self.fx > 0.0 && self.fy > 0.0 && self.fx.is_finite() && self.fy.is_finite()) {
            return Err(Error::Invalid(format!(
                "the focal lengths {}, {} are not positive",
                self.fx, self.fy
            )));
        }
        if !(self.cx.is_finite() && self.cy.is_finite() && self.distortion.is_finite()) {
            return Err(Error::Invalid(
                "the principal point or a distortion coefficient is not finite".into(),
            ));
        }
        let lens =
            [self.fx, self.fy, self.cx, self.cy].map(|value| ("a number of the matrix", value, LENS_PX));
        let coefficients = self.distortion.coefficients();
        let distortion =
            coefficients.into_iter().map(|value| ("a distortion coefficient", value, DISTORTION));
        for (name, value, range) in lens.into_iter().chain(distortion) {
            if let Some(problem) = range.defect(value) {
                return Err(Error::Invalid(format!("{name} {problem}")));
            }
        }
        Ok(())
    }

    /// OpenCV's camera matrix.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// The camera of the image scaled to `width` × `height`; pixel centres stay where they belong.
    #[must_use]
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        Self {
            width,
            height,
            fx: self.fx * sx,
            fy: self.fy * sy,
            cx: (self.cx + 0.5) * sx - 0.5,
            cy: (self.cy + 0.5) * sy - 0.5,
            distortion: self.distortion,
        }
    }

    /// Projects a point in camera coordinates to its pixel.
    ///
    /// `None` behind the camera, and where the lens model has folded back on itself
    /// ([`Distortion::max_radius`]). The pixel may lie outside the image.
    pub fn project(&self, p: &Point3<f64>) -> Option<Point2<f64>> {
        if p.z <= 0.0 || !p.z.is_finite() {
            return None;
        }
        let mut n = Vector2::new(p.x / p.z, p.y / p.z);
        if !self.distortion.is_none() {
            if n.norm() > self.distortion.max_radius() {
                return None;
            }
            n = self.distortion.distort(n);
        }
        Some(Point2::new(self.fx * n.x + self.cx, self.fy * n.y + self.cy))
    }

    /// Derivative of [`Self::project`] with respect to the point in camera coordinates.
    pub fn project_jacobian(&self, p: &Point3<f64>) -> Matrix2x3<f64> {
        let (inv_z, n) = (1.0 / p.z, Vector2::new(p.x / p.z, p.y / p.z));
        let d_normalised = Matrix2x3::new(inv_z, 0.0, -n.x * inv_z, 0.0, inv_z, -n.y * inv_z);
        let mut j = self.distortion.jacobian(n) * d_normalised;
        j.row_mut(0).scale_mut(self.fx);
        j.row_mut(1).scale_mut(self.fy);
        j
    }

    /// Point of a pixel's ray at z = 1 in camera coordinates.
    ///
    /// `None` where the lens model gives no ray to this pixel.
    pub fn unproject(&self, pixel: &Point2<f64>) -> Option<Vector3<f64>> {
        let distorted = Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy);
        let n = self.distortion.undistort(distorted)?;
        Some(Vector3::new(n.x, n.y, 1.0))
    }

    /// Tells whether a pixel lies on the image, borders of the outer pixels included.
    pub fn contains(&self, pixel: &Point2<f64>) -> bool {
        (-0.5..=self.width as f64 - 0.5).contains(&pixel.x)
            && (-0.5..=self.height as f64 - 0.5).contains(&pixel.y)
    }
}

/// A calibrated camera with its pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Mapping of directions to pixels.
    pub intrinsics: Intrinsics,
    /// `X_camera = camera_from_world · X_world`, metres in a finished room.
    pub camera_from_world: Isometry3<f64>,
}

impl Camera {
    /// Centre of the camera, in world coordinates.
    pub fn center(&self) -> Point3<f64> {
        self.camera_from_world.rotation.inverse() * Point3::from(-self.camera_from_world.translation.vector)
    }

    /// Projects a world point to its pixel; `None` as in [`Intrinsics::project`].
    pub fn project(&self, world: &Point3<f64>) -> Option<Point2<f64>> {
        self.intrinsics.project(&(self.camera_from_world * world))
    }

    /// Direction in the world that a pixel looks along; `None` as in [`Intrinsics::unproject`].
    pub fn ray(&self, pixel: &Point2<f64>) -> Option<Unit<Vector3<f64>>> {
        let direction = self.intrinsics.unproject(pixel)?;
        Some(Unit::new_normalize(self.camera_from_world.rotation.inverse() * direction))
    }

    /// The world point seen at a pixel at the given depth along the camera's z.
    pub fn back_project(&self, pixel: &Point2<f64>, depth_z: f64) -> Option<Point3<f64>> {
        let direction = self.intrinsics.unproject(pixel)?;
        Some(self.camera_from_world.inverse() * Point3::from(direction * depth_z))
    }

    /// The same camera in the world `b`, given the rigid `b_from_a` of its present world `a`.
    #[must_use]
    pub fn moved(&self, b_from_a: &Isometry3<f64>) -> Self {
        Self {
            intrinsics: self.intrinsics.clone(),
            camera_from_world: self.camera_from_world * b_from_a.inverse(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Translation3, UnitQuaternion};
    use proptest::prelude::*;

    fn wide() -> Intrinsics {
        Intrinsics {
            width: 640,
            height: 480,
            fx: 430.0,
            fy: 425.0,
            cx: 321.5,
            cy: 236.0,
            distortion: [-0.2, 0.05, 0.001, -0.002, 0.0].into(),
        }
    }

    proptest! {
        #[test]
        fn unproject_inverts_project(x in -1.0..1.0, y in -0.7..0.7, z in 0.5..20.0) {
            let k = wide();
            let pixel = k.project(&Point3::new(x * z * 0.7, y * z * 0.7, z)).unwrap();
            let back = k.unproject(&pixel).unwrap();
            prop_assert!((back - Vector3::new(x * 0.7, y * 0.7, 1.0)).norm() < 1e-9);
        }

        #[test]
        fn jacobian_matches_finite_differences(x in -0.6..0.6, y in -0.5..0.5, z in 0.5..10.0) {
            let (k, p, step) = (wide(), Point3::new(x * z, y * z, z), 1e-6);
            let analytic = k.project_jacobian(&p);
            for axis in 0..3 {
                let mut delta = Vector3::zeros();
                delta[axis] = step;
                let numeric = (k.project(&(p + delta)).unwrap() - k.project(&(p - delta)).unwrap()) / (2.0 * step);
                prop_assert!((analytic.column(axis) - numeric).norm() < 1e-5 * (1.0 + numeric.norm()));
            }
        }
    }

    #[test]
    fn behind_the_camera_there_is_no_pixel() {
        for z in [0.0, -1.0, f64::NAN] {
            assert_eq!(wide().project(&Point3::new(0.1, 0.1, z)), None);
        }
    }

    #[test]
    fn a_camera_finds_its_own_centre_and_rays() {
        let camera = Camera {
            intrinsics: wide(),
            camera_from_world: Isometry3::from_parts(
                Translation3::new(0.3, -1.2, 2.0),
                UnitQuaternion::from_euler_angles(0.4, -1.1, 2.0),
            ),
        };
        let pixel = Point2::new(100.0, 200.0);
        let world = camera.back_project(&pixel, 3.5).unwrap();
        assert_relative_eq!(camera.project(&world).unwrap(), pixel, epsilon = 1e-9);
        let towards = Unit::new_normalize(world - camera.center());
        assert_relative_eq!(towards.into_inner(), camera.ray(&pixel).unwrap().into_inner(), epsilon = 1e-12);

        let b_from_a = Isometry3::from_parts(
            Translation3::new(1.0, 2.0, 3.0),
            UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
        );
        let moved = camera.moved(&b_from_a);
        assert_relative_eq!(moved.project(&(b_from_a * world)).unwrap(), pixel, epsilon = 1e-9);
    }

    #[test]
    fn matrices_that_are_no_camera_are_refused() {
        let good = wide().matrix();
        assert!(Intrinsics::from_matrix(640, 480, &good, Distortion::NONE).is_ok());
        assert!(Intrinsics::from_matrix(0, 480, &good, Distortion::NONE).is_err());
        for (row, column, value) in
            [(0, 1, 0.5), (0, 0, -1.0), (1, 1, f64::NAN), (2, 2, 0.0), (0, 2, f64::INFINITY)]
        {
            let mut bad = good;
            bad[(row, column)] = value;
            assert!(Intrinsics::from_matrix(640, 480, &bad, Distortion::NONE).is_err(), "{bad}");
        }
    }

    #[test]
    fn resizing_keeps_directions() {
        let (k, half) = (wide(), wide().resized(320, 240));
        let direction = Point3::new(0.2, -0.1, 1.0);
        let (full, small) = (k.project(&direction).unwrap(), half.project(&direction).unwrap());
        assert_relative_eq!(0.5 * (full.x + 0.5) - 0.5, small.x, epsilon = 1e-9);
        assert_relative_eq!(0.5 * (full.y + 0.5) - 0.5, small.y, epsilon = 1e-9);
    }
}
