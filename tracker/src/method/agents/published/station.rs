//! One station under the published rule.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::super::{
    AgentId, Belief, FieldOfView, MediatorMessage, Packet, Report, Restart, Rule, Sighting, Sightings,
    StationId, Step, TargetId,
};
use super::PublishedOptions;
use super::agent::SeeingAgent;
use super::colour_memory::ColourMemory;
use super::confidence;
use super::mediator::{CLOSE_M, Mediator, SAME_M, Surroundings};
use super::reference::Reference;

/// Longest time step, seconds.
const LONGEST_STEP_S: f64 = 0.5;
/// Distance from an agent's predicted place below which a new image track is of its person, metres: the radius of
/// tracking plus the error of a measurement.
const REACH_M: f64 = CLOSE_M + 0.6;

/// Published rule at one station.
pub struct Published {
    station: StationId,
    stations: u8,
    life: u32,
    fields: Arc<dyn FieldOfView>,
    options: PublishedOptions,
    agents: Vec<SeeingAgent>,
    reference: Reference,
    memory: ColourMemory,
    mediator: Mediator,
    /// Image tracks of the last moment.
    tracks: BTreeSet<u32>,
    /// Image tracks and their known targets, until the first moment.
    introduced: Vec<(u32, TargetId)>,
    /// Time of the last moment, seconds.
    now_s: Option<f64>,
    sequence: u32,
}

impl Published {
    /// Creates the rule of a station, one of `stations`, that has just started and knows of no person.
    pub fn new(
        station: StationId,
        stations: u8,
        fields: Arc<dyn FieldOfView>,
        options: PublishedOptions,
    ) -> Self {
        Self {
            station,
            stations,
            life: 0,
            fields,
            options,
            agents: Vec::new(),
            reference: Reference::default(),
            memory: ColourMemory::default(),
            mediator: Mediator::default(),
            tracks: BTreeSet::new(),
            introduced: Vec::new(),
            now_s: None,
            sequence: 0,
        }
    }

    /// Sets the number that distinguishes this run of the station from earlier ones in its packets.
    #[must_use]
    pub fn with_life(self, life: u32) -> Self {
        Self { life, ..self }
    }

    /// Sets the target of an image track before the first moment, as in experiment 2, where all people are known at the
    /// start.
    pub fn introduce(&mut self, track: u32, target: TargetId) {
        self.introduced.push((track, target));
        self.mediator.reserve(target);
    }

    /// Stores received packets. Returns the messages of their mediators.
    fn receive(&mut self, received: &[Packet], now_s: f64) -> Vec<MediatorMessage> {
        let mut messages = Vec::new();
        for packet in received.iter().filter(|p| p.station != self.station && p.station.0 < self.stations) {
            if self.reference.update(packet, now_s) {
                messages.extend_from_slice(&packet.messages);
            }
        }
        self.reference.predict_to(now_s);
        messages
    }

    /// Updates every agent with its sighting, gives new image tracks to agents without one, and ends agents that were
    /// missed for too long.
    fn follow(&mut self, sightings: &Sightings, dt_s: f64) {
        let people = &sightings.people;
        for agent in &mut self.agents {
            agent.sighting = agent.track.and_then(|track| of_track(people, track)).copied();
            if agent.sighting.is_none() {
                agent.track = None;
            }
        }
        self.begin_tracks(people);
        self.introduced.clear();
        for agent in &mut self.agents {
            let sighting = agent.sighting;
            agent.filter.step(sighting.as_ref(), dt_s, self.options.filter_s);
            match (sighting, self.reference.leader(agent.target)) {
                (Some(sighting), _) => {
                    agent.height_m = sighting.height_m;
                    agent.unseen_s = 0.0;
                }
                // Section 3.3, item 6: the agent restarts from the place of the agency's most confident agent.
                (None, Some(leader)) => {
                    (agent.filter.position, agent.filter.velocity) = (leader.position, leader.velocity);
                    agent.unseen_s += dt_s;
                }
                (None, None) => agent.unseen_s += dt_s,
            }
        }
        let lost_s = self.options.lost_s;
        self.agents.retain(|a| a.unseen_s <= lost_s);
        self.tracks = people.iter().map(|s| s.track).collect();
    }

