//! Tests of linking as a whole, from rows to rows.

use std::fmt::Write;
use std::path::Path;

use super::*;
use crate::rows::RowFile;

pub(super) fn rows(text: &str) -> RowFile {
    RowFile::parse(Path::new("detections.txt"), text).unwrap()
}

fn linked(text: &str, options: &LinkOptions) -> Linked {
    link(&Detections::from_rows(&rows(text), |row| options.wants(row)).unwrap(), options).unwrap()
}

/// Boxes of 40 × 100 pixels around (x, 200) with a score of 0.9.
fn boxes(places: impl Iterator<Item = (u32, f64)>) -> String {
    places.fold(String::new(), |mut text, (frame, x)| {
        writeln!(text, "{frame},-1,{},150,40,100,0.9", x - 20.0).unwrap();
        text
    })
}

fn published() -> LinkOptions {
    LinkOptions {
        max_distance: Some(12.0),
        link_cost: Some(0.1),
        birth_cost: Some(1.0),
        detection_offset: Some(0.2),
        ..LinkOptions::default()
    }
}

/// Two people who walk towards each other, stand at one place in frame 10, and walk on.
fn crossing() -> String {
    boxes((1..=20).flat_map(|f| {
        let t = f64::from(f) - 10.0;
        [(f, 300.0 + 5.0 * t), (f, 300.0 - 5.0 * t)]
    }))
}

/// Whether each track continues in its direction.
fn all_pass(linked: &Linked) -> bool {
    linked.tracks.len() == 2
        && linked.tracks.iter().all(|t| (t[0].place.x - 300.0) * (t[t.len() - 1].place.x - 300.0) < 0.0)
}

#[test]
fn nothing_one_and_alone() {
    for options in [LinkOptions::default(), published()] {
        let nothing = linked("", &options);
        assert_eq!((nothing.tracks.len(), nothing.report.total_cost), (0, 0.0));
        assert_eq!(track_file(&nothing), "");
        // One detection gains less than a track costs.
        assert_eq!(linked("7,-1,1,2,30,60,0.9\n", &options).tracks.len(), 0);
    }
    let cheap = LinkOptions { birth_cost: Some(0.0), ..LinkOptions::default() };
    assert_eq!(track_file(&linked("7,-1,1,2,30,60,0.9\n", &cheap)), "7,1,1,2,30,60,0.9,-1,-1,-1\n");
}

#[test]
fn the_direction_constraint_carries_people_past_each_other() {
    let options = LinkOptions { direction_threshold: Some(4.0), ..published() };
    let found = linked(&crossing(), &options);
    assert!(all_pass(&found));
    // Going straight costs as much as turning back, so the bound is reached: this is the optimum.
    assert!(found.report.is_optimal, "{:?}", found.report);
    let skipping =
        LinkOptions { skip: 1, max_distance: Some(24.0), direction_threshold: Some(8.0), ..published() };
    let skipped = linked(&crossing(), &skipping);
    assert!(all_pass(&skipped));
    assert_eq!(skipped.report.detections, 20);
    // The detections of skipped frames are restored: 20 frames of two people, none invented.
    assert_eq!(skipped.tracks.iter().flatten().filter(|r| r.is_seen).count(), 40);
    // But no false detection, also where true ones are missing, and none on two tracks.
    let without = |is_missing: &dyn Fn(usize, &str) -> bool| {
        let whole = crossing();
        let kept: Vec<&str> =
            whole.lines().enumerate().filter(|(i, l)| !is_missing(*i, l)).map(|(_, l)| l).collect();
        kept.join("\n") + "\n"
    };
    let missed = without(&|_, line| line.starts_with("6,")) + &boxes([(6, 600.0)].into_iter());
    let seen = |text: &str| linked(text, &skipping).tracks.iter().flatten().filter(|r| r.is_seen).count();
    assert_eq!(seen(&missed), 38);
    let merged = without(&|index, _| index == 19);
    assert_eq!(seen(&merged), 39);
}

#[test]
fn no_detection_is_on_two_tracks_and_turns_are_limited() {
    // Noise decides which turns are allowed.
    let mut state = 5u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 65_536.0 - 0.5
    };
    let text = boxes(
        (1..=40)
            .flat_map(|f| {
                let t = f64::from(f) - 20.0;
                [300.0 + 4.0 * t, 300.0 - 4.0 * t, 310.0 + t].map(|x| (f, x))
            })
            .map(|(f, x)| (f, x + 6.0 * noise())),
    );
    let options = LinkOptions { direction_threshold: Some(5.0), keep_gaps: true, ..published() };
    let found = linked(&text, &options);
    let seen: Vec<(u32, u64)> =
        found.tracks.iter().flatten().map(|r| (r.frame, r.place.x.to_bits())).collect();
    assert_eq!(seen.iter().collect::<std::collections::HashSet<_>>().len(), seen.len());
    for track in &found.tracks {
        for t in track.windows(3) {
            let step = |a: &TrackRow, b: &TrackRow| (b.place - a.place) / f64::from(b.frame - a.frame);
            assert!((step(&t[1], &t[2]) - step(&t[0], &t[1])).norm() <= 5.0 + 1e-9);
        }
    }
    assert!(found.report.total_cost >= found.report.lower_bound);
}

