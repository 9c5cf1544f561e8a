//! Moves that change one person of the state: UPDATE-P (place) and UPDATE-S (size).

use nalgebra::Vector2;
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::super::options::Acceptance;
use super::super::person::Known;
use super::{Chain, is_a_size};
use crate::likelihood::prior::LOG_IMPOSSIBLE;
use crate::silhouette::Body;

/// Fraction of the jumps to unexplained foreground that are drawn by its weight; the rest is uniform, so that every
/// jump has a reverse.
const TO_LEFT_OVER: f64 = 0.9;
/// Fraction of the changes of a known person's size that propose another posture.
const OTHER_POSTURE: f64 = 0.15;
/// Standard deviation of a step along a line of sight, metres: the direction that one camera alone determines worst.
const LINE_OF_SIGHT_STEP_M: f64 = 0.15;

impl Chain<'_> {
    /// UPDATE-P: proposes a step of one of three lengths; under reversible jump, for a person known from the last
    /// moment, also a place drawn from the prediction, a step along a line of sight, or a jump to unexplained
    /// foreground.
    pub(super) fn update_position(&mut self, rng: &mut Pcg64Mcg) {
        let which = rng.random_range(0..self.people.len());
        let (kernel, person) = (rng.random::<f64>(), &self.people[which]);
        let mut body = person.body;
        let reversible = self.setting.options.acceptance == Acceptance::ReversibleJump;
        let mut log_proposal_ratio = 0.0;
        match &person.known {
            Some(known) if reversible && kernel < 0.1 => {
                let place = known.place.sample(rng);
                log_proposal_ratio =
                    known.place.log_density(body.x_m, body.y_m) - known.place.log_density(place.x, place.y);
                (body.x_m, body.y_m) = (place.x, place.y);
            }
            Some(known) if reversible && kernel < 0.3 => {
                let step = self.step_along_sight(known, rng);
                body.x_m += step.x;
                body.y_m += step.y;
            }
            Some(_) if reversible && kernel < 0.35 && self.setting.unexplained.is_some() => {
                // A jump to unexplained foreground recovers lost people.
                let Some(map) = self.setting.unexplained else { return };
                // The jump must not lead into another person, nor, to be reversible, out of one.
                if !self.stands_apart(&body, Some(which)) {
                    return;
                }
                let place = map.sample(TO_LEFT_OVER, rng);
                log_proposal_ratio = map.density(body.x_m, body.y_m, TO_LEFT_OVER).ln()
                    - map.density(place.x, place.y, TO_LEFT_OVER).ln();
                (body.x_m, body.y_m) = (place.x, place.y);
                if !self.stands_apart(&body, Some(which)) {
                    return;
                }
            }
            _ => {
                let scale = if kernel < 0.5 {
                    1.0 / 3.0
                } else if kernel < 0.85 {
                    1.0
                } else {
                    3.0
                };
                let step = self.setting.options.position_step_m * scale;
                let (dx, dy): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
                body.x_m += step * dx;
                body.y_m += step * dy;
            }
        }
        self.update(which, body, log_proposal_ratio, rng);
    }

    /// UPDATE-S: proposes a normal step in radius and height; under reversible jump, for a person known from the last
    /// moment, sometimes the size of another posture.
    pub(super) fn update_size(&mut self, rng: &mut Pcg64Mcg) {
        let which = rng.random_range(0..self.people.len());
        let mut body = self.people[which].body;
        let reversible = self.setting.options.acceptance == Acceptance::ReversibleJump;
        let known = self.people[which].known.as_ref().filter(|known| reversible && known.size.has_choice());
        if let Some(Known { size, .. }) = known
            && rng.random::<f64>() < OTHER_POSTURE
        {
            let back = size.log_density_of_any_mode(&body);
            [body.radius_m, body.height_m] = size.sample_any_mode(rng);
            let log_proposal_ratio = back - size.log_density_of_any_mode(&body);
            self.update(which, body, log_proposal_ratio, rng);
            return;
        }
        let (dr, dh): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
        body.radius_m += self.setting.options.radius_step_m * dr;
        body.height_m += self.setting.options.height_step_m * dh;
        self.update(which, body, 0.0, rng);
    }

    /// Random step, metres, along the line of sight of some camera to a person's prediction. The direction does not depend
    /// on the present state, so that the step is symmetric.
    pub(super) fn step_along_sight(&self, known: &Known, rng: &mut Pcg64Mcg) -> Vector2<f64> {
        let views = self.setting.layers.views();
        let eye = views[rng.random_range(0..views.len())].center.xy().coords;
        let along = known.place.mean() - eye;
        let length: f64 = rng.sample(StandardNormal);
        along / along.norm().max(1e-6) * (length * LINE_OF_SIGHT_STEP_M)
    }

    /// Proposes `body` for one of the people and accepts or rejects it.
    pub(super) fn update(&mut self, which: usize, body: Body, log_proposal_ratio: f64, rng: &mut Pcg64Mcg) {
        let old = self.people[which].body;
        if !is_a_size(&body) {
            return;
        }
        let prior = self.log_prior(which, &body);
        let old_prior = self.log_prior(which, &old);
        if prior <= LOG_IMPOSSIBLE && old_prior > LOG_IMPOSSIBLE {
            return;
        }
        let is_new = self.people[which].is_new();
        let log_ratio = prior - old_prior + self.crowding(&body, Some(which), is_new)
            - self.crowding(&old, Some(which), is_new)
            + log_proposal_ratio;
        if let Some(likelihood) = self.decide(Some(which), Some(&body), log_ratio, rng) {
            self.simulation.commit(Some(&self.people[which].silhouettes), Some(&self.proposed));
            self.boxes.commit(Some(which), true);
            self.arrive(likelihood);
            let at_exit = self.is_exit(&body);
            let person = &mut self.people[which];
            (person.body, person.at_exit) = (body, at_exit);
            std::mem::swap(&mut person.silhouettes, &mut self.proposed);
        }
    }
}
