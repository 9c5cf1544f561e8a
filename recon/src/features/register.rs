//! Registers a small patch in another image: efficient second-order minimisation (ESM; S. Benhimane and E. Malis,
//! "Real-time image-based tracking of planes using efficient second-order minimization", IROS 2004) over an affine
//! warp, blind to gain and bias.
//!
//! With `u` in the patch, `x(u) = c + A u` in the image, `T` the patch and `I` the image, both brought to weighted
//! mean 0 and deviation 1, each step solves the least squares of `Î(x(u)) − T̂(u)` with the mean of both gradients,
//! `½ (∇T̂ + ∇(Î∘x))`, as Jacobian. That is second order without second derivatives. The point reported is the
//! patch's centre `c`, which the window's symmetry makes nearly independent of `A`.

use nalgebra::{Matrix2, Matrix6, Point2, Vector6};

use super::intensity::Intensity;

const MAX_STEPS: usize = 20;
/// The centre's step at which registration has converged.
const STEP_END_PX: f64 = 0.003;
/// Deviation of the patch, in grey levels, below which there is only noise.
const MIN_CONTRAST: f64 = 2.0;
/// Damping of the affine part, relative: keeps `A` near its start where a patch hardly shows it.
const AFFINE_DAMPING: f64 = 3e-3;
/// A registration that wanders further than this from its start has found something else.
const MAX_SHIFT_PX: f64 = 6.0;

/// Where a patch lies in an image: `x(u) = center + affine · u`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Warp {
    pub(crate) center: Point2<f64>,
    pub(crate) affine: Matrix2<f64>,
}

/// The appearance of a feature, cut from one image.
#[derive(Debug, Clone)]
pub(crate) struct Patch {
    radius: i32,
    weights: Vec<f64>,
    /// Weighted mean 0, deviation 1.
    values: Vec<f64>,
    gradient: Vec<[f64; 2]>,
}

/// The image as a patch would see it.
#[derive(Default)]
struct Reading {
    /// Brightness, a pixel wider on each side than the patch.
    raw: Vec<f64>,
    /// Weighted mean 0, deviation 1.
    values: Vec<f64>,
    /// Of the values, in patch coordinates.
    gradient: Vec<[f64; 2]>,
}

