//! Tests of the motion model against the same model written as one covariance of all positions, without a filter.

use std::fmt::Write;
use std::path::Path;

use nalgebra::{DMatrix, DVector};

use super::build::Affinity;
use super::motion::MotionModel;
use super::*;
use crate::rows::RowFile;

const RATE: f64 = 10.0;
const HEIGHT_PX: f64 = 80.0;
/// Constants of the model, per frame and in heights.
const JITTER2: f64 = 0.045 * 0.045;
const SPEED2: f64 = 0.09 * 0.09;
const TURN: f64 = 0.08e-3;
const SLANT2: f64 = 0.35 * 0.35;
/// Variance of an unknown position.
const ANYWHERE: f64 = 1e5;

/// Boxes by frame, centre and height.
fn detections(places: &[(u32, f64, f64, f64)]) -> Detections {
    let text = places.iter().fold(String::new(), |mut text, (f, x, y, h)| {
        writeln!(text, "{f},-1,{},{},{},{h},0.9", x - 0.2 * h, y - 0.5 * h, 0.4 * h).unwrap();
        text
    });
    let file = RowFile::parse(Path::new("boxes.txt"), &text).unwrap();
    Detections::from_rows(&file, |_| true).unwrap()
}

/// Log density of positions (in heights) at some frames, for a person whose velocity is unknown at the first.
fn log_density(frames: &[f64], places: &[f64], speed2: f64, turn: f64) -> f64 {
    let n = frames.len();
    let at = |i: usize| frames[i] - frames[0];
    // White noise integrated twice: ∫ (s − u)(t − u) du up to the earlier of the two.
    let noise = |s: f64, t: f64| {
        let (a, b) = (s.min(t), s.max(t));
        a * a * (3.0 * b - a) / 6.0
    };
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let own = if i == j { JITTER2 } else { 0.0 };
        ANYWHERE + at(i) * at(j) * speed2 + turn * noise(at(i), at(j)) + own
    });
    let factor = covariance.cholesky().unwrap();
    let off = DVector::from_row_slice(places);
    let log_determinant = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    -0.5 * (off.dot(&factor.solve(&off)) + log_determinant + n as f64 * std::f64::consts::TAU.ln())
}

#[test]
fn a_link_costs_what_all_places_together_say() {
    // Two tracklets of one walk, with noise and a turn; all lie within the window at their ends.
    let places = [
        (1, 100.0, 200.0, 80.0),
        (2, 103.0, 201.5, 80.0),
        (3, 108.5, 200.0, 80.0),
        (5, 116.0, 203.0, 80.0),
        (13, 175.0, 216.0, 80.0),
        (14, 178.0, 219.5, 80.0),
        (16, 186.0, 221.0, 80.0),
    ];
    let found = detections(&places);
    let model = MotionModel::of_tracklets(RATE, false);
    for (cut, from, to) in [(4, 0, 7), (4, 3, 5), (4, 2, 7), (4, 0, 5)] {
        let (before, after): (Vec<u32>, Vec<u32>) = ((from..cut).collect(), (cut..to).collect());
        let cost = model.cost(&model.tail(&found, &before).unwrap(), &model.head(&found, &after).unwrap());
        let mut unlikely = 0.0;
        for (axis, (speed2, turn)) in
            [(SPEED2, TURN), (SPEED2 * SLANT2, TURN * SLANT2)].into_iter().enumerate()
        {
            let of = |nodes: &[u32]| {
                let all = nodes.iter().map(|n| &found.all[*n as usize]);
                let (frames, along): (Vec<f64>, Vec<f64>) =
                    all.map(|d| (f64::from(d.frame), (d.place[axis] - 130.0) / HEIGHT_PX)).unzip();
                log_density(&frames, &along, speed2, turn)
            };
            let together = of(&[before.clone(), after.clone()].concat()) - of(&before);
            let alone = of(&after) + 0.5 * (std::f64::consts::TAU * ANYWHERE).ln();
            let surest = -0.5 * (std::f64::consts::TAU * (2.0 * JITTER2 + speed2)).ln();
            unlikely -= together - alone - surest;
        }
        // Sizes are equal; their uncertainties remain.
        let counts = [before.len() as f64, after.len() as f64];
        let gap = f64::from(found.all[cut as usize].frame - found.all[cut as usize - 1].frame);
        let size = 0.09f64.powi(2) * (1.0 / counts[0] + 1.0 / counts[1]) + 0.0025 * gap;
        unlikely += 0.5 * (size / (2.0 * 0.09f64.powi(2) + 0.0025)).ln();
        let expected = 0.25 * unlikely.max(0.0);
        assert!(
            expected > 0.01 && (cost.unwrap() - expected).abs() < 1e-3,
            "{cost:?} {expected} {from} {to}"
        );
    }
}

