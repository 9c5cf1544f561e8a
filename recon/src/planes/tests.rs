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
/// Inverse depth of a pixel of disparity; the noise is a sixth of it.
const STEP: f32 = 0.004;

/// A plane `n · X = 1` and its colour.
const WALL: (Vec3, [u8; 3]) = (Vec3::new(0.0, 0.0, 0.25), [200, 200, 190]);
const FLOOR: (Vec3, [u8; 3]) = (Vec3::new(0.0, 0.7, 0.05), [120, 80, 50]);
const BOX: (Vec3, [u8; 3]) = (Vec3::new(0.05, 0.0, 0.4), [180, 30, 30]);

fn is_box(x: usize, y: usize) -> bool {
    (60..100).contains(&x) && (40..80).contains(&y)
}

/// Surface at a pixel: the box, or the nearer of floor and wall.
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

/// The view with noise, unknown where `unknown` returns true.
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
    let filmed = vec![true; WIDTH * HEIGHT];
    DenseView { picture, intrinsics: intrinsics(), camera_from_reference, map, filmed, agreeing, step: STEP }
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
    let Completed { surface, report, .. } = complete(&[view(hole)], &PlaneOptions::default()).unwrap();
    assert!(report.planes >= 3 && report.filled > 0.05, "{report:?}");
    let wrong = (0..WIDTH * HEIGHT)
        .map(|i| (i % WIDTH, i / WIDTH))
        .filter(|(x, y)| hole(*x, *y))
        .filter(|(x, y)| relative_error(&surface, *x, *y) > 0.02)
        .count();
    let holes = (0..WIDTH * HEIGHT).filter(|i| hole(i % WIDTH, i / WIDTH)).count();
    assert!(wrong < holes / 50, "{wrong} of {holes}");
    for (x, y) in [(25, 20), (130, 60), (130, 85), (95, 50), (105, 50)] {
        assert_eq!(surface.origin[y * WIDTH + x], DepthOrigin::Filled, "{x}, {y}");
    }
    assert_eq!(surface.origin[10 * WIDTH + 50], DepthOrigin::Stereo);
}

#[test]
fn planes_take_the_noise_away() {
    let Completed { surface, report, .. } =
        complete(&[view(|_, _| false)], &PlaneOptions::default()).unwrap();
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
    let Completed { surface, .. } = complete(&[view], &options).unwrap();
    assert!(relative_error(&surface, 20, 20) < 0.01);
    assert_eq!(surface.origin[20 * WIDTH + 20], DepthOrigin::Filled);
}

#[test]
fn depths_behind_the_rooms_walls_are_discarded() {
    let mut view = view(|_, _| false);
    // A mirror image below the floor.
    for y in 105..115 {
        for x in 30..50 {
            view.map.supports[y * WIDTH + x].w *= 0.6;
        }
    }
    let Completed { surface, .. } = complete(&[view], &PlaneOptions::default()).unwrap();
    assert!(relative_error(&surface, 40, 110) < 0.01, "{}", relative_error(&surface, 40, 110));
}

#[test]
fn an_empty_view_stays_empty() {
    let Completed { surface, report, .. } = complete(&[view(|_, _| true)], &PlaneOptions::default()).unwrap();
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
    // Behind the surfaces they see there is no evidence.
    assert!(!witnesses.contradict(on_wall * 1.5, 0.04));
    assert!(!witness::Witnesses::new(&views[..1]).contradict(on_wall * 0.7, 0.04));
}

/// A plane `n · X = 1` with that many pixels.
fn seen_plane(n: Vec3, pixels: usize) -> ImagePlane {
    ImagePlane::facing(-n.normalize(), n.length().recip(), &camera(), pixels)
}

fn with(mut plane: ImagePlane, encloses: bool, opposite: bool) -> ImagePlane {
    (plane.encloses, plane.opposite) = (encloses, opposite);
    plane
}

