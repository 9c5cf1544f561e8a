//! All stations of a site in one process, as a [`Method`]. The stations are the same as on separate machines, and their
//! packets pass in memory. Deterministic: packets of one moment are received at the next.

use std::sync::Arc;

use nalgebra::Point2;
use rayon::prelude::*;

use super::{AgentStation, AgentsOptions, Belief, FieldOfView, Packet, StageView, StationId};
use crate::method::{Method, Needs};
use crate::prepared_room::PreparedRoom;
use crate::silhouette::visibility::visible_fractions;
use crate::silhouette::{Body, View};
use crate::{Error, Moment, PersonEstimate, Result, TrackId};

/// Maximum number of stations of a system: their numbers are bytes.
const MOST_STATIONS: usize = 255;

/// Confidence above which a person whom no station measures is still reported.
const LIKELY: f64 = 0.5;
/// Number of steps to which confidences are rounded before they are compared.
const SURENESS_STEPS: f64 = 10.0;
/// Distance below which two estimates may be of one person, metres: two bodies are not nearer to each other.
const SAME_M: f64 = 0.35;

/// All stations of a site.
#[derive(Debug)]
pub struct Agents {
    stage: PreparedRoom,
    views: Vec<View>,
    stations: Vec<AgentStation>,
    /// Indices of the stations that each station hears.
    neighbours: Vec<Vec<usize>>,
    /// Packets of the last moment, one per station.
    sent: Vec<Packet>,
}

impl Agents {
    /// Prepares one station for each camera of the room.
    ///
    /// # Errors
    /// [`Error::Option`] for an option that is out of range, or for more than 255 cameras.
    pub fn new(stage: PreparedRoom, options: &AgentsOptions) -> Result<Self> {
        let count = stage.cameras.len();
        if count > MOST_STATIONS {
            return Err(Error::option("agents", format!("{count} cameras; give at most {MOST_STATIONS}")));
        }
        let fields: Arc<dyn FieldOfView> = Arc::new(StageView::new(&stage));
        let id = |i: usize| StationId(i as u8);
        let station = |i: usize| AgentStation::new(&stage, id(i), Arc::clone(&fields), options);
        let stations = (0..count).map(station).collect::<Result<Vec<_>>>()?;
        let hears = |i: usize| (0..count).filter(|j| *j != i && fields.overlap(id(i), id(*j))).collect();
        Ok(Self {
            views: stage.cameras.iter().map(View::new).collect(),
            neighbours: (0..count).map(hears).collect(),
            stations,
            stage,
            sent: Vec::new(),
        })
    }

    /// Estimates of the current agencies: for each target that of its leader, without duplicates.
    fn agencies(&self) -> Vec<Belief> {
        let mut best = leaders(self.stations.iter().flat_map(AgentStation::people).collect());
        let is_there = |belief: &Belief| belief.agent.is_some() || belief.confidence > LIKELY;
        let floor = &self.stage.floor;
        best.retain(|belief| is_there(belief) && floor.is_inside(belief.position.x, belief.position.y));
        let mut distinct: Vec<Belief> = Vec::with_capacity(best.len());
        for belief in best {
            if !distinct.iter().any(|older| self.is_same(older, &belief)) {
                distinct.push(belief);
            }
        }
        distinct
    }

    /// Whether two targets are one person on whose id the stations have not agreed yet: both are at one place, and no
    /// station measures two people there.
    fn is_same(&self, a: &Belief, b: &Belief) -> bool {
        let sees = |packet: &Packet, target| packet.reports.iter().any(|report| report.target == target);
        (a.position - b.position).norm() < SAME_M
            && !self.sent.iter().any(|packet| sees(packet, a.target) && sees(packet, b.target))
    }
}

impl Method for Agents {
    fn packets(&self) -> &[Packet] {
        &self.sent
    }

