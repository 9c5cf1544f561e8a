//! Centralised variant (Nakazawa et al., section 4.2.1 B): all stations' measurements of a target are fused in every
//! frame, and every station searches around the fused place in the next one.

use nalgebra::{Point2, Vector2, vector};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use super::judge::{Fates, PlaceJudge};
use super::{CLOSE_M, World};

/// Gains α and β of the filter of a centre that predicts.
const GAINS: [f64; 2] = [0.6, 0.15];
/// Purpose of the generator of noise and lost packets.
const PURPOSE: u64 = 1 << 33;

/// Choices that the paper leaves to the centralised variant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CentralisedOptions {
    /// Largest difference of attribute at a crossing. A station measures the person with the most similar attribute,
    /// and skips the frame when the difference is larger.
    pub attribute_limit: f64,
    /// Whether a filter's prediction is fed back instead of the fused place.
    pub predicts: bool,
    /// Time after which an unmeasured target is given up, seconds.
    pub coast_s: f64,
}

impl CentralisedOptions {
    /// Options as published: the limit is the attribute's own noise.
    pub fn published() -> Self {
        Self { attribute_limit: 0.15, predicts: false, coast_s: 0.0 }
    }

    /// All variants among which the best is searched.
    pub fn variants() -> Vec<Self> {
        let limits = [0.15, 0.2, 0.3, 0.45];
        let feedback = [(false, 0.0), (false, 1.0), (true, 1.0)];
        limits
            .iter()
            .flat_map(|limit| feedback.map(|f| (*limit, f)))
            .map(|(attribute_limit, (predicts, coast_s))| Self { attribute_limit, predicts, coast_s })
            .collect()
    }
}

/// State of one target at the centre.
#[derive(Clone, Copy)]
struct Target {
    place: Point2<f64>,
    velocity: Vector2<f64>,
    /// Number of frames since the last measurement.
    missed: u32,
    is_followed: bool,
}

/// Measurement of a target by one station, metres; `None` when no person near the target is accepted. The measured
/// person may be another than the target.
fn measure(
    world: &World,
    frame: usize,
    station: usize,
    person: usize,
    centre: Point2<f64>,
    options: &CentralisedOptions,
    noise: &[[f64; 3]],
) -> Option<Point2<f64>> {
    let places = world.places(frame);
    let near: Vec<usize> = (0..places.len())
        .filter(|p| (places[*p] - centre).norm() < CLOSE_M && world.site.sees(station, places[*p]))
        .collect();
    let limits = &world.options.noise;
    let factor = if near.len() > 1 { limits.close_factor } else { 1.0 };
    let difference = |p: usize| {
        let seen = world.attributes[p] + factor * limits.attribute * noise[p][2];
        (seen - world.attributes[person]).abs()
    };
    let best = near.iter().copied().min_by(|a, b| difference(*a).total_cmp(&difference(*b)))?;
    if near.len() > 1 && difference(best) > options.attribute_limit {
        return None;
    }
    let sight = (places[best] - world.site.stations[station].position).normalize();
    let aside = vector![-sight.y, sight.x];
    let error = sight * noise[best][0] * limits.along_m + aside * noise[best][1] * limits.across_m;
    Some(places[best] + error * factor)
}

/// Runs a trial of the centralised variant. `watch` receives each frame and the fused place of each person, metres;
/// `None` once the target has been given up.
pub fn run_centralised(
    world: &World,
    options: &CentralisedOptions,
    mut watch: impl FnMut(usize, &[Option<Point2<f64>>]),
) -> Fates {
    let count = world.options.people;
    let dt = 1.0 / world.options.rate_hz;
    let begin = |place: &Point2<f64>| Target {
        place: *place,
        velocity: Vector2::zeros(),
        missed: 0,
        is_followed: true,
    };
    let mut targets: Vec<Target> = world.places(0).iter().map(begin).collect();
    let mut rng = world.random(PURPOSE);
    let mut judge = PlaceJudge::new(count);
    for frame in 0..world.frames() {
        let stations: Vec<Station> =
            (0..world.options.stations).map(|_| Station::draw(world, &mut rng)).collect();
        for (person, target) in targets.iter_mut().enumerate().filter(|(_, t)| t.is_followed) {
            let predicted = target.place + target.velocity * dt;
            let taken = stations.iter().enumerate().filter(|(_, s)| !s.is_lost).filter_map(|(s, station)| {
                measure(world, frame, s, person, predicted, options, &station.noise)
            });
            match super::judge::mean(taken) {
                Some(fused) if options.predicts => {
                    let residual = fused - predicted;
                    target.place = predicted + residual * GAINS[0];
                    target.velocity += residual * (GAINS[1] / dt);
                    target.missed = 0;
                }
                Some(fused) => (target.place, target.missed) = (fused, 0),
                None => target.missed += 1,
            }
            target.is_followed = f64::from(target.missed) <= options.coast_s * world.options.rate_hz;
        }
        let places: Vec<_> = targets.iter().map(|t| t.is_followed.then_some(t.place)).collect();
        judge.watch(world, frame, |person| places[person]);
        watch(frame, &places);
    }
    judge.fates()
}

/// Random draws of one station for one frame.
struct Station {
    is_lost: bool,
    /// Unit noise for each person: along and across the line of sight, and of the attribute.
    noise: Vec<[f64; 3]>,
}

impl Station {
    fn draw(world: &World, rng: &mut Pcg64Mcg) -> Self {
        let is_lost = world.options.loss > 0.0 && rng.random_bool(world.options.loss);
        let mut unit = || rng.random_range(-1.0..1.0);
        let noise = (0..world.options.people).map(|_| [unit(), unit(), unit()]).collect();
        Self { is_lost, noise }
    }
}
