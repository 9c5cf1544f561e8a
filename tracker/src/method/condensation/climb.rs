//! Local search from a promising place to its peak of the weight, by a filter whose spread decreases.

use nalgebra::Vector3;
use rand_pcg::Pcg64Mcg;

use super::filter::HeadFilter;
use super::step_times::StepTimes;
use super::weight::{HeadSupport, WeighingInput};

/// Number of hypotheses of the local search, and their standard deviation in each layer, metres.
const CLIMBERS: usize = 60;
pub(super) const CLIMB_SIGMA_M: [f64; 3] = [0.08, 0.04, 0.02];

/// Peak of the weight near a promising place, with its support; `None` when the support of the place is below `least`.
pub(super) fn climb(
    start: &Vector3<f64>,
    least: f32,
    input: &WeighingInput<'_>,
    rng: &mut Pcg64Mcg,
) -> Option<(Vector3<f64>, HeadSupport)> {
    let mut times = StepTimes::default();
    let mut climb = HeadFilter::around(start, &Vector3::repeat(CLIMB_SIGMA_M[0]), CLIMBERS, rng);
    climb.weigh(input, &mut times);
    if climb.support(0.0, input).all < least {
        return None;
    }
    for sigma_m in &CLIMB_SIGMA_M[1..] {
        climb.redraw(CLIMBERS, &Vector3::repeat(*sigma_m), rng);
        climb.weigh(input, &mut times);
    }
    Some((climb.gaussian().mean, climb.support(0.0, input)))
}
