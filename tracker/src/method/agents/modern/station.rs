//! One station under the modern rule.

mod reception;

use std::sync::Arc;

use super::super::{
    AgentId, Belief, FieldOfView, Followed, Packet, Report, Restart, Rule, Sightings, StationId, Step,
    TargetId,
};
use super::ModernOptions;
use super::association::Association;
use super::contradiction;
use super::existence::{self, Measured, Watch};
use super::identity::{self, Meetings};
use super::measurement::{self, Measurement};
use super::naming;
use super::nursery::Nursery;
use super::peer::Peer;
use super::people::{People, bits};
use super::person::Person;

/// Longest time step, seconds: nothing is known about the rest of a longer one.
const LONGEST_STEP_S: f64 = 1.0;
/// Interval between reviews of identities and deaths, seconds.
const REVIEW_S: f64 = 0.2;

/// Modern rule at one station.
pub struct Modern {
    station: StationId,
    life: u32,
    fields: Arc<dyn FieldOfView>,
    options: ModernOptions,
    people: People,
    peers: Vec<Peer>,
    nursery: Nursery,
    meetings: Meetings,
    started_s: Option<f64>,
    now_s: f64,
    reviewed_s: f64,
    greatest: TargetId,
    sequence: u32,
    last_agent: u32,
    refused: u64,
    /// Sets of people measured at this moment, one per sender.
    measured: Vec<Measured>,
    /// The station's own sightings of this moment, each with the index of the associated person.
    seen: Vec<(Measurement, Option<usize>)>,
    /// Image tracks to end, because they follow no person.
    ended: Vec<u32>,
    association: Association,
    /// Measurements of one sender; the buffer is reused.
    measurements: Vec<Measurement>,
    /// Stations that run and have a usable image; the buffer is reused.
    watching: Vec<StationId>,
}

impl Modern {
    /// Creates the rule of a station, one of `stations`, that has just started and knows of no person.
    pub fn new(
        station: StationId,
        stations: u8,
        fields: Arc<dyn FieldOfView>,
        options: ModernOptions,
    ) -> Self {
        Self {
            station,
            life: 0,
            fields,
            options,
            people: People::default(),
            peers: vec![Peer::default(); usize::from(stations)],
            nursery: Nursery::default(),
            meetings: Meetings::default(),
            started_s: None,
            now_s: 0.0,
            reviewed_s: f64::NEG_INFINITY,
            greatest: TargetId::ALONE,
            sequence: 0,
            last_agent: 0,
            refused: 0,
            measured: Vec::new(),
            seen: Vec::new(),
            ended: Vec::new(),
            association: Association::default(),
            measurements: Vec::new(),
            watching: Vec::new(),
        }
    }

    /// Sets the number that distinguishes this run of the station from earlier ones in its packets.
    #[must_use]
    pub fn with_life(self, life: u32) -> Self {
        Self { life, ..self }
    }

    /// Number of reports and packets refused so far: invalid, too old, repeated or from an unknown sender.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Associates the station's own sightings and updates people and tentative tracks, `dt` seconds after the last
    /// frame.
    fn observe(&mut self, sightings: &Sightings, dt: f64) {
        let mut measurements = std::mem::take(&mut self.measurements);
        measurements.clear();
        self.refused += measurement::of_sightings(sightings, &self.options, &mut measurements) as u64;
        self.association.solve(&measurements, &self.people, &self.options);
        self.update(self.station, &measurements, dt.clamp(0.02, 0.5));
        for (i, measurement) in measurements.iter().enumerate() {
            let person = self.association.person_of(i);
            if let Some(index) = person {
                self.nursery.remove(measurement.track);
                self.people.follow(index, measurement.track);
                if self.people[index].agent.is_none() {
                    self.last_agent += 1;
                    self.people[index].agent = Some(self.last_agent);
                }
            } else {
                let is_apart = existence::is_apart(&self.people, measurement);
                self.nursery.add(measurement, is_apart, dt);
            }
            self.seen.push((*measurement, person));
        }
        self.measurements = measurements;
    }

