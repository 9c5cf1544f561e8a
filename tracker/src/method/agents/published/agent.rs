//! A seeing agent: one person, followed by one station (section 3.3).

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Point2, Vector2};

use super::super::{Sighting, TargetId};

/// Position and velocity by an α-β filter, which is a Kalman filter in its steady state.
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
    pub(super) fn new(position: Point2<f64>, covariance: Matrix2<f64>) -> Self {
        Self { position, velocity: Vector2::zeros(), covariance }
    }

    /// Moves on by `dt_s` seconds, with a measurement if there is one.
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

/// A request to join an agency that has not been granted yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pending {
    /// The agency's target.
    pub(super) candidate: TargetId,
    /// When it was asked for first, seconds.
    pub(super) since_s: f64,
    /// When it was asked for last, seconds.
    pub(super) asked_s: f64,
}

/// A seeing agent.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SeeingAgent {
    /// Number within the station.
    pub(super) number: u32,
    /// Target of its agency, or [`TargetId::ALONE`].
    pub(super) target: TargetId,
    /// Confidence, 0 to 1.
    pub(super) confidence: f64,
    /// Image track that it follows.
    pub(super) track: Option<u32>,
    /// What it sees now.
    pub(super) sighting: Option<Sighting>,
    /// Where it is, filtered.
    pub(super) filter: Filter,
    /// Height, metres.
    pub(super) height_m: f64,
    /// Time without success, seconds.
    pub(super) unseen_s: f64,
    /// Time for which another agent of the station has followed the same person, seconds.
    pub(super) doubled_s: f64,
    /// Time for which nobody else has known of the person, seconds.
    pub(super) alone_s: f64,
    /// Whether it has ever belonged to an agency.
    pub(super) has_belonged: bool,
    /// A lone agent's part of the mediator's list of confidences, by target.
    pub(super) list: BTreeMap<TargetId, f64>,
    /// Its request, while there is one.
    pub(super) request: Option<Pending>,
}

impl SeeingAgent {
    /// A lone agent for somebody whom image tracking has found.
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

    /// An agent for a target that another station follows; image tracking has yet to find the person.
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

    /// Whether it belongs to no agency.
    pub(super) fn is_alone(&self) -> bool {
        self.target == TargetId::ALONE
    }

    /// What it sees now, if that is certainly of one person.
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

    /// Leaves its agency and tracks alone (section 3.3, 7).
    pub(super) fn leave(&mut self) {
        self.target = TargetId::ALONE;
        self.list.clear();
        self.request = None;
        self.alone_s = 0.0;
    }
}
