//! Tests of the evaluator against independent ones, against closed forms, and at its limits.

use std::fmt::Write;
use std::path::Path;

use approx::assert_relative_eq;
use proptest::prelude::*;
use serde_json::Value as Json;

use super::*;

/// Figures of TrackEval and motmetrics for the files beside them; `tests/peers/figures.py` made both.
const PEERS: &str = include_str!("../../tests/peers/figures.json");

/// Figures of TrackEval's `MotChallenge2DBox` for the files beside them, by `figures.py --classes`.
const CLASSES: &str = include_str!("../../tests/peers/classes.json");

fn rows(name: &str, text: &str) -> RowFile {
    RowFile::parse(Path::new(name), text).unwrap()
}

pub(super) fn compare(truth: &str, tracks: &str, options: &EvalOptions) -> Result<Evaluation> {
    Evaluation::of_rows(&rows("truth.txt", truth), &rows("tracks.txt", tracks), options, None)
}

/// Floor rows of (frame, id, x).
pub(super) fn floor(people: &[(u32, i64, f64)]) -> String {
    people.iter().fold(String::new(), |mut text, (frame, id, x)| {
        writeln!(text, "{frame},{id},-1,-1,-1,-1,1,{x},0,0").unwrap();
        text
    })
}

fn judged(truth: &[(u32, i64, f64)], tracks: &[(u32, i64, f64)]) -> Json {
    compare(&floor(truth), &floor(tracks), &EvalOptions::default()).unwrap().json()
}

#[test]
fn independent_evaluators_give_the_same_figures() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers");
    let peers: serde_json::Map<String, Json> = serde_json::from_str(PEERS).unwrap();
    assert_eq!(peers.len(), 4);
    for (case, figures) in peers {
        let file = |kind: &str| folder.join(format!("{case}_{kind}.txt"));
        let found = Evaluation::of_files(&file("truth"), &file("tracks"), &EvalOptions::default(), None)
            .unwrap()
            .json();
        for (name, expected) in figures.as_object().unwrap() {
            let value = found[name].as_f64().unwrap_or_else(|| panic!("{case} has no {name}"));
            assert_relative_eq!(value, expected.as_f64().unwrap(), epsilon = 1e-9, max_relative = 1e-12);
        }
    }
}

#[test]
fn truth_with_classes_is_judged_as_trackeval_judges_the_benchmark() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers");
    let peers: serde_json::Map<String, Json> = serde_json::from_str(CLASSES).unwrap();
    for (name, protocol) in
        [("mot17", Protocol::Auto), ("mot17", Protocol::Mot16), ("mot20", Protocol::Mot20)]
    {
        let file = |kind: &str| folder.join(format!("{name}_{kind}.txt"));
        let options = EvalOptions { protocol, ..EvalOptions::default() };
        let found = Evaluation::of_files(&file("truth"), &file("tracks"), &options, None).unwrap().json();
        for (figure, expected) in peers[name].as_object().unwrap() {
            let value = found[figure].as_f64().unwrap_or_else(|| panic!("{name} has no {figure}"));
            assert_relative_eq!(value, expected.as_f64().unwrap(), epsilon = 1e-9);
        }
    }
}

#[test]
fn boxes_with_a_class_and_a_visibility_are_compared_as_boxes() {
    let truth = "1,1,105,50,40,100,1,1,0.9\n1,2,205,50,40,100,1,1,0.9\n";
    let found = compare(truth, &truth.replace(",50,", ",250,"), &EvalOptions::default()).unwrap();
    assert_eq!((found.scenario.space, found.clear.matches), (Space::Image, 0));
    assert_relative_eq!(found.clear.mota().unwrap(), -1.0);
    // Boxes with positions besides are boxes, too; against positions alone, the positions count.
    let both = "1,1,105,50,40,100,1,2.5,3.5,0\n";
    assert_eq!(compare(both, both, &EvalOptions::default()).unwrap().scenario.space, Space::Image);
    let floor = compare(both, "1,1,-1,-1,-1,-1,1,2.5,3.4,0\n", &EvalOptions::default()).unwrap();
    assert_eq!((floor.scenario.space, floor.clear.matches), (Space::Floor, 1));
}

