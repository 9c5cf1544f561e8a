//! Outlines of zones in a camera's image against closed forms.

use approx::assert_relative_eq;
use glam::Vec3;
use nalgebra::{Point2, Point3};

use super::super::outline::{ImageOutline, OutlineDrawer};
use super::*;
use crate::raycast::RayScene;
use crate::visibility::floor_under;

#[test]
fn a_square_below_a_pinhole_is_a_square() {
    // Half a metre around the origin, seen from two: 25 px around the image's middle.
    let square = polygon(&[(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]);
    let camera = looking_down(2.0);
    let ImageOutline { corners, visible, hidden } = OutlineDrawer::new(&camera, None).outline(&square, true);
    let expected = [(-25.0, 25.0), (25.0, 25.0), (25.0, -25.0), (-25.0, -25.0)];
    for (corner, (u, v)) in corners.iter().zip(expected) {
        assert_relative_eq!(corner.unwrap(), Point2::new(C + u, C + v), epsilon = 1e-9);
    }
    assert!(hidden.is_empty());
    assert_eq!(visible.len(), 1, "one line all around");
    assert_relative_eq!(length(&visible), 4.0 * 50.0, epsilon = 1e-6);
    for p in visible.iter().flatten() {
        assert_relative_eq!((p - Point2::new(C, C)).amax(), 25.0, epsilon = 1e-9);
    }
    // An open line leaves out the edge from the last corner to the first.
    let open = OutlineDrawer::new(&camera, None).outline(&square, false);
    assert_relative_eq!(length(&open.visible), 3.0 * 50.0, epsilon = 1e-6);
    for few in 0..3 {
        let few = Polygon(square.0[..few].to_vec());
        assert_eq!(OutlineDrawer::new(&camera, None).outline(&few, false).corners.len(), few.0.len());
    }
}

#[test]
fn a_bent_lens_bends_the_edges() {
    let zone = polygon(&[(2.0, -0.5), (4.5, -1.0), (5.0, 2.0), (3.0, 1.5)]);
    let camera = bent();
    let outline = OutlineDrawer::new(&camera, None).outline(&zone, true);
    for (corner, place) in outline.corners.iter().zip(&zone.0) {
        let expected = camera.project(&Point3::new(place.x, place.y, 0.0)).unwrap();
        assert_relative_eq!(corner.unwrap(), expected, epsilon = 1e-9);
    }
    // Points along each edge, projected by calib, lie on the line, and the line has no other points.
    let along: Vec<Point2<f64>> = zone
        .edges()
        .flat_map(|(a, b)| (0..4000).map(move |i| a + (b - a) * (f64::from(i) / 4000.0)))
        .map(|p| camera.project(&Point3::new(p.x, p.y, 0.0)).unwrap())
        .collect();
    let points: Vec<_> = outline.visible.iter().flatten().collect();
    assert!(points.iter().all(|p| along.iter().any(|q| (*p - q).norm() < 0.05)));
    assert!(along.iter().all(|q| points.iter().any(|p| (*p - q).norm() < 3.0)));
    let bends = outline.visible[0].windows(3).filter(|w| (w[1] - w[0]).perp(&(w[2] - w[1])).abs() > 1e-6);
    assert!(bends.count() > 10, "the edges are straight");
}

#[test]
fn outlines_behind_the_camera_are_cut_off() {
    let camera = looking_ahead(1.5);
    let around = polygon(&[(-5.0, -2.0), (5.0, -2.0), (5.0, 2.0), (-5.0, 2.0)]);
    let outline = OutlineDrawer::new(&camera, None).outline(&around, true);
    let at = |x: f64, y: f64| Point2::new(C - F * y / x, C + F * 1.5 / x);
    assert_eq!(outline.corners[0], None);
    assert_relative_eq!(outline.corners[2].unwrap(), at(5.0, 2.0), epsilon = 1e-9);
    let points: Vec<_> = outline.visible.iter().flatten().collect();
    // Either on the far edge, or on a side's image, which is a ray from the middle: Δu / Δv = ∓2 / 1.5.
    for p in &points {
        let (du, dv) = (p.x - C, p.y - C);
        let is_far = (dv - 30.0).abs() < 1e-6 && du.abs() < 40.0 + 1e-6;
        assert!(is_far || ((du.abs() / dv - 2.0 / 1.5).abs() < 1e-6 && dv > 30.0 - 1e-6), "{p}");
    }
    // The sides are followed to the image's rim.
    assert!(points.iter().any(|p| p.x < 0.0) && points.iter().any(|p| p.x > 199.0));
    assert!(points.iter().all(|p| p.coords.amax() < 1000.0));
    // Wholly behind; across, both ends far outside.
    let behind = polygon(&[(-5.0, -2.0), (-1.0, -2.0), (-1.0, 2.0)]);
    assert!(OutlineDrawer::new(&camera, None).outline(&behind, true).visible.is_empty());
    let across = polygon(&[(3.0, -1e4), (3.0, 1e4)]);
    let line = OutlineDrawer::new(&camera, None).outline(&across, false).visible;
    assert!(line.iter().flatten().all(|p| (p.y - (C + 50.0)).abs() < 1e-6));
    assert!(length(&line) > 200.0, "the middle of a long edge is lost");
}

#[test]
fn beyond_the_fold_of_a_lens_nothing_is_drawn() {
    let mut camera = looking_down(1.0);
    camera.intrinsics.distortion = [-0.3, 0.0, 0.0, 0.0, 0.0].into();
    // The fold is at a radius of √(1/0.9) = 1.054 m on the floor, where the image ends 70.3 px from its middle.
    let far = polygon(&[(0.0, -20.0), (0.0, 20.0), (-20.0, 0.9)]);
    let outline = OutlineDrawer::new(&camera, None).outline(&far, true);
    assert_eq!(outline.corners, [None, None, None]);
    let fold_px = F * (1.0_f64 / 0.9).sqrt() * 2.0 / 3.0;
    let radii: Vec<f64> = outline.visible.iter().flatten().map(|p| (p - Point2::new(C, C)).norm()).collect();
    let furthest = radii.iter().copied().fold(0.0, f64::max);
    assert!(furthest <= fold_px + 1e-6 && furthest > fold_px - 0.01, "{furthest}, not {fold_px}");
    let vertical = outline.visible.iter().find(|line| line.iter().all(|p| (p.x - C).abs() < 1e-6)).unwrap();
    assert_relative_eq!(length(std::slice::from_ref(vertical)), 2.0 * fold_px, epsilon = 1e-3);
}

#[test]
fn edges_behind_a_box_are_hidden_and_the_others_not() {
    // A cube of a metre, 3 m ahead. At 1.5 m the eye sees over it only what is beyond 9 m, so of an edge 5 m ahead it
    // hides what lies within 0.5 m · 5/3 of the axis.
    let geometry = scene(&[(Vec3::new(3.0, -0.5, 0.0), Vec3::new(4.0, 0.5, 1.0))]);
    let scene = RayScene::new(&geometry).unwrap();
    let camera = looking_ahead(1.5);
    let edge = polygon(&[(5.0, -2.5), (5.0, 2.5)]);
    let outline = OutlineDrawer::new(&camera, Some(&scene)).outline(&edge, false);
    assert_eq!((outline.visible.len(), outline.hidden.len()), (2, 1));
    let reach = F * 0.5 / 3.0;
    let (first, last) = (outline.hidden[0][0], outline.hidden[0].last().unwrap());
    for (p, u) in [(first, C + reach), (*last, C - reach)] {
        assert!((p.x - u).abs() <= 3.0, "{p} is not at {u}");
    }
    assert_relative_eq!(length(&outline.visible) + length(&outline.hidden), F * 5.0 / 5.0, epsilon = 1e-6);
    // Nothing hides the floor before the box, rough as it is.
    let near = polygon(&[(2.0, -1.0), (2.0, 1.0)]);
    assert!(OutlineDrawer::new(&camera, Some(&scene)).outline(&near, false).hidden.is_empty());
}

#[test]
fn a_pixel_finds_the_floor_that_it_shows() {
    let camera = bent();
    let mut found = 0;
    for i in 0..400 {
        let place = Point2::new(1.5 + 0.3 * f64::from(i % 20), -3.0 + 0.3 * f64::from(i / 20));
        let Some(pixel) = camera.project(&Point3::new(place.x, place.y, 0.0)) else { continue };
        if camera.intrinsics.contains(&pixel) {
            assert_relative_eq!(floor_under(&camera, &pixel).unwrap(), place, epsilon = 1e-6);
            found += 1;
        }
    }
    assert!(found > 100);
    // By hand: 45° down from 1.5 m. The horizon, a pixel above it, and one just below it show no floor.
    let level = looking_ahead(1.5);
    let ahead = floor_under(&level, &Point2::new(C, C + F)).unwrap();
    assert_relative_eq!(ahead, Point2::new(1.5, 0.0), epsilon = 1e-9);
    for v in [C, C - 30.0, C + 1e-4] {
        assert_eq!(floor_under(&level, &Point2::new(C, v)), None);
    }
}
