//! Measurements of one sender, as this station uses them: checked, and brought to its time.

use nalgebra::{Matrix2, Point2, Vector2};

use super::super::{Looks, Packet, Report, Sightings, TargetId};
use super::ModernOptions;
use super::signature::Signature;

/// Most reports of a packet, and most sightings of a moment, that are used.
pub(super) const MOST_MEASUREMENTS: usize = 64;
/// Largest target id that is believed: what is above is nobody's.
pub(super) const LARGEST_TARGET: u32 = 1 << 30;
/// Standard deviation of a place that is believed, metres: from as good as a station measures to as bad as is of use.
const SIGMA_RANGE_M: (f64, f64) = (0.03, 10.0);
/// Largest coordinate that is believed, metres.
const FARTHEST_M: f64 = 1e4;
/// Largest speed that is believed, m/s.
const FASTEST_M_S: f64 = 12.0;
/// Height that is believed, metres.
const HEIGHT_RANGE_M: (f64, f64) = (0.3, 2.6);
/// Standard deviation of a reported velocity, m/s.
const VELOCITY_SIGMA_M_S: f64 = 1.0;

/// One measurement of a person, at this station's time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measurement {
    /// Place, metres.
    pub(super) position: Point2<f64>,
    /// Covariance of the place, m².
    pub(super) covariance: Matrix2<f64>,
    /// Velocity by the sender, m/s; 0 of a sighting.
    pub(super) velocity: Vector2<f64>,
    /// Height, metres.
    pub(super) height_m: f64,
    /// Looks as they were measured; `None` where too little is seen.
    pub(super) looks: Option<Looks>,
    /// The same, to compare.
    pub(super) signature: Option<Signature>,
    /// Whether it may be of somebody near.
    pub(super) is_crowded: bool,
    /// The sender's target id of it, 0: none.
    pub(super) target: TargetId,
    /// The sender's confidence that it is its target.
    pub(super) confidence: f64,
    /// Image track of a sighting.
    pub(super) track: u32,
}

/// The station's own sightings. Two image tracks on one person give one measurement. Returns how many were refused.
pub(super) fn of_sightings(
    sightings: &Sightings,
    options: &ModernOptions,
    into: &mut Vec<Measurement>,
) -> usize {
    let mut refused = sightings.people.len().saturating_sub(MOST_MEASUREMENTS);
    for sighting in sightings.people.iter().take(MOST_MEASUREMENTS) {
        let Some(covariance) = checked_covariance(&sighting.covariance) else {
            refused += 1;
            continue;
        };
        if !is_place(&sighting.position) || !is_height(sighting.height_m) {
            refused += 1;
            continue;
        }
        if into.iter().any(|m| m.position == sighting.position) {
            continue;
        }
        into.push(Measurement {
            position: sighting.position,
            covariance,
            velocity: Vector2::zeros(),
            height_m: sighting.height_m,
            looks: sighting.looks,
            signature: signature(sighting.looks.as_ref(), sighting.height_m, options),
            is_crowded: sighting.is_crowded,
            target: TargetId::ALONE,
            confidence: 1.0,
            track: sighting.track,
        });
    }
    refused
}

/// A packet's reports, brought ahead by `age_s` seconds, which are negative for a report of later than now. Returns how
/// many were refused, because their numbers are not of a person's or their target is reported twice.
pub(super) fn of_packet(
    packet: &Packet,
    age_s: f64,
    options: &ModernOptions,
    into: &mut Vec<Measurement>,
) -> usize {
    let mut refused = packet.reports.len().saturating_sub(MOST_MEASUREMENTS);
    let begin = into.len();
    for report in packet.reports.iter().take(MOST_MEASUREMENTS) {
        let is_double =
            report.target != TargetId::ALONE && into[begin..].iter().any(|m| m.target == report.target);
        match of_report(report, age_s, options) {
            Some(measurement) if !is_double => into.push(measurement),
            _ => refused += 1,
        }
    }
    refused
}

fn of_report(report: &Report, age_s: f64, options: &ModernOptions) -> Option<Measurement> {
    let is_sound = is_place(&report.position)
        && report.velocity.norm() <= FASTEST_M_S
        && is_height(report.height_m)
        && (0.0..=1.0).contains(&report.confidence)
        && report.target.0 <= LARGEST_TARGET;
    if !is_sound {
        return None;
    }
    let covariance = checked_covariance(&report.covariance)?;
    Some(Measurement {
        position: report.position + report.velocity * age_s,
        covariance: covariance + Matrix2::identity() * (VELOCITY_SIGMA_M_S * age_s).powi(2),
        velocity: report.velocity,
        height_m: report.height_m,
        looks: report.looks,
        signature: signature(report.looks.as_ref(), report.height_m, options),
        is_crowded: report.is_crowded,
        target: report.target,
        confidence: report.confidence,
        track: 0,
    })
}

fn is_place(place: &Point2<f64>) -> bool {
    place.coords.iter().all(|c| c.abs() <= FARTHEST_M)
}

fn is_height(height_m: f64) -> bool {
    (HEIGHT_RANGE_M.0..=HEIGHT_RANGE_M.1).contains(&height_m)
}

/// The covariance, made symmetric and no smaller than any station measures; `None` where it is none or of no use.
fn checked_covariance(covariance: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let symmetric = (covariance + covariance.transpose()) * 0.5;
    let (trace, determinant) = (symmetric.trace(), symmetric.determinant());
    let is_sound = trace.is_finite()
        && determinant.is_finite()
        && trace > 0.0
        && determinant >= 0.0
        && trace <= 2.0 * SIGMA_RANGE_M.1.powi(2);
    is_sound.then(|| symmetric + Matrix2::identity() * SIGMA_RANGE_M.0.powi(2))
}

fn signature(looks: Option<&Looks>, height_m: f64, options: &ModernOptions) -> Option<Signature> {
    let looks = looks?;
    let is_sound = looks.colours.iter().all(|c| {
        (-360.0..=720.0).contains(&c.hue_deg)
            && (0.0..=1.0).contains(&c.saturation)
            && (0.0..=1.0).contains(&c.value)
    });
    is_sound.then(|| Signature::new(looks, height_m, options))
}