#[test]
fn a_switch_a_loss_and_a_ghost_are_counted_once_each() {
    // One person over 10 frames: tracked as 1, lost in frames 4 and 5, then tracked as 2; a ghost in frame 9.
    let truth: Vec<_> = (1..=10).map(|f| (f, 7, f as f64)).collect();
    let mut tracks: Vec<_> = (1..=10)
        .filter(|f| ![4, 5].contains(f))
        .map(|f| (f, if f < 4 { 1 } else { 2 }, f as f64 + 0.1))
        .collect();
    tracks.push((9, 3, 30.0));
    let found = judged(&truth, &tracks);
    let is =
        |name: &str, value: f64| assert_relative_eq!(found[name].as_f64().unwrap(), value, epsilon = 1e-9);
    is("misses", 2.0);
    is("false_positives", 1.0);
    is("id_switches", 1.0);
    is("fragmentations", 1.0);
    is("MOTA", 60.0);
    is("MODA", 70.0);
    is("mostly_tracked", 0.0); // 80 % exactly is not more than 80 %.
    is("MOTP", 0.1);
    is("mean_error_m", 0.1);
    is("maximum_error_m", 0.1);
    is("IDF1", 100.0 * 2.0 * 5.0 / (10.0 + 9.0));
    // d = 0.1 at a gate of 0.5: similarity 0.9, a match up to the 18th of 19 thresholds.
    let (det, ass) = (8.0 / 11.0, (3.0 * (3.0 / 10.0) + 5.0 * (5.0 / 10.0)) / 8.0);
    is("DetA", 100.0 * det * 18.0 / 19.0);
    is("AssA", 100.0 * ass * 18.0 / 19.0);
    is("HOTA", 100.0 * (det * ass).sqrt() * 18.0 / 19.0);
}

#[test]
fn a_pair_of_the_frame_before_is_kept_though_another_is_closer() {
    // Two tracks change sides of one person; the first stays within the gate.
    let truth = [(1, 1, 0.0), (2, 1, 0.0), (3, 1, 0.0)];
    let tracks = [(1, 1, 0.1), (2, 1, 0.4), (2, 2, 0.0), (3, 1, 0.6), (3, 2, 0.0)];
    let found = judged(&truth, &tracks);
    assert_eq!(found["id_switches"], 1, "only in frame 3, where track 1 has left the gate");
    assert_relative_eq!(found["maximum_error_m"].as_f64().unwrap(), 0.4, epsilon = 1e-12);
}

#[test]
fn a_person_who_leaves_and_comes_back_was_not_lost() {
    let truth = [(1, 1, 0.0), (2, 1, 0.0), (8, 1, 0.0), (9, 1, 0.0)];
    assert_eq!(judged(&truth, &truth)["fragmentations"], 0);
    // Missed on return, then found: once.
    assert_eq!(judged(&truth, &[truth[0], truth[1], truth[3]])["fragmentations"], 1);
    // A loss in frames without any track counts like any other.
    let alone: Vec<_> = (1..=9).map(|f| (f, 1, 0.0)).collect();
    assert_eq!(judged(&alone, &[&alone[..3], &alone[6..]].concat())["fragmentations"], 1);
}

#[test]
fn without_identities_only_detection_is_judged() {
    let truth = [(1, -1, 0.0), (1, -1, 2.0), (2, -1, 0.0)];
    let tracks = [(1, 4, 0.1), (2, 5, 0.0), (2, 6, 9.0)];
    let found = judged(&truth, &tracks);
    assert_relative_eq!(found["MODA"].as_f64().unwrap(), 100.0 / 3.0, epsilon = 1e-9);
    assert_eq!((&found["misses"], &found["false_positives"]), (&1.into(), &1.into()));
    for name in ["MOTA", "IDF1", "HOTA", "id_switches", "fragmentations", "mostly_tracked"] {
        assert!(found[name].is_null(), "{name}");
    }
    let mixed = floor(&[(1, -1, 0.0), (1, 2, 2.0)]);
    let error = compare(&mixed, &floor(&tracks), &EvalOptions::default()).unwrap_err().to_string();
    assert!(error.contains("truth.txt") && error.contains("line 1"), "{error}");
}

#[test]
fn empty_files_are_fine() {
    let some = [(1, 1, 0.0), (2, 1, 0.0)];
    let nothing_found = judged(&some, &[]);
    assert_eq!((&nothing_found["MOTA"], &nothing_found["misses"]), (&0.0.into(), &2.into()));
    assert_eq!((&nothing_found["IDF1"], &nothing_found["HOTA"]), (&0.0.into(), &0.0.into()));
    assert!(nothing_found["mean_error_m"].is_null());
    let nobody_there = judged(&[], &some);
    assert!(nobody_there["MOTA"].is_null());
    assert_eq!((&nobody_there["false_positives"], &nobody_there["HOTA"]), (&2.into(), &0.0.into()));
    let nothing = judged(&[], &[]);
    assert!(nothing["MOTA"].is_null() && nothing["IDF1"].is_null() && nothing["HOTA"].is_null());
    let table = compare("", "", &EvalOptions::default()).unwrap().table();
    assert!(table.contains("MOTA") && !table.contains("NaN"), "{table}");
}