#[test]
fn gaps_are_bridged_as_far_as_is_asked_for_and_filled() {
    let missing = |f: &u32| !(10..13).contains(f);
    let text = boxes((1..=25).filter(missing).map(|f| (f, 100.0 + 3.0 * f64::from(f))));
    let with = |gap: u32| LinkOptions { max_gap: Some(gap), ..published() };
    assert_eq!(linked(&text, &with(3)).tracks.len(), 2);
    let one = linked(&text, &with(4));
    assert_eq!(one.tracks.len(), 1);
    let filled: Vec<(u32, f64)> =
        one.tracks[0].iter().filter(|r| !r.is_seen).map(|r| (r.frame, r.place.x)).collect();
    assert_eq!(filled, [(10, 130.0), (11, 133.0), (12, 136.0)]);
    let kept = linked(&text, &LinkOptions { keep_gaps: true, ..with(4) });
    assert_eq!((kept.tracks.len(), kept.tracks[0].len()), (1, 22));
    // By default, motion bridges gaps that are too long for direct links.
    let fast = boxes((1..=60).filter(|f| !(25..40).contains(f)).map(|f| (f, 4.0 * f64::from(f))));
    let found = linked(&fast, &LinkOptions::default());
    assert_eq!((found.tracks.len(), found.tracks[0].len()), (1, 60));
    assert!((found.tracks[0][30].place.x - 4.0 * 31.0).abs() < 0.5);
}

#[test]
fn scale_does_not_matter_where_nothing_is_said() {
    let scaled = |k: f64| {
        let text = rows(&crossing());
        let mut detections = Detections::from_rows(&text, |_| true).unwrap();
        for d in &mut detections.all {
            d.place *= k;
            d.pixel_box = d.pixel_box.map(|mut b| {
                (b.left, b.top, b.width, b.height) = (b.left * k, b.top * k, b.width * k, b.height * k);
                b
            });
        }
        link(&detections, &LinkOptions::default()).unwrap()
    };
    let (small, large) = (scaled(0.25), scaled(8.0));
    let frames = |l: &Linked| l.tracks.iter().map(|t| (t.len(), t[0].frame)).collect::<Vec<_>>();
    assert_eq!(frames(&small), frames(&large));
    assert!((small.report.total_cost - large.report.total_cost).abs() < 1e-6);
}

#[test]
fn every_second_frame_at_half_the_rate_is_linked_alike() {
    // Three people pass each other at walking pace; two are not seen for half a second.
    let walks = |stride: u32| {
        boxes((1..=240).filter(|f| (f - 1) % stride == 0).flat_map(|f| {
            let t = f64::from(f) / 30.0;
            let seen = |from: f64| !(from..from + 0.5).contains(&t);
            let all = [(100.0 + 60.0 * t, seen(3.0)), (640.0 - 70.0 * t, seen(5.0)), (250.0 + 4.0 * t, true)];
            all.into_iter()
                .filter(|(_, is_seen)| *is_seen)
                .map(move |(x, _)| ((f - 1) / stride + 1, x))
                .collect::<Vec<_>>()
        }))
    };
    let ends = |stride: u32, rate: f64| {
        let options = LinkOptions { frames_per_s: Some(rate), ..LinkOptions::default() };
        let found = linked(&walks(stride), &options);
        found
            .tracks
            .iter()
            .map(|t| [t[0].place.x, t[t.len() - 1].place.x].map(|x| (x / 20.0).round() as i32))
            .collect::<Vec<_>>()
    };
    let whole = ends(1, 30.0);
    assert_eq!(whole.len(), 3, "{whole:?}");
    assert_eq!((ends(2, 15.0), ends(3, 10.0)), (whole.clone(), whole));
}

