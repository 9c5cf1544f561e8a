//! Motion model: prediction (equation 1 of the paper cited in [`super`]) with its uncertainty, and measurement
//! update.
//!
//! A person's velocity is an Ornstein–Uhlenbeck process: it decays over a memory time and is driven by white
//! acceleration. Place and velocity form a 4-vector with covariance, which is predicted over any time step; with
//! infinite memory its mean is the published `S + V`. The sampler works on the place of the silhouette alone; the
//! information of its posterior beyond the prediction updates the state as a measurement of that place (`update`).
//!
//! A walking person leans forward: head and trunk, which make up most of the silhouette, are ahead of the pelvis by
//! about `lean_s` times the velocity. The silhouette therefore stands at `C · state`, with `C = [I, lean_s · I]`, and
//! the reported place is that of the person.

mod update;

use mot::white_noise_acceleration::ProcessNoise;
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4};

use super::options::MotionOptions;

/// Longest part of a step, as a fraction of the velocity's memory.
const LONGEST_PART: f64 = 0.25;
/// Largest number of parts of one step.
const MOST_PARTS: f64 = 1000.0;

/// Place (m) and velocity (m/s) on the floor, with their covariance. Order: x, y, vx, vy.
#[derive(Debug, Clone)]
pub(super) struct Belief {
    pub(super) mean: Vector4<f64>,
    pub(super) covariance: Matrix4<f64>,
}

impl Belief {
    pub(super) fn place(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(0).into()
    }

    pub(super) fn velocity(&self) -> Vector2<f64> {
        self.mean.fixed_rows::<2>(2).into()
    }

    /// Covariance of the place.
    pub(super) fn place_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(0, 0).into()
    }
}

/// Prediction step from the moment before to this one.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub(super) transition: Matrix4<f64>,
    /// Belief predicted for this moment, before its observations.
    pub(super) predicted: Belief,
}

/// Measurement of a person's place by one moment alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measurement {
    pub(super) place: Vector2<f64>,
    /// Covariance, m²; the standard deviation is [`UNINFORMED_SIGMA_M`](update::UNINFORMED_SIGMA_M) along an axis without information.
    pub(super) covariance: Matrix2<f64>,
}

/// Place and velocity of a person over time.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub(super) belief: Belief,
    /// Measurement behind the last posterior; `None` when the moment had no information.
    pub(super) measured: Option<Measurement>,
    /// Step from the moment before; `None` for a person who has just appeared.
    pub(super) arrived: Option<Step>,
    /// Log density of the last measurement under its prediction; 0 without one.
    pub(super) log_evidence: f64,
    lean_s: f64,
}

impl Motion {
    /// Motion of a person who has just appeared: place known with this covariance (m²), velocity unknown.
    pub(super) fn appeared(place: Vector2<f64>, covariance: &Matrix2<f64>, options: &MotionOptions) -> Self {
        let mut all = Matrix4::from_diagonal_element(options.initial_speed_sigma.powi(2));
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(covariance);
        all.fixed_view_mut::<2, 2>(0, 2).fill(0.0);
        all.fixed_view_mut::<2, 2>(2, 0).fill(0.0);
        let belief = Belief { mean: Vector4::new(place.x, place.y, 0.0, 0.0), covariance: all };
        let measured = Some(Measurement { place, covariance: *covariance });
        Self { belief, measured, arrived: None, log_evidence: 0.0, lean_s: options.lean_s }
    }

    pub(super) fn place(&self) -> Vector2<f64> {
        self.belief.place()
    }

    /// Place of the person's silhouette, metres: an upright person standing there would have the same one.
    pub(super) fn silhouette_place(&self) -> Vector2<f64> {
        self.place() + self.belief.velocity() * self.lean_s
    }

    /// Covariance of [`Self::silhouette_place`].
    pub(super) fn silhouette_covariance(&self) -> Matrix2<f64> {
        let c = self.silhouette_from_state();
        c * self.belief.covariance * c.transpose()
    }

    /// Matrix C: silhouette's place from the state.
    fn silhouette_from_state(&self) -> Matrix2x4<f64> {
        let l = self.lean_s;
        Matrix2x4::new(1.0, 0.0, l, 0.0, 0.0, 1.0, 0.0, l)
    }

    /// Predicts the belief `dt_s` seconds ahead, for a person in sight or not. A step that is long against the memory
    /// of the velocity is divided into parts, over each of which the acceleration is white.
    pub(super) fn predict(&mut self, dt_s: f64, in_sight: bool, options: &MotionOptions) {
        let memory_s = if in_sight { options.velocity_memory_s } else { options.unseen_velocity_memory_s };
        let parts = (dt_s / (LONGEST_PART * memory_s)).ceil().clamp(1.0, MOST_PARTS);
        let (step, noise) = carried(dt_s / parts, memory_s, options.acceleration_density);
        let mut transition = Matrix4::identity();
        for _ in 0..parts as u32 {
            transition = step * transition;
            self.belief.mean = step * self.belief.mean;
            self.belief.covariance = step * self.belief.covariance * step.transpose() + noise;
        }
        self.arrived = Some(Step { transition, predicted: self.belief.clone() });
        (self.measured, self.log_evidence) = (None, 0.0);
    }

