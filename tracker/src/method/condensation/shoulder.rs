//! Detection of shoulders: half of a shoulder and the neck fit the upper contour of a head (figure 11) nearly as well
//! as a head. A head above distinguishes them.

use nalgebra::Vector3;
use rand_pcg::Pcg64Mcg;

use super::climb::{CLIMB_SIGMA_M, climb};
use super::exclusion::APART_M;
use super::filter::HeadFilter;
use super::step_times::StepTimes;
use super::weight::{HeadSupport, WeighingInput};

/// Mean offset of a head above a shoulder, and the standard deviations of the tested positions, metres.
const ABOVE_M: f64 = 0.28;
const ABOVE_SIGMA_M: Vector3<f64> = Vector3::new(0.12, 0.12, 0.1);
/// Number of hypotheses for that head.
const TRIED: usize = 120;
/// Least support of the head, relative to that of the place below: a shoulder is hidden by fewer others than a head.
const ENOUGH: f32 = 0.7;
/// Least relative support for a track to move from a shoulder to the head.
pub(super) const AS_GOOD: f32 = 0.9;
/// Largest distance of shoulders and elbows from the head on the floor plan, metres.
const REACH_M: f64 = 0.5;
/// Least height of the head above them, metres.
const LOWER_M: f64 = 0.12;

/// Head above a place that looks like a head, with its support; `None` when there is none, so that the place may be a
/// head itself.
pub(super) fn head_above(
    place: &Vector3<f64>,
    support: &HeadSupport,
    input: &WeighingInput<'_>,
    rng: &mut Pcg64Mcg,
) -> Option<(Vector3<f64>, HeadSupport)> {
    let middle = place + Vector3::z() * ABOVE_M;
    let mut column = HeadFilter::around(&middle, &ABOVE_SIGMA_M, TRIED, rng);
    column.weigh(input, &mut StepTimes::default());
    let (head, its) = climb(&column.heaviest()?, ENOUGH * support.all, input, rng)?;
    let is_above = head.z > place.z + CLIMB_SIGMA_M[0] && (head - place).xy().norm() < APART_M;
    (is_above && its.all >= ENOUGH * support.all).then_some((head, its))
}

/// Whether a place is where the shoulders and elbows below a head are.
pub(super) fn is_beside(place: &Vector3<f64>, head: &Vector3<f64>) -> bool {
    (place - head).xy().norm() < REACH_M && head.z > place.z + LOWER_M
}
