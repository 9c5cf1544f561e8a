//! A corner of a room with a box in it, whose depth is known in closed form.

use super::*;
use crate::dense::SupportMap;
use calib::Intrinsics;
use image::{Rgb, RgbImage};
use nalgebra::Isometry3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
/// Inverse depth of a pixel of disparity: noise is a sixth of it.
const STEP: f32 = 0.004;

/// A plane `n · X = 1` and its colour.
const WALL: (Vec3, [u8; 3]) = (Vec3::new(0.0, 0.0, 0.25), [200, 200, 190]);
const FLOOR: (Vec3, [u8; 3]) = (Vec3::new(0.0, 0.7, 0.05), [120, 80, 50]);
const BOX: (Vec3, [u8; 3]) = (Vec3::new(0.05, 0.0, 0.4), [180, 30, 30]);

fn is_box(x: usize, y: usize) -> bool {
    (60..100).contains(&x) && (40..80).contains(&y)
}

/// What a pixel shows: the box, or the nearer of floor and wall.
fn shown(x: usize, y: usize) -> ((Vec3, [u8; 3]), f32) {
    let ray = camera().ray(x as f32, y as f32);
    let plane = if is_box(x, y) {
        BOX
    } else if FLOOR.0.dot(ray) > WALL.0.dot(ray) {
        FLOOR
    } else {
        WALL
    };
    (plane, plane.0.dot(ray))
}

fn intrinsics() -> Intrinsics {
    Intrinsics::from_horizontal_fov(WIDTH as u32, HEIGHT as u32, 70.0)
}

fn camera() -> crate::dense::Pinhole {
    let k = intrinsics();
    crate::dense::Pinhole { fx: k.fx as f32, fy: k.fy as f32, cx: k.cx as f32, cy: k.cy as f32 }
}

/// The view with noise, unknown where `unknown` says so.
fn view(unknown: impl Fn(usize, usize) -> bool) -> DenseView {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut supports = Vec::new();
    let mut agreeing = Vec::new();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let ((n, _), w) = shown(x, y);
            let noise = (rng.random::<f32>() - 0.5) * STEP * 0.6;
            supports.push(Support { w: w + noise, gu: n.x / camera().fx, gv: n.y / camera().fy });
            agreeing.push(if unknown(x, y) { 0 } else { 4 });
        }
    }
    let picture = RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
        let ((_, color), _) = shown(x as usize, y as usize);
        let grain = rng.random_range(0..4u8);
        Rgb(color.map(|c| c + grain))
    });
    let costs = vec![0.1; supports.len()];
    let map = SupportMap { width: WIDTH, height: HEIGHT, supports, costs };
    let camera_from_reference = Isometry3::identity();
    DenseView { picture, intrinsics: intrinsics(), camera_from_reference, map, agreeing, step: STEP }
}

fn relative_error(surface: &Surface, x: usize, y: usize) -> f32 {
    let (_, w) = shown(x, y);
    (surface.depth[y * WIDTH + x] * w - 1.0).abs()
}

#[test]
fn holes_in_planes_are_filled_exactly_and_marked() {
    // A hole in the wall, one across the corner of wall and floor, one that cuts the box's outline.
    let hole = |x: usize, y: usize| {
        (10..40).contains(&x) && (10..30).contains(&y)
            || (110..150).contains(&x) && (55..90).contains(&y)
            || (90..110).contains(&x) && (45..60).contains(&y)
    };
    let (surface, report) = complete(&[view(hole)], &PlaneOptions::default()).unwrap();
    assert!(report.planes >= 3 && report.filled > 0.05, "{report:?}");
    let wrong = (0..WIDTH * HEIGHT)
        .map(|i| (i % WIDTH, i / WIDTH))
        .filter(|(x, y)| hole(*x, *y))
        .filter(|(x, y)| relative_error(&surface, *x, *y) > 0.02)
        .count();
    let holes = (0..WIDTH * HEIGHT).filter(|i| hole(i % WIDTH, i / WIDTH)).count();
    assert!(wrong < holes / 50, "{wrong} of {holes}");
    for (x, y) in [(25, 20), (130, 60), (130, 85), (95, 50), (105, 50)] {
        assert_eq!(surface.origin[y * WIDTH + x], Origin::Filled, "{x}, {y}");
    }
    assert_eq!(surface.origin[10 * WIDTH + 50], Origin::Stereo);
}

#[test]
fn planes_take_the_noise_away() {
    let (surface, report) = complete(&[view(|_, _| false)], &PlaneOptions::default()).unwrap();
    assert!(report.on_planes > 0.85, "{report:?}");
    for (x, y) in [(20, 20), (140, 30), (30, 110), (80, 60)] {
        assert!(relative_error(&surface, x, y) < 0.003, "{x}, {y}: {}", relative_error(&surface, x, y));
    }
}

#[test]
fn speckles_in_free_space_go() {
    let mut view = view(|_, _| false);
    for (x, y) in [(20, 20), (21, 20), (20, 21)] {
        view.map.supports[y * WIDTH + x] = Support { w: 0.8, gu: 0.0, gv: 0.0 };
    }
    let options = PlaneOptions { speckle_share: 0.0005, ..PlaneOptions::default() };
    let (surface, _) = complete(&[view], &options).unwrap();
    assert!(relative_error(&surface, 20, 20) < 0.01);
    assert_eq!(surface.origin[20 * WIDTH + 20], Origin::Filled);
}

#[test]
fn what_lies_behind_the_rooms_walls_is_a_reflection() {
    let mut view = view(|_, _| false);
    // A mirror image below the floor.
    for y in 105..115 {
        for x in 30..50 {
            view.map.supports[y * WIDTH + x].w *= 0.6;
        }
    }
    let (surface, _) = complete(&[view], &PlaneOptions::default()).unwrap();
    assert!(relative_error(&surface, 40, 110) < 0.01, "{}", relative_error(&surface, 40, 110));
}

#[test]
fn an_empty_view_stays_empty() {
    let (surface, report) = complete(&[view(|_, _| true)], &PlaneOptions::default()).unwrap();
    assert_eq!((surface.coverage(), report.planes), (0.0, 0));
    assert!(complete(&[], &PlaneOptions::default()).is_none());
}

#[test]
fn two_views_that_look_past_a_point_contradict_it() {
    let views = [view(|_, _| false), view(|_, _| false)];
    let witnesses = witness::Witnesses::new(&views);
    let on_wall = camera().ray(20.0, 20.0) * 4.0;
    assert!(!witnesses.contradict(on_wall, 0.04));
    assert!(witnesses.contradict(on_wall * 0.7, 0.04));
    // Behind what they see nothing can be said.
    assert!(!witnesses.contradict(on_wall * 1.5, 0.04));
    assert!(!witness::Witnesses::new(&views[..1]).contradict(on_wall * 0.7, 0.04));
}
