//! Reference information memory: current measurements by other stations' agents (Nakazawa et al., section 3.2).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix2, Point2, Vector2};

use super::super::{Looks, Packet, Report, StationId, TargetId};

/// Time for which a report is valid, seconds: it bridges a few lost packets.
const FRESH_S: f64 = 0.35;
/// Valid ages of a packet, seconds; negative for a packet from later than now.
const AGES_S: std::ops::RangeInclusive<f64> = -0.5..=1.0;
/// Greatest valid target id.
pub(super) const LARGEST_TARGET: u32 = 1 << 30;
/// Maximum number of reports used of one packet.
const MOST_REPORTS: usize = 256;

/// Agent of another station, predicted to now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Member {
    /// Predicted place, metres.
    pub(super) position: Point2<f64>,
    /// Covariance of the measurement, m².
    pub(super) covariance: Matrix2<f64>,
    /// Velocity, m/s.
    pub(super) velocity: Vector2<f64>,
    /// Height, metres.
    pub(super) height_m: f64,
    /// Measured colours.
    pub(super) looks: Option<Looks>,
    /// Confidence, 0 to 1.
    pub(super) confidence: f64,
    /// Whether the measurement may be of another person nearby.
    pub(super) is_crowded: bool,
}

/// Last packet of a station.
#[derive(Debug, Clone)]
struct LastPacket {
    life: u32,
    sequence: u32,
    time_s: f64,
    reports: Vec<Report>,
}

/// Last packet of each station, and the agents in it by target.
#[derive(Debug, Clone, Default)]
pub(super) struct Reference {
    last: BTreeMap<StationId, LastPacket>,
    members: BTreeMap<TargetId, Vec<Member>>,
    greatest: TargetId,
}

impl Reference {
    /// Stores a packet, unless it is old or repeated. Returns whether it was stored.
    pub(super) fn update(&mut self, packet: &Packet, now_s: f64) -> bool {
        if !AGES_S.contains(&(now_s - packet.time_s)) {
            return false;
        }
        if let Some(last) = self.last.get(&packet.station) {
            let is_old = if packet.life == last.life {
                packet.sequence <= last.sequence
            } else {
                packet.time_s <= last.time_s
            };
            if is_old {
                return false;
            }
        }
        let reports: Vec<Report> =
            packet.reports.iter().take(MOST_REPORTS).filter(|r| is_usable(r)).copied().collect();
        let targets = reports.iter().map(|r| r.target).chain([packet.greatest]);
        let greatest = targets.filter(|t| t.0 <= LARGEST_TARGET).max();
        self.greatest = self.greatest.max(greatest.unwrap_or_default());
        let last =
            LastPacket { life: packet.life, sequence: packet.sequence, time_s: packet.time_s, reports };
        self.last.insert(packet.station, last);
        true
    }

    /// Predicts the agents of all valid reports to now.
    pub(super) fn predict_to(&mut self, now_s: f64) {
        self.members.clear();
        for packet in self.last.values().filter(|p| now_s - p.time_s <= FRESH_S) {
            let age_s = (now_s - packet.time_s).max(0.0);
            for report in &packet.reports {
                self.members.entry(report.target).or_default().push(Member {
                    position: report.position + report.velocity * age_s,
                    covariance: report.covariance,
                    velocity: report.velocity,
                    height_m: report.height_m,
                    looks: report.looks,
                    confidence: report.confidence,
                    is_crowded: report.is_crowded,
                });
            }
        }
    }

    /// Agents of other stations that belong to an agency.
    pub(super) fn members(&self, target: TargetId) -> &[Member] {
        self.members.get(&target).map_or(&[], Vec::as_slice)
    }

    /// Most confident agent of other stations in an agency.
    pub(super) fn leader(&self, target: TargetId) -> Option<&Member> {
        self.members(target).iter().rev().max_by(|a, b| a.confidence.total_cmp(&b.confidence))
    }

    /// Targets that other stations track.
    pub(super) fn targets(&self) -> BTreeSet<TargetId> {
        self.members.keys().copied().collect()
    }

    /// Greatest target id in any packet so far.
    pub(super) fn greatest(&self) -> TargetId {
        self.greatest
    }
}

/// Whether a report has valid values and belongs to an agency.
fn is_usable(report: &Report) -> bool {
    (1..=LARGEST_TARGET).contains(&report.target.0)
        && report.position.iter().chain(report.velocity.iter()).all(|v| v.is_finite() && v.abs() < 1e4)
        && report.covariance.iter().all(|v| v.is_finite())
        && (0.0..=1.0).contains(&report.confidence)
        && (0.1..=3.0).contains(&report.height_m)
        && report.looks.is_none_or(|looks| looks.colours.iter().all(|c| c.hue_deg.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{point, vector};

    fn report(target: u32, confidence: f64) -> Report {
        Report {
            agent: super::super::super::AgentId { station: StationId(1), number: 1 },
            target: TargetId(target),
            position: point![1.0, 2.0],
            covariance: Matrix2::identity(),
            velocity: vector![1.0, 0.0],
            height_m: 1.7,
            looks: None,
            confidence,
            is_crowded: false,
        }
    }

    fn packet(station: u8, sequence: u32, time_s: f64, reports: Vec<Report>) -> Packet {
        Packet { station: StationId(station), sequence, time_s, reports, ..Packet::default() }
    }

    #[test]
    fn the_leader_is_the_most_confident_and_is_predicted_to_now() {
        let mut reference = Reference::default();
        assert!(reference.update(&packet(1, 1, 9.9, vec![report(7, 0.5)]), 10.0));
        assert!(reference.update(&packet(2, 1, 9.8, vec![report(7, 0.9)]), 10.0));
        reference.predict_to(10.0);
        let leader = reference.leader(TargetId(7)).unwrap();
        assert!((leader.confidence - 0.9).abs() < 1e-12 && (leader.position.x - 1.2).abs() < 1e-9);
        assert_eq!(reference.members(TargetId(7)).len(), 2);
        reference.predict_to(10.5);
        assert!(reference.leader(TargetId(7)).is_none(), "nothing fresh is known");
    }

    #[test]
    fn old_repeated_and_invalid_packets_change_nothing() {
        let mut reference = Reference::default();
        assert!(!reference.update(&packet(1, 1, 3600.0, vec![report(7, 0.5)]), 10.0));
        assert!(reference.update(&packet(1, 5, 10.0, vec![report(7, 0.5)]), 10.0));
        assert!(!reference.update(&packet(1, 5, 10.0, vec![report(8, 0.5)]), 10.0));
        let senseless = [
            Report { position: point![f64::NAN, 0.0], ..report(8, 0.5) },
            Report { target: TargetId(u32::MAX), ..report(8, 0.5) },
            Report { confidence: 3.0, ..report(8, 0.5) },
        ];
        assert!(reference.update(&packet(2, 1, 10.0, senseless.to_vec()), 10.0));
        reference.predict_to(10.0);
        assert_eq!(reference.targets().into_iter().collect::<Vec<_>>(), [TargetId(7)]);
        assert_eq!(reference.greatest(), TargetId(7));
    }
}
