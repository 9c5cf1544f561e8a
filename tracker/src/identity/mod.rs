//! Who is who after an encounter: appearance breaks the ties that position cannot (spec, section "Identity").
//!
//! While people are apart, their ways tell who they are, and their colours are learnt. Two who come so close that their
//! silhouettes could be taken for each other have *met*; once they are apart again, what they look like now is compared
//! with what was learnt before. If the other way round fits clearly better, they have exchanged their names on the way,
//! and get them back.
//!
//! * [`Identities`] — who has met whom, and what everybody looks like.
//! * [`appearance`] — the colours of torso and legs, from pixels that a camera is predicted to see.

pub mod appearance;

use std::collections::BTreeMap;

use self::appearance::Appearance;
use crate::silhouette::{Body, View};
use crate::{CameraFrame, TrackId};

/// People closer than this may be taken for each other afterwards, metres.
const MET_M: f64 = 0.6;
/// People farther than this from everybody are apart: their pixels are their own, metres.
const APART_M: f64 = 0.9;
/// Pixels, in views of the sampler's resolution, that an appearance has to be seen in before it is compared.
const ENOUGH_PX: f64 = 600.0;
/// What was learnt in so many pixels outweighs a new moment's.
const REMEMBERED_PX: f64 = 20_000.0;
/// By how much the exchange has to fit better, in Hellinger distances summed over who was known (each at most 1): noise,
/// shading and a turned back make some difference to the same clothes.
const CLEARLY: f64 = 0.15;

/// What everybody looks like, and who has met whom.
#[derive(Debug, Clone, Default)]
pub struct Identities {
    people: BTreeMap<TrackId, Looks>,
    /// Pairs that have met and have not been told apart since.
    met: Vec<(TrackId, TrackId)>,
}

#[derive(Debug, Clone, Default)]
struct Looks {
    /// Before the encounter.
    known: Appearance,
    /// Since.
    now: Appearance,
}

impl Identities {
    /// Takes in one moment: everybody with the name they go by, and the pictures (of all cameras, in the views' order).
    /// Returns the pairs that have to exchange their names.
    pub fn observe(
        &mut self,
        cameras: &[CameraFrame],
        views: &[View],
        people: &[(TrackId, Body)],
    ) -> Vec<(TrackId, TrackId)> {
        self.people.retain(|id, _| people.iter().any(|(other, _)| other == id));
        self.met.retain(|(a, b)| [a, b].iter().all(|id| people.iter().any(|(other, _)| other == *id)));
        let mut apart = vec![true; people.len()];
        for (i, (a, body)) in people.iter().enumerate() {
            for (j, (b, other)) in people.iter().enumerate().skip(i + 1) {
                let distance_m = body.floor_distance_m(other);
                if distance_m < APART_M {
                    (apart[i], apart[j]) = (false, false);
                }
                if distance_m < MET_M {
                    self.meet(*a, *b);
                }
            }
        }
        let bodies: Vec<Body> = people.iter().map(|(_, body)| *body).collect();
        let seen = appearance::sample(cameras, views, &bodies);
        for (((id, _), seen), _) in people.iter().zip(&seen).zip(&apart).filter(|(_, apart)| **apart) {
            let in_doubt = self.met.iter().any(|(a, b)| a == id || b == id);
            let looks = self.people.entry(*id).or_default();
            if in_doubt {
                looks.now.add(seen, f64::INFINITY);
            } else {
                looks.known.add(seen, REMEMBERED_PX);
            }
        }
        self.settle()
    }

    fn meet(&mut self, a: TrackId, b: TrackId) {
        // What is seen between two encounters is nobody's yet.
        for id in [a, b] {
            self.people.entry(id).or_default().now = Appearance::default();
        }
        if !self.met.contains(&(a, b)) {
            self.met.push((a, b));
        }
    }

    /// Tells apart whoever has been seen well enough since they met.
    fn settle(&mut self) -> Vec<(TrackId, TrackId)> {
        let mut exchanged = Vec::new();
        for (a, b) in std::mem::take(&mut self.met) {
            let (Some(of_a), Some(of_b)) = (self.people.get(&a), self.people.get(&b)) else { continue };
            // Whoever appeared beside somebody was never seen apart before: then the other's looks alone tell.
            let known: Vec<(&Looks, &Looks)> = [(of_a, of_b), (of_b, of_a)]
                .into_iter()
                .filter(|(own, _)| own.known.pixels() >= ENOUGH_PX)
                .collect();
            if known.is_empty() {
                // They met before anybody knew what they look like: nothing to compare with, ever.
                continue;
            }
            if of_a.now.pixels() < ENOUGH_PX || of_b.now.pixels() < ENOUGH_PX {
                self.met.push((a, b));
                continue;
            }
            let as_named: f64 = known.iter().map(|(own, _)| own.known.distance(&own.now)).sum();
            let exchange: f64 = known.iter().map(|(own, other)| own.known.distance(&other.now)).sum();
            if exchange + CLEARLY < as_named {
                let (of_a, of_b) = (of_a.now.clone(), of_b.now.clone());
                for (id, now) in [(a, of_b), (b, of_a)] {
                    if let Some(looks) = self.people.get_mut(&id) {
                        looks.now = now;
                    }
                }
                exchanged.push((a, b));
            }
        }
        for (id, looks) in &mut self.people {
            if !self.met.iter().any(|(a, b)| a == id || b == id) {
                looks.known.add(&std::mem::take(&mut looks.now), REMEMBERED_PX);
            }
        }
        exchanged
    }
}

#[cfg(test)]
mod tests;
