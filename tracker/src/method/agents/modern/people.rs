//! Everybody whom one station knows of.

use super::super::TargetId;
use super::person::Person;

/// Most people whom a station knows of: one bit each.
pub(super) const MOST_PEOPLE: usize = 64;

/// People, no two with one id.
#[derive(Debug, Clone, Default)]
pub(super) struct People {
    list: Vec<Person>,
}

impl People {
    /// Adds somebody whose id nobody has. Where there are too many, the one missed for longest makes room; `None` if
    /// everybody is measured.
    pub(super) fn add(&mut self, person: Person) -> Option<usize> {
        debug_assert!(self.index_of(person.identity.target).is_none());
        if self.list.len() >= MOST_PEOPLE {
            let (index, longest) =
                self.list.iter().enumerate().max_by(|a, b| a.1.missed_s.total_cmp(&b.1.missed_s))?;
            if longest.missed_s < 1.0 {
                return None;
            }
            self.forget(index);
            self.list[index] = person;
            return Some(index);
        }
        self.list.push(person);
        Some(self.list.len() - 1)
    }

    /// Removes somebody; the last one gets that index.
    pub(super) fn remove(&mut self, index: usize) {
        self.forget(index);
        self.list.swap_remove(index);
        let last = self.list.len();
        for set in self.list.iter_mut().flat_map(|p| [&mut p.met, &mut p.measured_with]) {
            let had_last = *set >> last & 1;
            *set = *set & !(1 << last) | had_last << index;
        }
    }

    /// Takes somebody out of everybody's sets.
    fn forget(&mut self, index: usize) {
        for set in self.list.iter_mut().flat_map(|p| [&mut p.met, &mut p.measured_with]) {
            *set &= !(1 << index);
        }
    }

    /// Index of the person with an id.
    pub(super) fn index_of(&self, target: TargetId) -> Option<usize> {
        self.list.iter().position(|p| p.identity.target == target)
    }

    /// Exchanges the identities of two bodies, which are in question from now on.
    pub(super) fn exchange(&mut self, i: usize, j: usize) {
        let identity = self.list[i].identity;
        self.list[i].identity = self.list[j].identity;
        self.list[j].identity = identity;
    }

    /// What a pair of bodies gains in log-likelihood by exchanging their identities, nats.
    pub(super) fn gain(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (&self.list[i], &self.list[j]);
        a.log_likelihood(&b.identity) + b.log_likelihood(&a.identity)
            - a.log_likelihood(&a.identity)
            - b.log_likelihood(&b.identity)
    }

    /// Probability that a body carries its own identity and not that of somebody whom it met, by looks.
    pub(super) fn certainty(&self, index: usize) -> f64 {
        /// Log-odds of a body's having kept its identity through a crossing, before any look.
        const CONTINUITY_NATS: f64 = 1.0;
        let others: f64 =
            bits(self.list[index].met).map(|j| (self.gain(index, j) - CONTINUITY_NATS).min(50.0).exp()).sum();
        1.0 / (1.0 + others)
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

/// The indices in a set.
pub(super) fn bits(mut set: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let index = set.trailing_zeros() as usize;
        set &= set.wrapping_sub(1);
        (index < 64).then_some(index)
    })
}
