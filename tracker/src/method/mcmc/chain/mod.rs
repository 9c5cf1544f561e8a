//! Markov chain of one moment: state, moves and acceptance (sections 3.3.1 to 3.3.4 of the paper cited in [`super`]).
//!
//! The target density is `V(S) · R(S) · E(S)` times, under reversible jump, the prior:
//!
//! ```text
//! people known from the last moment:  P(still there) · N(place; prediction) · p(r, h)    or, deleted, P(gone)
//! people born now:                    births · dt / region area         · p(r, h)
//! ```
//!
//! and 0 where a person born in this moment overlaps anybody.
//!
//! The jump that adds a person and the one that deletes them are each other's reverse, and the acceptance ratio
//! contains the ratio of their proposal probabilities (Green 2003; Khan, Balch & Dellaert 2005). ADD either proposes
//! a birth or reverts a deletion of this moment, so that a person who is deleted temporarily keeps their identity.
//!
//! * [`jumps`]: ADD and DELETE.
//! * [`updates`]: UPDATE-P and UPDATE-S.
//! * [`by_boxes`]: UPDATE-P where boxes are observed.
//! * [`labels`]: exchanges of identities.

mod by_boxes;
mod jumps;
mod labels;
#[cfg(test)]
mod tests;
mod updates;

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::appearance::Appearance;
use super::births::BirthMap;
use super::boxes::Boxes;
use super::options::{Acceptance, McmcOptions};
use super::person::{Key, Person};
use super::posture::SizePrior;
use crate::likelihood::prior::{LOG_IMPOSSIBLE, log_separation};
use crate::likelihood::{Counts, Layers, PreparedLikelihood, Simulation};
use crate::prepared_room::Floor;
use crate::silhouette::{Body, Silhouette};

/// Ranges of a person's radius and height.
const RADII_M: std::ops::RangeInclusive<f64> = 0.10..=0.60;
const HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.8..=2.3;

/// Tolerance of log densities in nats: far above their rounding errors, far below what matters to a decision.
const ROUNDING: f64 = 1e-6;

/// Constants of the chain during one moment.
pub(super) struct Setting<'a> {
    pub(super) floor: &'a Floor,
    pub(super) layers: &'a Layers,
    pub(super) options: &'a McmcOptions,
    /// Likelihood of masks, V(S).
    pub(super) rule: PreparedLikelihood,
    /// Birth model.
    pub(super) appearance: Appearance<'a>,
    /// Prior of the size of people born in this moment.
    pub(super) newcomers: SizePrior,
    /// Birth map weighted by the foreground that the predicted people leave unexplained; `None` when that is too
    /// little for a person.
    pub(super) unexplained: Option<&'a BirthMap>,
    /// Pixels of a typical silhouette, one entry a layer.
    pub(super) typical_px: &'a [f64],
    /// Factor of `log R`. As published, R is multiplied with a V between 0 and 1; with a V of hundreds of nats it
    /// needs a proportionally larger weight.
    pub(super) repulsion_weight: f64,
    /// λ of R(S), 1/m.
    pub(super) repulsion_per_m: f64,
    /// Least distance of a person born in this moment from everybody else, metres.
    pub(super) apart_m: f64,
}

/// State of the chain and its cached likelihood.
pub(super) struct Chain<'a> {
    setting: Setting<'a>,
    simulation: &'a mut Simulation,
    boxes: &'a mut Boxes,
    /// People of the state.
    pub(super) people: Vec<Person>,
    /// People of the last moment who are deleted in the present state.
    pub(super) gone: Vec<Person>,
    /// Log-likelihood of the state: `log V` plus that of the boxes.
    log_likelihood: f64,
    /// Index of the person whose removal the simulation has cached.
    removed: Option<usize>,
    next_key: &'a mut Key,
    /// Silhouettes of the proposed body, one a layer.
    proposed: Vec<Silhouette>,
    /// Unused silhouettes, kept for their memory.
    spare: Vec<Vec<Silhouette>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Move {
    Add,
    Delete,
    Position,
    Size,
}

