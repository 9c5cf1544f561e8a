//! Re-identification after an encounter: appearance resolves the ambiguities that position cannot.
//!
//! While people are apart, their positions identify them, and their appearance is learnt. Two people whose distance
//! makes their silhouettes interchangeable have *met*; once they are apart again, their present appearance is compared
//! with the one learnt before. If the exchanged assignment fits clearly better, their ids were swapped in the
//! encounter, and are swapped back.
//!
//! * [`Identities`] — appearances of all people, and pairs that have met.
//! * [`appearance`] — colours of torso and legs, from pixels that a camera is predicted to see.

pub mod appearance;

use std::collections::BTreeMap;

use self::appearance::Appearance;
use crate::silhouette::{Body, View};
use crate::{CameraFrame, TrackId};

/// Distance below which two people may be confused afterwards, metres.
const MET_M: f64 = 0.6;
/// Distance from everybody else above which a person's pixels are their own, metres.
const APART_M: f64 = 0.9;
/// Least number of pixels of an appearance that is compared, in views of the sampler's resolution.
const ENOUGH_PX: f64 = 600.0;
/// Number of pixels to which an appearance is faded before new ones are added.
const REMEMBERED_PX: f64 = 20_000.0;
/// Margin by which the exchange has to fit better, in Hellinger distances summed over the known people (each at most
/// 1): noise, shading and a turned back change the colours of the same clothes somewhat.
const CLEARLY: f64 = 0.15;

/// Appearances of all people, and the pairs that have met.
#[derive(Debug, Clone, Default)]
pub struct Identities {
    people: BTreeMap<TrackId, LearntAppearance>,
    /// Pairs that have met and have not been re-identified since.
    met: Vec<(TrackId, TrackId)>,
}

#[derive(Debug, Clone, Default)]
struct LearntAppearance {
    /// Appearance before the encounter.
    known: Appearance,
    /// Appearance since the encounter.
    now: Appearance,
}

impl Identities {
    /// Processes one moment: all people with their present ids, and the cameras' frames in the views' order. Returns
    /// the pairs whose ids have to be exchanged.
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
        // Pixels sampled between two encounters cannot be attributed.
        for id in [a, b] {
            self.people.entry(id).or_default().now = Appearance::default();
        }
        if !self.met.contains(&(a, b)) {
            self.met.push((a, b));
        }
    }

    /// Re-identifies the pairs that have been seen well enough since they met.
    fn settle(&mut self) -> Vec<(TrackId, TrackId)> {
        let mut exchanged = Vec::new();
        for (a, b) in std::mem::take(&mut self.met) {
            let (Some(of_a), Some(of_b)) = (self.people.get(&a), self.people.get(&b)) else { continue };
            // A person who appeared beside another was never seen apart before: then the other's appearance alone
            // decides.
            let known: Vec<(&LearntAppearance, &LearntAppearance)> = [(of_a, of_b), (of_b, of_a)]
                .into_iter()
                .filter(|(own, _)| own.known.pixels() >= ENOUGH_PX)
                .collect();
            if known.is_empty() {
                // They met before either appearance was known, so there is nothing to compare.
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
