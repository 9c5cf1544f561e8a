//! Property test of the likelihood: every count that [`super::Simulation`] updates change by change equals the count by
//! rays.
//!
//! Thousands of random rooms are tested, each with a camera that is prepared as in a run and a mask that is mapped into
//! the pinhole twin as in a run. An oracle beside it shares none of that code: it intersects the room surface by
//! surface, applies the lens by its formula, and intersects every body with every ray. The test compares:
//!
//! * **The simulation, exactly.** A pixel of the twin has a place in the film, between pixels. It is simulated where
//!   the ray that the lens gives to that place meets a body in front of room and floor; never where the film does not
//!   show it.
//! * **The foreground, exactly.** It is that of the filmed pixel nearest to that place.
//! * **Film and simulation, up to resampling**, which is no property of the simulation and not tested here: the two use
//!   rays that differ by up to half a filmed pixel, each way.
//! * **A coarse view** uses rays through the middles of its blocks, has the depth of one pixel there
//!   ([`scene::TracedPixel`]), and is foreground where half of the block is.
//!
//! Results differ in their last digits, and the tracker intersects the room in f32. So the oracle leaves undecided what
//! is within a tolerance of a boundary: a surface of the room within a hundredth of a millimetre ([`room`]), an outline
//! within a billionth, a place within a fifty-thousandth of a pixel of the middle between two ([`scene`]), a millionth
//! of the lens's rim ([`lens`]). Counts then have bounds, nearly always a single number, and the test limits how often
//! they are not.

mod cases;
mod lens;
mod room;
mod scene;

use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use self::cases::Cases;
use self::scene::{TestScene, random_film};
use super::random_body::random_body;
use super::{Counts, Layers, Simulation};
use crate::silhouette::{Body, Shape};

/// One decision a pixel; `None` where it is undecided.
type Decisions = Vec<Option<bool>>;

/// Decides by rays, for each pixel of a view, whether it shows a body.
fn traced(scene: &TestScene, shape: &Shape, body: &Body) -> Decisions {
    let (eye, solid) = (scene.eye(), shape.of(body));
    scene.traced_pixels.iter().map(|traced| traced.of(&eye, &solid)[1]).collect()
}

/// Least and largest possible counts of these bodies.
fn bounds(foreground: &Decisions, bodies: &[&Decisions]) -> [Counts; 2] {
    let mut bounds = [Counts::default(); 2];
    for (i, is_foreground) in foreground.iter().enumerate() {
        let surely = bodies.iter().any(|b| b[i] == Some(true));
        let perhaps = bodies.iter().any(|b| b[i] != Some(false));
        let found = [*is_foreground == Some(true), *is_foreground != Some(false)];
        for ((counts, is_simulated), is_foreground) in bounds.iter_mut().zip([surely, perhaps]).zip(found) {
            counts.foreground += i64::from(is_foreground);
            counts.simulated += i64::from(is_simulated);
            counts.both += i64::from(is_foreground && is_simulated);
        }
    }
    bounds
}

fn is_within(counts: &Counts, [low, high]: &[Counts; 2]) -> bool {
    (low.foreground..=high.foreground).contains(&counts.foreground)
        && (low.simulated..=high.simulated).contains(&counts.simulated)
        && (low.both..=high.both).contains(&counts.both)
}

/// A random change as the sampler makes them: a birth, a death or a move. Returns the index of the removed body, and
/// the new body.
fn random_change(bodies: &[Body], eye: &Point3<f64>, rng: &mut Pcg64Mcg) -> (Option<usize>, Option<Body>) {
    let kind = rng.random_range(0..4);
    if bodies.is_empty() || (kind < 2 && bodies.len() < 24) {
        return (None, Some(random_body(eye, rng)));
    }
    let which = rng.random_range(0..bodies.len());
    let mut moved = bodies[which];
    moved.x_m += rng.random_range(-0.2..0.2);
    moved.y_m += rng.random_range(-0.2..0.2);
    moved.height_m += rng.random_range(-0.1..0.1);
    (Some(which), (kind == 3).then_some(moved))
}

