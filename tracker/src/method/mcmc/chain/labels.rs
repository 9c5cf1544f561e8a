//! Exchanges of identities between people of a state, which leave the likelihood unchanged.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::super::options::Acceptance;
use super::super::person::{Known, Person};
use super::{Chain, accepted};
use crate::silhouette::Body;

/// Probability that a step also proposes to exchange the identity of a person born in this moment.
pub(super) const RELABEL: f64 = 0.1;

/// Probability that a step also proposes to exchange the identities of two people who are close, where boxes are
/// observed.
pub(super) const EXCHANGE: f64 = 0.2;
/// Largest distance between people whose identities are exchanged, metres.
const EXCHANGE_M: f64 = 2.5;

impl Chain<'_> {
    /// Proposes to exchange the identities of two people who are close. The likelihood of masks and boxes does not
    /// depend on identities, so only the priors decide; one of the two may be born in this moment. The pair is as
    /// likely to be drawn before as after.
    pub(super) fn exchange(&mut self, rng: &mut Pcg64Mcg) {
        if self.people.len() < 2 || self.setting.options.acceptance == Acceptance::Published {
            return;
        }
        let a = rng.random_range(0..self.people.len());
        let body_a = self.people[a].body;
        let is_close = |b: usize| b != a && self.people[b].body.floor_distance_m(&body_a) < EXCHANGE_M;
        let close = (0..self.people.len()).filter(|b| is_close(*b)).count();
        if close == 0 {
            return;
        }
        let nth = rng.random_range(0..close);
        let Some(b) = (0..self.people.len()).filter(|b| is_close(*b)).nth(nth) else { return };
        let body_b = self.people[b].body;
        let is_new = [a, b].map(|i| self.people[i].is_new());
        // A person born in this moment has to stand where births are possible, apart from everybody.
        let may_be_born = |i: usize, body: &Body| {
            self.setting.appearance.is_possible(body.x_m, body.y_m) && self.stands_apart(body, Some(i))
        };
        let is_possible = match is_new {
            [true, true] => false,
            [true, false] => may_be_born(b, &body_b),
            [false, true] => may_be_born(a, &body_a),
            [false, false] => true,
        };
        if !is_possible {
            return;
        }
        let exchanged = self.log_prior(a, &body_b) + self.log_prior(b, &body_a);
        let present = self.log_prior(a, &body_a) + self.log_prior(b, &body_b);
        if accepted(exchanged - present, rng) {
            let (first, rest) = self.people.split_at_mut(a.max(b));
            let (one, other) = (&mut first[a.min(b)], &mut rest[0]);
            std::mem::swap(&mut one.key, &mut other.key);
            std::mem::swap(&mut one.known, &mut other.known);
            std::mem::swap(&mut one.tentative, &mut other.tentative);
        }
    }

    /// Proposes that a person born in this moment is one deleted in this moment, who walked farther than the chain's
    /// steps, or the reverse. Needs no likelihood, so it comes in addition to a step.
    pub(super) fn relabel(&mut self, rng: &mut Pcg64Mcg) {
        if self.setting.options.acceptance == Acceptance::Published {
            return;
        }
        let known = self.people.iter().filter(|p| !p.is_new()).count();
        let new = self.people.len() - known;
        let (newcomers, appearance) = (&self.setting.newcomers, &self.setting.appearance);
        // Log ratio of a body's prior density as this known person and as a birth.
        let advantage = |known: &Known, body: &Body| {
            known.log_odds + known.log_density(body)
                - appearance.log_density(body.x_m, body.y_m)
                - newcomers.log_density(body)
        };
        if rng.random::<bool>() {
            if new == 0 || self.gone.is_empty() {
                return;
            }
            let n = self.nth(rng.random_range(0..new), Person::is_new);
            let g = rng.random_range(0..self.gone.len());
            let Some(of_gone) = &self.gone[g].known else { return };
            let log_ratio =
                advantage(of_gone, &self.people[n].body) + (new as f64).ln() + (self.gone.len() as f64).ln()
                    - ((known + 1) as f64).ln();
            if accepted(log_ratio, rng) {
                let back = self.gone.swap_remove(g);
                let person = &mut self.people[n];
                (person.key, person.known, person.tentative) = (back.key, back.known, back.tentative);
            }
        } else {
            if known == 0 {
                return;
            }
            let k = self.nth(rng.random_range(0..known), |p| !p.is_new());
            let person = &self.people[k];
            let body = person.body;
            let reversible = person.may_leave()
                && appearance.is_possible(body.x_m, body.y_m)
                && self.stands_apart(&body, Some(k));
            let Some(of_person) = person.known.as_ref().filter(|_| reversible) else { return };
            let log_ratio = (known as f64).ln()
                - advantage(of_person, &body)
                - ((new + 1) as f64).ln()
                - ((self.gone.len() + 1) as f64).ln();
            if accepted(log_ratio, rng) {
                let key = *self.next_key;
                *self.next_key += 1;
                let person = &mut self.people[k];
                let mut left = Person {
                    key,
                    body,
                    silhouettes: Vec::new(),
                    at_exit: person.at_exit,
                    known: None,
                    tentative: true,
                };
                std::mem::swap(person, &mut left);
                std::mem::swap(&mut person.silhouettes, &mut left.silhouettes);
                self.gone.push(left);
            }
        }
    }

    /// Index of the n-th person of a kind; at least n + 1 must exist.
    fn nth(&self, n: usize, kind: impl Fn(&Person) -> bool) -> usize {
        let mut of_kind = self.people.iter().enumerate().filter(|(_, p)| kind(p));
        of_kind.nth(n).map_or(0, |(i, _)| i)
    }
}
