//! One moment's chain: where people may be born, how many steps it gets, and the tally of its kept states.

use super::Mcmc;
use super::appearance::{self, Appearance, Opening};
use super::births::BirthMap;
use super::chain::{Chain, Setting};
use super::person::Person;
use super::posture::SizePrior;
use super::tally::Tally;
use crate::likelihood::Counts;
use crate::likelihood::prior::LOG_IMPOSSIBLE;

/// Factor of the burn-in steps while people who were inside already are being found.
pub(super) const SETTLING_STEPS: u32 = 5;
/// Upper bound of the factor by which a moment's steps are increased: after a long gap people have moved too far for
/// any search to find them by their prediction.
const MAX_STEP_FACTOR: f64 = 12.0;
/// Unexplained foreground in some camera, as a fraction of a typical silhouette, above which a person may be where
/// they were not expected.
const LEFT_OVER: f64 = 0.3;
/// Upper bound of the time over which births are expected in one step, seconds.
const LONGEST_BIRTHS_S: f64 = 10.0;

impl Mcmc {
    /// Factor of this moment's steps, 1 to [`MAX_STEP_FACTOR`]. It grows with the time step, since the chain then has
    /// to search farther (at no more cost a second than at a high frame rate), and by `surprise` where foreground is
    /// left over, since a person is then not where they were predicted.
    fn step_factor(&self, dt_s: f64, is_left_over: bool) -> f64 {
        let unexplained_factor = if is_left_over { self.options.surprise } else { 1.0 };
        ((dt_s / self.options.steps_for_s).max(1.0) * unexplained_factor).min(MAX_STEP_FACTOR)
    }

    /// Weights the birth maps by the foreground that the predicted people leave unexplained. Returns the area open to
    /// rescue, m².
    fn weigh_births(&mut self, people: &[Person], settling: bool, is_left_over: bool) -> f64 {
        if !self.simulation.sees_anything() {
            let maps = [
                &mut self.anywhere,
                &mut self.zones,
                &mut self.company,
                &mut self.rescued,
                &mut self.expected,
            ];
            maps.into_iter().for_each(BirthMap::forget);
            self.expected_at.clear();
            return 0.0;
        }
        let (prepared, layers, typical_px) = (self.rule, &self.layers, &self.typical_px);
        let worth = |camera: usize, [simulated, both]: [u32; 2]| {
            let counts = Counts {
                foreground: i64::from(both.max(1)),
                simulated: i64::from(simulated),
                both: i64::from(both),
            };
            let shapes = layers.innermost(camera)..=layers.outermost(camera);
            prepared.log_likelihood(shapes.map(|layer| (layers.shape(layer), counts, typical_px[layer])))
        };
        self.left_over.restart(layers, &self.simulation, people);
        if settling || is_left_over {
            self.anywhere.weigh(&self.left_over, worth);
        }
        if !settling {
            self.zones.weigh(&self.left_over, worth);
        }
        self.company.forget();
        self.rescued.forget();
        self.expected.forget();
        let expected_at = std::mem::take(&mut self.expected_at);
        // Without zones people are born anywhere anyway.
        if settling || self.stage.zones.is_empty() || !is_left_over {
            return 0.0;
        }
        if self.options.companions_per_s > 0.0 {
            let seen = self.tracks.iter().filter(|t| t.in_sight && !t.is_tentative());
            let places: Vec<_> = seen.map(|t| t.motion.silhouette_place()).collect();
            self.company.weigh_near(&places, appearance::COMPANY_M, &self.left_over, worth);
        }
        if !expected_at.is_empty() {
            self.expected.weigh_near(&expected_at, appearance::EXPECTED_M, &self.left_over, worth);
        }
        if !self.rescue.is_open_anywhere() {
            return 0.0;
        }
        let (rescue, map) = (&self.rescue, &self.anywhere);
        let is_open: Vec<bool> = (0..map.len()).map(|cell| rescue.is_open(map, cell)).collect();
        self.rescued.weigh_open(&is_open, &self.left_over, worth);
        map.cell_area_m2() * is_open.iter().filter(|is_open| **is_open).count() as f64
    }