    /// Updates the people associated with a sender's measurements, `since_s` seconds after the sender's last.
    fn update(&mut self, sender: StationId, measurements: &[Measurement], since_s: f64) {
        let options = &self.options;
        let inflation = (2.0 * options.correlation_s / since_s).max(1.0);
        let look_weight = 1.0 / (2.0 * options.look_correlation_s / since_s).max(1.0);
        let mut set = 0u64;
        for (measurement, of) in measurements.iter().zip(self.association.people()) {
            let Some(index) = *of else { continue };
            let person = &mut self.people[index];
            person.update(measurement, inflation, look_weight);
            if sender == self.station {
                person.unseen_s = 0.0;
            } else {
                person.unheard_s = 0.0;
            }
            set |= 1 << index;
        }
        for index in bits(set) {
            self.people[index].measured_with |= set & !(1 << index);
        }
        self.measured.push(Measured { by: sender, people: set });
    }

    /// Confirms tentative tracks that have lasted long enough: each becomes a lost person who matches, or a new one.
    fn confirm_newcomers(&mut self) {
        let listened = self.started_s.is_some_and(|s| self.now_s - s >= self.options.listen_s - 1e-6);
        let mut i = 0;
        while i < self.nursery.list.len() {
            let newcomer = self.nursery.list[i];
            if !listened || newcomer.lasting_s < self.options.birth_s - 1e-6 {
                i += 1;
                continue;
            }
            self.nursery.list.swap_remove(i);
            let index =
                if let Some((lost, others)) = existence::find_lost(&self.people, &newcomer, &self.options) {
                    self.people[lost].move_to(&newcomer.measurement);
                    identity::mix_with_lost(&mut self.people, lost, others);
                    self.people[lost].evidence = newcomer.looks;
                    Some(lost)
                } else {
                    let target =
                        existence::mint(self.greatest, self.station, self.peers.len() as u8, &self.people);
                    let mut person = Person::new(target, &newcomer.measurement);
                    person.identity.learnt = newcomer.looks;
                    self.greatest = self.greatest.max(target);
                    self.people.add(person)
                };
            let Some(index) = index else { continue };
            self.last_agent += 1;
            let person = &mut self.people[index];
            person.agent = Some(self.last_agent);
            person.unseen_s = 0.0;
            self.people.follow(index, newcomer.measurement.track);
            for (measurement, of) in &mut self.seen {
                if measurement.track == newcomer.measurement.track {
                    *of = Some(index);
                }
            }
        }
    }

    /// Decides identities, contradictions and deaths, `dt` seconds after the last review.
    fn review(&mut self, dt: f64, is_usable: bool) {
        identity::decide(&mut self.people, self.association.solver(), dt, &self.options);
        existence::reclaim(&mut self.people);
        self.watching.clear();
        if is_usable {
            self.watching.push(self.station);
        }
        for (index, peer) in self.peers.iter().enumerate() {
            if peer.is_watching(self.now_s) {
                self.watching.push(StationId(index as u8));
            }
        }
        let moment = contradiction::Moment {
            seen: &self.seen,
            fields: self.fields.as_ref(),
            own: self.station,
            watching: &self.watching,
        };
        self.ended = contradiction::settle(&mut self.people, &moment, dt);
        let watch = Watch {
            fields: self.fields.as_ref(),
            watching: &self.watching,
            stations: self.peers.len() as u8,
        };
        existence::remove_gone(&mut self.people, &watch, dt, &self.options);
    }

    /// Creates the packet to send to the other stations.
    fn packet(&mut self, is_usable: bool) -> Packet {
        self.sequence += 1;
        let mut packet = Packet {
            station: self.station,
            life: self.life,
            sequence: self.sequence,
            time_s: self.now_s,
            greatest: self.greatest,
            is_blind: !is_usable,
            ..Packet::default()
        };
        packet.reports.reserve_exact(self.seen.len());
        for (measurement, of) in &self.seen {
            let person = of.map(|i| &self.people[i]);
            let confidence = of.map_or(0.0, |i| self.confidence(i));
            packet.reports.push(Report {
                agent: AgentId {
                    station: self.station,
                    number: person.and_then(|p| p.agent).unwrap_or_default(),
                },
                target: person.map_or(TargetId::ALONE, |p| p.identity.target),
                position: measurement.position,
                covariance: measurement.covariance,
                velocity: person.map_or_else(Default::default, |p| p.motion.velocity),
                height_m: measurement.height_m,
                looks: measurement.looks,
                confidence,
                is_crowded: measurement.is_crowded,
            });
        }
        packet
    }

