//! The moment at which a person changed sides, among all at which their estimated path met the border.
//!
//! The path of a person who stays near a border meets it again and again. A position `d` metres beyond the border, known to σ, speaks for
//! the far side by about d / σ (in log odds, up to a factor). The change after which these sum up to most is the most probable one: a
//! cumulative sum, E. S. Page, "Continuous inspection schemes", Biometrika 41, 1954.

use super::fix::Fix;

/// Largest evidence of one fix, standard deviations.
const MOST_SIGMAS: f64 = 10.0;

/// Most probable moment of a change to the far side, since the person was last beyond doubt on the near one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct ChangePoint {
    /// Sum of the evidence for the far side.
    evidence: f64,
    /// The moment, and the sum before it.
    best: Option<(Fix, f64)>,
}

impl ChangePoint {
    /// The path meets the border, to the far side; the fixes before that have been taken.
    pub(super) fn meet(&mut self, at: Fix) {
        if self.best.is_none_or(|(_, before)| self.evidence <= before) {
            self.best = Some((at, self.evidence));
        }
    }

    /// Takes a fix, by its distance beyond the border over the standard deviation of that; negative on the near side.
    pub(super) fn take(&mut self, sigmas: f64) {
        if !sigmas.is_nan() {
            self.evidence += sigmas.clamp(-MOST_SIGMAS, MOST_SIGMAS);
        }
    }

    /// The most probable moment; `None` if the path has not met the border.
    pub(super) fn at(&self) -> Option<Fix> {
        self.best.map(|(at, _)| at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point2, Vector2};
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    fn at(time_s: f64) -> Fix {
        Fix { frame: 1, time_s, place: Point2::origin(), sigma_m: Vector2::repeat(0.05) }
    }

    /// A person stops 4 cm beyond a border at 5 s, stays for 20 s, and goes on; positions are known to 5 cm.
    #[test]
    fn a_person_who_stops_behind_a_border_has_passed_it_on_arrival() {
        let noise = Normal::new(0.0, 0.05).unwrap();
        let (mut sum_s, mut sum_of_latest_s) = (0.0, 0.0);
        for seed in 0..50 {
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let (mut change, mut latest_s, mut was_m) = (ChangePoint::default(), 0.0, -1.0);
            for frame in 0..300 {
                let time_s = f64::from(frame) * 0.1;
                let true_m = match time_s {
                    ..5.0 => time_s - 4.96,
                    ..25.0 => 0.04,
                    _ => 0.04 + time_s - 25.0,
                };
                let found_m = true_m + noise.sample(&mut rng);
                if was_m < 0.0 && found_m >= 0.0 {
                    change.meet(at(time_s));
                    latest_s = time_s;
                }
                change.take(found_m / 0.05);
                was_m = found_m;
            }
            sum_s += (change.at().unwrap().time_s - 4.96).abs();
            sum_of_latest_s += (latest_s - 4.96_f64).abs();
        }
        assert!(sum_s / 50.0 < 0.2, "mean error {} s", sum_s / 50.0);
        assert!(
            sum_of_latest_s / 50.0 > 15.0,
            "the latest meeting is no change: {} s",
            sum_of_latest_s / 50.0
        );
    }

    #[test]
    fn a_person_who_goes_back_and_returns_has_passed_on_the_return() {
        let mut change = ChangePoint::default();
        for (time_s, sigmas) in [(0.0, -3.0), (1.0, 1.0), (2.0, -4.0), (3.0, 2.0), (4.0, 3.0)] {
            if sigmas > 0.0 {
                change.meet(at(time_s));
            }
            change.take(sigmas);
        }
        assert_eq!(change.at(), Some(at(3.0)));
        change.take(f64::NAN);
        assert_eq!(change.at(), Some(at(3.0)));
    }
}