    fn needs(&self) -> Needs {
        Needs { masks: true, pictures: false, empty_scene: false }
    }

    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>> {
        let (sent, neighbours) = (&self.sent, &self.neighbours);
        let step = |(i, station): (usize, &mut AgentStation)| {
            let received: Vec<Packet> = neighbours[i].iter().filter_map(|j| sent.get(*j).cloned()).collect();
            station.step(moment.frame, moment.time_s, &moment.cameras[i], &received).map(|(_, packet)| packet)
        };
        let packets = self.stations.par_iter_mut().enumerate().map(step).collect::<Result<Vec<Packet>>>()?;
        self.sent = packets;
        let agencies = self.agencies();
        let bodies: Vec<Body> = agencies.iter().map(|b| body(b.position, b.height_m)).collect();
        let visible = visible_fractions(&self.views, &bodies);
        Ok(agencies.iter().zip(visible).map(|(belief, visible)| estimate(belief, visible)).collect())
    }
}

/// Estimate of the leader of each agency, by ascending target. The leader is the most confident agent that measures the
/// person now (Nakazawa et al., section 3.3); of agents with about the same confidence, the one with the smallest
/// covariance.
fn leaders(mut beliefs: Vec<Belief>) -> Vec<Belief> {
    let spread = |belief: &Belief| belief.covariance.determinant();
    let sureness = |belief: &Belief| (SURENESS_STEPS * belief.confidence).round();
    beliefs.sort_by(|a, b| {
        (a.target.cmp(&b.target))
            .then(b.agent.is_some().cmp(&a.agent.is_some()))
            .then(sureness(b).total_cmp(&sureness(a)))
            .then(spread(a).total_cmp(&spread(b)))
    });
    beliefs.dedup_by_key(|belief| belief.target);
    beliefs
}

/// Body of average width at a place.
pub(super) fn body(position: Point2<f64>, height_m: f64) -> Body {
    Body { x_m: position.x, y_m: position.y, height_m, ..Body::ADULT }
}

/// Estimate for output; `visible` is the visible fraction of the person in each camera, 0 to 1.
pub(super) fn estimate(belief: &Belief, visible: Vec<f64>) -> PersonEstimate {
    let sigma_m = |axis: usize| belief.covariance[(axis, axis)].sqrt();
    PersonEstimate {
        id: TrackId(belief.target.0),
        x_m: belief.position.x,
        y_m: belief.position.y,
        z_m: 0.0,
        radius_m: Body::ADULT.radius_m,
        height_m: belief.height_m,
        vx: belief.velocity.x,
        vy: belief.velocity.y,
        sigma_m: [sigma_m(0), sigma_m(1)],
        confidence: belief.confidence,
        visible,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::super::{AgentId, TargetId};
    use super::*;

    fn belief(target: u32, station: Option<u8>, x_m: f64, sigma_m: f64, confidence: f64) -> Belief {
        Belief {
            target: TargetId(target),
            agent: station.map(|station| AgentId { station: StationId(station), number: 1 }),
            position: Point2::new(x_m, 0.0),
            covariance: Matrix2::identity() * sigma_m.powi(2),
            velocity: Vector2::zeros(),
            height_m: 1.7,
            confidence,
        }
    }

    /// Station 1 has swapped two people and has low confidence, though its covariance is the smallest.
    #[test]
    fn a_less_confident_station_does_not_lead() {
        let beliefs = vec![
            belief(7, Some(1), 1.0, 0.05, 0.5),
            belief(8, Some(1), 5.0, 0.05, 0.5),
            belief(7, Some(0), 5.0, 0.2, 0.98),
            belief(8, Some(0), 1.0, 0.2, 0.98),
            // About the same confidence and a smaller covariance; then a person whom no station measures now.
            belief(7, Some(2), 5.1, 0.1, 0.97),
            belief(3, None, 2.0, 1.0, 0.6),
            belief(8, None, 9.0, 0.01, 1.0),
        ];
        let found: Vec<(u32, f64)> =
            leaders(beliefs).iter().map(|belief| (belief.target.0, belief.position.x)).collect();
        assert_eq!(found, [(3, 2.0), (7, 5.1), (8, 1.0)]);
    }
}
