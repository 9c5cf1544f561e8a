//! The pixel model: scores, learning, absorption.

use super::*;
use image::{Luma, Rgb};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn flat(color: [u8; 3]) -> RgbImage {
    RgbImage::from_pixel(16, 12, Rgb(color))
}

fn model(absorb_s: f32) -> PixelModel {
    let backdrop = Backdrop { picture: flat([100, 110, 120]), noise: GrayImage::new(16, 12) };
    PixelModel::new(&backdrop, &PixelOptions { absorb_s, ..PixelOptions::default() })
}

/// Shows a colour for a time at 10 frames a second; returns the last score of a pixel.
fn show(model: &mut PixelModel, color: [u8; 3], seconds: f32) -> u8 {
    show_under(model, color, seconds, 0)
}

/// The same under a believed person (255) or not (0).
fn show_under(model: &mut PixelModel, color: [u8; 3], seconds: f32, people: u8) -> u8 {
    let (mut expected, mut score) = (flat([0; 3]), GrayImage::new(16, 12));
    for _ in 0..(10.0 * seconds) as usize {
        let frame = flat(color);
        model.score(&frame, &Exposure::default(), &mut expected, &mut score);
        let mask =
            GrayImage::from_fn(16, 12, |u, v| Luma([255 * u8::from(score.get_pixel(u, v)[0] >= THRESHOLD)]));
        let people = GrayImage::from_pixel(16, 12, Luma([people]));
        let judged = ScoredFrame { score: &score, mask: &mask, people: &people };
        model.learn(&frame, &Exposure::default(), judged, 0.1);
    }
    score.get_pixel(3, 3)[0]
}

#[test]
fn the_threshold_is_at_the_tolerance() {
    let model = model(60.0);
    let (mut expected, mut score) = (flat([0; 3]), GrayImage::new(16, 12));
    let levels = PixelOptions::default().least_levels as u8;
    for (more, found) in [(0, 0), (levels / 2 - 1, 0), (levels, THRESHOLD), (2 * levels, 255)] {
        model.score(&flat([100 + more, 110, 120]), &Exposure::default(), &mut expected, &mut score);
        assert_eq!(score.get_pixel(5, 5)[0], found, "{more} levels");
    }
    assert_eq!(expected, flat([100, 110, 120]));
}

#[test]
fn many_pixels_at_once_are_scored_as_each_alone() {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    // A whole number of chunks and a remainder; with and without a former background.
    for (former, (gain, bias)) in
        [false, true].into_iter().zip([([0.6, 1.0, 3.2], [40.0, 0.0, -90.0]), ([1.0; 3], [0.0; 3])])
    {
        let exposure = Exposure { gain, bias };
        let picture = RgbImage::from_fn(37, 5, |_, _| Rgb(std::array::from_fn(|_| rng.random())));
        let noise = GrayImage::from_fn(37, 5, |_, _| Luma([rng.random()]));
        let mut model =
            PixelModel::new(&Backdrop { picture: picture.clone(), noise }, &PixelOptions::default());
        if former {
            model.adopt(&RgbImage::from_fn(37, 5, |_, _| Rgb(std::array::from_fn(|_| rng.random()))));
        }
        let mut now = picture.clone();
        model.picture(&mut now);
        let looks = |picture: &RgbImage, i: usize| -> [f64; 3] {
            std::array::from_fn(|c| {
                (gain[c] as f64 * picture.as_raw()[3 * i + c] as f64 + bias[c] as f64).clamp(0.0, 255.0)
            })
        };
        let mut frame = now.clone();
        for (i, pixel) in frame.pixels_mut().enumerate() {
            let from = if former && i % 3 == 0 { &picture } else { &now };
            *pixel = Rgb(looks(from, i).map(|v| (v + rng.random_range(-25.0..25.0)) as u8));
        }
        let (mut expected, mut score) = (RgbImage::new(37, 5), GrayImage::new(37, 5));
        model.score(&frame, &exposure, &mut expected, &mut score);
        for i in 0..37 * 5 {
            let x: [u8; 3] = frame.as_raw()[3 * i..3 * i + 3].try_into().unwrap();
            let off = |picture: &RgbImage| -> f64 {
                looks(picture, i).iter().zip(x).map(|(e, x)| (x as f64 - e.round()).powi(2)).sum()
            };
            for (e, truth) in expected.as_raw()[3 * i..].iter().zip(looks(&now, i)) {
                assert!((*e as f64 - truth).abs() < 0.6, "pixel {i}: {e} against {truth}");
            }
            let scaled = |squared: f64| squared * THRESHOLD as f64 / (model.tolerance[i] as f64).powi(2);
            let mut truth = scaled(off(&now));
            if truth < 16.0 {
                truth = 0.0;
            } else if former {
                truth = truth.min(scaled(off(&picture)).max(2.0));
            }
            // Rounding by a level changes the square of the distance by up to two distances.
            let slack = 1.5 + scaled(2.0 * off(&now).sqrt() + 3.0);
            let found = score.as_raw()[i] as f64;
            let edge = (truth - 16.0).abs() < slack;
            assert!(edge || (found - truth.min(255.0)).abs() < slack, "pixel {i}: {found} against {truth}");
        }
    }
}

