//! Tests of the chain: a proposal is abandoned early only if it would have been rejected; and without observations,
//! the states are samples of the prior, whatever is proposed.

use super::super::appearance::{COMPANY_M, Opening};
use super::super::boxes::Hotspots;
use super::super::left_over::LeftOver;
use super::super::options::Spread;
use super::super::person::{Gaussian, Known, Place};
use super::super::posture::Size;
use super::super::tests::{empty_room, masks, standing};
use super::super::vector_places::VectorPlaces;
use super::*;
use crate::likelihood::{LikelihoodRule, pack};
use crate::prepared_room::PreparedRoom;
use crate::silhouette::View;
use nalgebra::{Matrix2, Vector2};
use rand::SeedableRng;
use rand_distr::{Distribution, Poisson};

/// Birth model in which people appear anywhere on the floor.
fn on_all_the_floor<'a>(
    stage: &'a PreparedRoom,
    births: &'a BirthMap,
    options: &McmcOptions,
    log_density: f64,
    hotspots: &'a Hotspots,
) -> Appearance<'a> {
    Appearance {
        floor: &stage.floor,
        anywhere: true,
        births,
        informed: options.informed_births,
        log_density,
        openings: [Opening { map: births, log_density: LOG_IMPOSSIBLE }; 3],
        log_elsewhere: LOG_IMPOSSIBLE,
        hotspots,
    }
}

/// Random body within `reach_m` metres of another, of about a person's size.
fn near(body: &Body, reach_m: f64, rng: &mut Pcg64Mcg) -> Body {
    let mut off = |reach: f64| rng.random_range(-reach..reach);
    Body {
        x_m: body.x_m + off(reach_m),
        y_m: body.y_m + off(reach_m),
        radius_m: body.radius_m + off(0.05),
        height_m: body.height_m + off(0.1),
    }
}

#[test]
fn proposals_are_abandoned_early_only_if_they_would_be_rejected() {
    let stage = empty_room();
    let seen = masks(&stage, &[standing(3.0, 1.6), standing(3.4, 2.0), standing(1.8, 3.5)]);
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    for likelihood in [
        McmcOptions::default().likelihood,
        LikelihoodRule::Overlap { exponent: 1.0 },
        LikelihoodRule::Overlap { exponent: 40.0 },
    ] {
        let options = McmcOptions { likelihood, ..McmcOptions::default() };
        let views: Vec<View> = stage.cameras.iter().map(View::new).collect();
        let packed: Vec<_> =
            seen.iter().zip(&views).map(|(frame, view)| frame.mask.as_ref().map(|m| pack(m, view))).collect();
        let layers = Layers::new(views, likelihood.shapes());
        let births = BirthMap::new(&layers, &standing(0.0, 0.0), stage.floor.bounds(), |_, _| true);
        let hotspots = Hotspots::default();
        let mut simulation = Simulation::new(&layers);
        simulation.restart(&packed);
        let at = [standing(3.1, 1.6), standing(3.4, 2.1), standing(1.9, 3.6)];
        let people: Vec<Person> = at
            .into_iter()
            .zip(0..)
            .map(|(body, key)| {
                let silhouettes = layers.silhouettes(&body, |_| true);
                Person { key, body, silhouettes, at_exit: false, known: None, tentative: true }
            })
            .collect();
        for person in &people {
            simulation.insert(&person.silhouettes);
        }
        let setting = Setting {
            floor: &stage.floor,
            layers: &layers,
            options: &options,
            rule: likelihood.prepared(),
            appearance: on_all_the_floor(&stage, &births, &options, 0.0, &hotspots),
            newcomers: SizePrior::of_newcomers(&options),
            unexplained: None,
            typical_px: &births.typical_px(&layers),
            repulsion_weight: 1.0,
            repulsion_per_m: options.repulsion_per_m,
            apart_m: 2.0 * options.radius.mean_m,
        };
        let (mut next_key, mut boxes) = (3, Boxes::new(&stage));
        let mut chain = Chain::new(setting, (&mut simulation, &mut boxes), people, &mut next_key);
        let (mut taken, mut refused, mut abandoned) = (0, 0, 0);
        for _ in 0..3000 {
            let which = rng.random_range(0..at.len());
            let (old, new) = match rng.random_range(0..4) {
                0 => (None, Some(near(&at[which], 2.0, &mut rng))),
                1 => (Some(which), None),
                _ => (Some(which), Some(near(&at[which], 0.3, &mut rng))),
            };
            let whole = chain.likelihood_of(old, new.as_ref(), f64::NEG_INFINITY).unwrap();
            // Compensates V, so that some proposals are accepted and some rejected.
            let log_ratio = chain.log_likelihood - whole + rng.random_range(-4.0..1.0);
            let mut other = rng.clone();
            let wanted = accepted(whole - chain.log_likelihood + log_ratio, &mut other).then_some(whole);
            // Distance of the bound from the likelihood, nats.
            for least in [whole - 1e-9, whole - 1.0, whole - 30.0] {
                assert_eq!(chain.likelihood_of(old, new.as_ref(), least), Some(whole), "{old:?} {new:?}");
            }
            let present = chain.log_likelihood;
            abandoned += u32::from(chain.likelihood_of(old, new.as_ref(), present).is_none());
            assert_eq!(chain.decide(old, new.as_ref(), log_ratio, &mut rng), wanted, "{old:?} {new:?}");
            assert_eq!(rng, other, "the next number drawn is another");
            *(if wanted.is_some() { &mut taken } else { &mut refused }) += 1;
        }
        assert!(taken > 500 && refused > 500, "{likelihood:?}: {taken} taken, {refused} refused");
        assert!(abandoned > 200, "{likelihood:?}: {abandoned} abandoned");
    }
}

