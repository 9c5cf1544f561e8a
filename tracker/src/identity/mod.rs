//! Re-identification after an encounter: appearance resolves the ambiguities that position cannot.
//!
//! Appearance vectors of a detector's boxes are compared all the while, each person's newest ones with those of a longer
//! time, because a box belongs to one person even in a crowd. Colours need people who are apart:
//!
//! While people are apart, their positions identify them, and their appearance is learnt. Two people whose distance
//! makes their silhouettes interchangeable have *met*; once they are apart again, their present appearance is compared
//! with the one learnt before. If the exchanged assignment fits clearly better, their ids were swapped in the
//! encounter, and are swapped back.
//!
//! * [`Identities`] — appearances of all people, and pairs that have met.
//! * [`appearance`] — colours of torso and legs, from pixels that a camera is predicted to see.
//! * [`mean_vector`] — vectors of a re-identification network, where a detector's boxes carry them.

pub mod appearance;
pub mod mean_vector;

use std::collections::BTreeMap;

use self::appearance::Appearance;
use self::mean_vector::{MeanVector, log_distance_ratio};
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
/// Numbers of boxes to which the vectors of a long time and the newest ones are faded.
const REMEMBERED_BOXES: f64 = 400.0;
const NEWEST_BOXES: f64 = 20.0;
/// Least numbers of them that are compared.
const ENOUGH_BOXES: f64 = 60.0;
const ENOUGH_NEWEST: f64 = 12.0;
/// Distance and time within which two people were close enough for their tracks to be exchanged: metres, seconds.
const NEAR_M: f64 = 1.2;
const NEAR_S: f64 = 30.0;
/// Margin by which the exchange has to fit better, in Hellinger distances summed over the known people (each at most
/// 1): noise, shading and a turned back change the colours of the same clothes somewhat.
const CLEARLY: f64 = 0.15;
/// Margin for vectors, as the logarithm of the ratio of the two distances: an exchange has to fit better by a quarter.
const CLEARLY_LOG_RATIO: f64 = 0.29;

/// Person of a moment.
#[derive(Debug, Clone)]
pub struct NamedPerson {
    /// Present id.
    pub id: TrackId,
    /// Most probable body.
    pub body: Body,
    /// Appearance vectors of the boxes that are surely this person's.
    pub vector: MeanVector,
}

/// Appearances of all people, and the pairs that have met.
#[derive(Debug, Clone, Default)]
pub struct Identities {
    people: BTreeMap<TrackId, LearntAppearance>,
    /// Pairs that have met and have not been re-identified by colours since.
    met: Vec<(TrackId, TrackId)>,
    /// Time at which each pair was near last, seconds; the smaller id first.
    near: BTreeMap<(TrackId, TrackId), f64>,
}

#[derive(Debug, Clone, Default)]
struct LearntAppearance {
    /// Colours before the encounter.
    known: Appearance,
    /// Colours since the encounter.
    now: Appearance,
    /// Vectors of a long time, and the newest ones.
    vectors: [MeanVector; 2],
}