#[test]
fn a_plane_of_assumed_direction_is_filled_in_and_not_measured() {
    let ordinary = with(seen_plane(WALL.0, 900), true, false);
    let planes = [ordinary, seen_plane(BOX.0, 900)];
    let mut surface = Surface::from_view(&view(|_, _| false));
    let labels: Vec<Option<u16>> = (0..WIDTH * HEIGHT)
        .map(|i| {
            let (x, y) = (i % WIDTH, i / WIDTH);
            is_box(x, y).then_some(1).or((shown(x, y).0 == WALL).then_some(0))
        })
        .collect();
    let snapped = snap(&mut surface, &planes, &labels);
    assert_eq!(snapped, labels.iter().flatten().count());
    for (i, label) in labels.iter().enumerate() {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let expected = if *label == Some(1) { (DepthOrigin::Filled, 0) } else { (DepthOrigin::Stereo, 4) };
        assert_eq!((surface.origin[i], surface.agreeing[i]), expected, "{x}, {y}");
        assert!(label.is_none() || relative_error(&surface, x, y) < 1e-4, "{x}, {y}");
    }
}

/// Only column 10 is known, and lies on a plane `n · X = 1` with few pixels.
fn a_line_of(n: Vec3) -> (Surface, ImagePlane, Vec<Option<u16>>) {
    let mut surface = Surface::from_view(&view(|_, _| true));
    surface.picture.fill(128);
    let mut labels = vec![None; WIDTH * HEIGHT];
    for i in (0..HEIGHT).map(|y| y * WIDTH + 10) {
        let w = n.dot(camera().ray(10.0, (i / WIDTH) as f32));
        (surface.depth[i], surface.normal[i], labels[i]) = (1.0 / w, -n.normalize(), Some(0));
    }
    // Filled surfaces are not nearer than measured ones.
    surface.depth[0] = 1.0;
    (surface, seen_plane(n, 100), labels)
}

#[test]
fn planes_continued_behind_the_shell_are_set_onto_it() {
    // A side wall of something, that meets the room's wall at x = 60 or so, and continues behind it.
    let side = Vec3::new(-0.25, 0.0, 0.23);
    let (surface, plane, labels) = a_line_of(side);
    let shell = seen_plane(WALL.0, 5000);
    let fill = |encloses: bool| {
        let mut surface = surface.clone();
        let planes = [with(plane, false, true), with(shell, encloses, false)];
        let (alone, options) = (witness::Witnesses::new(&[]), PlaneOptions::default());
        spread::fill(&mut surface, &vec![true; WIDTH * HEIGHT], &planes, &labels, &alone, &options);
        surface
    };
    let (clipped, free) = (fill(true), fill(false));
    let mut behind = 0;
    for x in 11..100 {
        let i = 60 * WIDTH + x;
        let ray = camera().ray(x as f32, 60.0);
        let (own, wall) = (side.dot(ray), WALL.0.dot(ray));
        assert!((clipped.depth[i] * own.max(wall) - 1.0).abs() < 1e-3, "{x}: {}", clipped.depth[i]);
        assert!(own < 0.1 || (free.depth[i] * own - 1.0).abs() < 1e-3, "{x}: {}", free.depth[i]);
        behind += usize::from(own < 0.9 * wall);
    }
    assert!(behind > 10, "{behind}");
}

#[test]
fn an_opposite_plane_goes_on_and_a_small_one_only_a_little() {
    let options = PlaneOptions { reach_px: 90.0, surface_reach_px: 12.0, ..PlaneOptions::default() };
    let (surface, plane, labels) = a_line_of(WALL.0);
    for (opposite, reach) in [(false, 12), (true, 90)] {
        let mut surface = surface.clone();
        let planes = [with(plane, false, opposite)];
        let alone = witness::Witnesses::new(&[]);
        spread::fill(&mut surface, &vec![true; WIDTH * HEIGHT], &planes, &labels, &alone, &options);
        for x in 11..WIDTH {
            let known = surface.depth[60 * WIDTH + x] > 0.0;
            assert_eq!(known, x - 10 <= reach, "{opposite}: {x}");
        }
    }
}

