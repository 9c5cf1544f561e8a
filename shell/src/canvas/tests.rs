//! Drawn areas and places against closed forms.

use super::*;
use approx::assert_relative_eq;
use image::{Luma, Rgb};

fn points(list: &[(f64, f64)]) -> Vec<Point2<f64>> {
    list.iter().map(|(x, y)| Point2::new(*x, *y)).collect()
}

/// Area covered by black on white, counting partly covered pixels by their share.
fn covered(canvas: &Canvas) -> f64 {
    canvas.to_image().pixels().map(|p| 1.0 - f64::from(p.0[0]) / 255.0).sum()
}

#[test]
fn filled_shapes_cover_their_area() {
    let mut canvas = Canvas::new(100, 80, Color::WHITE);
    canvas.fill_circle(Point2::new(40.3, 41.7), 25.0, Color::BLACK);
    assert_relative_eq!(covered(&canvas), std::f64::consts::PI * 625.0, max_relative = 0.01);

    let mut canvas = Canvas::new(100, 80, Color::WHITE);
    canvas.fill_polygon(&points(&[(10.0, 10.0), (70.5, 20.0), (30.0, 60.0)]), Color::BLACK);
    assert_relative_eq!(covered(&canvas), 0.5 * (60.5 * 50.0 - 20.0 * 10.0), max_relative = 0.01);

    let mut canvas = Canvas::new(100, 80, Color::WHITE);
    let outer = points(&[(10.0, 10.0), (60.0, 10.0), (60.0, 60.0), (10.0, 60.0)]);
    let hole = points(&[(20.0, 20.0), (30.0, 20.0), (30.0, 30.0), (20.0, 30.0)]);
    canvas.fill_rings(&[outer, hole], Color::BLACK);
    assert_relative_eq!(covered(&canvas), 2400.0, max_relative = 0.002);

    let mut canvas = Canvas::new(100, 80, Color::WHITE);
    canvas.fill_rounded_rectangle([10.0, 10.0, 70.0, 50.0], 10.0, Color::BLACK);
    let corners = (4.0 - std::f64::consts::PI) * 100.0;
    assert_relative_eq!(covered(&canvas), 2400.0 - corners, max_relative = 0.01);
}

#[test]
fn a_square_around_a_pixel_centre_fills_that_pixel_alone() {
    let mut canvas = Canvas::new(9, 9, Color::WHITE);
    canvas.fill_polygon(&points(&[(3.5, 4.5), (4.5, 4.5), (4.5, 5.5), (3.5, 5.5)]), Color::BLACK);
    for (x, y, p) in canvas.into_image().enumerate_pixels() {
        assert_eq!(p.0[0], if (x, y) == (4, 5) { 0 } else { 255 }, "at {x}, {y}");
    }
}

#[test]
fn strokes_cover_length_times_width_and_dashes_their_share() {
    let line = points(&[(20.0, 40.0), (180.0, 40.0)]);
    let drawn = |stroke: &Stroke| {
        let mut canvas = Canvas::new(200, 80, Color::WHITE);
        canvas.stroke_polyline(&line, stroke);
        covered(&canvas)
    };
    // Round caps add a disc of the line's width.
    let solid = drawn(&Stroke::solid(Color::BLACK, 4.0));
    assert_relative_eq!(solid, 160.0 * 4.0 + std::f64::consts::PI * 4.0, max_relative = 0.01);
    let dashed = drawn(&Stroke { color: Color::BLACK, width_px: 4.0, dash_px: Some([10.0, 6.0]) });
    assert_relative_eq!(dashed, 160.0 * 4.0 * 10.0 / 16.0, max_relative = 0.01);
}

#[test]
fn opacity_mixes_with_what_is_below() {
    let mut canvas = Canvas::new(10, 10, Color::rgb(100, 100, 100));
    let all = points(&[(-1.0, -1.0), (20.0, -1.0), (20.0, 20.0), (-1.0, 20.0)]);
    canvas.fill_polygon(&all, Color::rgb(200, 0, 100).alpha(0.5));
    let p = *canvas.clone().into_image().get_pixel(5, 5);
    for (value, expected) in p.0.into_iter().zip([150_i32, 50, 100]) {
        assert!((i32::from(value) - expected).abs() <= 1, "{p:?}");
    }
    let mask = GrayImage::from_fn(4, 4, |x, _| Luma([if x < 2 { 255 } else { 0 }]));
    canvas.tint(&mask, Color::WHITE.alpha(1.0));
    let image = canvas.into_image();
    assert_eq!((image.get_pixel(1, 3).0, *image.get_pixel(2, 3)), ([255; 3], p));
}

#[test]
fn pictures_come_back_unchanged_and_are_cut_at_the_rim() {
    let picture = RgbImage::from_fn(17, 9, |x, y| Rgb([x as u8 * 3, y as u8 * 20, 7]));
    assert_eq!(Canvas::from_image(&picture).into_image(), picture);
    for (x, y) in [(-5, -3), (12, 6), (100, 100), (-100, 0)] {
        let mut canvas = Canvas::new(20, 12, Color::WHITE);
        canvas.blit(&picture, x, y);
        for (u, v, p) in canvas.into_image().enumerate_pixels() {
            let (i, j) = (i64::from(u) - x, i64::from(v) - y);
            let inside = (0..17).contains(&i) && (0..9).contains(&j);
            let expected = if inside { *picture.get_pixel(i as u32, j as u32) } else { Rgb([255; 3]) };
            assert_eq!(*p, expected);
        }
    }
}

#[test]
fn numbers_that_are_no_place_draw_nothing_and_do_not_panic() {
    let mut canvas = Canvas::new(20, 20, Color::WHITE);
    let stroke = Stroke::dashed(Color::BLACK, 2.0);
    let nan = Point2::new(f64::NAN, 3.0);
    canvas.fill_polygon(&[nan, nan], Color::BLACK);
    canvas.fill_polygon(&[], Color::BLACK);
    canvas.stroke_polyline(&[nan], &stroke);
    canvas.stroke_polygon(&[], &stroke);
    canvas.fill_circle(nan, 5.0, Color::BLACK);
    canvas.fill_circle(Point2::new(5.0, 5.0), f64::INFINITY, Color::BLACK);
    canvas.stroke_circle(Point2::new(5.0, 5.0), -1.0, &stroke);
    canvas.fill_rounded_rectangle([5.0, 5.0, 4.0, 9.0], 1.0, Color::BLACK);
    assert_relative_eq!(covered(&canvas), 0.0);
    // Far away is drawn as far as the picture goes.
    canvas.stroke_polyline(&points(&[(-1e12, 10.0), (1e12, 10.0)]), &Stroke::solid(Color::BLACK, 2.0));
    assert_relative_eq!(covered(&canvas), 40.0, max_relative = 0.05);
    assert_eq!(Canvas::new(0, 0, Color::WHITE).into_image().dimensions(), (1, 1));
}
