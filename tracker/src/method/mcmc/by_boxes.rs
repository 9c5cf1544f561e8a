//! Start and length of the chain in a moment with a detector's boxes.

use nalgebra::Vector2;

use super::boxes::Hotspots;
use super::person::Person;
use super::sampling::SETTLING_STEPS;
use super::traits::LearntTraits;
use super::vector_places::VectorPlaces;
use super::{BoxOptions, Mcmc};
use crate::likelihood::prior::LOG_IMPOSSIBLE;

/// Number of sweeps in which every person is fitted to the boxes that the others leave.
const SWEEPS: usize = 3;
/// Largest distance between two people whose places are exchanged, metres.
const EXCHANGE_M: f64 = 2.5;
/// Largest number of rounds of exchanges.
const MOST_ROUNDS: usize = 8;

impl Mcmc {
    /// Whether boxes are the only observations of this moment.
    pub(super) fn observes_boxes_alone(&self) -> bool {
        self.boxes.is_in_use() && !self.simulation.sees_anything()
    }

    /// Moves the predicted people to their fits to the boxes, and returns the places of boxes that nobody explains.
    ///
    /// A chain may start in any state; starting at the least-squares fits saves the steps to find them. The
    /// predictions, which are the prior, do not change.
    pub(super) fn fit_people_to_boxes(&mut self, people: &mut [Person]) -> Hotspots {
        if !self.boxes.is_in_use() {
            return Hotspots::default();
        }
        let floor = &self.stage.floor;
        for _ in 0..SWEEPS {
            let fits = self.boxes.fits(people.iter().map(|person| (person.body, person.known.as_ref())));
            for (person, fit) in people.iter_mut().zip(fits) {
                let Some(known) = &mut person.known else { continue };
                if let Some((body, place)) = fit {
                    let is_possible = floor.is_standable(body.x_m, body.y_m)
                        && known.place.log_density(body.x_m, body.y_m) > LOG_IMPOSSIBLE;
                    if is_possible && !self.simulation.sees_anything() {
                        person.body = body;
                        person.at_exit = floor.may_disappear(body.x_m, body.y_m);
                    }
                    known.fit = Some(place);
                }
            }
            exchange(people);
            self.boxes.clear();
            for person in people.iter() {
                self.boxes.insert(&person.body);
            }
            self.look_at_vectors(people);
        }
        self.boxes.hotspots((&self.options.radius, &self.options.height), |x, y| floor.is_standable(x, y))
    }

    /// Sets the likelihood of the appearance vectors for the known people, who are the people of the boxes' state.
    fn look_at_vectors(&self, people: &mut [Person]) {
        if !self.boxes.has_vectors() {
            return;
        }
        let places = people.iter().map(|person| Vector2::new(person.body.x_m, person.body.y_m));
        let seen: Vec<_> = places.zip(self.boxes.vectors()).collect();
        let nothing = LearntTraits::default();
        let learnt = |person: &Person| {
            let track = self.tracks.iter().find(|track| track.key == person.key);
            track.map_or(&nothing, |track| &track.learnt)
        };
        let learnt: Vec<&LearntTraits> = people.iter().map(learnt).collect();
        let evidence = VectorPlaces::of_people(&learnt, &seen);
        for (person, vectors) in people.iter_mut().zip(evidence) {
            person.known.iter_mut().for_each(|known| known.vectors = vectors.clone());
        }
    }

    /// Burn-in and kept steps of a moment with boxes alone.
    pub(super) fn steps_by_boxes(&self, people: usize, hotspots: usize, settling: bool) -> [u32; 2] {
        let BoxOptions { burn_in_per_person, kept_per_person, .. } = self.options.boxes;
        let parts = u32::try_from(people + hotspots).unwrap_or(u32::MAX);
        let settling = if settling { SETTLING_STEPS } else { 1 };
        let burn_in = self.options.burn_in_steps.max(burn_in_per_person.saturating_mul(parts));
        let kept = self.options.kept_steps.max(kept_per_person.saturating_mul(parts));
        [burn_in.saturating_mul(settling), kept]
    }
}

/// Exchanges the places of pairs of people when their priors make the exchanged places more likely.
fn exchange(people: &mut [Person]) {
    for _ in 0..MOST_ROUNDS {
        let mut has_changed = false;
        for a in 0..people.len() {
            for b in 0..a {
                let (body_a, body_b) = (people[a].body, people[b].body);
                let (Some(known_a), Some(known_b)) = (&people[a].known, &people[b].known) else { continue };
                if body_a.floor_distance_m(&body_b) > EXCHANGE_M {
                    continue;
                }
                let present = known_a.log_density(&body_a) + known_b.log_density(&body_b);
                let exchanged = known_a.log_density(&body_b) + known_b.log_density(&body_a);
                if exchanged > present {
                    let (first, rest) = people.split_at_mut(a);
                    std::mem::swap(&mut first[b].body, &mut rest[0].body);
                    std::mem::swap(&mut first[b].silhouettes, &mut rest[0].silhouettes);
                    std::mem::swap(&mut first[b].at_exit, &mut rest[0].at_exit);
                    has_changed = true;
                }
            }
        }
        if !has_changed {
            return;
        }
    }
}
