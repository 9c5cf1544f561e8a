//! Proposals of people at boxes, as mixtures whose density is known everywhere.

use nalgebra::{Matrix2, Vector2, Vector4};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::super::options::Spread;
use super::super::person::{Gaussian, Known};
use super::super::posture::Size;
use super::Boxes;
use super::in_camera::InCamera;
use super::least_squares::{Prior, body, fit};
use crate::silhouette::Body;

/// Factor of the fit's covariance in a proposal, since the posterior has wider tails.
const WIDER: f64 = 1.5;
/// Standard deviation added to every proposal, metres.
const LEAST_SIGMA_M: f64 = 0.02;

/// Least probability that a box belongs to none of the predicted people, for it to propose another person.
const UNEXPLAINED: f64 = 0.3;
/// Standard deviation of a person's place by a single box, before other cameras are used, metres.
const SEED_SIGMA_M: f64 = 0.7;
/// Least distance between hotspots, metres; the better of two nearer ones is kept.
const APART_M: f64 = 0.15;
/// Largest number of hotspots.
const MOST_HOTSPOTS: usize = 128;
/// Fraction of the proposals that is uniform over the hotspots; the rest follows their gain.
const ALIKE: f64 = 0.5;
/// Largest preference of one hotspot over another, nats.
const MOST_PREFERENCE: f64 = 5.0;

/// Normal distribution of a person's place by boxes.
type Fit = Gaussian;

fn widened(covariance: &Matrix2<f64>) -> Matrix2<f64> {
    covariance * WIDER + Matrix2::from_diagonal_element(LEAST_SIGMA_M.powi(2))
}

impl Boxes {
    /// Fit of each known person of the present state to the boxes, in the state's order: the best body, and the
    /// proposal distribution of its place. `None` for people born in this moment.
    pub(in super::super) fn fits<'a>(
        &self,
        people: impl Iterator<Item = (Body, Option<&'a Known>)>,
    ) -> Vec<Option<(Body, Fit)>> {
        let matchings: Vec<_> = self.cameras.iter().map(InCamera::matching).collect();
        let unexplained: Vec<Vec<f64>> = matchings.iter().map(|m| m.unexplained().collect()).collect();
        let matches: Vec<Vec<Vec<(usize, f64)>>> =
            matchings.iter().map(|m| m.matches().map(Iterator::collect).collect()).collect();
        let of_one = |(person, (present, known)): (usize, (Body, Option<&Known>))| {
            let known = known?;
            let (place, covariance) = (known.place.mean(), known.place.covariance());
            let Size { radius, height } = known.size.main();
            let prior = Prior {
                mean: Vector4::new(place.x, place.y, radius.mean_m, height.mean_m),
                precision: Vector4::new(0.0, 0.0, radius.sigma_m.powi(-2), height.sigma_m.powi(-2)),
                place_precision: covariance.try_inverse()?,
            };
            let free = |camera: usize, b: usize| {
                let own = matches[camera][person].iter().find(|(of, _)| *of == b).map_or(0.0, |(_, p)| *p);
                unexplained[camera][b] + own
            };
            let fitted = fit(self, &prior, &present, free)?;
            let place = Gaussian::new(fitted.place(), &widened(&fitted.place_covariance()));
            Some((body(&fitted.state), place))
        };
        people.enumerate().map(of_one).collect()
    }

