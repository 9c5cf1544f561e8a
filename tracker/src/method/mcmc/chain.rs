//! The Markov chain of one moment: state, moves, acceptance (seed 001, sections 3.3.1 to 3.3.4).
//!
//! The target is `V(S) · R(S) · E(S)` times, under reversible jump, what was known before looking:
//!
//! ```text
//! people known from the last moment:  P(still there) · N(place; prediction) · N(r) · N(h)    or, deleted, P(gone)
//! people born now:                    births · dt / region area         · N(r) · N(h)
//! ```
//!
//! A jump that adds a person and the one that deletes them are each other's reverse, and the acceptance carries the ratio
//! of their proposal probabilities (Green 2003; Khan, Balch & Dellaert 2005). ADD either bears somebody new or takes a
//! deletion of this moment back, so that a person who is deleted on the way keeps their identity when they return.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use super::births::BirthMap;
use super::options::{Acceptance, McmcOptions, Spread};
use super::person::{Key, Known, Person};
use crate::likelihood::prior::{LOG_IMPOSSIBLE, log_separation};
use crate::likelihood::{Counts, Layers, Simulation};
use crate::silhouette::{Body, Silhouette};
use crate::stage::Floor;

/// With what probability ADD takes a deletion back, when there is one to take back.
const REVIVE: f64 = 0.5;
/// The part of the jumps to left-over foreground that go by its weight; the rest, so that every jump has its way back, go
/// anywhere.
const TO_LEFT_OVER: f64 = 0.9;
/// Probability that a step also tries to exchange the label of somebody born now.
const RELABEL: f64 = 0.1;
/// Standard deviation of a step along a line of sight: the direction in which one camera alone knows least.
const LINE_OF_SIGHT_STEP_M: f64 = 0.15;
/// Sizes outside these are nobody's.
const RADII_M: std::ops::RangeInclusive<f64> = 0.10..=0.60;
const HEIGHTS_M: std::ops::RangeInclusive<f64> = 0.8..=2.3;

/// What stays the same during a moment.
pub(super) struct Setting<'a> {
    pub(super) floor: &'a Floor,
    pub(super) layers: &'a Layers,
    pub(super) options: &'a McmcOptions,
    /// Where ADD may put people, weighed for this moment.
    pub(super) births: &'a BirthMap,
    /// Where foreground is left over by the predicted people; `None` when it is too little to be a person.
    pub(super) unexplained: Option<&'a BirthMap>,
    /// People may appear anywhere.
    pub(super) settling: bool,
    /// Pixels of a typical silhouette, one entry a layer.
    pub(super) typical_px: &'a [f64],
    /// What multiplies `log R`. As published, R stands beside a V that goes from 0 to 1; beside a V that counts for
    /// hundreds of nats it has to weigh as much more.
    pub(super) repulsion_weight: f64,
    /// Expected births of this moment per m² of the region.
    pub(super) log_birth_density: f64,
}