#[test]
fn a_person_who_stands_for_a_minute_stays_and_a_chair_is_absorbed_in_the_end() {
    let mut model = model(120.0);
    assert_eq!(show(&mut model, [30, 30, 60], 60.0), 255, "a person still stands out after a minute");
    assert_eq!(show(&mut model, [30, 30, 60], 65.0), 0, "a chair does not after two");
    // The old background is known at once when the chair is taken away.
    assert!(show(&mut model, [100, 110, 120], 0.1) < THRESHOLD / 8);
}

#[test]
fn a_believed_person_is_not_absorbed_and_the_background_returns_when_they_leave() {
    const CLOTHES: [u8; 3] = [30, 30, 60];
    const FLOOR: [u8; 3] = [100, 110, 120];
    let mut model = model(120.0);
    show(&mut model, CLOTHES, 100.0);
    for minutes in 1..=20 {
        assert_eq!(show_under(&mut model, CLOTHES, 60.0, 255), 255, "after {minutes} minutes");
    }
    // Lost for a minute and a half, then found again.
    assert_eq!(show(&mut model, CLOTHES, 90.0), 255);
    show_under(&mut model, CLOTHES, 120.0, 255);
    assert_eq!(show(&mut model, FLOOR, 0.1), 0);
    show(&mut model, FLOOR, 1.0);
    assert_eq!(show(&mut model, CLOTHES, 100.0), 255, "who comes back stands out");
}

#[test]
fn a_person_who_was_absorbed_stands_out_again_after_leaving_once() {
    const CLOTHES: [u8; 3] = [30, 30, 60];
    const FLOOR: [u8; 3] = [100, 110, 120];
    for believed in [255, 0] {
        let mut model = model(120.0);
        assert_eq!(show(&mut model, CLOTHES, 130.0), 0, "nobody believed in them");
        show_under(&mut model, CLOTHES, 1.0, believed);
        assert!(show(&mut model, FLOOR, 1.0) < THRESHOLD / 8, "no ghost");
        let again = show(&mut model, CLOTHES, 1.0);
        assert_eq!(again, if believed > 0 { 255 } else { 0 }, "a door that opens again is known");
    }
}

#[test]
fn slow_change_is_followed() {
    let mut model = model(120.0);
    for step in 0..40_u8 {
        assert_eq!(show(&mut model, [100 + step, 110, 120], 10.0), 0, "after {step} levels");
    }
}

#[test]
fn after_a_switch_what_is_seen_is_adopted() {
    let mut model = model(120.0);
    for _ in 0..20 {
        model.watch(&flat([40, 50, 60]), 0.1);
    }
    model.adopt(&flat([200, 200, 200]));
    assert_eq!(show(&mut model, [40, 50, 60], 0.1), 0);
}
