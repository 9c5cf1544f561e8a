//! Tests of boxes: incremental updates equal a fresh computation, and fits and hotspots find the people.

use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::super::options::McmcOptions;
use super::super::person::{Known, Place};
use super::super::posture::{Size, SizePrior};
use super::super::tests::{empty_room, standing};
use super::super::vector_places::VectorPlaces;
use super::*;

/// Boxes of a perfect detector around these people, without those of the pairs (camera, person) in `skipping`.
fn detected(stage: &PreparedRoom, people: &[Body], skipping: &[(usize, usize)]) -> Vec<Vec<PersonBox>> {
    let boxes_of = |camera: usize| {
        let of_boxes = BoxCamera::new(&stage.cameras[camera]);
        let seen = (0..people.len()).filter(|person| !skipping.contains(&(camera, *person)));
        seen.filter_map(|person| of_boxes.expected(&people[person]))
            .filter(|expected| of_boxes.outside(expected) == 0)
            .map(|expected| {
                let [left, top, right, bottom] = expected.edges;
                PersonBox { left, top, right, bottom, cut: [false; 4], appearance: None }
            })
            .collect()
    };
    (0..stage.cameras.len()).map(boxes_of).collect()
}

fn restarted(boxes: &mut Boxes, seen: &[Vec<PersonBox>]) {
    boxes.restart(seen.iter().map(|camera| Some(camera.as_slice())));
}

fn random_body(rng: &mut Pcg64Mcg) -> Body {
    Body {
        x_m: rng.random_range(1.0..4.5),
        y_m: rng.random_range(0.5..4.0),
        radius_m: rng.random_range(0.2..0.3),
        height_m: rng.random_range(1.5..1.9),
    }
}

#[test]
fn a_changing_state_has_the_likelihood_of_a_fresh_one() {
    let stage = empty_room();
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let crowd: Vec<Body> = (0..8).map(|_| random_body(&mut rng)).collect();
    let seen = detected(&stage, &crowd, &[(0, 2), (1, 5)]);
    let (mut boxes, mut fresh) = (Boxes::new(&stage), Boxes::new(&stage));
    restarted(&mut boxes, &seen);
    let mut people: Vec<Body> = Vec::new();
    let mut compared = 0;
    for _ in 0..2000 {
        let near = |body: &Body, rng: &mut Pcg64Mcg| Body {
            x_m: body.x_m + rng.random_range(-0.3..0.3),
            y_m: body.y_m + rng.random_range(-0.3..0.3),
            ..*body
        };
        let (old, new) = match (rng.random_range(0..4), people.len()) {
            (0, 0..=11) | (_, 0) => (None, Some(near(&crowd[rng.random_range(0..crowd.len())], &mut rng))),
            (1, n) => (Some(rng.random_range(0..n)), None),
            (_, n) => {
                let which = rng.random_range(0..n);
                (Some(which), Some(near(&people[which], &mut rng)))
            }
        };
        let tried = boxes.try_change(old, new.as_ref());
        let mut after = people.clone();
        match (old, new) {
            (None, Some(new)) => after.push(new),
            (Some(old), Some(new)) => after[old] = new,
            (Some(old), None) => {
                after.swap_remove(old);
            }
            (None, None) => {}
        }
        restarted(&mut fresh, &seen);
        for body in &after {
            fresh.insert(body);
        }
        let whole = fresh.log_likelihood();
        assert!((tried - whole).abs() < 1e-3, "{tried}, not {whole}: {old:?} {new:?}");
        compared += 1;
        if rng.random::<bool>() {
            boxes.commit(old, new.is_some());
            people = after;
            assert!((boxes.log_likelihood() - whole).abs() < 1e-3);
        }
    }
    assert_eq!(compared, 2000);
}

#[test]
fn people_where_the_boxes_are_explain_them_best() {
    let stage = empty_room();
    let crowd = [standing(2.0, 1.5), standing(3.2, 2.4)];
    let seen = detected(&stage, &crowd, &[]);
    let mut boxes = Boxes::new(&stage);
    let mut value = |people: &[Body]| {
        restarted(&mut boxes, &seen);
        for body in people {
            boxes.insert(body);
        }
        boxes.log_likelihood()
    };
    let right = value(&crowd);
    assert!(right > value(&crowd[..1]) + 10.0);
    assert!(right > value(&[crowd[0], standing(3.5, 2.4)]) + 3.0);
    assert!(right > value(&[crowd[0], crowd[1], standing(2.1, 1.5)]) + 3.0, "a box is one person");
}

#[test]
fn hotspots_and_fits_find_who_is_there() {
    let stage = empty_room();
    let options = McmcOptions::default();
    let crowd = [standing(2.0, 1.5), standing(3.2, 2.4)];
    let mut boxes = Boxes::new(&stage);
    restarted(&mut boxes, &detected(&stage, &crowd, &[]));
    boxes.insert(&crowd[0]);
    let hotspots = boxes.hotspots((&options.radius, &options.height), |_, _| true);
    assert!(!hotspots.is_empty());
    let [known, missing] = crowd.map(|body| hotspots.density(body.x_m, body.y_m));
    assert!(missing > 1.0 && missing > 100.0 * known, "{known} {missing}");
    let known = Known {
        place: Place::new(Vector2::new(1.8, 1.6), &(Matrix2::identity() * 0.09), 0.35),
        size: SizePrior::of_one(Size::prior(&options)),
        log_odds: 2.0,
        fit: None,
        vectors: VectorPlaces::default(),
    };
    let fit = boxes.fits(std::iter::once((crowd[0], Some(&known)))).remove(0).unwrap().1;
    assert!(fit.log_density(2.0, 1.5) > fit.log_density(1.8, 1.6) + 2.0);
    // All people are explained.
    boxes.insert(&crowd[1]);
    assert!(boxes.hotspots((&options.radius, &options.height), |_, _| true).is_empty());
}