#[test]
fn rows_that_do_not_count_do_not() {
    let truth = "1,1,0,0,10,20,1\n1,2,50,0,10,20,0\n2,1,0,0,10,20,1\n3,1,0,0,10,20,1\n";
    let tracks = "1,5,0,0,10,20,0.9\n2,5,0,0,10,20,0\n3,5,80,0,10,20,1\n";
    let all = compare(truth, tracks, &EvalOptions::default()).unwrap();
    assert_eq!((all.scenario.truth_rows, all.scenario.track_rows, all.clear.matches), (3, 3, 2));
    let first_two = EvalOptions {
        frames: FrameSelection { range: Some(FrameRange { first: 1, last: 2 }), annotated: None },
        ..EvalOptions::default()
    };
    let some = compare(truth, tracks, &first_two).unwrap();
    assert_relative_eq!(some.clear.mota().unwrap(), 1.0);
    assert_relative_eq!(some.clear.motp().unwrap(), 1.0);
}

#[test]
fn files_of_different_kinds_and_bad_gates_are_refused() {
    let (floor, image) = (floor(&[(1, 1, 0.0)]), "1,1,0,0,5,5,1\n");
    let options = EvalOptions::default();
    let error = compare(&floor, image, &options).unwrap_err().to_string();
    assert!(
        error.contains("tracks.txt") && error.contains("boxes") && error.contains("truth.txt"),
        "{error}"
    );
    for gate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let options = EvalOptions { gate: Some(gate), ..EvalOptions::default() };
        assert!(compare(&floor, &floor, &options).unwrap_err().to_string().contains("gate"), "{gate}");
    }
    let options = EvalOptions { gate: Some(1.5), ..EvalOptions::default() };
    assert!(compare(image, image, &options).is_err());
    assert!(compare(&floor, &floor, &options).is_ok());
}

#[test]
fn tracks_from_another_room_are_brought_over() {
    let truth = rows("truth.txt", &floor(&[(1, 1, 0.0), (2, 1, 1.0)]));
    // The same in a frame rotated by a quarter turn and shifted.
    let tracks = rows("tracks.txt", "1,1,-1,-1,-1,-1,1,3,2,0\n2,1,-1,-1,-1,-1,1,3,3,0\n");
    let alignment = RoomAlignment {
        truth_from_room: nalgebra::Isometry2::new(
            nalgebra::Vector2::new(3.0, 2.0),
            std::f64::consts::FRAC_PI_2,
        )
        .inverse(),
        cameras: 2,
        center_rms_m: 0.0,
    };
    let found =
        Evaluation::of_rows(&truth, &tracks, &EvalOptions::default(), Some(alignment.clone())).unwrap();
    assert!(found.position.statistics.unwrap().max < 1e-12);
    let boxes = rows("boxes.txt", "1,1,0,0,5,5,1\n");
    assert!(Evaluation::of_rows(&boxes, &boxes, &EvalOptions::default(), Some(alignment)).is_err());
}