/// The state and what is kept about it.
pub(super) struct Chain<'a> {
    setting: Setting<'a>,
    simulation: &'a mut Simulation,
    /// Who is there.
    pub(super) people: Vec<Person>,
    /// Who was there at the last moment and has been deleted since.
    pub(super) gone: Vec<Person>,
    /// `log V` of the state.
    log_likelihood: f64,
    next_key: &'a mut Key,
    /// Silhouettes of the proposed body.
    proposed: Vec<Silhouette>,
    /// Memory of silhouettes no longer used.
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
    /// Starts from the predicted people. The simulation has the moment's masks and their bodies.
    pub(super) fn new(
        setting: Setting<'a>,
        simulation: &'a mut Simulation,
        people: Vec<Person>,
        next_key: &'a mut Key,
    ) -> Self {
        let proposed = vec![Silhouette::default(); setting.layers.count()];
        let mut chain = Self {
            setting,
            simulation,
            people,
            gone: Vec::new(),
            log_likelihood: 0.0,
            next_key,
            proposed,
            spare: Vec::new(),
        };
        chain.log_likelihood = chain.rule_of(chain.simulation.counts());
        chain
    }

    /// One step: a move is chosen, proposed, and taken or not.
    pub(super) fn step(&mut self, rng: &mut Pcg64Mcg) {
        if rng.random::<f64>() < RELABEL {
            self.relabel(rng);
        }
        let mut mark = rng.random::<f64>();
        for (kind, probability) in self.moves(self.people.len(), self.deletable()) {
            mark -= probability;
            if mark < 0.0 {
                match kind {
                    Move::Add if !self.gone.is_empty() && rng.random::<f64>() < REVIVE => self.revive(rng),
                    Move::Add => self.bear(rng),
                    Move::Delete => self.delete(rng),
                    Move::Position => self.update_position(rng),
                    Move::Size => self.update_size(rng),
                }
                return;
            }
        }
    }

    /// The moves on offer and their probabilities, for a state of so many people of whom so many can be deleted.
    fn moves(&self, people: usize, deletable: usize) -> [(Move, f64); 4] {
        let w = &self.setting.options.moves;
        let full = people >= self.setting.options.max_people || self.setting.births.is_empty();
        let weights = if people == 0 {
            // ADD is always chosen when there is nobody; where nobody can be born, only a deletion can be taken back.
            [1.0, 0.0, 0.0, 0.0]
        } else {
            [if full { 0.0 } else { w.add }, if deletable == 0 { 0.0 } else { w.delete }, w.position, w.size]
        };
        let sum: f64 = weights.iter().sum();
        let kinds = [Move::Add, Move::Delete, Move::Position, Move::Size];
        std::array::from_fn(|i| (kinds[i], weights[i] / sum))
    }

    fn probability_of(&self, wanted: Move, people: usize, deletable: usize) -> f64 {
        self.moves(people, deletable).iter().filter(|(kind, _)| *kind == wanted).map(|(_, p)| p).sum()
    }

    fn is_deletable(&self, person: &Person, body: &Body) -> bool {
        person.tentative || self.setting.floor.may_disappear(body.x_m, body.y_m)
    }

    fn deletable(&self) -> usize {
        self.people.iter().filter(|p| self.is_deletable(p, &p.body)).count()
    }

    /// ADD somebody new.
    fn bear(&mut self, rng: &mut Pcg64Mcg) {
        let options = self.setting.options;
        if self.setting.births.is_empty() {
            return;
        }
        let place = self.setting.births.sample(options.informed_births, rng);
        let body = Body {
            x_m: place.x,
            y_m: place.y,
            radius_m: options.radius.sample(rng),
            height_m: options.height.sample(rng),
        };
        let floor = self.setting.floor;
        let allowed = self.setting.settling || floor.may_appear(body.x_m, body.y_m);
        if !allowed || !is_a_size(&body) || !floor.is_standable(body.x_m, body.y_m) {
            return;
        }
        let likelihood = self.likelihood_of(None, Some(&body));
        let mut log_ratio = likelihood - self.log_likelihood + self.crowding(&body, None);
        if options.acceptance == Acceptance::ReversibleJump {
            // The size is drawn from its prior: the two cancel. Somebody born now can be deleted wherever they are.
            let density = self.setting.births.density(body.x_m, body.y_m, options.informed_births);
            let new = if self.gone.is_empty() { 1.0 } else { 1.0 - REVIVE };
            let (k, d) = (self.people.len(), self.deletable());
            let forth = self.probability_of(Move::Add, k, d) * new * density;
            let back = self.probability_of(Move::Delete, k + 1, d + 1) / (d + 1) as f64;
            log_ratio += self.setting.log_birth_density + back.ln() - forth.ln();
        }
        if accepted(log_ratio, rng) {
            let key = *self.next_key;
            *self.next_key += 1;
            let person = Person { key, body, silhouettes: Vec::new(), known: None, tentative: true };
            self.take_in(person, likelihood);
        }
    }

    /// ADD: take back the deletion of somebody known.
    fn revive(&mut self, rng: &mut Pcg64Mcg) {
        let which = rng.random_range(0..self.gone.len());
        let person = &self.gone[which];
        let Some(known) = &person.known else { return };
        let place = known.place.sample(rng);
        let body = Body {
            x_m: place.x,
            y_m: place.y,
            radius_m: known.radius.sample(rng),
            height_m: known.height.sample(rng),
        };
        let floor = self.setting.floor;
        let log_odds = known.log_odds;
        // Where DELETE could not have taken them from, ADD cannot put them.
        let reversible = self.is_deletable(person, &body);
        if !reversible || !is_a_size(&body) || !floor.is_standable(body.x_m, body.y_m) {
            return;
        }
        let likelihood = self.likelihood_of(None, Some(&body));
        let mut log_ratio = likelihood - self.log_likelihood + self.crowding(&body, None);
        if self.setting.options.acceptance == Acceptance::ReversibleJump {
            let (k, d) = (self.people.len(), self.deletable());
            let forth = self.probability_of(Move::Add, k, d) * REVIVE / self.gone.len() as f64;
            let back = self.probability_of(Move::Delete, k + 1, d + 1) / (d + 1) as f64;
            log_ratio += log_odds + back.ln() - forth.ln();
        }
        if accepted(log_ratio, rng) {
            let mut person = self.gone.swap_remove(which);
            person.body = body;
            self.take_in(person, likelihood);
        }
    }

    /// Somebody born now may be somebody deleted now, who went farther than the chain's steps: exchanges the labels, which
    /// no pixel sees. Comes on top of a step and costs next to nothing.
    fn relabel(&mut self, rng: &mut Pcg64Mcg) {
        if self.setting.options.acceptance == Acceptance::Published {
            return;
        }
        let known: Vec<usize> = (0..self.people.len()).filter(|i| self.people[*i].known.is_some()).collect();
        let new: Vec<usize> = (0..self.people.len()).filter(|i| self.people[*i].known.is_none()).collect();
        let (options, births) = (self.setting.options, self.setting.log_birth_density);
        // How much more likely a body is as this known person than as somebody born now.
        let advantage = |known: &Known, body: &Body| {
            known.log_odds + known.log_density(body)
                - births
                - log_size(&options.radius, &options.height, body)
        };
        if rng.random::<bool>() {
            if new.is_empty() || self.gone.is_empty() {
                return;
            }
            let (n, g) = (new[rng.random_range(0..new.len())], rng.random_range(0..self.gone.len()));
            let Some(of_gone) = &self.gone[g].known else { return };
            let log_ratio = advantage(of_gone, &self.people[n].body)
                + (new.len() as f64).ln()
                + (self.gone.len() as f64).ln()
                - ((known.len() + 1) as f64).ln();
            if accepted(log_ratio, rng) {
                let back = self.gone.swap_remove(g);
                let person = &mut self.people[n];
                (person.key, person.known, person.tentative) = (back.key, back.known, back.tentative);
            }
        } else {
            if known.is_empty() {
                return;
            }
            let k = known[rng.random_range(0..known.len())];
            let person = &self.people[k];
            let body = person.body;
            let floor = self.setting.floor;
            let reversible = self.is_deletable(person, &body)
                && (self.setting.settling || floor.may_appear(body.x_m, body.y_m));
            let Some(of_person) = person.known.as_ref().filter(|_| reversible) else { return };
            let log_ratio = (known.len() as f64).ln()
                - advantage(of_person, &body)
                - ((new.len() + 1) as f64).ln()
                - ((self.gone.len() + 1) as f64).ln();
            if accepted(log_ratio, rng) {
                let key = *self.next_key;
                *self.next_key += 1;
                let person = &mut self.people[k];
                let mut left = Person { key, body, silhouettes: Vec::new(), known: None, tentative: true };
                std::mem::swap(person, &mut left);
                std::mem::swap(&mut person.silhouettes, &mut left.silhouettes);
                self.gone.push(left);
            }
        }
    }

    /// The proposed body becomes a person of the state.
    fn take_in(&mut self, mut person: Person, likelihood: f64) {
        self.simulation.commit(None, Some(&self.proposed));
        self.log_likelihood = likelihood;
        let spare =
            self.spare.pop().unwrap_or_else(|| vec![Silhouette::default(); self.setting.layers.count()]);
        person.silhouettes = std::mem::replace(&mut self.proposed, spare);
        self.people.push(person);
    }

    /// DELETE.
    fn delete(&mut self, rng: &mut Pcg64Mcg) {
        let deletable = self.deletable();
        let nth = rng.random_range(0..deletable.max(1));
        let Some(which) = (0..self.people.len())
            .filter(|i| self.is_deletable(&self.people[*i], &self.people[*i].body))
            .nth(nth)
        else {
            return;
        };
        let options = self.setting.options;
        let likelihood = self.likelihood_of(Some(which), None);
        let (person, body) = (&self.people[which], self.people[which].body);
        let mut log_ratio = likelihood - self.log_likelihood - self.crowding(&body, Some(which));
        if options.acceptance == Acceptance::ReversibleJump {
            let k = self.people.len();
            let forth = self.probability_of(Move::Delete, k, deletable) / deletable as f64;
            let add = self.probability_of(Move::Add, k - 1, deletable - 1);
            log_ratio += if let Some(known) = &person.known {
                let back = add * REVIVE / (self.gone.len() + 1) as f64;
                back.ln() - forth.ln() - known.log_odds
            } else {
                let new = if self.gone.is_empty() { 1.0 } else { 1.0 - REVIVE };
                let density = self.setting.births.density(body.x_m, body.y_m, options.informed_births);
                let back = add * new * density;
                back.ln() - forth.ln() - self.setting.log_birth_density
            };
        }
        if accepted(log_ratio, rng) {
            let mut person = self.people.swap_remove(which);
            self.simulation.commit(Some(&person.silhouettes), None);
            self.log_likelihood = likelihood;
            self.spare.push(std::mem::take(&mut person.silhouettes));
            if person.known.is_some() {
                self.gone.push(person);
            }
        }
    }

    /// UPDATE-P: a step of one of three lengths, or, for somebody known, a place drawn from the prediction or a step along
    /// a line of sight.
    fn update_position(&mut self, rng: &mut Pcg64Mcg) {
        let which = rng.random_range(0..self.people.len());
        let (kernel, person) = (rng.random::<f64>(), &self.people[which]);
        let mut body = person.body;
        let reversible = self.setting.options.acceptance == Acceptance::ReversibleJump;
        let mut log_proposal_ratio = 0.0;
        match &person.known {
            Some(known) if reversible && kernel < 0.1 => {
                let place = known.place.sample(rng);
                log_proposal_ratio =
                    known.place.log_density(body.x_m, body.y_m) - known.place.log_density(place.x, place.y);
                (body.x_m, body.y_m) = (place.x, place.y);
            }
            Some(known) if kernel < 0.3 => {
                // Along the line of sight of some camera, as seen to the prediction so that there and back are alike.
                let views = self.setting.layers.views();
                let eye = views[rng.random_range(0..views.len())].center.xy().coords;
                let along = known.place.mean() - eye;
                let length: f64 = rng.sample(StandardNormal);
                let step = along / along.norm().max(1e-6) * (length * LINE_OF_SIGHT_STEP_M);
                body.x_m += step.x;
                body.y_m += step.y;
            }
            Some(_) if kernel < 0.35 && self.setting.unexplained.is_some() => {
                // To where foreground is left over: whoever was lost is found again.
                let Some(map) = self.setting.unexplained else { return };
                let place = map.sample(TO_LEFT_OVER, rng);
                log_proposal_ratio = map.density(body.x_m, body.y_m, TO_LEFT_OVER).ln()
                    - map.density(place.x, place.y, TO_LEFT_OVER).ln();
                (body.x_m, body.y_m) = (place.x, place.y);
            }
            _ => {
                let scale = if kernel < 0.5 {
                    1.0 / 3.0
                } else if kernel < 0.85 {
                    1.0
                } else {
                    3.0
                };
                let step = self.setting.options.position_step_m * scale;
                let (dx, dy): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
                body.x_m += step * dx;
                body.y_m += step * dy;
            }
        }
        self.update(which, body, log_proposal_ratio, rng);
    }

    /// UPDATE-S.
    fn update_size(&mut self, rng: &mut Pcg64Mcg) {
        let which = rng.random_range(0..self.people.len());
        let mut body = self.people[which].body;
        let (dr, dh): (f64, f64) = (rng.sample(StandardNormal), rng.sample(StandardNormal));
        body.radius_m += self.setting.options.radius_step_m * dr;
        body.height_m += self.setting.options.height_step_m * dh;
        self.update(which, body, 0.0, rng);
    }

    /// Takes `body` for one of the people, or not.
    fn update(&mut self, which: usize, body: Body, log_proposal_ratio: f64, rng: &mut Pcg64Mcg) {
        let old = self.people[which].body;
        if !is_a_size(&body) {
            return;
        }
        let prior = self.log_prior(which, &body);
        let old_prior = self.log_prior(which, &old);
        if prior <= LOG_IMPOSSIBLE && old_prior > LOG_IMPOSSIBLE {
            return;
        }
        let likelihood = self.likelihood_of(Some(which), Some(&body));
        let log_ratio = likelihood - self.log_likelihood + prior - old_prior
            + self.crowding(&body, Some(which))
            - self.crowding(&old, Some(which))
            + log_proposal_ratio;
        if accepted(log_ratio, rng) {
            self.simulation.commit(Some(&self.people[which].silhouettes), Some(&self.proposed));
            self.log_likelihood = likelihood;
            let person = &mut self.people[which];
            person.body = body;
            std::mem::swap(&mut person.silhouettes, &mut self.proposed);
        }
    }

    /// E of one body, and under reversible jump its motion and size prior.
    fn log_prior(&self, which: usize, body: &Body) -> f64 {
        let (person, floor) = (&self.people[which], self.setting.floor);
        let mut log = if floor.is_standable(body.x_m, body.y_m) { 0.0 } else { LOG_IMPOSSIBLE };
        if self.setting.options.acceptance == Acceptance::ReversibleJump {
            log += match &person.known {
                Some(known) => {
                    known.place.log_density(body.x_m, body.y_m) + log_size(&known.radius, &known.height, body)
                }
                None if self.setting.settling || floor.may_appear(body.x_m, body.y_m) => {
                    log_size(&self.setting.options.radius, &self.setting.options.height, body)
                }
                None => LOG_IMPOSSIBLE,
            };
        }
        log
    }

    /// `log R` of one body against the others, in proportion to `log V`.
    fn crowding(&self, body: &Body, except: Option<usize>) -> f64 {
        let lambda = self.setting.options.repulsion_per_m;
        let others = self.people.iter().enumerate().filter(|(i, _)| Some(*i) != except);
        let log_r: f64 = others.map(|(_, p)| log_separation(body, &p.body, lambda)).sum();
        (self.setting.repulsion_weight * log_r).max(LOG_IMPOSSIBLE)
    }

    /// Draws the proposal (into `proposed`) and works out its `log V`.
    fn likelihood_of(&mut self, old: Option<usize>, new: Option<&Body>) -> f64 {
        if let Some(body) = new {
            for (layer, silhouette) in self.proposed.iter_mut().enumerate() {
                if self.simulation.in_use(layer) {
                    self.setting.layers.draw(layer, body, silhouette);
                }
            }
        }
        let old = old.map(|i| self.people[i].silhouettes.as_slice());
        self.simulation.try_change(old, new.map(|_| self.proposed.as_slice()));
        self.rule_of(self.simulation.tried())
    }

    fn rule_of(&self, counts: impl Iterator<Item = Option<Counts>>) -> f64 {
        let Setting { layers, typical_px, options, .. } = &self.setting;
        let used = counts.enumerate().filter_map(|(i, c)| Some((layers.shape(i), c?, typical_px[i])));
        options.likelihood.log_likelihood(used)
    }
}

pub(super) fn log_size(radius: &Spread, height: &Spread, body: &Body) -> f64 {
    radius.log_density(body.radius_m) + height.log_density(body.height_m)
}

fn is_a_size(body: &Body) -> bool {
    RADII_M.contains(&body.radius_m) && HEIGHTS_M.contains(&body.height_m)
}

/// The Metropolis–Hastings decision.
fn accepted(log_ratio: f64, rng: &mut Pcg64Mcg) -> bool {
    log_ratio >= 0.0 || rng.random::<f64>() < log_ratio.exp()
}