/// Statistics of a state: whether it has 0, 1 or 2 people; presence, x and height of the known person; sums over the
/// people born in this moment of radius, x and two indicators of the place.
fn statistics(people: &[(Body, bool)]) -> [f64; 10] {
    let of = |is_new: bool| people.iter().filter(move |p| p.1 == is_new).map(|p| p.0);
    let is = |truth: bool| f64::from(u8::from(truth));
    let n = people.len();
    [
        is(n == 0),
        is(n == 1),
        is(n == 2),
        is(of(false).count() == 1),
        of(false).map(|b| b.x_m).sum(),
        of(false).map(|b| b.height_m).sum(),
        of(true).map(|b| b.radius_m).sum(),
        of(true).map(|b| b.x_m).sum(),
        of(true).map(|b| is(b.y_m > 2.5)).sum(),
        of(true).map(|b| is(b.x_m < 4.0)).sum(),
    ]
}

/// Means of the statistics of many states, and their standard deviations by batches, within which neighbouring states
/// may be correlated.
fn means(states: &[[f64; 10]]) -> [(f64, f64); 10] {
    const BATCHES: usize = 100;
    std::array::from_fn(|i| {
        let mean = |part: &[[f64; 10]]| part.iter().map(|t| t[i]).sum::<f64>() / part.len() as f64;
        let all = mean(states);
        let batches = states.chunks_exact(states.len() / BATCHES);
        let spread = batches.map(|batch| (mean(batch) - all).powi(2)).sum::<f64>() / BATCHES as f64;
        (all, (spread / BATCHES as f64).sqrt())
    })
}

/// Statistics of states of the prior, drawn by rejection: births are a Poisson process, thinned to the expected
/// density; states with an overlap or too many people are rejected.
fn drawn_by_rejection(
    stage: &PreparedRoom,
    options: &McmcOptions,
    known: &Known,
    (most_per_m2, expected_per_m2): (f64, impl Fn(f64, f64) -> f64),
    rng: &mut Pcg64Mcg,
) -> Vec<[f64; 10]> {
    let (low, high) = stage.floor.bounds();
    let born = Poisson::new(most_per_m2 * (high.x - low.x) * (high.y - low.y)).unwrap();
    let there = 1.0 / (1.0 + (-known.log_odds).exp());
    let newcomers = SizePrior::of_newcomers(options);
    let mut drawn = Vec::new();
    while drawn.len() < 300_000 {
        let mut people: Vec<(Body, bool)> = Vec::new();
        for _ in 0..born.sample(rng) as u32 {
            let (x_m, y_m) = (rng.random_range(low.x..high.x), rng.random_range(low.y..high.y));
            let [radius_m, height_m] = newcomers.sample(rng);
            let body = Body { x_m, y_m, radius_m, height_m };
            let is_born = rng.random::<f64>() * most_per_m2 < expected_per_m2(body.x_m, body.y_m);
            if is_born && stage.floor.is_standable(body.x_m, body.y_m) {
                people.push((body, true));
            }
        }
        if rng.random::<f64>() < there {
            let at = known.place.sample(rng);
            let [radius_m, height_m] = known.size.sample(rng);
            people.push((Body { x_m: at.x, y_m: at.y, radius_m, height_m }, false));
        }
        let apart = (0..people.len()).all(|i| {
            (0..i).all(|j| people[i].0.floor_distance_m(&people[j].0) >= 2.0 * options.radius.mean_m)
        });
        if people.len() <= options.max_people && apart && people.iter().all(|p| is_a_size(&p.0)) {
            drawn.push(statistics(&people));
        }
    }
    drawn
}

