//! Registers a small patch in another image: efficient second-order minimisation (ESM; S. Benhimane and E. Malis,
//! "Real-time image-based tracking of planes using efficient second-order minimization", IROS 2004) over an affine
//! warp, blind to gain and bias.
//!
//! With `u` in the patch, `x(u) = c + A u` in the image, `T` the patch and `I` the image, both brought to weighted
//! mean 0 and deviation 1, each step solves the least squares of `Î(x(u)) − T̂(u)` with the mean of both gradients,
//! `½ (∇T̂ + ∇(Î∘x))`, as Jacobian. That is second order without second derivatives. Bias and gain are unknowns of each step
//! beside the warp, since a warp that moves changes them: their columns are 1 and the mean of both readings, `m = ½ (T̂ + Î)`,
//! and they are eliminated (Schur complement), which leaves `Σ w J Jᵀ − b bᵀ − g gᵀ / Σ w m²` with `b = Σ w J` and
//! `g = Σ w m J`. The right side stays as it is: both readings are normalised, so their difference is orthogonal to 1 and to
//! `m`. The point reported is the patch's centre `c`, which the window's symmetry makes nearly independent of `A`.

use nalgebra::{Matrix2, Matrix6, Point2, Vector6};
use wide::f32x4;

use super::intensity::Intensity;

/// Limit of the steps: registrations that converge take half as many, others are unreliable.
const MAX_STEPS: usize = 12;
/// Step of the centre at which registration has converged.
const STEP_END_PX: f64 = 0.003;
/// Deviation of the patch, in grey levels, below which there is only noise.
pub(super) const MIN_CONTRAST: f64 = 2.0;
/// Damping of the affine part, relative: keeps `A` near its start where a patch hardly shows it.
const AFFINE_DAMPING: f64 = 3e-3;
/// Distance from its start beyond which a registration has found something else.
const MAX_SHIFT_PX: f64 = 6.0;

/// Position and deformation of a patch in an image: `x(u) = center + affine · u`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Warp {
    pub(crate) center: Point2<f64>,
    pub(crate) affine: Matrix2<f64>,
}

/// Appearance of a feature, cut from one image. Rows are filled up to whole fours with pixels of weight 0.
#[derive(Debug, Clone)]
pub(crate) struct Patch {
    pub(super) radius: i32,
    weights: Vec<f32x4>,
    /// Values with weighted mean 0, deviation 1.
    values: Vec<f32x4>,
    gradient: Vec<[f32x4; 2]>,
}

/// The image resampled in the patch's coordinates: buffers that are reused.
#[derive(Default)]
pub(crate) struct Reading {
    /// Brightness, a pixel wider on each side than the patch.
    raw: Vec<f32>,
    /// Values with weighted mean 0, deviation 1.
    values: Vec<f32x4>,
    /// Gradient of the values, in patch coordinates.
    gradient: Vec<[f32x4; 2]>,
}

/// Result of a registration.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Registration {
    pub(crate) warp: Warp,
    /// Weighted normalised cross-correlation of patch and image, −1 … 1.
    pub(crate) correlation: f64,
}

impl Patch {
    /// Cuts a patch of `2 radius + 1` pixels a side, seen through `warp` (the identity for a plain cut). `None` at the
    /// image's border or without contrast.
    pub(crate) fn cut(image: &Intensity, warp: &Warp, radius: i32) -> Option<Self> {
        let sigma = 0.6 * radius as f32;
        let weight = |x: i32, y: i32| (-0.5 * ((x * x + y * y) as f32) / (sigma * sigma)).exp();
        let total: f32 = window(radius).map(|(x, y)| weight(x, y)).sum();
        let lane = |x: i32, y: i32| if x <= radius { weight(x, y) / total } else { 0.0 };
        let weights = (-radius..=radius)
            .flat_map(|y| (0..fours(radius) as i32).map(move |k| (4 * k - radius, y)))
            .map(|(x, y)| f32x4::new(std::array::from_fn(|i| lane(x + i as i32, y))))
            .collect();
        let mut patch = Self { radius, weights, values: Vec::new(), gradient: Vec::new() };
        let mut reading = Reading::default();
        patch.read(image, warp, &mut reading)?;
        (patch.values, patch.gradient) = (reading.values, reading.gradient);
        Some(patch)
    }

