//! Who is who among the people of a state: labels that no pixel sees.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::super::options::Acceptance;
use super::super::person::{Known, Person};
use super::{Chain, accepted, log_size};
use crate::silhouette::Body;

/// Probability that a step also tries to exchange the label of somebody born now.
pub(super) const RELABEL: f64 = 0.1;

/// Probability that a step also tries to exchange the labels of two people who are close, where boxes are looked at.
pub(super) const EXCHANGE: f64 = 0.2;
/// Labels are exchanged between people no farther apart than this, metres.
const EXCHANGE_M: f64 = 2.5;

impl Chain<'_> {
    /// Exchanges the labels of two people who are close: who came from where. No pixel and no box sees labels, so only what was
    /// known of the two decides; one of them may be born now. The pair is as likely to be drawn before as after.
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
        // Who is born now appears where people do, and stands apart from everybody.
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

    /// Somebody born now may be somebody deleted now, who went farther than the chain's steps: exchanges the labels, which
    /// no pixel sees. Comes on top of a step and costs next to nothing.
    pub(super) fn relabel(&mut self, rng: &mut Pcg64Mcg) {
        if self.setting.options.acceptance == Acceptance::Published {
            return;
        }
        let known = self.people.iter().filter(|p| !p.is_new()).count();
        let new = self.people.len() - known;
        let (options, appearance) = (self.setting.options, &self.setting.appearance);
        // How much more likely a body is as this known person than as somebody born now.
        let advantage = |known: &Known, body: &Body| {
            known.log_odds + known.log_density(body)
                - appearance.log_density(body.x_m, body.y_m)
                - log_size(&options.radius, &options.height, body)
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

    /// The place in the list of the n-th of the people who are of a kind; there must be so many.
    fn nth(&self, n: usize, kind: impl Fn(&Person) -> bool) -> usize {
        let mut of_kind = self.people.iter().enumerate().filter(|(_, p)| kind(p));
        of_kind.nth(n).map_or(0, |(i, _)| i)
    }
}
