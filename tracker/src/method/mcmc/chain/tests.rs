//! A proposal that is given up early must be one that would have been refused.

use super::super::tests::{empty_room, masks, standing};
use super::*;
use crate::likelihood::{Rule, pack};
use crate::silhouette::View;
use rand::SeedableRng;

/// A body not far from another, of about a person's size.
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
fn proposals_are_given_up_early_only_where_they_would_be_refused() {
    let stage = empty_room();
    let seen = masks(&stage, &[standing(3.0, 1.6), standing(3.4, 2.0), standing(1.8, 3.5)]);
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    for likelihood in
        [McmcOptions::default().likelihood, Rule::Overlap { exponent: 1.0 }, Rule::Overlap { exponent: 40.0 }]
    {
        let options = McmcOptions { likelihood, ..McmcOptions::default() };
        let views: Vec<View> = stage.cameras.iter().map(View::new).collect();
        let packed: Vec<_> =
            seen.iter().zip(&views).map(|(frame, view)| frame.mask.as_ref().map(|m| pack(m, view))).collect();
        let layers = Layers::new(views, likelihood.shapes());
        let births = BirthMap::new(&layers, &standing(0.0, 0.0), stage.floor.bounds(), |_, _| true);
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
            births: &births,
            unexplained: None,
            settling: true,
            typical_px: &births.typical_px(&layers),
            repulsion_weight: 1.0,
            log_birth_density: 0.0,
        };
        let mut next_key = 3;
        let mut chain = Chain::new(setting, &mut simulation, people, &mut next_key);
        let (mut taken, mut refused, mut given_up) = (0, 0, 0);
        for _ in 0..3000 {
            let which = rng.random_range(0..at.len());
            let (old, new) = match rng.random_range(0..4) {
                0 => (None, Some(near(&at[which], 2.0, &mut rng))),
                1 => (Some(which), None),
                _ => (Some(which), Some(near(&at[which], 0.3, &mut rng))),
            };
            let whole = chain.likelihood_of(old, new.as_ref(), f64::NEG_INFINITY).unwrap();
            // Makes up for V, so that some are taken and some refused.
            let log_ratio = chain.log_likelihood - whole + rng.random_range(-4.0..1.0);
            let mut other = rng.clone();
            let wanted = accepted(whole - chain.log_likelihood + log_ratio, &mut other).then_some(whole);
            // So little may be missing, or so much.
            for least in [whole - 1e-9, whole - 1.0, whole - 30.0] {
                assert_eq!(chain.likelihood_of(old, new.as_ref(), least), Some(whole), "{old:?} {new:?}");
            }
            let present = chain.log_likelihood;
            given_up += u32::from(chain.likelihood_of(old, new.as_ref(), present).is_none());
            assert_eq!(chain.decide(old, new.as_ref(), log_ratio, &mut rng), wanted, "{old:?} {new:?}");
            assert_eq!(rng, other, "the next number drawn is another");
            *(if wanted.is_some() { &mut taken } else { &mut refused }) += 1;
        }
        assert!(taken > 500 && refused > 500, "{likelihood:?}: {taken} taken, {refused} refused");
        assert!(given_up > 200, "{likelihood:?}: {given_up} given up");
    }
}
