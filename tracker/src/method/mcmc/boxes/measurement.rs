//! Measurement of each person by the boxes of one moment alone.
//!
//! The sampler determines which people exist and which boxes belong to them. Its mean over a few hundred states, and
//! even more its covariance, has sampling noise; a least-squares fit to the associated boxes has none.

use nalgebra::{Matrix2, Vector2, Vector4};

use super::super::options::Spread;
use super::Boxes;
use super::in_camera::InCamera;
use super::least_squares::{Prior, fit};
use crate::silhouette::Body;

/// Standard deviation of the search around the mean of the states, metres: too wide to inform the place.
const LOOKED_FOR_M: f64 = 3.0;
/// Largest standard deviation of a measured height or radius, metres.
const WIDEST_M: f64 = 0.3;
/// Least probability with which a box is associated with a person.
const LEAST_MATCH: f64 = 0.3;

/// Measurement of a person by the boxes of one moment.
#[derive(Debug, Clone)]
pub(in super::super) struct BoxMeasurement {
    /// Place on the floor, metres, without the prediction.
    pub(in super::super) place: Vector2<f64>,
    /// Its covariance, m².
    pub(in super::super) covariance: Matrix2<f64>,
    /// Radius, combined with its prior.
    pub(in super::super) radius: Spread,
    /// Height, combined with its prior.
    pub(in super::super) height: Spread,
    /// Height without its prior; `None` where the boxes hardly measure it.
    pub(in super::super) height_seen: Option<Spread>,
    /// Radius without its prior; `None` where the boxes hardly measure it.
    pub(in super::super) radius_seen: Option<Spread>,
}

impl Boxes {
    /// Measurement of each person of the present state, given with the priors of radius and height; `None` for a
    /// person without an associated box.
    pub(in super::super) fn measurements(
        &self,
        people: &[(Body, Spread, Spread)],
    ) -> Vec<Option<BoxMeasurement>> {
        let matchings: Vec<_> = self.cameras.iter().map(InCamera::matching).collect();
        let matches: Vec<Vec<Vec<(usize, f64)>>> =
            matchings.iter().map(|m| m.matches().map(Iterator::collect).collect()).collect();
        let of_one = |(person, (body, radius, height)): (usize, &(Body, Spread, Spread))| {
            let probability = |camera: usize, b: usize| {
                let pairs = matches[camera].get(person)?;
                pairs.iter().find(|(of, p)| *of == b && *p > LEAST_MATCH).map(|(_, p)| *p)
            };
            let has_any = |camera: &Vec<Vec<(usize, f64)>>| {
                camera.get(person).is_some_and(|m| m.iter().any(|(_, p)| *p > LEAST_MATCH))
            };
            if !matches.iter().any(has_any) {
                return None;
            }
            let prior = Prior {
                mean: Vector4::new(body.x_m, body.y_m, radius.mean_m, height.mean_m),
                precision: Vector4::new(0.0, 0.0, radius.sigma_m.powi(-2), height.sigma_m.powi(-2)),
                place_precision: Matrix2::from_diagonal_element(LOOKED_FOR_M.powi(-2)),
            };
            let fitted = fit(self, &prior, body, |camera, b| probability(camera, b).unwrap_or(0.0))?;
            let spread = |i: usize| Spread { mean_m: fitted.state[i], sigma_m: fitted.sigma(i) };
            Some(BoxMeasurement {
                place: fitted.place(),
                covariance: fitted.place_covariance(),
                radius: spread(2),
                height: spread(3),
                height_seen: without_prior(&spread(3), height),
                radius_seen: without_prior(&spread(2), radius),
            })
        };
        people.iter().enumerate().map(of_one).collect()
    }
}

/// Measurement behind an estimate that combines it with a prior; `None` where it is wider than [`WIDEST_M`].
fn without_prior(combined: &Spread, prior: &Spread) -> Option<Spread> {
    let precision = combined.sigma_m.powi(-2) - prior.sigma_m.powi(-2);
    let sum = combined.mean_m * combined.sigma_m.powi(-2) - prior.mean_m * prior.sigma_m.powi(-2);
    (precision > WIDEST_M.powi(-2)).then(|| Spread { mean_m: sum / precision, sigma_m: precision.powf(-0.5) })
}