impl Identities {
    /// Processes one moment: all people with their present ids, and the cameras' frames in the views' order. Returns
    /// the pairs whose ids have to be exchanged.
    pub fn observe(
        &mut self,
        cameras: &[CameraFrame],
        views: &[View],
        people: &[NamedPerson],
        time_s: f64,
    ) -> Vec<(TrackId, TrackId)> {
        let is_there = |id: &TrackId| people.iter().any(|person| person.id == *id);
        self.people.retain(|id, _| is_there(id));
        self.met.retain(|(a, b)| is_there(a) && is_there(b));
        self.near.retain(|(a, b), at_s| is_there(a) && is_there(b) && time_s < *at_s + NEAR_S);
        let mut apart = vec![true; people.len()];
        for (i, a) in people.iter().enumerate() {
            for (j, b) in people.iter().enumerate().skip(i + 1) {
                let distance_m = a.body.floor_distance_m(&b.body);
                if distance_m < APART_M {
                    (apart[i], apart[j]) = (false, false);
                }
                if distance_m < MET_M {
                    self.meet(a.id, b.id);
                }
                if distance_m < NEAR_M {
                    self.near.insert((a.id.min(b.id), a.id.max(b.id)), time_s);
                }
            }
        }
        let bodies: Vec<Body> = people.iter().map(|person| person.body).collect();
        let seen = appearance::sample(cameras, views, &bodies);
        for ((person, seen), is_apart) in people.iter().zip(&seen).zip(&apart) {
            let in_doubt = self.met.iter().any(|(a, b)| *a == person.id || *b == person.id);
            let looks = self.people.entry(person.id).or_default();
            let [long, newest] = &mut looks.vectors;
            long.add(&person.vector, REMEMBERED_BOXES);
            newest.add(&person.vector, NEWEST_BOXES);
            match (is_apart, in_doubt) {
                (true, true) => looks.now.add(seen, f64::INFINITY),
                (true, false) => looks.known.add(seen, REMEMBERED_PX),
                (false, _) => {}
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

    /// Takes notice that others have exchanged two people's tracks: what was seen newly was the other one's.
    pub fn exchange(&mut self, a: TrackId, b: TrackId) {
        self.meet(a, b);
        self.exchange_newest(a, b);
    }

    /// Gives what was seen newly of two people to each other.
    fn exchange_newest(&mut self, a: TrackId, b: TrackId) {
        let Some(mut of_a) = self.people.remove(&a) else { return };
        if let Some(of_b) = self.people.get_mut(&b) {
            std::mem::swap(&mut of_a.now, &mut of_b.now);
            std::mem::swap(&mut of_a.vectors[1], &mut of_b.vectors[1]);
        }
        self.people.insert(a, of_a);
    }

    /// Re-identifies the pairs that have been seen well enough since they met, or whose newest vectors are each other's.
    fn settle(&mut self) -> Vec<(TrackId, TrackId)> {
        let mut margins: BTreeMap<(TrackId, TrackId), f64> = BTreeMap::new();
        for (a, b) in std::mem::take(&mut self.met) {
            let (Some(of_a), Some(of_b)) = (self.people.get(&a), self.people.get(&b)) else { continue };
            match by_colours([of_a, of_b]) {
                Evidence::Never => {}
                Evidence::Later => self.met.push((a, b)),
                Evidence::Margins(of_colours) => {
                    margins.insert((a.min(b), a.max(b)), of_colours);
                }
            }
        }
        for pair in self.near.keys() {
            if let (Some(of_a), Some(of_b)) = (self.people.get(&pair.0), self.people.get(&pair.1)) {
                *margins.entry(*pair).or_default() += margins_by_vectors([of_a, of_b]);
            }
        }
        let mut clear: Vec<((TrackId, TrackId), f64)> =
            margins.into_iter().filter(|(_, margins)| *margins > 1.0).collect();
        clear.sort_by(|one, other| other.1.total_cmp(&one.1));
        let mut exchanged: Vec<(TrackId, TrackId)> = Vec::new();
        for ((a, b), _) in clear {
            // The evidence for others was that of the names before.
            if !exchanged.iter().any(|(c, d)| [a, b].iter().any(|id| id == c || id == d)) {
                self.exchange_newest(a, b);
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

/// Evidence of the colours for an exchange of two people's names.
enum Evidence {
    /// The two met before either appearance was known, so there is nothing to compare.
    Never,
    /// The two have not been seen well enough since they met.
    Later,
    /// The exchange fits better by so many times the margin; negative where it fits worse.
    Margins(f64),
}

/// Evidence of the colours. A person who appeared beside another was never seen apart before: then the other's
/// appearance alone decides.
fn by_colours([a, b]: [&LearntAppearance; 2]) -> Evidence {
    let known: Vec<_> =
        [(a, b), (b, a)].into_iter().filter(|(own, _)| own.known.pixels() >= ENOUGH_PX).collect();
    if known.is_empty() {
        return Evidence::Never;
    }
    if a.now.pixels() < ENOUGH_PX || b.now.pixels() < ENOUGH_PX {
        return Evidence::Later;
    }
    let as_named: f64 = known.iter().map(|(own, _)| own.known.distance(&own.now)).sum();
    let exchanged: f64 = known.iter().map(|(own, other)| own.known.distance(&other.now)).sum();
    Evidence::Margins((as_named - exchanged) / CLEARLY)
}

/// Evidence of the vectors: the exchange fits better by so many times the margin; 0 while there are too few.
fn margins_by_vectors(people: [&LearntAppearance; 2]) -> f64 {
    let unknown = MeanVector::default();
    let [long, newest] = [0, 1].map(|span| people.map(|person| &person.vectors[span]));
    let known = long.map(|vector| if vector.boxes() < ENOUGH_BOXES { &unknown } else { vector });
    if newest.iter().any(|vector| vector.boxes() < ENOUGH_NEWEST) {
        return 0.0;
    }
    log_distance_ratio(known, newest) / CLEARLY_LOG_RATIO
}

#[cfg(test)]
mod tests;