/// What registration found.
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
        let sigma = 0.6 * radius as f64;
        let mut weights: Vec<f64> =
            window(radius).map(|(x, y)| (-0.5 * ((x * x + y * y) as f64) / (sigma * sigma)).exp()).collect();
        let total: f64 = weights.iter().sum();
        for w in &mut weights {
            *w /= total;
        }
        let mut patch = Self { radius, weights, values: Vec::new(), gradient: Vec::new() };
        let mut reading = Reading::default();
        patch.read(image, warp, &mut reading)?;
        (patch.values, patch.gradient) = (reading.values, reading.gradient);
        Some(patch)
    }

    /// The image as the patch would see it, written over `reading`.
    fn read(&self, image: &Intensity, warp: &Warp, reading: &mut Reading) -> Option<()> {
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
        let side = (2 * self.radius + 3) as usize;
        let Reading { raw, values, gradient } = reading;
        raw.clear();
        raw.extend(window(self.radius + 1).map(|(x, y)| {
            let (x, y) = to_image(f64::from(x), f64::from(y));
            f64::from(image.at(x, y))
        }));
        let at = |x: i32, y: i32| raw[(y + self.radius + 1) as usize * side + (x + self.radius + 1) as usize];
        let mean: f64 = window(self.radius).zip(&self.weights).map(|((x, y), w)| w * at(x, y)).sum();
        let variance: f64 =
            window(self.radius).zip(&self.weights).map(|((x, y), w)| w * (at(x, y) - mean).powi(2)).sum();
        let deviation = variance.sqrt();
        if deviation.is_nan() || deviation < MIN_CONTRAST {
            return None;
        }
        values.clear();
        values.extend(window(self.radius).map(|(x, y)| (at(x, y) - mean) / deviation));
        let half = 0.5 / deviation;
        gradient.clear();
        gradient.extend(
            window(self.radius)
                .map(|(x, y)| [(at(x + 1, y) - at(x - 1, y)) * half, (at(x, y + 1) - at(x, y - 1)) * half]),
        );
        Some(())
    }

    /// Weighted correlation with the image at a warp, without moving it.
    pub(crate) fn correlation(&self, image: &Intensity, warp: &Warp) -> Option<f64> {
        let mut reading = Reading::default();
        self.read(image, warp, &mut reading)?;
        Some(self.weights.iter().zip(&reading.values).zip(&self.values).map(|((w, i), t)| w * i * t).sum())
    }

    /// Every second pixel of the patch, deformed: what is tried at many places before registration.
    pub(crate) fn probe(&self, affine: &Matrix2<f64>) -> Probe {
        let kept = |(x, y): &(i32, i32)| (x + self.radius) % 2 == 0 && (y + self.radius) % 2 == 0;
        let taken: Vec<usize> =
            window(self.radius).enumerate().filter(|(_, at)| kept(at)).map(|(index, _)| index).collect();
        let at: Vec<(i32, i32)> = window(self.radius).collect();
        let total: f64 = taken.iter().map(|i| self.weights[*i]).sum();
        let mean = taken.iter().map(|i| self.weights[*i] * self.values[*i]).sum::<f64>() / total;
        let samples: Vec<Sample> = taken
            .iter()
            .map(|&i| Sample {
                aside: affine * nalgebra::Vector2::new(f64::from(at[i].0), f64::from(at[i].1)),
                weight: (self.weights[i] / total) as f32,
                value: (self.values[i] - mean) as f32,
            })
            .collect();
        let reach = f64::from(self.radius) * (affine.row(0).abs().sum()).max(affine.row(1).abs().sum());
        // Rounding must not carry a sample beyond it.
        let reach = reach + 1e-9;
        let deviation = samples.iter().map(|s| s.weight * s.value * s.value).sum::<f32>().sqrt();
        Probe { samples, reach, deviation }
    }

    /// Finds the patch in `image` near `start`. `None` when it leaves the image, wanders off or does not converge.
    pub(crate) fn register(&self, image: &Intensity, start: &Warp) -> Option<Registration> {
        let mut warp = *start;
        let mut reading = Reading::default();
        for _ in 0..MAX_STEPS {
            self.read(image, &warp, &mut reading)?;
            let Reading { values, gradient, .. } = &reading;
            let (mut normal, mut right) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
            for (index, (x, y)) in window(self.radius).enumerate() {
                let (x, y) = (f64::from(x), f64::from(y));
                let gx = 0.5 * (self.gradient[index][0] + gradient[index][0]);
                let gy = 0.5 * (self.gradient[index][1] + gradient[index][1]);
                let j = [gx, gy, gx * x, gx * y, gy * x, gy * y];
                let weight = self.weights[index];
                let residual = weight * (values[index] - self.values[index]);
                for row in 0..6 {
                    let scaled = weight * j[row];
                    for column in row..6 {
                        normal[(row, column)] += scaled * j[column];
                    }
                    right[row] -= j[row] * residual;
                }
            }
            for row in 0..6 {
                for column in 0..row {
                    normal[(row, column)] = normal[(column, row)];
                }
            }
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
                let correlation = self.correlation(image, &warp)?;
                return Some(Registration { warp, correlation });
            }
        }
        None
    }
}

/// A coarse, deformed patch.
pub(crate) struct Probe {
    samples: Vec<Sample>,
    /// How far samples lie from the centre along an axis, pixels.
    reach: f64,
    deviation: f32,
}

struct Sample {
    aside: nalgebra::Vector2<f64>,
    /// All add up to 1.
    weight: f32,
    /// Weighted mean 0.
    value: f32,
}

impl Probe {
    /// Weighted normalised cross-correlation with the image around `center`, −1 … 1; `None` where it leaves the image.
    pub(crate) fn correlation(&self, image: &Intensity, center: &Point2<f64>) -> Option<f32> {
        self.placed(image, center).correlation(0, 0)
    }

    /// Ready to be tried at `center` and any whole number of pixels beside it.
    pub(crate) fn placed<'a>(&'a self, image: &'a Intensity, center: &Point2<f64>) -> PlacedProbe<'a> {
        let taps = self.samples.iter().map(|s| {
            let (x, y) = (center.x + s.aside.x, center.y + s.aside.y);
            let (left, top) = (x.floor(), y.floor());
            let index = top as i64 * image.width as i64 + left as i64;
            Tap { index, fraction: [(x - left) as f32, (y - top) as f32] }
        });
        PlacedProbe { probe: self, image, center: *center, taps: taps.collect() }
    }
}

/// A probe over an image: whole steps leave the fractions of its samples as they are.
pub(crate) struct PlacedProbe<'a> {
    probe: &'a Probe,
    image: &'a Intensity,
    center: Point2<f64>,
    /// One a sample.
    taps: Vec<Tap>,
}