    /// Weight and value of a pixel.
    pub(super) fn at(&self, x: i32, y: i32) -> (f32, f32) {
        let column = (x + self.radius) as usize;
        let index = (y + self.radius) as usize * fours(self.radius) + column / 4;
        (self.weights[index].to_array()[column % 4], self.values[index].to_array()[column % 4])
    }

    /// Resamples the image in the patch's coordinates into `reading`.
    fn read(&self, image: &Intensity, warp: &Warp, reading: &mut Reading) -> Option<()> {
        let deviation = self.read_values(image, warp, reading)?;
        let (side, fours) = ((2 * self.radius + 1) as usize, fours(self.radius));
        let wide = 4 * fours;
        let Reading { raw, gradient, .. } = reading;
        let half = f32x4::splat(0.5 / deviation);
        gradient.clear();
        gradient.reserve(side * fours);
        for (row, k) in (0..side).flat_map(|row| (0..fours).map(move |k| (row, k))) {
            let here = (row + 1) * wide + 4 * k;
            let beside = four(raw, here + 2) - four(raw, here);
            let upright = four(raw, here + 1 + wide) - four(raw, here + 1 - wide);
            gradient.push([beside * half, upright * half]);
        }
        Some(())
    }

    /// Fills a reading without its gradient, and returns the deviation before normalisation.
    fn read_values(&self, image: &Intensity, warp: &Warp, reading: &mut Reading) -> Option<f32> {
        let reach = f64::from(self.radius + 1);
        let to_image = |x: f64, y: f64| {
            let p = warp.center + warp.affine * nalgebra::Vector2::new(x, y);
            (p.x, p.y)
        };
        for (sx, sy) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let (x, y) = to_image(sx * reach, sy * reach);
            if !image.holds(x, y) {
                return None;
            }
        }
        let (side, fours) = ((2 * self.radius + 1) as usize, fours(self.radius));
        let wide = 4 * fours;
        let Reading { raw, values, .. } = reading;
        raw.clear();
        raw.reserve((side + 2) * wide + 1);
        let [along_x, along_y] = [warp.affine[(0, 0)], warp.affine[(1, 0)]].map(|a| f32x4::splat(a as f32));
        for y in -self.radius - 1..=self.radius + 1 {
            let (row_x, row_y) = to_image(-reach, f64::from(y));
            let (row_x, row_y) = (f32x4::splat(row_x as f32), f32x4::splat(row_y as f32));
            let mut x = f32x4::new([0.0, 1.0, 2.0, 3.0]);
            for _ in 0..fours {
                raw.extend(image.at_four(row_x + along_x * x, row_y + along_y * x).to_array());
                x += f32x4::splat(4.0);
            }
        }
        // The padding allows reading a row's last four from its second pixel on.
        raw.push(0.0);
        // The patch's pixels, four at a time, and those above, below and beside them.
        let inner = |row: usize, k: usize| four(raw, (row + 1) * wide + 1 + 4 * k);
        values.clear();
        values.reserve(side * fours);
        values.extend((0..side).flat_map(|row| (0..fours).map(move |k| inner(row, k))));
        let mut sum = f32x4::ZERO;
        for (w, v) in self.weights.iter().zip(values.iter()) {
            sum += *w * *v;
        }
        let mean = f32x4::splat(sum.reduce_add());
        let mut squares = f32x4::ZERO;
        for (w, v) in self.weights.iter().zip(values.iter_mut()) {
            *v -= mean;
            squares += *w * *v * *v;
        }
        let deviation = squares.reduce_add().sqrt();
        if deviation.is_nan() || f64::from(deviation) < MIN_CONTRAST {
            return None;
        }
        let scale = f32x4::splat(1.0 / deviation);
        for v in values.iter_mut() {
            *v *= scale;
        }
        Some(deviation)
    }

    /// Weighted correlation with the image at a warp, without moving it.
    pub(crate) fn correlation(&self, image: &Intensity, warp: &Warp, reading: &mut Reading) -> Option<f64> {
        self.read_values(image, warp, reading)?;
        Some(self.likeness(reading))
    }

    /// Weighted correlation of the patch with a reading.
    fn likeness(&self, reading: &Reading) -> f64 {
        let mut sum = f32x4::ZERO;
        for ((w, i), t) in self.weights.iter().zip(&reading.values).zip(&self.values) {
            sum += *w * *i * *t;
        }
        f64::from(sum.reduce_add())
    }

    /// `Σ w J Jᵀ` and `−Σ w J r` after elimination of bias and gain, with `J = (gx, gy, gx x, gx y, gy x, gy y)`: all
    /// are sums of `gx²`, `gx gy`, `gy²` and of `gx`, `gy`, alone and times `r` and `m`, times powers of x and y, those
    /// of x summed along each row.
    fn normal_equations(&self, reading: &Reading) -> (Matrix6<f64>, Vector6<f64>) {
        let fours = fours(self.radius);
        // Sums of each product with 1, x, y, x², xy, y².
        let (mut squares, mut singles) = ([[f32x4::ZERO; 6]; 3], [[f32x4::ZERO; 3]; 6]);
        let mut strength = f32x4::ZERO;
        for (row, y) in (-self.radius..=self.radius).enumerate() {
            let here = row * fours..(row + 1) * fours;
            let own = self.gradient[here.clone()].iter().zip(&reading.gradient[here.clone()]);
            let seen = self.values[here.clone()].iter().zip(&reading.values[here.clone()]);
            let (mut rows, mut row_singles) = ([[f32x4::ZERO; 3]; 3], [[f32x4::ZERO; 2]; 6]);
            let mut x = f32x4::new([0.0, 1.0, 2.0, 3.0]) - f32x4::splat(self.radius as f32);
            for (((g, h), (t, i)), w) in own.zip(seen).zip(&self.weights[here]) {
                let half = f32x4::splat(0.5);
                let (gx, gy) = (half * (g[0] + h[0]), half * (g[1] + h[1]));
                let (wx, wy, off, mean) = (*w * gx, *w * gy, *i - *t, half * (*i + *t));
                strength += *w * mean * mean;
                for (sum, product) in rows.iter_mut().zip([wx * gx, wx * gy, wy * gy]) {
                    let with_x = product * x;
                    *sum = [sum[0] + product, sum[1] + with_x, sum[2] + with_x * x];
                }
                let products = [wx * off, wy * off, wx, wy, wx * mean, wy * mean];
                for (sum, product) in row_singles.iter_mut().zip(products) {
                    *sum = [sum[0] + product, sum[1] + product * x];
                }
                x += f32x4::splat(4.0);
            }
            let y = f32x4::splat(y as f32);
            for (sum, [one, x, xx]) in squares.iter_mut().zip(rows) {
                for (sum, add) in sum.iter_mut().zip([one, x, one * y, xx, x * y, one * y * y]) {
                    *sum += add;
                }
            }
            for (sum, [one, x]) in singles.iter_mut().zip(row_singles) {
                *sum = [sum[0] + one, sum[1] + x, sum[2] + one * y];
            }
        }
        let over_lanes = |sum: f32x4| f64::from(sum.reduce_add());
        let [[a, ax, ay, axx, axy, ayy], [b, bx, by, bxx, bxy, byy], [c, cx, cy, cxx, cxy, cyy]] =
            squares.map(|sums| sums.map(over_lanes));
        #[rustfmt::skip]
        let mut normal = Matrix6::new(
            a,  b,  ax,  ay,  bx,  by,
            b,  c,  bx,  by,  cx,  cy,
            ax, bx, axx, axy, bxx, bxy,
            ay, by, axy, ayy, bxy, byy,
            bx, cx, bxx, bxy, cxx, cxy,
            by, cy, bxy, byy, cxy, cyy,
        );
        // Sums of products with gx and with gy, each in a row: with 1, x and y.
        let [off_x, off_y, bias_x, bias_y, gain_x, gain_y] = singles.map(|sums| sums.map(over_lanes));
        let column = |[[r, rx, ry], [s, sx, sy]]: [[f64; 3]; 2]| Vector6::new(r, s, rx, ry, sx, sy);
        let (bias, gain) = (column([bias_x, bias_y]), column([gain_x, gain_y]));
        // The sum is zero for patches that are each other's negative; their gain is undetermined.
        let strength = over_lanes(strength).max(f64::EPSILON);
        normal -= bias * bias.transpose() + gain * gain.transpose() / strength;
        (normal, -column([off_x, off_y]))
    }

    /// Finds the patch in `image` near `start`. `None` when it leaves the image, wanders off or does not converge.
    pub(crate) fn register(&self, image: &Intensity, start: &Warp) -> Option<Registration> {
        let mut warp = *start;
        let mut reading = Reading::default();
        for _ in 0..MAX_STEPS {
            self.read(image, &warp, &mut reading)?;
            let (mut normal, right) = self.normal_equations(&reading);
            for k in 2..6 {
                normal[(k, k)] *= 1.0 + AFFINE_DAMPING;
            }
            let step = normal.cholesky()?.solve(&right);
            // x(u) ← x(u + Δc + ΔA u)
            let shift = warp.affine * nalgebra::Vector2::new(step[0], step[1]);
            warp.center += shift;
            warp.affine *= Matrix2::identity() + Matrix2::new(step[2], step[3], step[4], step[5]);
            if (warp.center - start.center).norm() > MAX_SHIFT_PX || !is_plausible(&warp.affine) {
                return None;
            }
            if shift.norm() < STEP_END_PX {
                // Read before this last step, which is too short to matter.
                return Some(Registration { warp, correlation: self.likeness(&reading) });
            }
        }
        None
    }
}