impl<'a> Chain<'a> {
    /// Starts from the predicted people. The simulation must hold the moment's masks and these people's silhouettes,
    /// and the boxes their bodies.
    pub(super) fn new(
        setting: Setting<'a>,
        (simulation, boxes): (&'a mut Simulation, &'a mut Boxes),
        people: Vec<Person>,
        next_key: &'a mut Key,
    ) -> Self {
        let proposed = vec![Silhouette::default(); setting.layers.count()];
        let mut chain = Self {
            setting,
            simulation,
            boxes,
            people,
            gone: Vec::new(),
            log_likelihood: 0.0,
            removed: None,
            next_key,
            proposed,
            spare: Vec::new(),
        };
        chain.log_likelihood = chain.rule_of(chain.simulation.counts()) + chain.boxes.log_likelihood();
        chain
    }

    /// Runs one step: chooses a move, proposes a change, and accepts or rejects it.
    pub(super) fn step(&mut self, rng: &mut Pcg64Mcg) {
        if rng.random::<f64>() < labels::RELABEL {
            self.relabel(rng);
        }
        if self.boxes.is_in_use() && rng.random::<f64>() < labels::EXCHANGE {
            self.exchange(rng);
        }
        let mut mark = rng.random::<f64>();
        for (kind, probability) in self.moves(self.people.len(), self.deletable(), self.gone.len()) {
            mark -= probability;
            if mark < 0.0 {
                match kind {
                    Move::Add if !self.gone.is_empty() && rng.random::<f64>() < jumps::REVIVE => {
                        self.revive(rng);
                    }
                    Move::Add => self.propose_birth(rng),
                    Move::Delete => self.delete(rng),
                    Move::Position if self.boxes.is_in_use() => self.update_position_by_boxes(rng),
                    Move::Position => self.update_position(rng),
                    Move::Size => self.update_size(rng),
                }
                return;
            }
        }
    }

    /// Probabilities of the moves in a state with this many people, deletable people, and people deleted in this
    /// moment.
    fn moves(&self, people: usize, deletable: usize, gone: usize) -> [(Move, f64); 4] {
        let w = &self.setting.options.moves;
        // A deletion can be reverted even where nobody can be born; without that reverse move, DELETE would never be
        // accepted.
        let anybody = gone > 0 || !self.setting.appearance.is_nowhere();
        let add = if people < self.setting.options.max_people && anybody { w.add } else { 0.0 };
        let weights = if people == 0 {
            // ADD is the only move without people.
            [1.0, 0.0, 0.0, 0.0]
        } else {
            [add, if deletable == 0 { 0.0 } else { w.delete }, w.position, w.size]
        };
        let sum: f64 = weights.iter().sum();
        let kinds = [Move::Add, Move::Delete, Move::Position, Move::Size];
        std::array::from_fn(|i| (kinds[i], weights[i] / sum))
    }

    fn probability_of(&self, wanted: Move, people: usize, deletable: usize, gone: usize) -> f64 {
        self.moves(people, deletable, gone).iter().filter(|(kind, _)| *kind == wanted).map(|(_, p)| p).sum()
    }

    fn deletable(&self) -> usize {
        self.people.iter().filter(|p| p.may_leave()).count()
    }

    fn is_exit(&self, body: &Body) -> bool {
        self.setting.floor.may_disappear(body.x_m, body.y_m)
    }

    /// Log of E of one body, plus under reversible jump its motion (or birth) and size priors.
    fn log_prior(&self, which: usize, body: &Body) -> f64 {
        let (person, floor) = (&self.people[which], self.setting.floor);
        let mut log = if floor.is_standable(body.x_m, body.y_m) { 0.0 } else { LOG_IMPOSSIBLE };
        if self.setting.options.acceptance == Acceptance::ReversibleJump {
            log += match &person.known {
                Some(known) => known.log_density(body),
                None => {
                    self.setting.appearance.log_density(body.x_m, body.y_m)
                        + self.setting.newcomers.log_density(body)
                }
            };
        }
        log
    }

    /// Log density of the present state under the target, up to a constant of the moment.
    pub(super) fn log_density(&self) -> f64 {
        let of_one = |(which, person): (usize, &Person)| {
            let there = person.known.as_ref().map_or(0.0, |known| known.log_odds);
            // Each pair is counted twice.
            let crowding = 0.5 * self.crowding(&person.body, Some(which), person.is_new());
            self.log_prior(which, &person.body) + there + crowding
        };
        self.log_likelihood + self.people.iter().enumerate().map(of_one).sum::<f64>()
    }