#[test]
fn gaps_are_bridged_for_so_many_seconds_whatever_the_rate() {
    let tracks = |rate: f64, lost_s: f64, said: Option<f64>| {
        let seen = |f: &u32| !(2.0..2.0 + lost_s).contains(&(f64::from(*f) / rate));
        let frames = (1..=(8.0 * rate) as u32).filter(seen);
        let text = boxes(frames.map(|f| (f, 100.0 + 40.0 * f64::from(f) / rate)));
        linked(&text, &LinkOptions { frames_per_s: said, ..LinkOptions::default() }).tracks.len()
    };
    for rate in [8.0, 25.0, 60.0] {
        assert_eq!((tracks(rate, 2.0, Some(rate)), tracks(rate, 3.5, Some(rate))), (1, 2), "{rate}");
    }
    // The default rate is 25.
    assert_eq!((tracks(25.0, 2.0, None), tracks(60.0, 2.0, None)), (1, 2));
}

#[test]
fn colours_tell_apart_who_cannot_be_told_apart_by_place() {
    use crate::histogram::Histogram;
    use std::sync::Arc;
    // Two people stand at one place for a second and a half, and their motion does not tell on which side each one
    // leaves.
    let text = boxes((1..=90).flat_map(|f| {
        let t = f64::from(f);
        let away = if f < 30 {
            5.0 * (30.0 - t)
        } else if f > 60 {
            5.0 * (t - 60.0)
        } else {
            0.0
        };
        [(f, 300.0 + away), (f, 300.0 - away)]
    }));
    let clothes = |color: [u8; 3]| {
        let mut histogram = Histogram::default();
        histogram.count(image::Rgb(color));
        Some(Arc::new(histogram))
    };
    let (red, blue) = (clothes([200, 10, 10]), clothes([10, 10, 200]));
    for options in [LinkOptions::default(), published()] {
        for changes_sides in [false, true] {
            let mut found = Detections::from_rows(&rows(&text), |row| options.wants(row)).unwrap();
            for (i, d) in found.all.iter_mut().enumerate() {
                let is_red = (i % 2 == 0) != (changes_sides && d.frame > 45);
                d.colours = if is_red { red.clone() } else { blue.clone() };
            }
            let tracks = link(&found, &options).unwrap().tracks;
            assert_eq!(tracks.len(), 2);
            for track in tracks {
                let (first, last) = (track[0].place.x - 300.0, track[track.len() - 1].place.x - 300.0);
                assert_eq!(first * last < 0.0, changes_sides);
            }
        }
    }
}

#[test]
fn floor_positions_are_linked_in_metres() {
    let text = (1..=30).filter(|f| f % 7 != 0).fold(String::new(), |mut text, f| {
        let t = f64::from(f);
        writeln!(
            text,
            "{f},-1,-1,-1,-1,-1,0.9,{},1.5,0\n{f},-1,-1,-1,-1,-1,0.9,{},3.5,0",
            0.08 * t,
            4.0 - 0.05 * t
        )
        .unwrap();
        text
    });
    let found = linked(&text, &LinkOptions::default());
    assert_eq!(found.tracks.iter().map(Vec::len).collect::<Vec<_>>(), [30, 30]);
    let written = rows(&track_file(&found));
    assert!(written.is_on_floor() && written.rows.iter().all(|row| row.id.is_some()) && !written.has_boxes());
    let mixed = rows("1,-1,1,1,5,5,0.9\n1,-1,-1,-1,-1,-1,0.9,1,1,0\n");
    let error = Detections::from_rows(&mixed, |_| true).unwrap_err().to_string();
    assert!(error.contains("detections.txt") && error.contains("line 1"), "{error}");
}

#[test]
fn classes_and_scores_are_filtered() {
    let text = "1,-1,0,0,10,20,0.9,1,0.5\n1,-1,50,0,10,20,0.9,7,0.5\n1,-1,90,0,10,20,0.3,1,0.5\n";
    let options = LinkOptions { class: Some(1), min_score: Some(0.5), ..LinkOptions::default() };
    let found = Detections::from_rows(&rows(text), |row| options.wants(row)).unwrap();
    assert_eq!(found.all.iter().map(|d| d.place.x).collect::<Vec<_>>(), [5.0]);
}

