//! Packets of other stations: what their reports change here.

use super::super::existence;
use super::super::measurement::{self, LARGEST_TARGET, Measurement};
use super::super::peer::Claim;
use super::super::person::Person;
use super::Modern;
use crate::method::agents::{Packet, TargetId};

/// Smallest and largest valid age of a packet, seconds; negative for a packet from later than now.
const AGE_RANGE_S: (f64, f64) = (-0.5, 1.0);

impl Modern {
    /// Associates the reports of a packet and updates people, claims and ids with them.
    pub(super) fn receive(&mut self, packet: &Packet) {
        let index = usize::from(packet.station.0);
        let age_s = self.now_s - packet.time_s;
        if packet.station == self.station
            || index >= self.peers.len()
            || !(AGE_RANGE_S.0..=AGE_RANGE_S.1).contains(&age_s)
        {
            self.refused += 1;
            return;
        }
        let Some(since_s) = self.peers[index].update(packet, self.now_s) else {
            self.refused += 1;
            return;
        };
        if packet.greatest.0 <= LARGEST_TARGET {
            self.greatest = self.greatest.max(packet.greatest);
        }
        let mut measurements = std::mem::take(&mut self.measurements);
        measurements.clear();
        self.refused += measurement::of_packet(packet, age_s, &self.options, &mut measurements) as u64;
        self.association.solve(&measurements, &self.people, &self.options);
        self.update(packet.station, &measurements, since_s);
        for (i, measurement) in measurements.iter().enumerate() {
            self.greatest = self.greatest.max(measurement.target);
            if measurement.target == TargetId::ALONE {
                continue;
            }
            match self.association.person_of(i) {
                // A crowded measurement may be of another person.
                Some(_) if measurement.is_crowded => {}
                Some(person) => self.record_claim(index, measurement, person, since_s),
                None => self.add_reported(measurement),
            }
        }
        self.measurements = measurements;
    }

    /// Records a peer's id for a person here, `since_s` seconds after the peer's previous packet.
    fn record_claim(&mut self, peer: usize, measurement: &Measurement, person: usize, since_s: f64) {
        let claim = Claim {
            theirs: measurement.target,
            mine: self.people[person].identity.target,
            lasting_s: 0.0,
            confidence: measurement.confidence,
            made_s: self.now_s,
        };
        self.peers[peer].claim(claim, since_s, 3.0 * self.options.naming_s);
    }

    /// Adds a person whom a peer reports and who is associated with no person here, or restarts a lost one.
    fn add_reported(&mut self, measurement: &Measurement) {
        if !existence::is_apart(&self.people, measurement) {
            return;
        }
        match self.people.index_of(measurement.target) {
            None => {
                let mut person = Person::new(measurement.target, measurement);
                person.unheard_s = 0.0;
                self.people.add(person);
            }
            Some(lost) if self.people[lost].is_lost(self.options.birth_s) => {
                self.people[lost].move_to(measurement);
                self.people[lost].unheard_s = 0.0;
            }
            // Another person here, who is measured, carries the id: the report is useless.
            Some(_) => self.refused += 1,
        }
    }
}
