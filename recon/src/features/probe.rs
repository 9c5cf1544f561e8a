//! A subsampled patch, for searching many places by correlation before it is registered at the best.

use nalgebra::{Matrix2, Point2, Vector2};

use super::intensity::Intensity;
use super::register::{MIN_CONTRAST, Patch, window};

impl Patch {
    /// Every second pixel of the patch, deformed, for correlation at many places before registration.
    pub(crate) fn probe(&self, affine: &Matrix2<f64>) -> Probe {
        let kept = |(x, y): &(i32, i32)| (x + self.radius) % 2 == 0 && (y + self.radius) % 2 == 0;
        let taken: Vec<(f32, f32, Vector2<f64>)> = window(self.radius)
            .filter(kept)
            .map(|(x, y)| {
                let (weight, value) = self.at(x, y);
                (weight, value, affine * Vector2::new(f64::from(x), f64::from(y)))
            })
            .collect();
        let total: f32 = taken.iter().map(|(weight, ..)| weight).sum();
        let mean = taken.iter().map(|(weight, value, _)| weight * value).sum::<f32>() / total;
        let samples: Vec<ProbeSample> = taken
            .into_iter()
            .map(|(weight, value, aside)| ProbeSample { aside, weight: weight / total, value: value - mean })
            .collect();
        let reach = f64::from(self.radius) * (affine.row(0).abs().sum()).max(affine.row(1).abs().sum());
        // Rounding must not move a sample beyond it.
        let reach = reach + 1e-9;
        let deviation = samples.iter().map(|s| s.weight * s.value * s.value).sum::<f32>().sqrt();
        Probe { samples, reach, deviation }
    }
}

/// Step between the places of a [`PlacedProbe::row`], pixels.
pub(crate) const STEP_PX: i32 = 2;
/// Number of places of a [`PlacedProbe::row`].
pub(crate) const PLACES: usize = 8;

/// A coarse, deformed patch.
pub(crate) struct Probe {
    samples: Vec<ProbeSample>,
    /// Largest distance of a sample from the centre along an axis, pixels.
    reach: f64,
    deviation: f32,
}

struct ProbeSample {
    aside: Vector2<f64>,
    /// Weight; all add up to 1.
    weight: f32,
    /// Value; the weighted mean is 0.
    value: f32,
}

impl Probe {
    /// Weighted normalised cross-correlation with the image around `center`, −1 … 1; `None` where it leaves the image.
    pub(crate) fn correlation(&self, image: &Intensity, center: &Point2<f64>) -> Option<f32> {
        self.placed(image, center).correlation(0, 0)
    }

    /// Places the probe at `center`, ready for correlation there and at whole-pixel offsets.
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

/// A probe over an image: whole-pixel steps leave the fractions of its samples unchanged.
pub(crate) struct PlacedProbe<'a> {
    probe: &'a Probe,
    image: &'a Intensity,
    center: Point2<f64>,
    /// One entry a sample.
    taps: Vec<Tap>,
}

/// Position at which a sample is read.
struct Tap {
    /// Index of the pixel left of and above it; perhaps outside the image, until the probe is moved.
    index: i64,
    fraction: [f32; 2],
}