/// Where a sample is read.
struct Tap {
    /// Of the pixel left of and above it; outside the image perhaps, until the probe is moved.
    index: i64,
    fraction: [f32; 2],
}

impl PlacedProbe<'_> {
    /// [`Probe::correlation`], `dx` and `dy` pixels beside the centre.
    pub(crate) fn correlation(&self, dx: i32, dy: i32) -> Option<f32> {
        let (x, y) = (self.center.x + f64::from(dx), self.center.y + f64::from(dy));
        let held = |sign: f64| self.image.holds(x + sign * self.probe.reach, y + sign * self.probe.reach);
        if !(held(-1.0) && held(1.0)) {
            return None;
        }
        let moved = i64::from(dy) * self.image.width as i64 + i64::from(dx);
        let (mut mean, mut square, mut shared) = (0.0_f32, 0.0_f32, 0.0_f32);
        for (s, tap) in self.probe.samples.iter().zip(&self.taps) {
            let read = self.image.between((tap.index + moved) as usize, tap.fraction[0], tap.fraction[1]);
            let weighted = s.weight * read;
            mean += weighted;
            square += weighted * read;
            shared += weighted * s.value;
        }
        let deviation = (square - mean * mean).max(0.0).sqrt();
        let contrast = f64::from(deviation) >= MIN_CONTRAST;
        contrast.then(|| shared / (deviation * self.probe.deviation).max(f32::MIN_POSITIVE))
    }
}

/// Whether a warp still shows the same thing: not turned inside out, not squeezed or grown beyond threefold area.
fn is_plausible(affine: &Matrix2<f64>) -> bool {
    let area = affine.determinant();
    let singular = affine.singular_values();
    (1.0 / 3.0..3.0).contains(&area) && singular.max() < 3.0 * singular.min()
}

/// The patch's grid, row by row.
fn window(radius: i32) -> impl Iterator<Item = (i32, i32)> {
    (-radius..=radius).flat_map(move |y| (-radius..=radius).map(move |x| (x, y)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!((found.warp.center - truth.center).norm() < 0.01, "{:?}", found.warp);
        assert!((found.warp.affine - truth.affine).norm() < 0.01, "{:?}", found.warp);
        assert!(found.correlation > 0.999);
    }

    #[test]
    fn a_placed_probe_reads_what_each_place_shows() {
        let image = Intensity::from_fn(60, 50, |x, y| texture(x as f64, y as f64) as f32);
        let home = Warp { center: Point2::new(30.0, 25.0), affine: Matrix2::identity() };
        let affine = Matrix2::new(1.1, -0.2, 0.15, 0.9);
        let probe = Patch::cut(&image, &home, 6).unwrap().probe(&affine);
        let center = Point2::new(12.37, 20.81);
        let placed = probe.placed(&image, &center);
        for (dx, dy) in (-20..30).step_by(3).flat_map(|x| (-20..30).step_by(4).map(move |y| (x, y))) {
            let at = center + nalgebra::Vector2::new(f64::from(dx), f64::from(dy));
            let corners = [-probe.reach, probe.reach].map(|r| image.holds(at.x + r, at.y + r));
            let (mut weights, mut reads, mut values) = (Vec::new(), Vec::new(), Vec::new());
            if corners == [true, true] {
                for s in &probe.samples {
                    weights.push(f64::from(s.weight));
                    reads.push(f64::from(image.at(at.x + s.aside.x, at.y + s.aside.y)));
                    values.push(f64::from(s.value));
                }
            }
            // Pearson's correlation as a textbook has it.
            let mean = |of: &[f64]| of.iter().zip(&weights).map(|(v, w)| v * w).sum::<f64>();
            let (m, n) = (mean(&reads), mean(&values));
            let with = |a: &[f64], b: &[f64], m: f64, n: f64| {
                a.iter().zip(b).zip(&weights).map(|((a, b), w)| w * (a - m) * (b - n)).sum::<f64>()
            };
            let wanted = with(&reads, &values, m, n)
                / (with(&reads, &reads, m, m) * with(&values, &values, n, n)).sqrt();
            match placed.correlation(dx, dy) {
                Some(found) => assert!((f64::from(found) - wanted).abs() < 1e-4, "{found} {wanted}"),
                None => assert!(reads.is_empty(), "{dx} {dy}"),
            }
        }
        assert!(placed.correlation(0, 0).is_some() && placed.correlation(-20, 0).is_none());
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
}
