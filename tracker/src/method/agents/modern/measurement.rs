//! Measurements of one sender, validated and predicted to this station's time.

use nalgebra::{Matrix2, Point2, Vector2};

use super::super::{Looks, Packet, Report, Sightings, TargetId};
use super::ModernOptions;
use super::signature::Signature;

/// Maximum number of reports used of a packet, and of sightings used of a moment.
pub(super) const MOST_MEASUREMENTS: usize = 64;
/// Largest valid target id.
pub(super) const LARGEST_TARGET: u32 = 1 << 30;
/// Smallest and largest valid standard deviation of a place, metres: from the best that a station measures to the
/// worst that is useful.
const SIGMA_RANGE_M: (f64, f64) = (0.03, 10.0);
/// Largest valid coordinate, metres.
const FARTHEST_M: f64 = 1e4;
/// Largest valid speed, m/s.
const FASTEST_M_S: f64 = 12.0;
/// Smallest and largest valid height, metres.
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
    /// Velocity estimated by the sender, m/s; 0 for a sighting.
    pub(super) velocity: Vector2<f64>,
    /// Height, metres.
    pub(super) height_m: f64,
    /// Measured looks; `None` when too little of the person is visible.
    pub(super) looks: Option<Looks>,
    /// Looks and height as a vector for comparison.
    pub(super) signature: Option<Signature>,
    /// Whether the measurement may be of another person nearby.
    pub(super) is_crowded: bool,
    /// Target id given by the sender; 0 for none.
    pub(super) target: TargetId,
    /// The sender's confidence in the target id, 0 to 1.
    pub(super) confidence: f64,
    /// Image track of a sighting; 0 for a report.
    pub(super) track: u32,
}

/// Appends the station's own sightings. Two image tracks on one person give one measurement. Returns the number of
/// sightings refused.
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

/// Appends a packet's reports, predicted by `age_s` seconds (negative for reports later than now). Returns the number
/// of reports refused: invalid values, or a target that is reported twice.
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

/// Covariance made symmetric, with the variance of the best station added; `None` for an invalid or useless one.
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