    /// Assigns image tracks without an agent: a new one to the nearest agent without a track, and otherwise to a new
    /// lone agent, unless another agent tracks the same person.
    fn begin_tracks(&mut self, people: &[Sighting]) {
        for sighting in people {
            if self.agents.iter().any(|a| a.track == Some(sighting.track)) {
                continue;
            }
            let distance_m = |a: &SeeingAgent| {
                let expected = self.reference.leader(a.target).map_or(a.filter.position, |l| l.position);
                (expected - sighting.position).norm()
            };
            let is_new = !self.tracks.contains(&sighting.track);
            let looking =
                self.agents.iter_mut().filter(|a| is_new && a.track.is_none() && distance_m(a) < REACH_M);
            if let Some(agent) = looking.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b))) {
                agent.track = Some(sighting.track);
                agent.sighting = Some(*sighting);
                continue;
            }
            let introduced = self.introduced.iter().position(|(track, _)| *track == sighting.track);
            let is_followed = self
                .agents
                .iter()
                .any(|a| a.sighting.is_some_and(|s| (s.position - sighting.position).norm() < SAME_M));
            if introduced.is_none() && (sighting.is_crowded || is_followed) {
                continue;
            }
            let mut agent = SeeingAgent::lone(self.mediator.number_agent(), sighting);
            if let Some(index) = introduced {
                agent.join(self.introduced.swap_remove(index).1, agent.confidence);
            }
            self.agents.push(agent);
        }
    }

    /// Equations (1) and (2) for all agents that belong to an agency.
    fn update_confidence(&mut self, dt_s: f64) {
        for agent in self.agents.iter_mut().filter(|a| !a.is_alone()) {
            let Some(sighting) = agent.sighting else { continue };
            // eval_event: -1 while the person is too close to another.
            let eval_event = if sighting.is_crowded { -1.0 } else { 0.0 };
            let own = agent.confidence;
            let surer = self.reference.members(agent.target).iter().filter(|m| m.confidence > own);
            let change =
                confidence::change(&sighting, agent.target, surer, &self.memory, dt_s, &self.options);
            agent.confidence = (own + self.options.crossing_penalty * eval_event + change).clamp(0.0, 1.0);
            if let Some(looks) = sighting.looks.filter(|_| !sighting.is_crowded)
                && agent.confidence >= self.options.memory_confidence
            {
                self.memory.record(agent.target, &looks, self.now_s.unwrap_or_default());
            }
            if agent.confidence <= self.options.leaving_confidence {
                agent.leave();
            }
        }
    }

    /// Creates the packet to send: a report of each agent of an agency that has a sighting (section 3.3, item 5).
    fn packet(&mut self, is_usable: bool) -> Packet {
        self.sequence += 1;
        let mut reports: Vec<Report> = Vec::new();
        for agent in self.agents.iter().filter(|a| !a.is_alone()) {
            let Some(sighting) = agent.sighting else { continue };
            reports.push(Report {
                agent: AgentId { station: self.station, number: agent.number },
                target: agent.target,
                position: sighting.position,
                covariance: sighting.covariance,
                velocity: agent.filter.velocity,
                height_m: sighting.height_m,
                looks: sighting.looks,
                confidence: agent.confidence,
                is_crowded: sighting.is_crowded,
            });
        }
        Packet {
            station: self.station,
            life: self.life,
            sequence: self.sequence,
            time_s: self.now_s.unwrap_or_default(),
            greatest: self.mediator.greatest(&self.reference),
            is_blind: !is_usable,
            reports,
            messages: std::mem::take(&mut self.mediator.messages),
        }
    }

    /// Predicted places of people whose agents have no sighting.
    fn restarts(&self) -> Vec<Restart> {
        let looking = |a: &&SeeingAgent| a.sighting.is_none() && self.reference.leader(a.target).is_some();
        let restart = |a: &SeeingAgent| Restart { position: a.filter.position, height_m: a.height_m };
        self.agents.iter().filter(looking).map(restart).collect()
    }
}

/// Sighting of an image track.
fn of_track(people: &[Sighting], track: u32) -> Option<&Sighting> {
    people.binary_search_by_key(&track, |s| s.track).ok().map(|index| &people[index])
}

impl Rule for Published {
    fn step(&mut self, sightings: &Sightings, received: &[Packet]) -> Step {
        let now_s = sightings.time_s;
        let dt_s = self.now_s.map_or(0.0, |before| (now_s - before).clamp(0.0, LONGEST_STEP_S));
        self.now_s = Some(now_s);
        let messages = self.receive(received, now_s);
        if !sightings.is_usable {
            self.agents.iter_mut().for_each(|a| a.sighting = None);
            return Step { packet: self.packet(false), ..Step::default() };
        }
        self.follow(sightings, dt_s);
        self.update_confidence(dt_s);
        let around = Surroundings {
            station: self.station,
            stations: self.stations,
            now_s,
            dt_s,
            reference: &self.reference,
            memory: &self.memory,
            fields: self.fields.as_ref(),
            options: &self.options,
        };
        self.mediator.mediate(&mut self.agents, &messages, &around);
        Step { packet: self.packet(true), restarts: self.restarts(), ..Step::default() }
    }

    fn people(&self) -> Vec<Belief> {
        let own = self.agents.iter().filter(|a| !a.is_alone()).map(|a| Belief {
            target: a.target,
            agent: a.sighting.map(|_| AgentId { station: self.station, number: a.number }),
            position: a.filter.position,
            covariance: a.filter.covariance,
            velocity: a.filter.velocity,
            height_m: a.height_m,
            confidence: a.confidence,
        });
        let held: BTreeSet<TargetId> = self.agents.iter().map(|a| a.target).collect();
        let others = self.reference.targets().into_iter().filter(|target| !held.contains(target));
        let reported = others.filter_map(|target| self.reference.leader(target).map(|l| (target, l))).map(
            |(target, leader)| Belief {
                target,
                agent: None,
                position: leader.position,
                covariance: leader.covariance,
                velocity: leader.velocity,
                height_m: leader.height_m,
                confidence: leader.confidence,
            },
        );
        let mut people: Vec<Belief> = own.chain(reported).collect();
        people.sort_by_key(|belief| belief.target);
        people
    }
}