    /// Confidence that a person is present and carries the right id, 0 to 1.
    fn confidence(&self, index: usize) -> f64 {
        /// Time constant of the probability that an unmeasured person is present, seconds.
        const UNMEASURED_S: f64 = 20.0;
        /// Time constant of that probability while a station should measure the person, seconds.
        const OVERDUE_S: f64 = 0.5;
        let person = &self.people[index];
        let is_there = (-person.missed_s / UNMEASURED_S - person.overdue_s / OVERDUE_S).exp();
        let is_one = if person.spare_s.is_some() { 0.3 } else { 1.0 };
        let is_plain = if person.is_crowded { 0.7 } else { 1.0 };
        self.people.certainty(index) * is_there * is_one * is_plain
    }
}

impl Rule for Modern {
    fn step(&mut self, sightings: &Sightings, received: &[Packet]) -> Step {
        let is_first = self.started_s.is_none();
        let now_s = sightings.time_s;
        let dt = if is_first { 0.0 } else { (now_s - self.now_s).clamp(0.0, LONGEST_STEP_S) };
        self.now_s = now_s;
        self.started_s.get_or_insert(now_s);

        let kept = (-dt / self.options.memory_s).exp();
        for person in self.people.iter_mut() {
            person.predict(dt, self.options.acceleration_m_s2, kept);
        }
        self.nursery.advance(dt);
        self.measured.clear();
        self.seen.clear();
        for packet in received {
            self.receive(packet);
        }
        if sightings.is_usable {
            self.observe(sightings, dt);
        }
        for person in self.people.iter_mut().filter(|p| p.unseen_s > 1.0) {
            person.agent = None;
        }

        self.meetings.update(&mut self.people, now_s, &self.options);
        existence::set_twins_aside(&mut self.people, &self.measured, self.fields.as_ref(), dt, &self.options);
        self.confirm_newcomers();
        let packet = self.packet(sightings.is_usable);

        // After the clock is set back the interval restarts.
        self.reviewed_s = self.reviewed_s.min(now_s);
        let since_s = now_s - self.reviewed_s;
        if since_s >= REVIEW_S - 1e-6 {
            self.reviewed_s = now_s;
            self.review(since_s.min(LONGEST_STEP_S), sightings.is_usable);
            naming::settle(&mut self.people, &mut self.peers, self.station, now_s, &self.options);
        }
        let mut restarts = Vec::new();
        if sightings.is_usable {
            existence::find_restarts(&mut self.people, self.fields.as_ref(), self.station, |person| {
                restarts.push(Restart { position: person.motion.position, height_m: person.height_m });
            });
        }
        Step { packet, restarts, ended: std::mem::take(&mut self.ended) }
    }

    fn people(&self) -> Vec<Belief> {
        let mut beliefs: Vec<Belief> = self
            .people
            .iter()
            .enumerate()
            .map(|(i, person)| Belief {
                target: person.identity.target,
                agent: person
                    .agent
                    .filter(|_| person.unseen_s == 0.0)
                    .map(|number| AgentId { station: self.station, number }),
                position: person.motion.position,
                covariance: person.covariance(),
                velocity: person.motion.velocity,
                height_m: person.height_m,
                confidence: self.confidence(i),
            })
            .collect();
        beliefs.sort_unstable_by_key(|b| b.target);
        beliefs
    }

    fn followed(&self) -> Option<Vec<Followed>> {
        let followed = self.people.iter().filter_map(|person| {
            let motion = &person.motion;
            Some(Followed { track: person.track?, mean: motion.mean(), covariance: motion.covariance() })
        });
        Some(followed.collect())
    }
}