/// Tests 3000 scenes with ten changes each.
#[test]
fn every_change_counts_what_rays_through_the_lens_count() {
    const SHAPES: [&[Shape]; 4] =
        [&[Shape::BODY], &[Shape::CORE], &[Shape::LIMBS, Shape::REACH], &[Shape::REACH]];
    const SCENES: usize = 3000;
    let mut rng = Pcg64Mcg::seed_from_u64(17);
    let mut cases = Cases::default();
    let (mut counted, mut left_open, mut off_middle) = (0, 0, 0);
    // One count of a hundred, in a view of as many pixels as the film.
    let mut may_be_open = 0.0;
    for number in 0..SCENES {
        let block = [1, 2, 3, 1, 4, 5, 1][number % 7];
        let scene = TestScene::random(block, number % 3 != 0, &mut rng);
        cases.note_scene(&scene);
        let (packed, foreground) = scene.foreground(&random_film(&scene.camera, &mut rng));
        let shapes = SHAPES[number % SHAPES.len()];
        let layers = Layers::new(vec![scene.view.clone()], shapes);
        let mut simulation = Simulation::new(&layers);
        simulation.restart(&[Some(packed)]);
        let draw = |body: &Body| layers.silhouettes(body, |_| true);
        let rays =
            |body: &Body| -> Vec<Decisions> { shapes.iter().map(|s| traced(&scene, s, body)).collect() };
        // Some scenes begin with a crowd.
        let mut bodies: Vec<Body> = Vec::new();
        let mut seen: Vec<Vec<Decisions>> = Vec::new();
        for _ in 0..if number % 50 == 0 { 20 } else { 0 } {
            let body = random_body(&scene.eye(), &mut rng);
            simulation.insert(&draw(&body));
            seen.push(rays(&body));
            bodies.push(body);
        }
        for _ in 0..10 {
            let (old, new) = random_change(&bodies, &scene.eye(), &mut rng);
            let (drawn_old, drawn_new) = (old.map(|i| draw(&bodies[i])), new.as_ref().map(draw));
            let (mut changed, mut changed_seen) = (bodies.clone(), seen.clone());
            if let Some(which) = old {
                changed.swap_remove(which);
                changed_seen.swap_remove(which);
            }
            if let Some(body) = new {
                changed.push(body);
                changed_seen.push(rays(&body));
                cases.note_body(&scene, &shapes[0].of(&body));
            }
            cases.note_overlap(&changed_seen);
            simulation.try_removal(drawn_old.as_deref());
            let hoped: Vec<Counts> = simulation.tried().flatten().collect();
            for layer in 0..layers.count() {
                simulation.try_addition(layer, drawn_old.as_deref(), drawn_new.as_deref());
            }
            let tried: Vec<Counts> = simulation.tried().flatten().collect();
            assert_eq!(tried.len(), shapes.len());
            for (layer, (tried, hoped)) in tried.iter().zip(hoped).enumerate() {
                let of_layer: Vec<&Decisions> = changed_seen.iter().map(|s| &s[layer]).collect();
                let bounds = bounds(&foreground, &of_layer);
                assert!(
                    is_within(tried, &bounds),
                    "scene {number}, blocks of {block}: {tried:?} is not within {bounds:?}\n{:?}\n{changed:?}",
                    scene.camera.real
                );
                let in_vain = |c: &Counts| c.simulated - c.both;
                assert!(hoped.both >= tried.both && in_vain(&hoped) <= in_vain(tried), "{hoped:?}");
                counted += 1;
                may_be_open += 0.01 * scene.pixels_per_filmed();
                left_open += u32::from(bounds[0] != bounds[1]);
                off_middle += u32::from(*tried != bounds[0] && *tried != bounds[1]);
            }
            // A change that was tried but not committed must leave no trace.
            if rng.random::<f32>() < 0.6 {
                simulation.commit(drawn_old.as_deref(), drawn_new.as_deref());
                (bodies, seen) = (changed, changed_seen);
                assert_eq!(simulation.counts().flatten().collect::<Vec<_>>(), tried);
            }
        }
    }
    println!("{counted} counts, {left_open} left open ({off_middle}); {cases}");
    assert!(
        f64::from(left_open) < may_be_open,
        "{left_open} of {counted} are left open, {may_be_open} may be"
    );
    cases.assert_all();
}
