//! Seeing agent: one person tracked by one station (Nakazawa et al., section 3.3).

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Point2, Vector2};

use super::super::{Sighting, TargetId};

/// α-β filter of position and velocity, which is a Kalman filter in its steady state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Filter {
    /// Place, metres.
    pub(super) position: Point2<f64>,
    /// Velocity, m/s.
    pub(super) velocity: Vector2<f64>,
    /// Covariance of the place, m².
    pub(super) covariance: Matrix2<f64>,
}

impl Filter {
    /// Initialises the filter at rest with a place, metres, and its covariance, m².
    pub(super) fn new(position: Point2<f64>, covariance: Matrix2<f64>) -> Self {
        Self { position, velocity: Vector2::zeros(), covariance }
    }

    /// Predicts the state `dt_s` seconds ahead and updates it with a measurement if there is one. `filter_s` is the
    /// time constant of the filter, seconds.
    pub(super) fn step(&mut self, measured: Option<&Sighting>, dt_s: f64, filter_s: f64) {
        self.position += self.velocity * dt_s;
        let Some(sighting) = measured.filter(|_| dt_s > 0.0) else { return };
        let alpha = 1.0 - (-dt_s / filter_s).exp();
        // The β of a Kalman filter with this α (Kalata 1984).
        let beta = 2.0 * (2.0 - alpha) - 4.0 * (1.0 - alpha).sqrt();
        let residual = sighting.position - self.position;
        self.position += residual * alpha;
        self.velocity += residual * (beta / dt_s);
        self.covariance = sighting.covariance * alpha;
    }
}

/// Request to join an agency that has not been granted yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pending {
    /// Target of the agency.
    pub(super) candidate: TargetId,
    /// Time of the first request, seconds.
    pub(super) since_s: f64,
    /// Time of the latest request, seconds.
    pub(super) asked_s: f64,
}

/// Seeing agent.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SeeingAgent {
    /// Number within the station.
    pub(super) number: u32,
    /// Target of its agency, or [`TargetId::ALONE`].
    pub(super) target: TargetId,
    /// Confidence, 0 to 1.
    pub(super) confidence: f64,
    /// Image track of the person.
    pub(super) track: Option<u32>,
    /// Sighting of the current frame.
    pub(super) sighting: Option<Sighting>,
    /// Filtered place and velocity.
    pub(super) filter: Filter,
    /// Height, metres.
    pub(super) height_m: f64,
    /// Time since the last sighting, seconds.
    pub(super) unseen_s: f64,
    /// Time for which another agent of the station has tracked the same person, seconds.
    pub(super) doubled_s: f64,
    /// Time for which the person has matched no known target, seconds.
    pub(super) alone_s: f64,
    /// Whether the agent has ever belonged to an agency.
    pub(super) has_belonged: bool,
    /// Entries of a lone agent in the mediator's list of confidences, by target.
    pub(super) list: BTreeMap<TargetId, f64>,
    /// Pending request to join an agency.
    pub(super) request: Option<Pending>,
}

impl SeeingAgent {
    /// Creates a lone agent for a sighting.
    pub(super) fn lone(number: u32, sighting: &Sighting) -> Self {
        Self {
            number,
            target: TargetId::ALONE,
            confidence: 1.0,
            track: Some(sighting.track),
            sighting: Some(*sighting),
            filter: Filter::new(sighting.position, sighting.covariance),
            height_m: sighting.height_m,
            unseen_s: 0.0,
            doubled_s: 0.0,
            alone_s: 0.0,
            has_belonged: false,
            list: BTreeMap::new(),
            request: None,
        }
    }

    /// Creates an agent for a target that another station tracks; this station has no sighting of the person yet.
    pub(super) fn created(
        number: u32,
        target: TargetId,
        confidence: f64,
        filter: Filter,
        height_m: f64,
    ) -> Self {
        Self {
            number,
            target,
            confidence,
            track: None,
            sighting: None,
            filter,
            height_m,
            unseen_s: 0.0,
            doubled_s: 0.0,
            alone_s: 0.0,
            has_belonged: true,
            list: BTreeMap::new(),
            request: None,
        }
    }

    /// Whether the agent belongs to no agency.
    pub(super) fn is_alone(&self) -> bool {
        self.target == TargetId::ALONE
    }

    /// Current sighting, unless it may be of another person nearby.
    pub(super) fn clear_sighting(&self) -> Option<&Sighting> {
        self.sighting.as_ref().filter(|s| !s.is_crowded)
    }

    /// Joins an agency.
    pub(super) fn join(&mut self, target: TargetId, confidence: f64) {
        self.target = target;
        self.confidence = confidence;
        self.has_belonged = true;
        self.alone_s = 0.0;
        self.list.clear();
        self.request = None;
    }

    /// Leaves the agency and tracks alone (section 3.3, item 7).
    pub(super) fn leave(&mut self) {
        self.target = TargetId::ALONE;
        self.list.clear();
        self.request = None;
        self.alone_s = 0.0;
    }
}
