//! Mediator of a station: creates agents, and finds agencies for lone agents (Nakazawa et al., section 3.4, figure 6).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point2;

use super::super::{AgentId, FieldOfView, MediatorMessage, StationId, TargetId};
use super::PublishedOptions;
use super::agent::{Filter, Pending, SeeingAgent};
use super::colour_memory::ColourMemory;
use super::confidence;
use super::reference::{LARGEST_TARGET, Reference};

/// Distance below which sightings of two people may be swapped, metres: the paper's radius of tracking.
pub(super) const CLOSE_M: f64 = 1.0;
/// Distance below which two uncrowded sightings of one station are of one person, metres: two people so near to each
/// other would be crowded.
pub(super) const SAME_M: f64 = 0.3;
/// Visible fraction of a person from which a station should track the person.
const PLAINLY_VISIBLE: f64 = 0.5;
/// Interval at which a request that was not granted is repeated, seconds.
const ASK_AGAIN_S: f64 = 0.3;
/// Maximum number of requests that are answered at one moment.
const MOST_ANSWERS: usize = 64;

/// Inputs of the mediator, apart from the agents.
pub(super) struct Surroundings<'a> {
    pub(super) station: StationId,
    pub(super) stations: u8,
    pub(super) now_s: f64,
    pub(super) dt_s: f64,
    pub(super) reference: &'a Reference,
    pub(super) memory: &'a ColourMemory,
    pub(super) fields: &'a dyn FieldOfView,
    pub(super) options: &'a PublishedOptions,
}

/// Mediator of one station.
#[derive(Debug, Clone, Default)]
pub(super) struct Mediator {
    /// Time for which each target that other stations track has had no agent here, seconds.
    absent_s: BTreeMap<TargetId, f64>,
    /// Greatest target id that this station has assigned.
    greatest: TargetId,
    next_agent: u32,
    /// Messages to send.
    pub(super) messages: Vec<MediatorMessage>,
}

impl Mediator {
    /// Returns the number for a new agent.
    pub(super) fn number_agent(&mut self) -> u32 {
        self.next_agent += 1;
        self.next_agent
    }

    /// Greatest target id that this station knows of.
    pub(super) fn greatest(&self, reference: &Reference) -> TargetId {
        self.greatest.max(reference.greatest())
    }

    /// Marks a target id as used.
    pub(super) fn reserve(&mut self, target: TargetId) {
        self.greatest = self.greatest.max(target);
    }

    /// Answers the received messages, proposes lone agents to agencies, and creates and ends agents.
    pub(super) fn mediate(
        &mut self,
        agents: &mut Vec<SeeingAgent>,
        received: &[MediatorMessage],
        around: &Surroundings<'_>,
    ) {
        let mut answered = 0;
        for message in received {
            match *message {
                MediatorMessage::Answer { agent, candidate, is_granted: true }
                    if agent.station == around.station =>
                {
                    take_grant(agents, agent, candidate, around.options);
                }
                MediatorMessage::Request { agent, candidate, position, .. }
                    if answered < MOST_ANSWERS && position.iter().all(|v| v.is_finite()) =>
                {
                    answered += 1;
                    let is_granted = is_granted(agents, agent, candidate, position, around);
                    self.messages.push(MediatorMessage::Answer { agent, candidate, is_granted });
                }
                MediatorMessage::Answer { .. } | MediatorMessage::Request { .. } => {}
            }
        }
        update_list(agents, around);
        self.propose(agents, around);
        self.propose_new_targets(agents, around);
        self.create(agents, around);
        end_doubles(agents, around);
    }

    /// Proposes lone agents to the agencies that they fit best, one agent per agency (step b).
    fn propose(&mut self, agents: &mut [SeeingAgent], around: &Surroundings<'_>) {
        let mut held = held(agents);
        let mut entries: Vec<(f64, usize, TargetId)> = Vec::new();
        for (index, agent) in agents.iter().enumerate().filter(|(_, a)| is_waiting(a)) {
            entries.extend(agent.list.iter().map(|(target, value)| (*value, index, *target)));
        }
        entries.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut proposed = BTreeSet::new();
        for (value, index, candidate) in entries {
            if value < around.options.request_confidence {
                break;
            }
            if held.contains(&candidate) || !proposed.insert(index) {
                continue;
            }
            held.insert(candidate);
            let pending = self.ask(&mut agents[index], candidate, around);
            // Not in the paper: a request to an agency without members can only be granted by a lone agent of another
            // station. Without such a grant no other station sees the person, and the agent joins by itself.
            let is_nobodys = around.reference.leader(candidate).is_none();
            if is_nobodys && around.now_s - pending.since_s >= around.options.alone_s {
                agents[index].join(candidate, around.options.joining_confidence);
            }
        }
    }

