//! One view at one resolution: the brightness image in which patches are compared, and its camera.

use calib::Intrinsics;
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Matrix3, Vector3};
use wide::{f32x4, i32x4};

use super::support::Pinhole;

/// A brightness image with a one-pixel border repeated around it, so that interpolation needs no special cases. Pixels that the
/// lens did not film, beside the picture of a distorted one, are NaN, and with them whatever is computed of them.
#[derive(Debug, Clone)]
pub(super) struct PyramidLevel {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) camera: Pinhole,
    /// Length of a row of `padded`.
    pub(super) stride: usize,
    /// Each pixel with the one below it, so that the four around a place lie side by side.
    pub(super) padded: Vec<[f32; 2]>,
}

impl PyramidLevel {
    /// Converts a pinhole picture; `filmed` tells which of its pixels the lens filmed.
    pub(super) fn new(picture: &RgbImage, filmed: &[bool], intrinsics: &Intrinsics) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let brightness =
            |p: &Rgb<u8>| 0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2]);
        let gray: Vec<f32> = picture
            .pixels()
            .zip(filmed)
            .map(|(pixel, filmed)| if *filmed { brightness(pixel) } else { f32::NAN })
            .collect();
        Self::from_gray(width, height, &gray, intrinsics)
    }

    fn from_gray(width: usize, height: usize, gray: &[f32], intrinsics: &Intrinsics) -> Self {
        let stride = width + 3;
        let mut padded = Vec::with_capacity(stride * (height + 3));
        for y in 0..height + 3 {
            let [row, below] = [y, y + 1].map(|y| y.saturating_sub(1).min(height - 1) * width);
            for x in 0..stride {
                let column = x.saturating_sub(1).min(width - 1);
                padded.push([gray[row + column], gray[below + column]]);
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

    /// Tells of each pixel, row by row, whether the lens filmed it.
    pub(super) fn filmed(&self) -> Vec<bool> {
        let row = |y| self.row(0, y, self.width).iter().map(|[value, _]| !value.is_nan());
        (0..self.height).flat_map(row).collect()
    }

    /// Brightness of a pixel; coordinates are clamped to the image.
    pub(super) fn at(&self, x: isize, y: isize) -> f32 {
        let x = (x + 1).clamp(0, self.width as isize + 1) as usize;
        let y = (y + 1).clamp(0, self.height as isize + 1) as usize;
        self.padded[y * self.stride + x][0]
    }

    /// `count` pixels to the right from (`x`, `y`), each with the one below it; all must lie in the image.
    pub(super) fn row(&self, x: usize, y: usize, count: usize) -> &[[f32; 2]] {
        &self.padded[(y + 1) * self.stride + x + 1..][..count]
    }

    /// Brightness between pixels, bilinear, at four places. `x` must lie in `-1 ..= width`, `y` likewise; this is not
    /// checked.
    #[inline]
    pub(super) fn between(&self, x: f32x4, y: f32x4) -> f32x4 {
        // With the border no coordinate is negative, so rounding towards zero rounds down.
        let (x, y) = (x + f32x4::ONE, y + f32x4::ONE);
        let (left, top) = (x.fast_trunc_int(), y.fast_trunc_int());
        let (fx, fy) = (x - left.round_float(), y - top.round_float());
        let index = (top * i32x4::splat(self.stride as i32) + left).to_array();
        let around = |lane: usize| {
            let index = index[lane] as u32 as usize;
            match self.padded.get(index..index + 2) {
                Some(&[[a, b], [c, d]]) => f32x4::new([a, b, c, d]),
                _ => f32x4::ZERO,
            }
        };
        let [upper, lower, upper_right, lower_right] =
            f32x4::transpose([around(0), around(1), around(2), around(3)]);
        let upper = upper + fx * (upper_right - upper);
        let lower = lower + fx * (lower_right - lower);
        upper + fy * (lower - upper)
    }
}

/// Mapping of pixels of one view into another: `source ∝ a · (u, v, 1) + b · w` for inverse depth `w`.
#[derive(Debug, Clone, Copy)]
pub(super) struct ViewMapping {
    pub(super) a: [[f32; 3]; 3],
    pub(super) b: [f32; 3],
}

impl ViewMapping {
    /// Mapping between two pinhole cameras; `source_from_reference` transforms points between their frames.
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

    /// Homogeneous source pixel of a reference pixel at inverse depth `w`.
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

    /// An irregular picture: a ramp would not distinguish the pixels that were read.
    #[test]
    fn interpolation_weighs_the_four_pixels_around_and_repeats_the_border() {
        let (width, height) = (20_u32, 10_u32);
        let gray = |x: u32, y: u32| (x * x * 37 + y * 91 + x * y * 13) % 251;
        let picture = RgbImage::from_fn(width, height, |x, y| Rgb([gray(x, y) as u8; 3]));
        let filmed = vec![true; picture.pixels().len()];
        let level =
            PyramidLevel::new(&picture, &filmed, &Intrinsics::from_horizontal_fov(width, height, 60.0));
        let pixel = |x: f64, y: f64| {
            let last = |v: f64, size: u32| v.clamp(0.0, f64::from(size - 1)) as u32;
            f64::from(gray(last(x, width), last(y, height)))
        };
        let wanted = |x: f64, y: f64| {
            let (left, top) = (x.floor(), y.floor());
            let (fx, fy) = (x - left, y - top);
            let row = |y: f64| (1.0 - fx) * pixel(left, y) + fx * pixel(left + 1.0, y);
            (1.0 - fy) * row(top) + fy * row(top + 1.0)
        };
        // Across the border on all sides, each place in every lane beside others.
        let places: Vec<(f32, f32)> = (0..400)
            .map(|i| (-0.99 + 20.98 * (i as f32 / 400.0), -0.99 + 10.98 * (i as f32 * 0.37).fract()))
            .collect();
        let corners = [(0.0, 0.0), (3.0, 4.0), (19.0, 9.0), (20.0, 10.0), (-0.5, -1.0), (7.5, 8.5)];
        let places: Vec<(f32, f32)> = places.into_iter().chain(corners).collect();
        for first in 0..places.len() {
            let four: [_; 4] = std::array::from_fn(|lane| places[(first + lane) % places.len()]);
            let read = level.between(four.map(|p| p.0).into(), four.map(|p| p.1).into()).to_array();
            for (value, (x, y)) in read.into_iter().zip(four) {
                let wanted = wanted(f64::from(x), f64::from(y));
                assert!((f64::from(value) - wanted).abs() < 1e-2, "{value} at {x}, {y}, not {wanted}");
            }
        }
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
            ViewMapping::new(&a, &b, &b_from_a).map(pixel.x as f32, pixel.y as f32, 1.0 / point.z as f32);
        assert_relative_eq!(x / z, expected.x as f32, epsilon = 1e-2);
        assert_relative_eq!(y / z, expected.y as f32, epsilon = 1e-2);
    }
}