proptest! {
    /// People stand in the plane, not on a line: there several assignments are often equally good (two people on the
    /// same side of two tracks), and then the order of the rows may decide which of them is taken.
    #[test]
    fn names_and_order_of_rows_do_not_matter_and_the_truth_itself_is_perfect(
        rows in prop::collection::vec((1u32..12, 1i64..5, [-3.0..3.0f64, -3.0..3.0], [-0.5..0.5f64, -0.5..0.5]), 1..40)) {
        let mut rows = rows;
        rows.sort_by_key(|row| (row.0, row.1));
        rows.dedup_by_key(|row| (row.0, row.1));
        let text = |rows: &[(u32, i64, [f64; 2])]| {
            let line = |(f, id, [x, y]): &(u32, i64, [f64; 2])| format!("{f},{id},-1,-1,-1,-1,1,{x},{y},0\n");
            rows.iter().map(line).collect::<Vec<_>>().concat()
        };
        let truth = text(&rows.iter().map(|&(f, id, at, _)| (f, id, at)).collect::<Vec<_>>());
        let judged = |tracks: &str| compare(&truth, tracks, &EvalOptions::default()).unwrap().json();
        let perfect = judged(&truth);
        for name in ["MOTA", "MODA", "IDF1", "HOTA", "DetA", "AssA"] {
            prop_assert!((perfect[name].as_f64().unwrap() - 100.0).abs() < 1e-9, "{}", name);
        }
        let mut tracks: Vec<_> =
            rows.iter().map(|&(f, id, [x, y], [u, v])| (f, id, [x + u, y + v])).collect();
        let before = judged(&text(&tracks));
        tracks.reverse();
        for track in &mut tracks {
            track.1 = 40 - track.1;
        }
        let after = judged(&text(&tracks));
        prop_assert_eq!(&after["id_switches"], &before["id_switches"]);
        for name in ["MOTA", "MOTP", "IDF1", "HOTA", "AssA"] {
            let (a, b) = (after[name].as_f64(), before[name].as_f64());
            prop_assert!(a.is_some() == b.is_some() && (a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs() < 1e-9, "{}", name);
        }
    }
}

#[test]
fn a_pair_that_outlives_a_loss_is_motmetrics_own() {
    // Track 1 loses the person in frame 2 and is back in frame 3, where track 2 is nearer.
    let truth = [(1, 1, 0.0), (2, 1, 0.0), (3, 1, 0.0)];
    let tracks = [(1, 1, 0.1), (2, 1, 5.0), (3, 1, 0.3), (3, 2, 0.0)];
    let found = judged(&truth, &tracks);
    assert_eq!((&found["id_switches"], &found["motmetrics"]["id_switches"]), (&1.into(), &0.into()));
    assert_eq!(found["motmetrics"]["fragmentations"], 1);
}

#[test]
fn success_is_one_track_from_the_first_frame_to_the_last() {
    let person = |id: i64| (1..=4).map(move |f| (f, id, 3.0 * id as f64));
    let truth: Vec<_> = (1..=4).flat_map(person).collect();
    // 1 is tracked throughout, 2 is missed once, 3 changes its track, and 4's track goes on to follow another person.
    let tracks: Vec<_> = truth
        .iter()
        .filter(|(f, id, _)| (*f, *id) != (2, 2))
        .map(|(f, id, x)| (*f, if (*f, *id) == (4, 3) { 9 } else { *id }, *x))
        .collect();
    let found = judged(&truth, &tracks);
    assert_relative_eq!(found["tracking_success"].as_f64().unwrap(), 50.0);
}

#[test]
fn the_detection_curve_goes_from_the_surest_to_all() {
    let truth = rows("truth.txt", &floor(&[(1, 1, 0.0), (1, 2, 5.0), (2, 1, 0.0)]));
    let score = |frame: u32, x: f64, s: f64| format!("{frame},-1,-1,-1,-1,-1,{s},{x},0,0\n");
    // Frame 1 has two detections of one person; the one with the higher score matches.
    let found = [score(1, 0.1, 0.9), score(1, 0.0, 0.6), score(2, 0.0, 0.8), score(2, 9.0, 0.8)].concat();
    let curve = DetectionCurve::new(&truth, &rows("found.txt", &found), 0.5, &FrameSelection::default())
        .unwrap()
        .unwrap();
    let steps: Vec<(f64, f64, f64)> =
        curve.points.iter().map(|p| (p.score, 3.0 * p.recall, 2.0 * p.false_positives_per_frame)).collect();
    assert_eq!(steps, [(0.9, 1.0, 0.0), (0.8, 2.0, 1.0), (0.6, 2.0, 2.0)]);
    assert_relative_eq!(curve.average_precision, 1.0 / 3.0 + (1.0 / 3.0) * (2.0 / 3.0), epsilon = 1e-12);
    let nobody = DetectionCurve::new(&rows("t", ""), &truth, 0.5, &FrameSelection::default()).unwrap();
    assert_eq!(nobody, None);
}

#[test]
fn folders_are_compared_sequence_by_sequence() {
    let (truth, tracks) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let write = |path: std::path::PathBuf, text: &str| {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    let people = floor(&[(1, 1, 0.0), (2, 1, 0.0)]);
    write(truth.path().join("a/truth.txt"), &people);
    write(truth.path().join("b/gt/gt.txt"), &people);
    write(tracks.path().join("a.txt"), &people);
    let error = Sequences::of_folders(truth.path(), tracks.path(), &EvalOptions::default()).unwrap_err();
    assert!(error.to_string().contains("b.txt"), "{error}");
    write(tracks.path().join("b/tracks.txt"), "");
    let found = Sequences::of_folders(truth.path(), tracks.path(), &EvalOptions::default()).unwrap();
    let json = found.json();
    assert_eq!(
        (&json["sequences"]["a"]["MOTA"], &json["sequences"]["b"]["MOTA"]),
        (&100.0.into(), &0.0.into())
    );
    assert_eq!((&json["together"]["MOTA"], &json["together"]["misses"]), (&50.0.into(), &2.into()));
    assert!(found.table().contains("together"));
    let nothing = Sequences::of_folders(tracks.path(), truth.path(), &EvalOptions::default()).unwrap_err();
    assert!(nothing.to_string().contains("SEQUENCE"), "{nothing}");
}