    /// Gives a new target to lone agents that match no known target.
    ///
    /// In the paper people enter through a door that one station watches. Here a lone agent that matches no target
    /// sends a request with a new target id to the lone agents of other stations (step c2). Without a grant it takes
    /// the id after some time, so that a person whom only one station sees is reported as well.
    fn propose_new_targets(&mut self, agents: &mut [SeeingAgent], around: &Surroundings<'_>) {
        for agent in agents.iter_mut().filter(|a| is_waiting(a)) {
            let Some(sighting) = agent.sighting else { continue };
            let is_others = |target: &TargetId| {
                let members = around.reference.members(*target);
                members.iter().any(|m| (m.position - sighting.position).norm() < CLOSE_M)
            };
            if !agent.list.is_empty() || around.reference.targets().iter().any(is_others) {
                agent.alone_s = 0.0;
                continue;
            }
            agent.alone_s += around.dt_s;
            if agent.alone_s < 0.5 * around.options.alone_s {
                continue;
            }
            let candidate = match agent.request {
                Some(pending) if !is_known(pending.candidate, around) => pending.candidate,
                _ => self.mint(around),
            };
            self.ask(agent, candidate, around);
            if agent.alone_s >= around.options.alone_s {
                agent.join(candidate, around.options.joining_confidence);
            }
        }
    }

    /// Sends a request, unless the same one was sent less than [`ASK_AGAIN_S`] ago. Returns the pending request.
    fn ask(&mut self, agent: &mut SeeingAgent, candidate: TargetId, around: &Surroundings<'_>) -> Pending {
        let now_s = around.now_s;
        let before =
            agent.request.filter(|p| p.candidate == candidate && now_s - p.asked_s < 4.0 * ASK_AGAIN_S);
        let is_due = before.is_none_or(|p| now_s - p.asked_s >= ASK_AGAIN_S);
        let pending = Pending {
            candidate,
            since_s: before.map_or(now_s, |p| p.since_s),
            asked_s: if is_due { now_s } else { before.map_or(now_s, |p| p.asked_s) },
        };
        agent.request = Some(pending);
        if let Some(sighting) = agent.sighting.filter(|_| is_due) {
            self.messages.push(MediatorMessage::Request {
                agent: AgentId { station: around.station, number: agent.number },
                candidate,
                position: sighting.position,
                looks: sighting.looks,
            });
        }
        pending
    }

    /// Returns the next unused id of this station: ids of different stations differ modulo the number of stations.
    fn mint(&mut self, around: &Surroundings<'_>) -> TargetId {
        let (station, stations) = (u32::from(around.station.0), u32::from(around.stations.max(1)));
        let above = self.greatest(around.reference).0;
        let mut id = above.saturating_sub(station).div_ceil(stations) * stations + station + 1;
        if id > LARGEST_TARGET {
            // All ids have been used: restart from the first.
            id = station + 1;
        }
        self.reserve(TargetId(id));
        TargetId(id)
    }

    /// Creates agents for targets that other stations measure and this station should measure (section 3.4, item 1).
    fn create(&mut self, agents: &mut Vec<SeeingAgent>, around: &Surroundings<'_>) {
        let targets = around.reference.targets();
        let held = held(agents);
        self.absent_s.retain(|target, _| targets.contains(target) && !held.contains(target));
        for target in targets.difference(&held) {
            let absent_s = self.absent_s.entry(*target).or_default();
            *absent_s += around.dt_s;
            let Some(leader) = around.reference.leader(*target) else { continue };
            let is_due = *absent_s > around.options.creation_s
                && leader.confidence >= around.options.creation_confidence
                && !leader.is_crowded
                && around.fields.visible(around.station, leader.position, leader.height_m) >= PLAINLY_VISIBLE;
            if !is_due {
                continue;
            }
            let distance_m =
                |a: &SeeingAgent| a.sighting.map_or(f64::INFINITY, |s| (s.position - leader.position).norm());
            let near = agents
                .iter_mut()
                .filter(|a| a.is_alone() && distance_m(a) < CLOSE_M)
                .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
            match near {
                // A lone agent already tracks the person: it joins instead of a new agent.
                Some(lone) if !lone.has_belonged && distance_m(lone) < around.options.grant_m => {
                    lone.join(*target, leader.confidence);
                }
                Some(_) => continue,
                None => {
                    let number = self.number_agent();
                    let filter = Filter {
                        velocity: leader.velocity,
                        ..Filter::new(leader.position, leader.covariance)
                    };
                    agents.push(SeeingAgent::created(
                        number,
                        *target,
                        leader.confidence,
                        filter,
                        leader.height_m,
                    ));
                }
            }
            self.absent_s.remove(target);
        }
    }
}

