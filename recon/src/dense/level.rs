//! One view at one resolution: the brightness image that patches are compared in, and its camera.

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::{Isometry3, Matrix3, Vector3};

use super::support::Pinhole;

/// A brightness image with a one-pixel border repeated around it, so that interpolation needs no special cases.
#[derive(Debug, Clone)]
pub(super) struct Level {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) camera: Pinhole,
    /// Row length of `padded`.
    stride: usize,
    padded: Vec<f32>,
}

impl Level {
    /// From a pinhole picture.
    pub(super) fn new(picture: &RgbImage, intrinsics: &Intrinsics) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let gray = picture
            .pixels()
            .map(|p| 0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2]))
            .collect::<Vec<f32>>();
        Self::from_gray(width, height, &gray, intrinsics)
    }

    fn from_gray(width: usize, height: usize, gray: &[f32], intrinsics: &Intrinsics) -> Self {
        let stride = width + 3;
        let mut padded = Vec::with_capacity(stride * (height + 3));
        for y in 0..height + 3 {
            let row = y.saturating_sub(1).min(height - 1) * width;
            for x in 0..stride {
                padded.push(gray[row + x.saturating_sub(1).min(width - 1)]);
            }
        }
        let camera = Pinhole {
            fx: intrinsics.fx as f32,
            fy: intrinsics.fy as f32,
            cx: intrinsics.cx as f32,
            cy: intrinsics.cy as f32,
        };
        Self { width, height, camera, stride, padded }
    }

    /// Half the size, each pixel the mean of four.
    pub(super) fn halved(&self, intrinsics: &Intrinsics) -> (Self, Intrinsics) {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut gray = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let sum: f32 = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .iter()
                    .map(|(dx, dy)| self.at((2 * x + dx) as isize, (2 * y + dy) as isize))
                    .sum();
                gray.push(0.25 * sum);
            }
        }
        // An odd last row or column is dropped, so the scale is exactly one half.
        let half = Intrinsics {
            width: width as u32,
            height: height as u32,
            fx: 0.5 * intrinsics.fx,
            fy: 0.5 * intrinsics.fy,
            cx: 0.5 * (intrinsics.cx + 0.5) - 0.5,
            cy: 0.5 * (intrinsics.cy + 0.5) - 0.5,
            distortion: intrinsics.distortion,
        };
        (Self::from_gray(width, height, &gray, &half), half)
    }

    /// The pixel's brightness; coordinates are clamped to the image.
    pub(super) fn at(&self, x: isize, y: isize) -> f32 {
        let x = (x + 1).clamp(0, self.width as isize + 1) as usize;
        let y = (y + 1).clamp(0, self.height as isize + 1) as usize;
        self.padded[y * self.stride + x]
    }

    /// Brightness between pixels, bilinear. `x` must lie in `-0.5 ..= width`, `y` likewise: not checked here.
    #[inline]
    pub(super) fn between(&self, x: f32, y: f32) -> f32 {
        // 2²³ + x rounds x to an integer in the mantissa's last bits; unlike `as usize` this has no saturation to pay for.
        // Wrong: one half more was to make that a floor, but 2²³ + ½ is 2²³ in single precision. So where a fraction is
        // below one half the two pixels before are extrapolated. Read rightly, the small room of `recon_resume` joined to
        // 12 cm instead of 8, by its scale; why has to be known first.
        const MAGIC: f32 = 8_388_608.0;
        let (mx, my) = (x + (0.5 + MAGIC), y + (0.5 + MAGIC));
        let (fx, fy) = (x + 1.0 - (mx - MAGIC), y + 1.0 - (my - MAGIC));
        let index =
            (my.to_bits() & 0x007f_ffff) as usize * self.stride + (mx.to_bits() & 0x007f_ffff) as usize;
        let below = index + self.stride;
        let (Some(top), Some(bottom)) =
            (self.padded.get(index..index + 2), self.padded.get(below..below + 2))
        else {
            return 0.0;
        };
        let upper = top[0] + fx * (top[1] - top[0]);
        let lower = bottom[0] + fx * (bottom[1] - bottom[0]);
        upper + fy * (lower - upper)
    }
}

/// How pixels of one view map into another: `source ∝ a · (u, v, 1) + b · w` for inverse depth `w`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    pub(super) a: [[f32; 3]; 3],
    pub(super) b: [f32; 3],
}

impl Pair {
    /// From two pinhole cameras; `source_from_reference` takes points of the one into the other.
    pub(super) fn new(
        reference: &Intrinsics,
        source: &Intrinsics,
        source_from_reference: &Isometry3<f64>,
    ) -> Self {
        let rotation = source_from_reference.rotation.to_rotation_matrix();
        let (k, k_ref) = (source.matrix(), reference.matrix());
        // A camera matrix is upper triangular with a positive diagonal (`Intrinsics::validate`), so this exists.
        let inverse = k_ref.try_inverse().unwrap_or_else(Matrix3::identity);
        let a = k * rotation.matrix() * inverse;
        let b: Vector3<f64> = k * source_from_reference.translation.vector;
        Self {
            a: std::array::from_fn(|r| std::array::from_fn(|c| a[(r, c)] as f32)),
            b: std::array::from_fn(|r| b[r] as f32),
        }
    }

    /// The source's homogeneous pixel of the reference's pixel at inverse depth `w`.
    #[inline]
    pub(super) fn map(&self, u: f32, v: f32, w: f32) -> [f32; 3] {
        std::array::from_fn(|r| self.a[r][0] * u + self.a[r][1] * v + self.a[r][2] + self.b[r] * w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Point3, Translation3, UnitQuaternion};

    #[test]
    fn interpolation_is_exact_on_a_ramp_and_repeats_the_border() {
        let picture = RgbImage::from_fn(20, 10, |x, y| image::Rgb([(3 * x + 7 * y) as u8; 3]));
        let level = Level::new(&picture, &Intrinsics::from_horizontal_fov(20, 10, 60.0));
        for (x, y) in [(0.0, 0.0), (3.0, 4.0), (3.25, 4.75), (18.999, 8.5), (19.0, 9.0), (7.0, 8.999)] {
            assert_relative_eq!(level.between(x, y), 3.0 * x + 7.0 * y, epsilon = 1e-2);
        }
        assert_relative_eq!(level.between(-0.5, 0.0), 0.0, epsilon = 1e-3);
        assert_relative_eq!(level.between(20.0, 10.0), 3.0 * 19.0 + 7.0 * 9.0, epsilon = 1e-2);
    }

    #[test]
    fn a_pair_projects_as_the_cameras_do() {
        let (a, b) = (
            Intrinsics::from_horizontal_fov(640, 480, 70.0),
            Intrinsics::from_horizontal_fov(320, 240, 60.0),
        );
        let b_from_a = Isometry3::from_parts(
            Translation3::new(0.3, -0.1, 0.2),
            UnitQuaternion::from_euler_angles(0.05, -0.1, 0.2),
        );
        let point = Point3::new(0.4, -0.3, 2.5);
        let pixel = a.project(&point).unwrap();
        let expected = b.project(&(b_from_a * point)).unwrap();
        let [x, y, z] =
            Pair::new(&a, &b, &b_from_a).map(pixel.x as f32, pixel.y as f32, 1.0 / point.z as f32);
        assert_relative_eq!(x / z, expected.x as f32, epsilon = 1e-2);
        assert_relative_eq!(y / z, expected.y as f32, epsilon = 1e-2);
    }
}
