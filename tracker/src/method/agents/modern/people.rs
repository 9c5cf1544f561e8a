//! All people whom one station tracks, with their identity probabilities.

use super::super::TargetId;
use super::person::{Identity, MOST_PEOPLE, Person};
use super::signature::MeanLook;

/// Probability below which a body does not carry an identity.
const IMPOSSIBLE: f64 = 1e-4;

/// Bodies and the identities that they carry. Ids are unique; a body's current identity has the body's index.
#[derive(Debug, Clone, Default)]
pub(super) struct People {
    list: Vec<Person>,
    last_serial: u32,
}

impl People {
    /// Adds a person with an unused id. A full list drops the person missed for longest; `None` when all are measured.
    pub(super) fn add(&mut self, mut person: Person) -> Option<usize> {
        debug_assert!(self.index_of(person.identity.target).is_none());
        self.last_serial += 1;
        person.serial = self.last_serial;
        let index = if self.list.len() < MOST_PEOPLE {
            self.list.push(person);
            self.list.len() - 1
        } else {
            let missed = self.list.iter().enumerate().max_by(|a, b| a.1.missed_s.total_cmp(&b.1.missed_s));
            let (index, longest) = missed?;
            if longest.missed_s < 1.0 {
                return None;
            }
            self.forget(index);
            self.list[index] = person;
            index
        };
        self.resolve(index);
        Some(index)
    }

    /// Removes a person; the last person of the list gets that index.
    pub(super) fn remove(&mut self, index: usize) {
        self.forget(index);
        self.list.swap_remove(index);
        let last = self.list.len();
        for person in &mut self.list {
            for set in [&mut person.may_be, &mut person.measured_with] {
                let had_last = *set >> last & 1;
                *set = *set & !(1 << last) | had_last << index;
            }
            if last != index {
                person.prior[index] = std::mem::take(&mut person.prior[last]);
            }
        }
    }

    /// Clears an index from the sets and probabilities of all people.
    fn forget(&mut self, index: usize) {
        for person in &mut self.list {
            person.may_be &= !(1 << index);
            person.measured_with &= !(1 << index);
            person.prior[index] = 0.0;
        }
        for i in 0..self.list.len() {
            if i != index {
                self.normalise(i);
            }
        }
    }

    /// Index of the person who carries an id.
    pub(super) fn index_of(&self, target: TargetId) -> Option<usize> {
        self.list.iter().position(|p| p.identity.target == target)
    }

    /// Assigns an image track to a body, and to no other.
    pub(super) fn follow(&mut self, index: usize, track: u32) {
        for person in self.list.iter_mut().filter(|person| person.track == Some(track)) {
            person.track = None;
        }
        self.list[index].track = Some(track);
    }

    /// Makes the current identity of a body certain.
    pub(super) fn resolve(&mut self, index: usize) {
        let person = &mut self.list[index];
        person.prior = [0.0; MOST_PEOPLE];
        person.prior[index] = 1.0;
        person.may_be = 1 << index;
    }

    /// Permutes identities. Each pair is a body and the index whose identity the body gets.
    pub(super) fn permute(&mut self, pairs: &[(usize, usize)]) {
        let identities: Vec<Identity> = pairs.iter().map(|(_, from)| self.list[*from].identity).collect();
        for ((body, _), identity) in pairs.iter().zip(identities) {
            self.list[*body].identity = identity;
        }
        for person in &mut self.list {
            let (prior, may_be) = (person.prior, person.may_be);
            for (to, from) in pairs {
                person.prior[*to] = prior[*from];
                person.may_be = person.may_be & !(1 << to) | (may_be >> from & 1) << to;
            }
        }
    }

    /// Exchanges the identities of two bodies on another station's evidence; each new identity gets at least
    /// probability 0.5.
    pub(super) fn exchange(&mut self, i: usize, j: usize) {
        self.permute(&[(i, j), (j, i)]);
        for index in [i, j] {
            let person = &mut self.list[index];
            person.prior.iter_mut().for_each(|p| *p *= 0.5);
            person.prior[index] += 0.5;
            person.may_be |= 1 << index;
        }
    }