/// Whether a lone agent may ask to join an agency: while people are too close it has to wait (section 2.4).
fn is_waiting(agent: &SeeingAgent) -> bool {
    agent.is_alone() && agent.clear_sighting().is_some()
}

/// Targets with an agent at this station.
fn held(agents: &[SeeingAgent]) -> BTreeSet<TargetId> {
    agents.iter().filter(|a| !a.is_alone()).map(|a| a.target).collect()
}

/// Whether any station tracks a target, or the colour memory has it.
fn is_known(target: TargetId, around: &Surroundings<'_>) -> bool {
    around.reference.leader(target).is_some() || around.memory.targets().any(|t| t == target)
}

/// Updates the list of confidences of all lone agents (step a).
fn update_list(agents: &mut [SeeingAgent], around: &Surroundings<'_>) {
    let mut targets = around.reference.targets();
    targets.extend(around.memory.targets());
    for agent in agents.iter_mut().filter(|a| is_waiting(a)) {
        let Some(sighting) = agent.sighting else { continue };
        for target in &targets {
            let leader = around.reference.leader(*target);
            let change = confidence::change(
                &sighting,
                *target,
                leader.into_iter(),
                around.memory,
                around.dt_s,
                around.options,
            );
            let value = agent.list.get(target).copied().unwrap_or(0.0) + change;
            if value > 0.0 {
                agent.list.insert(*target, value.min(1.0));
            } else {
                agent.list.remove(target);
            }
        }
    }
}

/// Whether the agent of another station that sent a request may join the agency (steps c1, c2).
fn is_granted(
    agents: &mut [SeeingAgent],
    asking: AgentId,
    candidate: TargetId,
    position: Point2<f64>,
    around: &Surroundings<'_>,
) -> bool {
    let is_near = |agent: &SeeingAgent| {
        agent.sighting.is_some_and(|s| (s.position - position).norm() < around.options.grant_m)
    };
    // (c1) An agent of the agency tracks the same person.
    if let Some(member) = agents.iter().find(|a| a.target == candidate && a.sighting.is_some()) {
        return is_near(member);
    }
    // (c2) A lone agent tracks the same person, and the target is its best match.
    let mut lone = agents.iter_mut().filter(|a| a.is_alone() && is_near(a));
    lone.any(|agent| {
        let best = agent.list.iter().max_by(|a, b| a.1.total_cmp(b.1)).map(|(target, _)| *target);
        match best {
            Some(best) => best == candidate,
            None if is_known(candidate, around) => false,
            // The id is new. Of two stations with requests for the same person, the one with the lower number wins.
            None => {
                let is_first = agent.request.is_none() || asking.station < around.station;
                if is_first {
                    (agent.request, agent.alone_s) = (None, 0.0);
                }
                is_first
            }
        }
    })
}

/// Lets an agent join the agency that was granted, unless the station has another agent for it by now (step d).
fn take_grant(agents: &mut [SeeingAgent], asking: AgentId, candidate: TargetId, options: &PublishedOptions) {
    if held(agents).contains(&candidate) {
        return;
    }
    let is_asking = |a: &SeeingAgent| {
        a.number == asking.number && is_waiting(a) && a.request.is_some_and(|p| p.candidate == candidate)
    };
    if let Some(agent) = agents.iter_mut().find(|a| is_asking(a)) {
        agent.join(candidate, options.joining_confidence);
    }
}

/// Ends the lone one of two agents that have tracked one person for some time; of two lone ones the newer.
fn end_doubles(agents: &mut Vec<SeeingAgent>, around: &Surroundings<'_>) {
    let places: Vec<Option<Point2<f64>>> =
        agents.iter().map(|a| a.clear_sighting().map(|s| s.position)).collect();
    let goes_before = |a: &SeeingAgent, b: &SeeingAgent| !a.is_alone() || a.number < b.number;
    for index in 0..agents.len() {
        let is_double = agents[index].is_alone()
            && places[index].is_some_and(|place| {
                agents.iter().zip(&places).enumerate().any(|(other, (agent, at))| {
                    other != index
                        && at.is_some_and(|at| (at - place).norm() < SAME_M)
                        && goes_before(agent, &agents[index])
                })
            });
        agents[index].doubled_s = if is_double { agents[index].doubled_s + around.dt_s } else { 0.0 };
    }
    agents.retain(|a| a.doubled_s <= around.options.double_s);
}