#[test]
fn options_that_mean_nothing_are_refused_by_name() {
    let refused = |options: LinkOptions| link(&Detections::default(), &options).unwrap_err().to_string();
    let some = LinkOptions::default;
    assert!(refused(LinkOptions { max_gap: Some(0), ..some() }).contains("max_gap"));
    assert!(refused(LinkOptions { max_distance: Some(-1.0), ..some() }).contains("max_distance"));
    assert!(
        refused(LinkOptions { max_colour_distance: Some(f64::NAN), ..some() })
            .contains("max_colour_distance")
    );
    assert!(refused(LinkOptions { window: Some(0), ..some() }).contains("window"));
    for rate in [0.0, -5.0, f64::NAN, f64::INFINITY] {
        assert!(refused(LinkOptions { frames_per_s: Some(rate), ..some() }).contains("frames_per_s"));
    }
    assert!(refused(LinkOptions { link_cost: Some(f64::NAN), ..some() }).contains("link_cost"));
    let both = LinkOptions { solver: SolverKind::Greedy, direction_threshold: Some(1.0), ..some() };
    assert!(refused(both).contains("greedy"));
    let huge = LinkOptions { birth_cost: Some(1e12), ..some() };
    assert!(refused(huge).contains("birth_cost"));
    let odd = Detections::from_rows(&rows("1,-1,0,0,10,20,1e300\n"), |row| some().wants(row)).unwrap();
    assert!(link(&odd, &published()).unwrap_err().to_string().contains("detection_offset"));
}

#[test]
fn cross_validation_finds_the_constraint_worth_having_and_tests_on_what_it_did_not_see() {
    // Crossings one after the other, with noise: without the constraint people swap.
    let mut state = 11u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        1.5 * (f64::from(state >> 16) / 65_536.0 - 0.5)
    };
    let (mut truth, mut found) = (String::new(), String::new());
    for scene in 0..12u32 {
        for f in 1..=20u32 {
            // The order is shuffled.
            let mut people = [(1, 1.0), (2, -1.0)];
            people.rotate_left(usize::from(noise() > 0.0));
            for (person, direction) in people {
                let x = 300.0 + direction * 5.0 * (f64::from(f) - 10.0);
                let (frame, id) = (30 * scene + f, 2 * scene + person);
                writeln!(truth, "{frame},{id},{},150,40,100,1", x - 20.0).unwrap();
                writeln!(found, "{frame},-1,{},{},40,100,0.9", x - 20.0 + noise(), 150.0 + noise()).unwrap();
            }
        }
    }
    let validate = |folds: usize, direction: bool| {
        let options = tune::TuneOptions { folds, direction, link: LinkOptions::default() };
        tune::cross_validate(&rows(&found), &rows(&truth), &options)
    };
    let (without, with) = (validate(4, false).unwrap(), validate(4, true).unwrap());
    assert!(with.score.success >= 90.0 && without.score.success <= 60.0, "{with:?} {without:?}");
    let frames: Vec<[u32; 2]> = with.folds.iter().map(|f| f.frames).collect();
    assert_eq!(frames, [[1, 87], [88, 175], [176, 262], [263, 350]]);
    assert_eq!(with.folds.iter().map(|f| f.people).sum::<usize>(), 24);
    assert!(
        with.table().contains("--direction-threshold") && !without.table().contains("--direction-threshold")
    );
    for folds in [0, 1, 351] {
        assert!(validate(folds, false).unwrap_err().to_string().contains("folds"), "{folds}");
    }
}

#[test]
fn a_fold_is_judged_with_thresholds_that_never_saw_it() {
    // In the last third people walk faster than any threshold that suits the first two thirds permits.
    let walk = |f: u32| if f <= 40 { 2.0 * f64::from(f) } else { 80.0 + 30.0 * (f64::from(f) - 40.0) };
    let line = |id: &str, confidence: &str| {
        (1..=60).fold(String::new(), |mut text, f| {
            writeln!(text, "{f},{id},{},150,40,100,{confidence}", walk(f)).unwrap();
            text
        })
    };
    let options = tune::TuneOptions { folds: 3, direction: false, link: LinkOptions::default() };
    let found = tune::cross_validate(&rows(&line("-1", "0.9")), &rows(&line("1", "1")), &options).unwrap();
    assert!(found.folds[2].chosen.max_distance < 30.0 && found.folds[2].score.success < 1.0, "{found:?}");
    assert!(found.best.max_distance > 30.0);
}

#[test]
fn margins_of_a_classifier_are_taken_as_log_odds_where_nothing_is_said() {
    let scored = |score: &dyn Fn(f64) -> f64| {
        let text = (1..=30u32).fold(String::new(), |mut text, f| {
            let sure = score(1.5 + 0.1 * f64::from(f % 20));
            writeln!(text, "{f},-1,{},150,40,100,{sure}", 100 + 2 * f).unwrap();
            text
        });
        linked(&text, &LinkOptions::default())
    };
    let (margins, odds) = (scored(&|s| s), scored(&|s: f64| 1.0 / (1.0 + (-s).exp())));
    assert!((margins.report.total_cost - odds.report.total_cost).abs() < 1e-6);
    // The written scores are the detector's own.
    assert!((margins.tracks[0][0].score - 1.6).abs() < 1e-12);
}
