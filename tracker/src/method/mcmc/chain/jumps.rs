//! Moves that change the number of people: ADD (a birth, or a deletion reverted) and DELETE.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::super::options::Acceptance;
use super::super::person::Person;
use super::{Chain, Move, is_a_size};
use crate::likelihood::prior::LOG_IMPOSSIBLE;
use crate::silhouette::{Body, Silhouette};

/// Probability that ADD reverts a deletion, when there is one.
pub(super) const REVIVE: f64 = 0.5;

impl Chain<'_> {
    /// ADD: proposes the birth of a person.
    pub(super) fn propose_birth(&mut self, rng: &mut Pcg64Mcg) {
        let options = self.setting.options;
        if self.setting.appearance.is_nowhere() {
            return;
        }
        let place = self.setting.appearance.sample(rng);
        let [radius_m, height_m] = self.setting.newcomers.sample(rng);
        let body = Body { x_m: place.x, y_m: place.y, radius_m, height_m };
        let appears = self.setting.appearance.log_density(body.x_m, body.y_m);
        let floor = self.setting.floor;
        if appears <= LOG_IMPOSSIBLE || !is_a_size(&body) || !floor.is_standable(body.x_m, body.y_m) {
            return;
        }
        let mut log_ratio = self.crowding(&body, None, true);
        if options.acceptance == Acceptance::ReversibleJump {
            // The size is drawn from its prior: the two cancel. A person born in this moment can be deleted anywhere.
            let density = self.setting.appearance.proposal_density(body.x_m, body.y_m);
            let new = if self.gone.is_empty() { 1.0 } else { 1.0 - REVIVE };
            let (k, d, g) = (self.people.len(), self.deletable(), self.gone.len());
            let forth = self.probability_of(Move::Add, k, d, g) * new * density;
            let back = self.probability_of(Move::Delete, k + 1, d + 1, g) / (d + 1) as f64;
            log_ratio += appears + back.ln() - forth.ln();
        }
        if let Some(likelihood) = self.decide(None, Some(&body), log_ratio, rng) {
            let key = *self.next_key;
            *self.next_key += 1;
            let at_exit = self.is_exit(&body);
            let person = Person { key, body, silhouettes: Vec::new(), at_exit, known: None, tentative: true };
            self.insert_proposed(person, likelihood);
        }
    }

    /// ADD: proposes to revert the deletion of a known person.
    pub(super) fn revive(&mut self, rng: &mut Pcg64Mcg) {
        let which = rng.random_range(0..self.gone.len());
        let person = &self.gone[which];
        let Some(known) = &person.known else { return };
        let place = known.place.sample(rng);
        let [radius_m, height_m] = known.size.sample(rng);
        let body = Body { x_m: place.x, y_m: place.y, radius_m, height_m };
        let floor = self.setting.floor;
        let log_odds = known.log_odds;
        // ADD can only revert what DELETE could have done.
        let at_exit = self.is_exit(&body);
        let reversible = person.tentative || at_exit;
        if !reversible || !is_a_size(&body) || !floor.is_standable(body.x_m, body.y_m) {
            return;
        }
        let mut log_ratio = self.crowding(&body, None, false);
        if self.setting.options.acceptance == Acceptance::ReversibleJump {
            let (k, d, g) = (self.people.len(), self.deletable(), self.gone.len());
            let forth = self.probability_of(Move::Add, k, d, g) * REVIVE / g as f64;
            let back = self.probability_of(Move::Delete, k + 1, d + 1, g - 1) / (d + 1) as f64;
            log_ratio += log_odds + back.ln() - forth.ln();
        }
        if let Some(likelihood) = self.decide(None, Some(&body), log_ratio, rng) {
            let mut person = self.gone.swap_remove(which);
            (person.body, person.at_exit) = (body, at_exit);
            self.insert_proposed(person, likelihood);
        }
    }

    /// Accepts the proposed body as a person of the state.
    fn insert_proposed(&mut self, mut person: Person, likelihood: f64) {
        self.simulation.commit(None, Some(&self.proposed));
        self.boxes.commit(None, true);
        self.arrive(likelihood);
        let spare =
            self.spare.pop().unwrap_or_else(|| vec![Silhouette::default(); self.setting.layers.count()]);
        person.silhouettes = std::mem::replace(&mut self.proposed, spare);
        self.people.push(person);
    }

    /// DELETE: proposes to remove a person who may leave.
    pub(super) fn delete(&mut self, rng: &mut Pcg64Mcg) {
        let deletable = self.deletable();
        let nth = rng.random_range(0..deletable.max(1));
        let Some(which) = (0..self.people.len()).filter(|i| self.people[*i].may_leave()).nth(nth) else {
            return;
        };
        let options = self.setting.options;
        let (person, body) = (&self.people[which], self.people[which].body);
        let mut log_ratio = -self.crowding(&body, Some(which), person.is_new());
        if options.acceptance == Acceptance::ReversibleJump {
            let (k, g) = (self.people.len(), self.gone.len());
            let forth = self.probability_of(Move::Delete, k, deletable, g) / deletable as f64;
            let add = |gone: usize| self.probability_of(Move::Add, k - 1, deletable - 1, gone);
            log_ratio += if let Some(known) = &person.known {
                let back = add(g + 1) * REVIVE / (g + 1) as f64;
                back.ln() - forth.ln() - known.log_odds
            } else {
                let new = if self.gone.is_empty() { 1.0 } else { 1.0 - REVIVE };
                let density = self.setting.appearance.proposal_density(body.x_m, body.y_m);
                let back = add(g) * new * density;
                back.ln() - forth.ln() - self.setting.appearance.log_density(body.x_m, body.y_m)
            };
        }
        if let Some(likelihood) = self.decide(Some(which), None, log_ratio, rng) {
            let mut person = self.people.swap_remove(which);
            self.simulation.commit(Some(&person.silhouettes), None);
            self.boxes.commit(Some(which), false);
            self.arrive(likelihood);
            self.spare.push(std::mem::take(&mut person.silhouettes));
            if !person.is_new() {
                self.gone.push(person);
            }
        }
    }
}