impl PlacedProbe<'_> {
    /// [`Probe::correlation`], `dx` and `dy` pixels beside the centre.
    pub(crate) fn correlation(&self, dx: i32, dy: i32) -> Option<f32> {
        if !self.holds(dx, dy) {
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
        self.normalised(mean, square, shared)
    }

    /// [`Self::correlation`] at places [`STEP_PX`] apart, from `dx` on.
    pub(crate) fn row(&self, dx: i32, dy: i32) -> [Option<f32>; PLACES] {
        let first = i64::from(dy) * self.image.width as i64 + i64::from(dx);
        let (mut mean, mut square, mut shared) = ([0.0_f32; PLACES], [0.0_f32; PLACES], [0.0_f32; PLACES]);
        for (s, tap) in self.probe.samples.iter().zip(&self.taps) {
            let index = tap.index + first;
            let rows = [index, index + self.image.width as i64].map(|i| self.pairs(i));
            let [Some(upper), Some(lower)] = rows else {
                // The row touches the first or the last pixels of the image.
                return std::array::from_fn(|k| self.correlation(dx + STEP_PX * k as i32, dy));
            };
            let [fx, fy] = tap.fraction;
            for k in 0..PLACES {
                let above = upper[k][0] + fx * (upper[k][1] - upper[k][0]);
                let below = lower[k][0] + fx * (lower[k][1] - lower[k][0]);
                let read = above + fy * (below - above);
                let weighted = s.weight * read;
                mean[k] += weighted;
                square[k] += weighted * read;
                shared[k] += weighted * s.value;
            }
        }
        std::array::from_fn(|k| {
            let held = self.holds(dx + STEP_PX * k as i32, dy);
            held.then(|| self.normalised(mean[k], square[k], shared[k]))?
        })
    }

    /// The two pixels between which each place of a row lies.
    fn pairs(&self, index: i64) -> Option<&[[f32; 2]; PLACES]> {
        let index = usize::try_from(index).ok()?;
        self.image.from(index, 2 * PLACES)?.as_chunks::<2>().0.try_into().ok()
    }

    /// Tells whether the whole probe lies in the image.
    fn holds(&self, dx: i32, dy: i32) -> bool {
        let (x, y) = (self.center.x + f64::from(dx), self.center.y + f64::from(dy));
        let held = |sign: f64| self.image.holds(x + sign * self.probe.reach, y + sign * self.probe.reach);
        held(-1.0) && held(1.0)
    }

    fn normalised(&self, mean: f32, square: f32, shared: f32) -> Option<f32> {
        let deviation = (square - mean * mean).max(0.0).sqrt();
        let contrast = f64::from(deviation) >= MIN_CONTRAST;
        contrast.then(|| shared / (deviation * self.probe.deviation).max(f32::MIN_POSITIVE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::Warp;

    fn texture(x: f64, y: f64) -> f32 {
        (120.0 + 30.0 * (0.29 * x + 0.003 * y * y).sin() + 25.0 * (0.37 * y - 0.002 * x * x).cos()) as f32
    }

    #[test]
    fn a_placed_probe_reads_what_each_place_shows() {
        let image = Intensity::from_fn(60, 50, |x, y| texture(x as f64, y as f64));
        let home = Warp { center: Point2::new(30.0, 25.0), affine: Matrix2::identity() };
        let affine = Matrix2::new(1.1, -0.2, 0.15, 0.9);
        let probe = Patch::cut(&image, &home, 6).unwrap().probe(&affine);
        let center = Point2::new(12.37, 20.81);
        let placed = probe.placed(&image, &center);
        for (dx, dy) in (-20..30).step_by(3).flat_map(|x| (-20..30).step_by(4).map(move |y| (x, y))) {
            let at = center + Vector2::new(f64::from(dx), f64::from(dy));
            let corners = [-probe.reach, probe.reach].map(|r| image.holds(at.x + r, at.y + r));
            let (mut weights, mut reads, mut values) = (Vec::new(), Vec::new(), Vec::new());
            if corners == [true, true] {
                for s in &probe.samples {
                    weights.push(f64::from(s.weight));
                    reads.push(f64::from(image.at(at.x + s.aside.x, at.y + s.aside.y)));
                    values.push(f64::from(s.value));
                }
            }
            // Pearson's correlation by its textbook formula.
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
    fn a_row_tells_what_its_places_do() {
        let image = Intensity::from_fn(64, 40, |x, y| texture(x as f64, y as f64));
        let home = Warp { center: Point2::new(30.0, 20.0), affine: Matrix2::identity() };
        let probe = Patch::cut(&image, &home, 6).unwrap().probe(&Matrix2::new(1.1, -0.2, 0.15, 0.9));
        // Places inside, and at each border and corner of the image.
        for (x, y) in
            [(31.4, 19.2), (8.2, 20.0), (55.9, 19.0), (30.0, 7.9), (30.0, 32.3), (9.0, 8.5), (56.1, 31.6)]
        {
            let placed = probe.placed(&image, &Point2::new(x, y));
            for (dx, dy) in (-20..9).flat_map(|dx| (-8..9).map(move |dy| (dx, dy))) {
                for (k, found) in placed.row(dx, dy).into_iter().enumerate() {
                    let wanted = placed.correlation(dx + STEP_PX * k as i32, dy);
                    assert_eq!(found, wanted, "{k} from {dx}, {dy} at {x}, {y}");
                }
            }
        }
    }
}
