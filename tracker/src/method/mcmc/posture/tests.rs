//! Tests of postures: what moments show of a person's size, over sitting down and rising.

use approx::assert_relative_eq;
use rand::SeedableRng;

use super::*;

const STEP_S: f64 = 0.25;

fn options() -> McmcOptions {
    McmcOptions { sits_down_per_s: McmcOptions::SITS_DOWN_PER_S, ..McmcOptions::default() }
}

fn body([radius_m, height_m]: [f64; 2]) -> Body {
    Body { x_m: 0.0, y_m: 0.0, radius_m, height_m }
}

/// Moments that show these radii and heights, in a person who stands still.
fn shown(postures: &mut Postures, moments: usize, size: [f64; 2], options: &McmcOptions) {
    for _ in 0..moments {
        postures.predict(STEP_S, 0.0, options);
        let mut states = PostureShares::default();
        states.add(&postures.prior(), &body(size));
        postures.update(&states, 1.0);
    }
}

#[test]
fn who_sits_down_is_as_tall_as_on_the_seat_and_keeps_the_stature() {
    let options = options();
    let mut postures = Postures::of_newcomer([0.25, 1.8], &options);
    shown(&mut postures, 80, [0.25, 1.8], &options);
    let stature_m = postures.size().height.mean_m;
    assert_relative_eq!(stature_m, 1.79, epsilon = 0.02);
    for _ in 0..3 {
        shown(&mut postures, 40, [0.29, 1.38], &options);
        assert_relative_eq!(postures.size().height.mean_m, 1.38, epsilon = 0.04);
        shown(&mut postures, 40, [0.25, 1.8], &options);
        assert_relative_eq!(postures.size().height.mean_m, stature_m, epsilon = 0.02);
    }
}

/// States drawn from the prior, as of somebody whom no camera shows well, change no probability.
#[test]
fn states_without_information_leave_the_probabilities() {
    let options = options();
    let mut postures = Postures::of_newcomer([0.25, 1.75], &options);
    postures.set([0.3, 0.6, 0.1]);
    let prior = postures.prior();
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut states = PostureShares::default();
    for _ in 0..20_000 {
        states.add(&prior, &body(prior.sample(&mut rng)));
    }
    postures.update(&states, 0.2);
    for (found, expected) in postures.probabilities.into_iter().zip([0.3, 0.6, 0.1]) {
        assert_relative_eq!(found, expected, epsilon = 0.01);
    }
}

#[test]
fn people_who_walk_do_not_sit_down() {
    let options = options();
    let mut postures = Postures::of_newcomer([0.25, 1.75], &options);
    let after = |postures: &mut Postures, speed_m_s: f64| {
        postures.predict(60.0, speed_m_s, &options);
        postures.probabilities[STANDING]
    };
    assert!(after(&mut postures.clone(), 1.2) > 0.99);
    // Rates of sitting down and of crouching, a fifth of it, over a minute, from a person who stands.
    let left =
        (-60.0 * McmcOptions::SITS_DOWN_PER_S).exp() + (-12.0 * McmcOptions::SITS_DOWN_PER_S).exp() - 1.0;
    assert_relative_eq!(after(&mut postures, 0.0), left, epsilon = 1e-6);
}