/// Tells whether a warp is plausible: not mirrored, not squeezed or grown beyond threefold area.
fn is_plausible(affine: &Matrix2<f64>) -> bool {
    let area = affine.determinant();
    let singular = affine.singular_values();
    (1.0 / 3.0..3.0).contains(&area) && singular.max() < 3.0 * singular.min()
}

/// Four consecutive values.
fn four(raw: &[f32], at: usize) -> f32x4 {
    f32x4::new([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]])
}

/// Number of fours that hold a patch's row with a pixel more on each side.
fn fours(radius: i32) -> usize {
    (2 * radius + 3).unsigned_abs().div_ceil(4) as usize
}

/// Offsets of the patch's grid, row by row.
pub(super) fn window(radius: i32) -> impl Iterator<Item = (i32, i32)> {
    (-radius..=radius).flat_map(move |y| (-radius..=radius).map(move |x| (x, y)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    fn texture(x: f64, y: f64) -> f64 {
        128.0
            + 35.0 * ((0.31 * x + 0.17 * y).sin() + (0.23 * y - 0.11 * x).cos() + (0.045 * x * y / 9.0).sin())
    }

    #[test]
    fn an_affine_change_with_gain_and_bias_is_undone_to_a_hundredth_pixel() {
        let first = Intensity::from_fn(80, 80, |x, y| texture(x as f64, y as f64) as f32);
        let home = Warp { center: Point2::new(40.0, 38.0), affine: Matrix2::identity() };
        let truth = Warp { center: Point2::new(43.37, 35.81), affine: Matrix2::new(1.08, -0.1, 0.06, 0.95) };
        let back = truth.affine.try_inverse().unwrap();
        let second = Intensity::from_fn(80, 80, |x, y| {
            let u = back * (Point2::new(x as f64, y as f64) - truth.center);
            (0.7 * texture(40.0 + u.x, 38.0 + u.y) + 25.0) as f32
        });
        let patch = Patch::cut(&first, &home, 8).unwrap();
        let start = Warp { center: Point2::new(42.5, 36.8), affine: Matrix2::identity() };
        let found = patch.register(&second, &start).unwrap();
        // The remaining error is that of bilinear interpolation: the registration has converged.
        assert!((found.warp.center - truth.center).norm() < 0.0105, "{:?}", found.warp);
        let again = patch.register(&second, &found.warp).unwrap();
        assert!((again.warp.center - found.warp.center).norm() < 1e-3, "{:?}", again.warp);
        assert!((found.warp.affine - truth.affine).norm() < 0.01, "{:?}", found.warp);
        assert!(found.correlation > 0.999);
    }

    #[test]
    fn borders_and_blank_walls_give_nothing() {
        let blank = Intensity::from_fn(40, 40, |_, _| 90.0);
        let at = |x, y| Warp { center: Point2::new(x, y), affine: Matrix2::identity() };
        assert!(Patch::cut(&blank, &at(20.0, 20.0), 6).is_none());
        let image = Intensity::from_fn(40, 40, |x, y| texture(x as f64, y as f64) as f32);
        assert!(Patch::cut(&image, &at(4.0, 20.0), 6).is_none());
        let patch = Patch::cut(&image, &at(20.0, 20.0), 6).unwrap();
        assert!(patch.register(&image, &at(f64::NAN, 20.0)).is_none());
        assert!(patch.register(&blank, &at(20.0, 20.0)).is_none());
    }

    #[test]
    fn a_step_is_that_of_all_eight_unknowns() {
        let image = Intensity::from_fn(60, 60, |x, y| texture(x as f64, y as f64) as f32);
        let at = |x, y| Warp { center: Point2::new(x, y), affine: Matrix2::identity() };
        let patch = Patch::cut(&image, &at(30.0, 29.0), 8).unwrap();
        let mut reading = Reading::default();
        patch.read(&image, &at(30.8, 28.1), &mut reading).unwrap();
        let (mut all, mut all_right) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
        for (x, y) in window(8) {
            let column = (x + 8) as usize;
            let (index, lane) = ((y + 8) as usize * fours(8) + column / 4, column % 4);
            let of = |four: f32x4| f64::from(four.to_array()[lane]);
            let [gx, gy] =
                [0, 1].map(|k| 0.5 * (of(patch.gradient[index][k]) + of(reading.gradient[index][k])));
            let (t, i) = (of(patch.values[index]), of(reading.values[index]));
            let (x, y) = (f64::from(x), f64::from(y));
            let j = SVector::from([gx, gy, gx * x, gx * y, gy * x, gy * y, 1.0, 0.5 * (t + i)]);
            all += of(patch.weights[index]) * j * j.transpose();
            all_right -= of(patch.weights[index]) * j * (i - t);
        }
        let across = all.fixed_view::<6, 2>(0, 6) * all.fixed_view::<2, 2>(6, 6).try_inverse().unwrap();
        let normal: Matrix6<f64> = all.fixed_view::<6, 6>(0, 0) - across * all.fixed_view::<2, 6>(6, 0);
        let right: Vector6<f64> = all_right.fixed_rows::<6>(0) - across * all_right.fixed_rows::<2>(6);
        // Compared to single precision, in which the sums are formed before the elimination.
        let (found, found_right) = patch.normal_equations(&reading);
        assert!((found - normal).amax() < 1e-5 * all.amax(), "{found} {normal}");
        assert!((found_right - right).amax() < 1e-5 * all.amax(), "{found_right} {right}");
    }
}