#[test]
fn distant_or_taller_detections_are_not_linked_and_missed_frames_cost() {
    let model = MotionModel::of_detections(RATE, false);
    let cost = |dx: f64, dy: f64, growth: f64, gap: u32| {
        let found = detections(&[
            (1, 300.0, 300.0, HEIGHT_PX),
            (1 + gap, 300.0 + dx, 300.0 + dy, HEIGHT_PX * growth),
        ]);
        model.link_cost(&found.all[0], &found.all[1], gap)
    };
    let reach = |gap: f64, slant2: f64| {
        5.0 * HEIGHT_PX * (2.0 * JITTER2 + slant2 * gap * gap * (SPEED2 + TURN * gap / 3.0)).sqrt()
    };
    for (gap, frames) in [(1, 1.0), (2, 2.0), (7, 7.0)] {
        let (across, along) = (reach(frames, 1.0), reach(frames, SLANT2));
        assert!(
            cost(0.999 * across, 0.0, 1.0, gap).is_some() && cost(1.001 * across, 0.0, 1.0, gap).is_none()
        );
        assert!(cost(0.0, 0.999 * along, 1.0, gap).is_some() && cost(0.0, 1.001 * along, 1.0, gap).is_none());
        let grown = 5.0 * (2.0 * 0.09f64.powi(2) + 0.0025 * frames).sqrt();
        assert!(
            cost(0.0, 0.0, (0.999 * grown).exp(), gap).is_some()
                && cost(0.0, 0.0, (1.001 * grown).exp(), gap).is_none()
        );
        let other = detections(&[(1, 300.0, 300.0, HEIGHT_PX)]);
        assert!(model.reach(&other.all[0], gap) >= across);
    }
    // The same on the floor: no foreshortening, and the height of a person.
    let floor = MotionModel::of_detections(RATE, true);
    let place = |f: u32, y: f64| {
        let text = format!("{f},-1,-1,-1,-1,-1,1,0,{y},0\n");
        let file = RowFile::parse(Path::new("places.txt"), &text).unwrap();
        Detections::from_rows(&file, |_| true).unwrap().all[0].clone()
    };
    let farthest = reach(1.0, 1.0) / HEIGHT_PX * 1.75;
    assert!(floor.link_cost(&place(1, 0.0), &place(2, 0.999 * farthest), 1).is_some());
    assert!(floor.link_cost(&place(1, 0.0), &place(2, 1.001 * farthest), 1).is_none());
    // A frame without a detection costs the same in any surroundings: 8 a second.
    let still = |gap| cost(0.0, 0.0, 1.0, gap).unwrap();
    let unlikely = |frames: f64| {
        let place = |slant2: f64| 2.0 * JITTER2 + slant2 * frames * frames * (SPEED2 + TURN * frames / 3.0);
        let surest = |slant2: f64| 2.0 * JITTER2 + slant2 * SPEED2;
        let size = (2.0 * 0.09f64.powi(2) + 0.0025 * frames) / (2.0 * 0.09f64.powi(2) + 0.0025);
        0.125 * (size * place(1.0) / surest(1.0) * place(SLANT2) / surest(SLANT2)).ln()
    };
    assert!((still(3) - unlikely(3.0) - 2.0 * 8.0 / RATE).abs() < 1e-4, "{}", still(3));
}

#[test]
fn only_the_end_of_a_tracklet_says_where_it_goes() {
    let walk = |early: f64| {
        let before = (1..=10).map(|f| (f, 100.0 + early * f64::from(f), 200.0, HEIGHT_PX));
        let after = (11..=20).map(|f| (f, 300.0 + 4.0 * f64::from(f), 200.0, HEIGHT_PX));
        detections(&before.chain(after).collect::<Vec<_>>())
    };
    let model = MotionModel::of_tracklets(RATE, false);
    let (all, mut reversed): (Vec<u32>, Vec<u32>) = ((0..20).collect(), (0..20).collect());
    reversed.truncate(10);
    assert_eq!(model.tail(&walk(3.0), &all), model.tail(&walk(-9.0), &all));
    assert_ne!(model.tail(&walk(3.0), &reversed), model.tail(&walk(-9.0), &reversed));
    assert_eq!(model.tail(&walk(3.0), &[]), None);
}

#[test]
fn skipping_frames_is_a_lower_rate() {
    let of = |skip: u32, frames_per_s: f64| {
        let options = LinkOptions { skip, frames_per_s: Some(frames_per_s), ..LinkOptions::default() };
        (options.motion(false), options.joining(false), options.fill())
    };
    assert_eq!(of(1, 30.0), of(0, 15.0));
    assert_ne!(of(0, 30.0), of(0, 15.0));
    assert!((of(0, 15.0).2.smooth_frames - 3.0).abs() < 1e-12);
}