#[test]
fn planes_end_where_nothing_was_filmed() {
    /// First column and row beside the lens's picture.
    const END: usize = 50;
    let (mut surface, plane, labels) = a_line_of(WALL.0);
    let filmed: Vec<bool> = (0..WIDTH * HEIGHT).map(|i| i % WIDTH < END).collect();
    let (alone, options) = (witness::Witnesses::new(&[]), PlaneOptions::default());
    spread::fill(&mut surface, &filmed, &[with(plane, true, true)], &labels, &alone, &options);
    for (i, filmed) in filmed.iter().enumerate().filter(|(i, _)| i % WIDTH > 10) {
        assert_eq!(surface.depth[i] > 0.0, *filmed, "{}, {}", i % WIDTH, i / WIDTH);
    }
}

#[test]
fn a_fat_rim_goes_back_to_what_lies_behind_and_the_things_own_stays_measured() {
    const FAT: usize = 4;
    let mut view = view(|_, _| false);
    let plane = Support { w: 0.0, gu: BOX.0.x / camera().fx, gv: 0.0 };
    let fat = |x: usize, y: usize| {
        (60 - FAT..100 + FAT).contains(&x) && (40 - FAT..80 + FAT).contains(&y) && !is_box(x, y)
    };
    let all = || (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    for (x, y) in all().filter(|(x, y)| fat(*x, *y)) {
        let w = BOX.0.dot(camera().ray(x as f32, y as f32));
        view.map.supports[y * WIDTH + x] = Support { w, ..plane };
    }
    let Completed { surface, .. } = complete(&[view], &PlaneOptions::default()).unwrap();
    let right = |x: usize, y: usize| relative_error(&surface, x, y) < 0.02;
    let rim = all().filter(|(x, y)| fat(*x, *y)).count();
    let back = all().filter(|(x, y)| fat(*x, *y) && right(*x, *y)).count();
    assert!(back > rim * 9 / 10, "{back} of {rim}");
    let inside = all().filter(|(x, y)| is_box(*x, *y)).count();
    let measured = |x: usize, y: usize| surface.origin[y * WIDTH + x] == DepthOrigin::Stereo;
    let kept = all().filter(|(x, y)| is_box(*x, *y) && right(*x, *y) && measured(*x, *y)).count();
    assert!(kept > inside * 97 / 100, "{kept} of {inside}");
}

#[test]
fn of_something_thin_the_middle_stays_and_creases_are_no_edges() {
    let mut view = view(|_, _| false);
    let pole = |x: usize| (20..29).contains(&x);
    for i in (0..WIDTH * HEIGHT).filter(|i| pole(i % WIDTH)) {
        view.map.supports[i] = Support { w: 0.5, gu: 0.0, gv: 0.0 };
    }
    let mut surface = Surface::from_view(&view);
    let labels = vec![None; WIDTH * HEIGHT];
    let cells = local::fit(&surface, STEP);
    rims::forget(&mut surface, &[], &labels, &cells, STEP, &PlaneOptions::default());
    let known = |x: usize, y: usize| surface.depth[y * WIDTH + x] > 0.0;
    for y in 10..50 {
        assert!(known(24, y) && !known(20, y) && !known(28, y), "{y}");
        assert!(known(18, y) && known(30, y), "the wall behind, {y}");
    }
    // Floor and wall meet in a crease: hardly anything is forgotten there.
    let crease = |i: &usize| (110..155).contains(&(i % WIDTH)) && (60..118).contains(&(i / WIDTH));
    let all = (0..WIDTH * HEIGHT).filter(crease).count();
    let gone = (0..WIDTH * HEIGHT).filter(crease).filter(|i| surface.depth[*i] <= 0.0).count();
    assert!(gone < all / 50, "{gone} of {all}");
}