    /// Hotspots of people with these sizes, standing where `is_possible`, at boxes that the present state leaves
    /// unexplained.
    pub(in super::super) fn hotspots(
        &mut self,
        (radius, height): (&Spread, &Spread),
        is_possible: impl Fn(f64, f64) -> bool,
    ) -> Hotspots {
        if !self.has_any {
            return Hotspots::default();
        }
        let unexplained: Vec<Vec<f64>> =
            (self.cameras.iter()).map(|camera| camera.matching().unexplained().collect()).collect();
        let mut found: Vec<(f64, Vector2<f64>, Matrix2<f64>)> = Vec::new();
        for (camera, unexplained_here) in (0..self.cameras.len()).zip(&unexplained) {
            for b in (0..unexplained_here.len()).filter(|b| unexplained_here[*b] > UNEXPLAINED) {
                let detected = self.cameras[camera].boxes[b];
                let [left, top, right, bottom] = detected.edges;
                let middle = 0.5 * (left + right);
                let seeds = [(!detected.cut[3], bottom, 0.0), (!detected.cut[1], top, height.mean_m)];
                for (_, row, at_m) in seeds.into_iter().filter(|(is_seen, ..)| *is_seen) {
                    let Some([x, y]) = self.cameras[camera].camera.place(middle, row, at_m) else { continue };
                    let prior = Prior {
                        mean: Vector4::new(x, y, radius.mean_m, height.mean_m),
                        precision: Vector4::new(0.0, 0.0, radius.sigma_m.powi(-2), height.sigma_m.powi(-2)),
                        place_precision: Matrix2::from_diagonal_element(SEED_SIGMA_M.powi(-2)),
                    };
                    let free = |c: usize, b: usize| {
                        if unexplained[c][b] > UNEXPLAINED { unexplained[c][b] } else { 0.0 }
                    };
                    let Some(fitted) = fit(self, &prior, &body(&prior.mean), free) else { continue };
                    let (state, covariance) = (fitted.state, fitted.place_covariance());
                    if !is_possible(state[0], state[1]) {
                        continue;
                    }
                    let gain = self.try_change(None, Some(&body(&state))) - self.log_likelihood();
                    found.push((gain, Vector2::new(state[0], state[1]), covariance));
                }
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut kept: Vec<(f64, Vector2<f64>, Matrix2<f64>)> = Vec::new();
        for spot in found {
            if kept.len() < MOST_HOTSPOTS && kept.iter().all(|other| (other.1 - spot.1).norm() > APART_M) {
                kept.push(spot);
            }
        }
        Hotspots::new(&kept)
    }
}

/// Places of people proposed by unexplained boxes: a mixture of normal distributions.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct Hotspots {
    spots: Vec<Gaussian>,
    /// Log weights of the components.
    log_parts: Vec<f64>,
    /// Running sums of the weights, ending in 1.
    cumulative: Vec<f64>,
}

impl Hotspots {
    /// Mixture of places with their gain in nats, best first, and their covariance in m².
    fn new(found: &[(f64, Vector2<f64>, Matrix2<f64>)]) -> Self {
        let Some((best, ..)) = found.first() else { return Self::default() };
        let preference = |gain: f64| (gain - best).max(-MOST_PREFERENCE).exp();
        let sum: f64 = found.iter().map(|(gain, ..)| preference(*gain)).sum();
        let parts: Vec<f64> = (found.iter())
            .map(|(gain, ..)| ALIKE / found.len() as f64 + (1.0 - ALIKE) * preference(*gain) / sum)
            .collect();
        let mut so_far = 0.0;
        Self {
            spots: found
                .iter()
                .map(|(_, place, covariance)| Gaussian::new(*place, &widened(covariance)))
                .collect(),
            log_parts: parts.iter().map(|part| part.ln()).collect(),
            cumulative: parts
                .iter()
                .map(|part| {
                    so_far += part;
                    so_far
                })
                .collect(),
        }
    }

    /// Whether no box proposes a person.
    pub(in super::super) fn is_empty(&self) -> bool {
        self.spots.is_empty()
    }

    /// Number of places.
    pub(in super::super) fn len(&self) -> usize {
        self.spots.len()
    }

    /// Draws a place, metres. There must be at least one hotspot.
    pub(in super::super) fn sample(&self, rng: &mut Pcg64Mcg) -> Vector2<f64> {
        let mark = rng.random::<f64>();
        let spot = self.cumulative.partition_point(|sum| *sum <= mark).min(self.spots.len() - 1);
        self.spots[spot].sample(rng)
    }

    /// Density of [`Self::sample`], 1/m².
    pub(in super::super) fn density(&self, x_m: f64, y_m: f64) -> f64 {
        let spots = self.spots.iter().zip(&self.log_parts);
        spots.map(|(spot, log_part)| (log_part + spot.log_density(x_m, y_m)).exp()).sum()
    }

    /// Hotspots at these places, as narrow as a fit to a single camera's box.
    #[cfg(test)]
    pub(in super::super) fn at(places: &[(f64, f64)]) -> Self {
        let covariance = Matrix2::identity() * 0.04;
        let found: Vec<_> = places
            .iter()
            .enumerate()
            .map(|(i, (x, y))| (-(i as f64), Vector2::new(*x, *y), covariance))
            .collect();
        Self::new(&found)
    }
}