    /// Stops the person at this place: the predicted movement did not happen.
    pub(super) fn halt(&mut self, place: Vector2<f64>) {
        self.belief.mean = Vector4::new(place.x, place.y, 0.0, 0.0);
        if let Some(step) = &mut self.arrived {
            step.predicted.mean = self.belief.mean;
        }
    }

    /// Motion `dt_s` seconds later, had the person been where this measurement of another track is; `in_sight` at the
    /// earlier moment.
    pub(super) fn continued(
        &self,
        dt_s: f64,
        in_sight: bool,
        measured: Option<&Measurement>,
        options: &MotionOptions,
    ) -> Self {
        let mut motion = self.clone();
        motion.predict(dt_s, in_sight, options);
        if let Some(Measurement { place, covariance }) = measured {
            motion.observe(&(place + motion.belief.velocity() * motion.lean_s), covariance);
        }
        motion
    }
}

/// Transition matrix over a step that is short against the memory of the velocity, and the covariance added by white
/// acceleration of this density (m²/s³).
fn carried(dt_s: f64, memory_s: f64, density: f64) -> (Matrix4<f64>, Matrix4<f64>) {
    let beta = 1.0 / memory_s;
    // Remaining fraction of the velocity, and distance per unit of velocity.
    let left = (-beta * dt_s).exp();
    let carries = if beta * dt_s < 1e-6 { dt_s } else { (1.0 - left) / beta };
    let added = ProcessNoise::over(dt_s, density);
    let mut step = Matrix4::identity();
    let mut noise = Matrix4::zeros();
    for axis in 0..2 {
        step[(axis, axis + 2)] = carries;
        step[(axis + 2, axis + 2)] = left;
        noise[(axis, axis)] = added.position;
        noise[(axis, axis + 2)] = added.cross;
        noise[(axis + 2, axis)] = added.cross;
        noise[(axis + 2, axis + 2)] = added.velocity;
    }
    (step, noise)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    pub(super) fn start() -> Motion {
        let options = MotionOptions::default();
        let mut motion = Motion::appeared(Vector2::new(1.0, 2.0), &(Matrix2::identity() * 0.01), &options);
        motion.belief.mean[2] = 0.7;
        motion.belief.mean[3] = -0.4;
        motion.predict(0.3, true, &options);
        motion
    }

    #[test]
    fn with_infinite_memory_the_prediction_is_the_published_one() {
        let options = MotionOptions { velocity_memory_s: f64::INFINITY, ..MotionOptions::default() };
        let mut motion = Motion::appeared(Vector2::new(1.0, 2.0), &Matrix2::identity(), &options);
        motion.belief.mean[2] = 0.7;
        motion.belief.mean[3] = -0.4;
        motion.predict(0.5, true, &options);
        assert_relative_eq!(motion.belief.mean, Vector4::new(1.35, 1.8, 0.7, -0.4), epsilon = 1e-12);
    }

    #[test]
    fn unseen_people_become_uncertain_and_stop_walking() {
        let (mut motion, options) = (start(), MotionOptions::default());
        let before = motion.belief.place_covariance().trace();
        for _ in 0..120 {
            motion.predict(1.0 / 12.0, false, &options);
        }
        assert!(motion.belief.place_covariance().trace() > before + 1.0);
        assert!(motion.belief.velocity().norm() < 0.05);
    }

    /// Variance of a known place in the Ornstein–Uhlenbeck process in closed form (Uhlenbeck & Ornstein 1930).
    #[test]
    fn people_wander_over_minutes_as_far_as_the_process_says() {
        let options = MotionOptions::default();
        for (seconds, in_sight) in [(10.0, false), (120.0, true), (400.0, false)] {
            let memory_s =
                if in_sight { options.velocity_memory_s } else { options.unseen_velocity_memory_s };
            let mut motion = Motion::appeared(Vector2::zeros(), &(Matrix2::identity() * 1e-4), &options);
            motion.belief.covariance.fixed_view_mut::<2, 2>(2, 2).fill(0.0);
            motion.predict(seconds, in_sight, &options);
            let (once, twice) = ((-seconds / memory_s).exp(), (-2.0 * seconds / memory_s).exp());
            let way_s = seconds - 2.0 * memory_s * (1.0 - once) + 0.5 * memory_s * (1.0 - twice);
            let variance = options.acceleration_density * memory_s.powi(2) * way_s;
            // Parts of a quarter of the memory overestimate the effect of the acceleration slightly.
            let found = motion.belief.covariance[(0, 0)] / variance;
            assert!((0.95..1.3).contains(&found), "{seconds} s: {found}");
        }
    }
}
