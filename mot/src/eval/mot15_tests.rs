//! Tests of the evaluator against TrackEval and motmetrics on MOT15, each sequence and all together.
//!
//! The recordings may not be redistributed. Where they are available, tracks are made from them by the rule of
//! `tests/peers/figures.py`, whose peers' figures are stored in `tests/peers/mot15.json`.

use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;

use serde_json::{Map, Value as Json};

use super::{EvalOptions, Evaluation, Sequences};
use crate::rows::RowFile;

const PEERS: &str = include_str!("../../tests/peers/mot15.json");

/// `blurred` of `figures.py`.
fn blurred(truth: &str, detections: &str) -> String {
    let mut state = 1u32;
    let mut draw = |n: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % n
    };
    let numbers = |line: &str| -> Vec<f64> { line.split(',').map(|t| t.parse().unwrap()).collect() };
    let mut rows: Vec<(u32, u32, [f64; 4])> = Vec::new();
    for v in truth.lines().map(numbers).filter(|v| v[6] != 0.0) {
        let (is_lost, dx, dy) = (draw(100) < 20, f64::from(draw(41)) - 20.0, f64::from(draw(41)) - 20.0);
        if !is_lost {
            let (frame, id) = (v[0] as u32, v[1] as u32);
            let track = id * 1000 + frame / (15 + id % 40);
            rows.push((frame, track, [v[2] + v[4] * dx / 100.0, v[3] + v[5] * dy / 100.0, v[4], v[5]]));
        }
    }
    for (index, v) in detections.lines().map(numbers).enumerate().filter(|(index, _)| index % 7 == 0) {
        rows.push((v[0] as u32, 10_000_000 + index as u32 / 70, [v[2], v[3], v[4], v[5]]));
    }
    let mut seen = HashSet::new();
    let mut text = String::new();
    for (frame, track, [left, top, width, height]) in rows {
        if seen.insert((frame, track)) {
            writeln!(text, "{frame},{track},{left},{top},{width},{height},1").unwrap();
        }
    }
    text
}

fn assert_same(sequence: &str, found: &Json, expected: &Map<String, Json>) {
    assert!(!expected.is_empty());
    for (name, value) in expected {
        let (found, value) = (found[name].as_f64(), value.as_f64().unwrap());
        let found = found.unwrap_or_else(|| panic!("{sequence} has no {name}"));
        assert!((found - value).abs() < 1e-9, "{sequence}: {name} is {found}, the peer says {value}");
    }
}

#[test]
fn each_sequence_and_all_together_are_what_trackeval_and_motmetrics_say() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/mot15");
    if !folder.is_dir() {
        eprintln!("skipped: {} is not here", folder.display());
        return;
    }
    let peers: Map<String, Json> = serde_json::from_str(PEERS).unwrap();
    let mut each = Vec::new();
    for sequence in peers.keys().filter(|name| *name != "together") {
        let read = |file: &str| std::fs::read_to_string(folder.join(sequence).join(file)).unwrap();
        let truth = read("truth.txt");
        let tracks = blurred(&truth, &read("detections.txt"));
        let parse = |name: &str, text: &str| RowFile::parse(Path::new(name), text).unwrap();
        let (truth, tracks) = (parse("truth.txt", &truth), parse("tracks.txt", &tracks));
        let evaluation = Evaluation::of_rows(&truth, &tracks, &EvalOptions::default(), None).unwrap();
        each.push((sequence.clone(), evaluation));
    }
    assert_eq!(each.len(), 5);
    let json = Sequences::of(each).json();
    for (sequence, figures) in &peers {
        let found = if sequence == "together" { &json["together"] } else { &json["sequences"][sequence] };
        assert_same(sequence, found, figures["trackeval"].as_object().unwrap());
        let mut lasting = figures["motmetrics"].as_object().unwrap().clone();
        let idf1 = Map::from_iter(lasting.remove_entry("IDF1"));
        assert_same(sequence, found, &idf1);
        assert_same(sequence, &found["motmetrics"], &lasting);
    }
}