    /// Runs the chain of one moment and returns the tally of its kept states.
    pub(super) fn sample(&mut self, mut people: Vec<Person>, dt_s: f64, settling: bool) -> Tally {
        let hotspots = self.fit_people_to_boxes(&mut people);
        let alone = self.observes_boxes_alone();
        let (rule, typical_px, layers) = (self.options.likelihood, &self.typical_px, &self.layers);
        // Only the outermost shape counts: it leaves the least foreground unexplained.
        let left_over = self
            .simulation
            .counts()
            .zip(typical_px)
            .enumerate()
            .filter(|(layer, _)| layers.shape(*layer) + 1 == layers.shapes().len())
            .filter_map(|(_, (counts, px))| counts.map(|c| (c.foreground - c.both) as f64 / px))
            .fold(0.0, f64::max);
        let is_left_over = left_over > LEFT_OVER;
        let open_m2 = self.weigh_births(&people, settling, is_left_over);
        let births = if settling { &self.anywhere } else { &self.zones };
        let unexplained = (is_left_over && self.anywhere.is_weighed()).then_some(&self.anywhere);
        // The likelihood of boxes models false boxes; that of masks does not model stray pieces of foreground.
        let chance = if alone { 0.0 } else { rule.worth_of(self.options.birth_evidence) };
        let births_s = dt_s.min(LONGEST_BIRTHS_S);
        let expected = |per_s: f64| per_s * births_s;
        let openings = [
            Opening { map: &self.expected, log_density: appearance::log_expected_density(chance) },
            Opening {
                map: &self.rescued,
                log_density: appearance::log_rescue_density(
                    expected(self.options.rescues_per_s),
                    open_m2,
                    chance,
                ),
            },
            Opening {
                map: &self.company,
                log_density: appearance::log_company_density(expected(self.options.companions_per_s), chance),
            },
        ];
        let appearance = Appearance {
            floor: &self.stage.floor,
            anywhere: settling,
            births,
            informed: self.options.informed_births,
            log_density: (expected(self.options.births_per_s) / births.area_m2().max(1e-3)).ln() - chance,
            openings,
            log_elsewhere: if self.boxes.is_in_use() {
                (expected(self.options.rescues_per_s) / self.anywhere.area_m2().max(1e-3)).ln() - chance
            } else {
                LOG_IMPOSSIBLE
            },
            hotspots: &hotspots,
        };
        let setting = Setting {
            floor: &self.stage.floor,
            layers: &self.layers,
            options: &self.options,
            rule: self.rule,
            appearance,
            newcomers: SizePrior::of_newcomers(&self.options),
            unexplained,
            typical_px: &self.typical_px,
            repulsion_per_m: self.options.repulsion_per_m,
            repulsion_weight: if alone {
                self.options.boxes.repulsion_weight
            } else {
                rule.worth_of(0.5).max(1.0)
            },
            apart_m: if alone { self.options.boxes.apart_m } else { 2.0 * self.options.radius.mean_m },
        };
        let [burn_in, kept] = if alone {
            self.steps_by_boxes(people.len(), hotspots.len(), settling)
        } else {
            let step_factor = self.step_factor(dt_s, is_left_over);
            let steps = |least: u32| {
                let least = least.max(self.options.steps_per_person.saturating_mul(people.len() as u32));
                (f64::from(least) * step_factor).round() as u32
            };
            let settling_steps =
                if settling { SETTLING_STEPS.saturating_mul(self.options.burn_in_steps) } else { 0 };
            [steps(self.options.burn_in_steps).max(settling_steps), steps(self.options.kept_steps)]
        };
        let factors = (&mut self.simulation, &mut self.boxes);
        let mut chain = Chain::new(setting, factors, people, &mut self.next_key);
        for _ in 0..burn_in {
            chain.step(&mut self.rng);
        }
        let mut tally = Tally::default();
        for kept in 0..kept {
            chain.step(&mut self.rng);
            tally.add(&chain.people);
            if alone && (kept as usize).is_multiple_of(chain.people.len().max(1)) {
                tally.compare(chain.log_density(), &chain.people);
            }
        }
        tally
    }
}
