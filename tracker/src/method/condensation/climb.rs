//! From a promising place to the peak of the weight it belongs to: a filter of its own, ever closer around the best.

use nalgebra::Vector3;
use rand_pcg::Pcg64Mcg;

use super::filter::Filter;
use super::spent::Spent;
use super::weight::{Sight, Support};

/// Hypotheses that follow a promising one to its peak, and how far each layer of them spreads, metres.
const CLIMBERS: usize = 60;
pub(super) const CLIMB_SIGMA_M: [f64; 3] = [0.08, 0.04, 0.02];

/// From a promising place to the peak it belongs to, and what supports it; `None` when that would be less than `least`.
pub(super) fn climb(
    start: &Vector3<f64>,
    least: f32,
    sight: &Sight<'_>,
    rng: &mut Pcg64Mcg,
) -> Option<(Vector3<f64>, Support)> {
    let mut spent = Spent::default();
    let mut climb = Filter::around(start, &Vector3::repeat(CLIMB_SIGMA_M[0]), CLIMBERS, rng);
    climb.weigh(sight, &mut spent);
    if climb.support(0.0, sight).all < least {
        return None;
    }
    for sigma_m in &CLIMB_SIGMA_M[1..] {
        climb.redraw(CLIMBERS, &Vector3::repeat(*sigma_m), rng);
        climb.weigh(sight, &mut spent);
    }
    Some((climb.gaussian().mean, climb.support(0.0, sight)))
}