/// Prior of a person's size with three modes.
fn three_postures() -> SizePrior {
    let mode = |radius_m: f64, height_m: f64| Size {
        radius: Spread { mean_m: radius_m, sigma_m: 0.03 },
        height: Spread { mean_m: height_m, sigma_m: 0.05 },
    };
    SizePrior::new([0.6, 0.3, 0.1], [mode(0.3, 1.6), mode(0.35, 1.25), mode(0.32, 1.0)])
}

#[test]
fn without_masks_the_states_sample_the_prior() {
    assert_states_sample_the_prior(true, [0.03; 3], None, 600_000);
}

/// People appear through the door, and at a higher density at persistent evidence and close to followed people.
#[test]
fn without_masks_births_in_openings_are_as_frequent_as_expected() {
    assert_states_sample_the_prior(false, [0.3, 0.6, 1.0], None, 2_000_000);
}

/// Moves for a detector's boxes, without any boxes: people also appear everywhere else, are proposed at hotspots, and
/// exchange identities.
#[test]
fn without_boxes_the_states_sample_the_prior() {
    // Narrow hotspots mix slowly, so that the means need more steps.
    assert_states_sample_the_prior(false, [0.3, 0.6, 1.0], Some(0.05), 4_000_000);
}

/// Compares the chain's states with the prior, for these densities of births (1/m²): in zones or anywhere, at
/// persistent evidence, close to followed people; and everywhere else, where boxes are observed.
fn assert_states_sample_the_prior(
    anywhere: bool,
    [per_m2, rescued_per_m2, of_company_per_m2]: [f64; 3],
    elsewhere_per_m2: Option<f64>,
    steps: u32,
) {
    let stage = empty_room();
    let options = McmcOptions { repulsion_per_m: f64::INFINITY, max_people: 3, ..McmcOptions::default() };
    let layers = Layers::new(stage.cameras.iter().map(View::new).collect(), options.likelihood.shapes());
    let (low, high) = stage.floor.bounds();
    let standable = |x: f64, y: f64| stage.floor.is_standable(x, y);
    let mut everywhere = BirthMap::new(&layers, &standing(0.0, 0.0), (low, high), standable);
    let may_appear = |x: f64, y: f64| anywhere || stage.floor.may_appear(x, y);
    let mut births =
        BirthMap::new(&layers, &standing(0.0, 0.0), (low, high), |x, y| standable(x, y) && may_appear(x, y));
    let (mut company, mut rescued) = (everywhere.clone(), everywhere.clone());
    // Weights by a moment with a person in it, so that ADD and the jumps prefer some places.
    let mut simulation = Simulation::new(&layers);
    let seen = masks(&stage, &[standing(2.0, 1.5)]);
    let packed =
        seen.iter().zip(layers.views()).map(|(frame, view)| frame.mask.as_ref().map(|m| pack(m, view)));
    simulation.restart(&packed.collect::<Vec<_>>());
    let mut left_over = LeftOver::default();
    left_over.restart(&layers, &simulation, &[]);
    let explained = |_: usize, [_, found]: [u32; 2]| f64::from(found);
    everywhere.weigh(&left_over, explained);
    births.weigh(&left_over, explained);
    company.weigh_near(&[Vector2::new(2.6, 1.8)], COMPANY_M, &left_over, explained);
    let mut unopened = company.clone();
    unopened.forget();
    // One of the openings overlaps the other.
    let is_open: Vec<bool> = (0..rescued.len()).map(|cell| cell % 3 == 0).collect();
    rescued.weigh_open(&is_open, &left_over, explained);
    assert!(everywhere.is_weighed() && company.is_weighed() && rescued.is_weighed());
    simulation.restart(&[None, None]);
    let expected_per_m2 = |x: f64, y: f64| {
        if may_appear(x, y) {
            per_m2
        } else if rescued.density(x, y, 1.0) > 0.0 {
            rescued_per_m2
        } else if company.density(x, y, 1.0) > 0.0 {
            of_company_per_m2
        } else {
            elsewhere_per_m2.unwrap_or(0.0)
        }
    };

    let log_odds = 0.4_f64;
    let place = Place::new(Vector2::new(3.0, 2.0), &(Matrix2::identity() * 0.04), 0.35);
    let known = Known {
        place: place.clone(),
        size: three_postures(),
        log_odds,
        fit: elsewhere_per_m2.map(|_| Gaussian::new(Vector2::new(3.1, 2.1), &(Matrix2::identity() * 0.02))),
        vectors: VectorPlaces::default(),
    };
    let person = Person {
        key: 0,
        body: Body { x_m: 3.0, y_m: 2.0, radius_m: 0.3, height_m: 1.6 },
        silhouettes: layers.silhouettes(&standing(3.0, 2.0), |_| false),
        at_exit: false,
        known: Some(known.clone()),
        tentative: true,
    };
    simulation.insert(&person.silhouettes);
    let hotspots = match elsewhere_per_m2 {
        Some(_) => Hotspots::at(&[(2.0, 1.5), (3.2, 2.4), (4.5, 3.0)]),
        None => Hotspots::default(),
    };
    let setting = Setting {
        floor: &stage.floor,
        layers: &layers,
        options: &options,
        rule: options.likelihood.prepared(),
        appearance: Appearance {
            floor: &stage.floor,
            anywhere,
            births: &births,
            informed: options.informed_births,
            log_density: per_m2.ln(),
            openings: [(&unopened, 1.0), (&rescued, rescued_per_m2), (&company, of_company_per_m2)]
                .map(|(map, per_m2)| Opening { map, log_density: per_m2.ln() }),
            log_elsewhere: elsewhere_per_m2.map_or(LOG_IMPOSSIBLE, f64::ln),
            hotspots: &hotspots,
        },
        newcomers: SizePrior::of_newcomers(&options),
        unexplained: Some(&everywhere),
        typical_px: &everywhere.typical_px(&layers),
        repulsion_weight: 1.0,
        repulsion_per_m: options.repulsion_per_m,
        apart_m: 2.0 * options.radius.mean_m,
    };
    let (mut next_key, mut rng) = (1, Pcg64Mcg::seed_from_u64(4));
    let mut boxes = Boxes::new(&stage);
    if elsewhere_per_m2.is_some() {
        boxes.blind();
        boxes.restart(stage.cameras.iter().map(|_| Some(&[][..])));
        boxes.insert(&person.body);
    }
    let mut chain = Chain::new(setting, (&mut simulation, &mut boxes), vec![person], &mut next_key);
    let sampled: Vec<_> = (0..steps)
        .map(|_| {
            chain.step(&mut rng);
            statistics(&chain.people.iter().map(|p| (p.body, p.is_new())).collect::<Vec<_>>())
        })
        .collect();

    let most_per_m2 = per_m2.max(rescued_per_m2).max(of_company_per_m2).max(elsewhere_per_m2.unwrap_or(0.0));
    let drawn = drawn_by_rejection(&stage, &options, &known, (most_per_m2, expected_per_m2), &mut rng);
    assert_means_agree(&sampled, &drawn);
}

/// Compares the means of the chain's states with those drawn by rejection, within four of their standard deviations.
fn assert_means_agree(sampled: &[[f64; 10]], drawn: &[[f64; 10]]) {
    for (i, ((found, off), (expected, by))) in means(sampled).into_iter().zip(means(drawn)).enumerate() {
        assert!(
            (found - expected).abs() < 4.0 * off.hypot(by),
            "{i}: {found} ± {off}, not {expected} ± {by}"
        );
        assert!(off < 0.03 * expected.max(0.3), "{i}: {off} tells little");
    }
}
