//! A person over time, as the sampler carries them from moment to moment.

use nalgebra::Matrix2;

use super::motion::Motion;
use super::options::{McmcOptions, Spread};
use super::person::{Gaussian, Key, Known};
use super::tally::Sums;
use crate::TrackId;
use crate::silhouette::Body;

/// A silhouette seen in full says this much about its body's radius and height, in metres (one standard deviation):
/// clothes, gait and the mask's own errors are not independent from moment to moment.
const RADIUS_SEEN_SIGMA_M: f64 = 0.06;
const HEIGHT_SEEN_SIGMA_M: f64 = 0.15;
/// People bend, carry and turn: sizes drift by this much in a second.
const RADIUS_DRIFT_M: f64 = 0.01;
const HEIGHT_DRIFT_M: f64 = 0.02;

/// A person the sampler follows.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub(super) key: Key,
    /// Given once the person is believed in.
    pub(super) id: Option<TrackId>,
    pub(super) motion: Motion,
    pub(super) radius: Spread,
    pub(super) height: Spread,
    /// Probability of being there, by the last moment's states.
    pub(super) confidence: f64,
    /// Moments since birth.
    pub(super) moments: u32,
}

impl Track {
    /// Somebody born in this moment.
    pub(super) fn born(sums: &Sums, options: &McmcOptions) -> Self {
        let gait = Matrix2::identity() * options.motion.gait_sigma_m.powi(2);
        let mut track = Self {
            key: sums.key,
            id: None,
            motion: Motion::appeared(sums.place(), &(sums.covariance() + gait), &options.motion),
            radius: options.radius,
            height: options.height,
            confidence: 0.0,
            moments: 0,
        };
        track.resize(sums, 1.0);
        track
    }

    /// Carries the belief on in time.
    pub(super) fn predict(&mut self, dt_s: f64, options: &McmcOptions) {
        self.motion.predict(dt_s, &options.motion);
        let drifted = |s: &Spread, drift: f64, most: f64| Spread {
            sigma_m: (s.sigma_m.powi(2) + drift.powi(2) * dt_s).sqrt().min(most),
            ..*s
        };
        self.radius = drifted(&self.radius, RADIUS_DRIFT_M, options.radius.sigma_m);
        self.height = drifted(&self.height, HEIGHT_DRIFT_M, options.height.sigma_m);
    }

    /// Takes in a moment's states. `visible` is the largest fraction of the person that any camera saw.
    pub(super) fn update(&mut self, sums: &Sums, visible: f64, options: &McmcOptions) {
        let gait = Matrix2::identity() * options.motion.gait_sigma_m.powi(2);
        self.motion.condition(&sums.place(), &(sums.covariance() + gait));
        self.resize(sums, visible);
    }

    fn resize(&mut self, sums: &Sums, visible: f64) {
        let seen = |s: &Spread, mean_m: f64, sigma_m: f64| Spread {
            mean_m,
            sigma_m: (s.sigma_m.powi(-2) + visible * sigma_m.powi(-2)).powf(-0.5),
        };
        self.radius = seen(&self.radius, sums.radius_m(), RADIUS_SEEN_SIGMA_M);
        self.height = seen(&self.height, sums.height_m(), HEIGHT_SEEN_SIGMA_M);
    }

    /// What is known before the next moment is looked at.
    pub(super) fn known(&self) -> Known {
        Known {
            place: Gaussian::new(self.motion.place(), &self.motion.place_covariance()),
            radius: self.radius,
            height: self.height,
        }
    }

    /// The most probable body.
    pub(super) fn body(&self) -> Body {
        let place = self.motion.place();
        Body { x_m: place.x, y_m: place.y, radius_m: self.radius.mean_m, height_m: self.height.mean_m }
    }
}