    /// Weighted `log R` of one body against the others; under reversible jump, [`LOG_IMPOSSIBLE`] where a person born
    /// in this moment overlaps another one. `except`: index of the person whose body this is.
    fn crowding(&self, body: &Body, except: Option<usize>, is_new: bool) -> f64 {
        let options = self.setting.options;
        let apart = options.acceptance == Acceptance::ReversibleJump;
        let mut log_r = 0.0;
        for other in self.others(except) {
            if apart && (is_new || other.is_new()) && self.overlap(body, &other.body) {
                return LOG_IMPOSSIBLE;
            }
            log_r += log_separation(body, &other.body, self.setting.repulsion_per_m);
        }
        (self.setting.repulsion_weight * log_r).max(LOG_IMPOSSIBLE)
    }

    /// Whether a body overlaps nobody.
    ///
    /// Masks are wider than ellipsoids and the cameras' calibrations disagree by a few centimetres, so two
    /// overlapping bodies explain most people better than one does. Followed people may come that close; nobody is
    /// born there.
    fn stands_apart(&self, body: &Body, except: Option<usize>) -> bool {
        self.others(except).all(|other| !self.overlap(body, &other.body))
    }

    fn overlap(&self, a: &Body, b: &Body) -> bool {
        a.floor_distance_m(b) < self.setting.apart_m
    }

    fn others(&self, except: Option<usize>) -> impl Iterator<Item = &Person> {
        self.people.iter().enumerate().filter(move |(i, _)| Some(*i) != except).map(|(_, person)| person)
    }

    /// Makes the Metropolis–Hastings decision about a change of the person `old` to the body `new`: returns the new
    /// state's log-likelihood if it is accepted. `log_ratio` is the log acceptance ratio without the likelihood. The
    /// silhouettes are drawn into `proposed`, and the change is the last one that the simulation tried.
    fn decide(
        &mut self,
        old: Option<usize>,
        new: Option<&Body>,
        log_ratio: f64,
        rng: &mut Pcg64Mcg,
    ) -> Option<f64> {
        // The random number of the decision is drawn before the likelihood is computed, so that the computation stops
        // as soon as rejection is certain: most proposals are rejected.
        let mark = rng.clone().random::<f64>().ln();
        let least = self.log_likelihood - log_ratio + mark - ROUNDING;
        let likelihood = self.likelihood_of(old, new, least).unwrap_or(f64::NEG_INFINITY);
        accepted(likelihood - self.log_likelihood + log_ratio, rng).then_some(likelihood)
    }

    /// Draws the proposal (into `proposed`) and computes its log-likelihood, layer by layer; `None` as soon as it is
    /// certain to be less than `least`.
    fn likelihood_of(&mut self, old: Option<usize>, new: Option<&Body>, least: f64) -> Option<f64> {
        let boxes = self.boxes.try_change(old, new);
        let least = least - boxes;
        let layers = self.setting.layers;
        if old.is_some() && old == self.removed {
            // Most proposals are rejected, and the next one often concerns the same person.
            self.simulation.try_again();
        } else {
            self.simulation.try_removal(old.map(|i| self.people[i].silhouettes.as_slice()));
            self.removed = old;
        }
        let old = old.map(|i| self.people[i].silhouettes.as_slice());
        for layer in 0..layers.count() {
            if !self.simulation.in_use(layer) {
                continue;
            }
            if self.rule_of(self.simulation.tried()) < least {
                return None;
            }
            if let Some(body) = new {
                layers.draw(layer, body, &mut self.proposed[layer]);
            }
            self.simulation.try_addition(layer, old, new.map(|_| self.proposed.as_slice()));
        }
        Some(self.rule_of(self.simulation.tried()) + boxes)
    }

    /// Accepts the state last tried, which has this log-likelihood.
    fn arrive(&mut self, log_likelihood: f64) {
        (self.log_likelihood, self.removed) = (log_likelihood, None);
    }

    fn rule_of(&self, counts: impl Iterator<Item = Option<Counts>>) -> f64 {
        let Setting { layers, typical_px, rule, .. } = &self.setting;
        let used = counts.enumerate().filter_map(|(i, c)| Some((layers.shape(i), c?, typical_px[i])));
        rule.log_likelihood(used)
    }
}

fn is_a_size(body: &Body) -> bool {
    RADII_M.contains(&body.radius_m) && HEIGHTS_M.contains(&body.height_m)
}

/// Draws whether a change with this log acceptance ratio is accepted.
fn accepted(log_ratio: f64, rng: &mut Pcg64Mcg) -> bool {
    log_ratio >= 0.0 || rng.random::<f64>() < log_ratio.exp()
}