    /// Mixes the identity probabilities of two bodies that were swapped with this probability.
    pub(super) fn mix(&mut self, i: usize, j: usize, probability: f64) {
        self.fold(i);
        self.fold(j);
        let (a, b) = (self.list[i].prior, self.list[j].prior);
        for (index, own, other) in [(i, &a, &b), (j, &b, &a)] {
            let person = &mut self.list[index];
            person.may_be = 0;
            person.apart_s = 0.0;
            for k in 0..MOST_PEOPLE {
                let mixed = own[k] * (1.0 - probability) + other[k] * probability;
                let kept = mixed >= IMPOSSIBLE || k == index;
                person.prior[k] = if kept { mixed.max(IMPOSSIBLE) } else { 0.0 };
                person.may_be |= u64::from(kept) << k;
            }
            self.normalise(index);
        }
    }

    /// Allows two bodies to carry each other's identities, with at least the smallest probability.
    pub(super) fn allow_swap(&mut self, i: usize, j: usize) {
        for (a, b) in [(i, j), (j, i)] {
            let person = &mut self.list[a];
            person.may_be |= 1 << b;
            person.prior[b] = person.prior[b].max(IMPOSSIBLE);
        }
    }

    /// Updates the prior with the looks since the last meeting, and clears them.
    fn fold(&mut self, index: usize) {
        if self.list[index].may_be != 1 << index && self.list[index].evidence.weight >= 0.5 {
            let posterior = self.posterior(index);
            let person = &mut self.list[index];
            for k in bits(person.may_be) {
                person.prior[k] = posterior[k].max(IMPOSSIBLE);
            }
            self.normalise(index);
        }
        self.list[index].evidence = MeanLook::none();
    }

    fn normalise(&mut self, index: usize) {
        let person = &mut self.list[index];
        let sum: f64 = bits(person.may_be).map(|k| person.prior[k]).sum();
        if sum > 0.0 {
            bits(person.may_be).for_each(|k| person.prior[k] /= sum);
        }
    }

    /// Probability that a body carries each identity, by index.
    pub(super) fn posterior(&self, index: usize) -> [f64; MOST_PEOPLE] {
        let person = &self.list[index];
        if person.may_be == 1 << index || person.evidence.weight < 0.5 {
            return person.prior;
        }
        let mut posterior = [0.0; MOST_PEOPLE];
        let mut best = f64::NEG_INFINITY;
        for k in bits(person.may_be) {
            posterior[k] = self.log_fit(index, k);
            best = best.max(posterior[k]);
        }
        let mut sum = 0.0;
        for k in bits(person.may_be) {
            posterior[k] = (posterior[k] - best).exp();
            sum += posterior[k];
        }
        bits(person.may_be).for_each(|k| posterior[k] /= sum);
        posterior
    }

    /// Log-probability of a body's identity, up to a constant, nats: prior at the last meeting and looks since.
    pub(super) fn log_fit(&self, body: usize, identity: usize) -> f64 {
        let person = &self.list[body];
        let looks_of = |k: usize| self.list[k].is_comparable();
        // An identity without learnt looks fits as well as the body's current one.
        let compared = if looks_of(identity) { identity } else { body };
        person.prior[identity].max(IMPOSSIBLE).ln() + person.log_likelihood(&self.list[compared].identity)
    }

    /// Gain of log-likelihood of two bodies' looks by exchanging their identities, nats.
    pub(super) fn gain(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (&self.list[i], &self.list[j]);
        if !a.is_comparable() || !b.is_comparable() {
            return 0.0;
        }
        a.log_likelihood(&b.identity) + b.log_likelihood(&a.identity)
            - a.log_likelihood(&a.identity)
            - b.log_likelihood(&b.identity)
    }

    /// Probability that a body carries its current identity.
    pub(super) fn certainty(&self, index: usize) -> f64 {
        if self.list[index].may_be == 1 << index { 1.0 } else { self.posterior(index)[index] }
    }
}

impl std::ops::Deref for People {
    type Target = [Person];
    fn deref(&self) -> &[Person] {
        &self.list
    }
}

impl std::ops::DerefMut for People {
    fn deref_mut(&mut self) -> &mut [Person] {
        &mut self.list
    }
}

/// Iterates over the indices in a set of bits.
pub(super) fn bits(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let index = set.trailing_zeros() as usize;
        set &= set.wrapping_sub(1);
        (index < 64).then_some(index)
    })
}
