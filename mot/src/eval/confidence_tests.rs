//! Tests of how confidences are judged: existence and number of people, against closed forms.

use std::fmt::Write;

use approx::assert_relative_eq;

use super::tests::{compare, floor};
use super::*;

/// Floor rows of (frame, id, x, confidence).
fn confident(people: &[(u32, i64, f64, f64)]) -> String {
    people.iter().fold(String::new(), |mut text, (frame, id, x, confidence)| {
        writeln!(text, "{frame},{id},-1,-1,-1,-1,{confidence},{x},0,0").unwrap();
        text
    })
}

/// Ten frames with a person at 0 in the first `there` of them, and a track there with this confidence in all.
fn ten_frames_with(there: u32, confidence: f64) -> Evaluation {
    let truth: Vec<_> = (1..=there).map(|f| (f, 1, 0.0)).collect();
    let tracks: Vec<_> = (1..=10).map(|f| (f, 1, 0.0, confidence)).collect();
    compare(&floor(&truth), &confident(&tracks), &EvalOptions::default()).unwrap()
}

#[test]
fn confidences_that_come_true_are_calibrated_and_others_off_by_the_difference() {
    for (there, confidence, error, brier) in [
        (8, 0.8, 0.0, 0.16),
        (3, 0.3, 0.0, 0.21),
        (10, 1.0, 0.0, 0.0),
        (5, 0.95, 45.0, 0.5 * (0.05 * 0.05 + 0.95 * 0.95)),
        (8, 1.0, 20.0, 0.2),
        (0, 0.9, 90.0, 0.81),
        (10, 0.25, 75.0, 0.75 * 0.75),
    ] {
        let found = ten_frames_with(there, confidence).json();
        assert_relative_eq!(found["existence_error"].as_f64().unwrap(), error, epsilon = 1e-9);
        assert_relative_eq!(found["Brier"].as_f64().unwrap(), brier, epsilon = 1e-12);
        let [bin] = found["reliability"].as_array().unwrap().as_slice() else { panic!("{found}") };
        assert_eq!(bin["rows"], 10);
        assert_relative_eq!(bin["told"].as_f64().unwrap(), 100.0 * confidence, epsilon = 1e-9);
        assert_relative_eq!(bin["matched"].as_f64().unwrap(), 10.0 * f64::from(there), epsilon = 1e-9);
    }
}

/// One overconfident and one underconfident track do not compensate each other, within a recording and over several.
#[test]
fn confidences_are_judged_each_by_what_it_came_to() {
    let truth = floor(&[(1, 1, 0.0), (1, 2, 5.0), (2, 1, 0.0), (2, 2, 5.0)]);
    let tracks = confident(&[(1, 1, 0.0, 0.4), (2, 1, 0.0, 0.4), (1, 2, 9.0, 0.6), (2, 2, 9.0, 0.6)]);
    let found = compare(&truth, &tracks, &EvalOptions::default()).unwrap().json();
    assert_relative_eq!(found["existence_error"].as_f64().unwrap(), 60.0, epsilon = 1e-9);

    let parts = [ten_frames_with(10, 0.75), ten_frames_with(2, 0.7)];
    let together = Existence::together(parts.iter().map(|p| &p.existence));
    assert_relative_eq!(together.error().unwrap(), (14.5_f64 - 12.0).abs() / 20.0, epsilon = 1e-12);
    let squares = 10.0 * 0.25 * 0.25 + 2.0 * 0.3 * 0.3 + 8.0 * 0.7 * 0.7;
    assert_relative_eq!(together.brier().unwrap(), squares / 20.0, epsilon = 1e-12);
    let counts = PeopleCount::together(parts.iter().map(|p| &p.people_count));
    let score = (10.0 * 0.75_f64.ln() + 2.0 * 0.7_f64.ln() + 8.0 * 0.3_f64.ln()) / 20.0;
    assert_relative_eq!(counts.log_score().unwrap(), score, epsilon = 1e-12);
    assert_relative_eq!(counts.coverage().unwrap(), 1.0, epsilon = 1e-12);
}

#[test]
fn the_number_of_people_is_judged_by_what_the_confidences_say_of_it() {
    let impossible = 5e-4_f64.ln();
    for (there, confidence, coverage, score) in [
        (8, 0.8, 100.0, 0.8 * 0.8_f64.ln() + 0.2 * 0.2_f64.ln()),
        // Zero people are too improbable to be in the set.
        (8, 0.95, 80.0, 0.8 * 0.95_f64.ln() + 0.2 * 0.05_f64.ln()),
        (8, 1.0, 80.0, 0.2 * impossible),
        (10, 1.0, 100.0, 0.0),
    ] {
        let found = ten_frames_with(there, confidence).json();
        assert_relative_eq!(found["count_coverage"].as_f64().unwrap(), coverage, epsilon = 1e-9);
        assert_relative_eq!(found["count_log_score"].as_f64().unwrap(), score, epsilon = 1e-9);
    }
    // More people than tracks, in frame 2 without any, at any positions.
    let truth = floor(&[(1, 1, 0.0), (1, 2, 7.0), (2, 1, 0.0)]);
    let found = compare(&truth, &confident(&[(1, 1, 3.0, 0.5)]), &EvalOptions::default()).unwrap();
    assert_relative_eq!(found.people_count.log_score().unwrap(), impossible, epsilon = 1e-12);
    assert_relative_eq!(found.people_count.coverage().unwrap(), 0.0);
}

#[test]
fn without_probabilities_there_is_no_calibration() {
    let truth = floor(&[(1, 1, 0.0)]);
    for score in [-1.0, 87.5] {
        let tracks = confident(&[(1, 1, 0.0, score), (2, 1, 0.0, 0.5)]);
        let found = compare(&truth, &tracks, &EvalOptions::default()).unwrap();
        let json = found.json();
        for name in ["existence_error", "Brier", "count_coverage", "count_log_score", "reliability"] {
            assert!(json[name].is_null(), "{name} of scores like {score}");
        }
        assert!(!found.table().contains("NaN"));
        let beside = ten_frames_with(8, 0.8);
        assert_eq!(Existence::together([&found.existence, &beside.existence].into_iter()).error(), None);
    }
    let nothing = compare("", "", &EvalOptions::default()).unwrap();
    assert_eq!((nothing.existence.error(), nothing.people_count.coverage()), (None, None));
    let nothing_found = compare(&truth, "", &EvalOptions::default()).unwrap();
    assert_eq!((nothing_found.existence.brier(), nothing_found.people_count.coverage()), (None, Some(0.0)));
}
