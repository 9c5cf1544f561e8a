//! UPDATE-P where a detector's boxes are observed: most places are drawn from the fit to the boxes.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::super::options::Acceptance;
use super::Chain;

impl Chain<'_> {
    /// UPDATE-P: proposes a place drawn from the fit to the boxes, from the prediction or from the hotspots, a step
    /// along a line of sight, or a step of one of three lengths. The kernels available to a person do not change
    /// within a moment.
    pub(super) fn update_position_by_boxes(&mut self, rng: &mut Pcg64Mcg) {
        if self.setting.options.acceptance == Acceptance::Published {
            self.update_position(rng);
            return;
        }
        let which = rng.random_range(0..self.people.len());
        let kernel = rng.random::<f64>();
        let person = &self.people[which];
        let mut body = person.body;
        let known = person.known.as_ref();
        let mut log_proposal_ratio = 0.0;
        match (known, known.and_then(|known| known.fit.as_ref())) {
            (_, Some(fit)) if kernel < 0.3 => {
                let place = fit.sample(rng);
                log_proposal_ratio = fit.log_density(body.x_m, body.y_m) - fit.log_density(place.x, place.y);
                (body.x_m, body.y_m) = (place.x, place.y);
            }
            (Some(known), _) if kernel < 0.4 => {
                let place = known.place.sample(rng);
                log_proposal_ratio =
                    known.place.log_density(body.x_m, body.y_m) - known.place.log_density(place.x, place.y);
                (body.x_m, body.y_m) = (place.x, place.y);
            }
            (Some(known), _) if kernel < 0.5 => {
                let step = self.step_along_sight(known, rng);
                body.x_m += step.x;
                body.y_m += step.y;
            }
            _ if kernel < 0.55 && !self.setting.appearance.hotspots.is_empty() => {
                let hotspots = self.setting.appearance.hotspots;
                let place = hotspots.sample(rng);
                log_proposal_ratio =
                    hotspots.density(body.x_m, body.y_m).ln() - hotspots.density(place.x, place.y).ln();
                (body.x_m, body.y_m) = (place.x, place.y);
            }
            _ => {
                let scale = match kernel {
                    ..0.7 => 1.0 / 3.0,
                    ..0.9 => 1.0,
                    _ => 3.0,
                };
                let step = self.setting.options.position_step_m * scale;
                let (dx, dy): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
                body.x_m += step * dx;
                body.y_m += step * dy;
            }
        }
        self.update(which, body, log_proposal_ratio, rng);
    }
}
