//! Search for heads over an area of the floor: hypotheses throughout its volume, the best of which are followed to
//! their peaks.

use nalgebra::{Point2, Vector3};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use scenes::polygon::Polygon;

use super::climb::{CLIMB_SIGMA_M, climb};
use super::exclusion::APART_M;
use super::filter::HeadFilter;
use super::options::CondensationOptions;
use super::shoulder;
use super::step_times::StepTimes;
use super::weight::{ExpectedHead, WeighingInput};
use crate::prepared_room::Floor;

/// Hypotheses for each square metre of an area: about one in 17 cm cubed over one metre of height.
const PER_M2: f64 = 150.0;
/// Least and largest number of hypotheses.
const LEAST: usize = 150;
const MOST: usize = 4000;
/// Largest number of promising places that are followed to their peaks, in an area and moment.
const MOST_CLIMBS: usize = 6;
/// Largest number of steps upwards: from an arm to a shoulder to a head.
const MOST_RISES: usize = 2;
/// Share of a birth's support that a promising place needs.
const PROMISING: f32 = 0.6;

/// An area with its hypotheses.
#[derive(Debug, Clone)]
pub struct HeadSearch {
    area: Polygon,
    filter: HeadFilter,
}

/// Criteria of a new head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Least and largest height of a head's centre, metres.
    pub height_m: [f64; 2],
    /// Least support.
    pub born_at: f32,
}

impl Criteria {
    /// Criteria of the options.
    pub fn new(options: &CondensationOptions) -> Self {
        let life = &options.life;
        Self { height_m: [life.lowest_born_m, life.highest_m], born_at: life.born_at as f32 }
    }
}

impl HeadSearch {
    /// Search over this area.
    pub fn over(area: Polygon, rng: &mut Pcg64Mcg) -> Self {
        let count = ((PER_M2 * area.area()) as usize).clamp(LEAST, MOST);
        Self { area, filter: HeadFilter::around(&Vector3::zeros(), &Vector3::zeros(), count, rng) }
    }

    /// Moves the search to another area, with the same number of hypotheses.
    pub fn move_to(&mut self, area: Polygon) {
        self.area = area;
    }

    /// Adds the heads found at this moment to `found`: none nearer than [`APART_M`] to another, or to a tracked one.
    pub fn heads(
        &mut self,
        criteria: &Criteria,
        floor: &Floor,
        input: &WeighingInput<'_>,
        found: &mut Vec<ExpectedHead>,
        rng: &mut Pcg64Mcg,
    ) {
        // Not part of the paper's table 2.
        let mut times = StepTimes::default();
        let [lowest_m, highest_m] = criteria.height_m;
        self.spread(lowest_m, highest_m, rng);
        self.filter.weigh(input, &mut times);
        self.keep(|s| floor.is_standable(s.x, s.y));
        for known in input.everybody.iter().chain(&*found) {
            self.keep(|s| (known.head - s).xy().norm() > APART_M);
        }
        for _ in 0..MOST_CLIMBS {
            let Some(start) = self.filter.heaviest() else { break };
            self.keep(|s| (start - s).xy().norm() > APART_M);
            let Some((mut head, mut support)) = climb(&start, PROMISING * criteria.born_at, input, rng)
            else {
                continue;
            };
            for _ in 0..MOST_RISES {
                let Some(above) = shoulder::head_above(&head, &support, input, rng) else { break };
                (head, support) = above;
            }
            let mut others = input.everybody.iter().chain(&*found);
            let is_head = support.all >= criteria.born_at
                && !support.is_doubtful()
                && (lowest_m..=highest_m).contains(&head.z)
                && floor.is_standable(head.x, head.y)
                && others.all(|o| (o.head - head).xy().norm() > APART_M);
            if is_head {
                self.keep(|s| (head - s).xy().norm() > APART_M);
                found.push(ExpectedHead { head, trust: support.all });
            }
        }
    }

    /// Keeps half of the hypotheses, and spreads the other half over the volume.
    fn spread(&mut self, lowest_m: f64, highest_m: f64, rng: &mut Pcg64Mcg) {
        self.filter.redraw(self.filter.hypotheses.len(), &Vector3::repeat(CLIMB_SIGMA_M[0]), rng);
        for (i, s) in self.filter.hypotheses.iter_mut().enumerate() {
            if i % 2 == 0 || !self.area.contains(&Point2::new(s.x, s.y)) {
                let place: Point2<f64> = self.area.sample(rng);
                *s = Vector3::new(place.x, place.y, rng.random_range(lowest_m..highest_m));
            }
        }
    }

    /// Sets the weights of all other hypotheses to 0.
    fn keep(&mut self, is_kept: impl Fn(&Vector3<f64>) -> bool) {
        for (s, weight) in self.filter.hypotheses.iter().zip(&mut self.filter.weights) {
            if *weight > 0.0 && !is_kept(s) {
                *weight = 0.0;
            }
        }
    }
}
