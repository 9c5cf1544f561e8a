//! Shoulders: to the upper contour of a head (figure 11), half of a shoulder and the neck are nearly as good. What tells them
//! apart is that there is a head above.

use nalgebra::Vector3;
use rand_pcg::Pcg64Mcg;

use super::climb::{CLIMB_SIGMA_M, climb};
use super::exclusion::APART_M;
use super::filter::Filter;
use super::spent::Spent;
use super::weight::{Sight, Support};

/// A head is about so far above a shoulder, and to its side as far as the spread of what is tried, metres.
const ABOVE_M: f64 = 0.28;
const ABOVE_SIGMA_M: Vector3<f64> = Vector3::new(0.12, 0.12, 0.1);
/// Hypotheses of where that head is.
const TRIED: usize = 120;
/// It has to have this share of the support of what is below: a shoulder is seen past by fewer others than a head is.
const ENOUGH: f32 = 0.7;
/// And this share of it for somebody to go on there who has been followed by what is below.
pub(super) const AS_GOOD: f32 = 0.9;
/// Shoulders and elbows are nearer than this to the head, on the floor plan.
const REACH_M: f64 = 0.5;
/// And lower than it by no less than this.
const LOWER_M: f64 = 0.12;

/// The head above a place that looks like one, and what supports it; `None` when there is none, so that the place may be a
/// head itself.
pub(super) fn head_above(
    place: &Vector3<f64>,
    support: &Support,
    sight: &Sight<'_>,
    rng: &mut Pcg64Mcg,
) -> Option<(Vector3<f64>, Support)> {
    let middle = place + Vector3::z() * ABOVE_M;
    let mut column = Filter::around(&middle, &ABOVE_SIGMA_M, TRIED, rng);
    column.weigh(sight, &mut Spent::default());
    let (head, its) = climb(&column.heaviest()?, ENOUGH * support.all, sight, rng)?;
    let is_above = head.z > place.z + CLIMB_SIGMA_M[0] && (head - place).xy().norm() < APART_M;
    (is_above && its.all >= ENOUGH * support.all).then_some((head, its))
}

/// Whether a place is where somebody's shoulders and elbows are, by where their head is.
pub(super) fn is_beside(place: &Vector3<f64>, head: &Vector3<f64>) -> bool {
    (place - head).xy().norm() < REACH_M && head.z > place.z + LOWER_M
}
