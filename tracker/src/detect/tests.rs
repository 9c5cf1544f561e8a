//! Tests of detection as a whole, on drawn people.

use image::Rgb;

use super::train::{Labelled, TrainOptions};
use super::*;

/// Picture with figures whose heads are at these places, 90 pixels high, before a striped wall.
fn picture(heads: &[(i64, i64)]) -> RgbImage {
    RgbImage::from_fn(320, 240, |u, v| {
        let (u, v) = (i64::from(u), i64::from(v));
        let inside = heads.iter().any(|(x, top)| {
            let (du, dv) = ((u - x).abs(), v - top);
            (0..15).contains(&dv) && du < 7
                || (15..55).contains(&dv) && du < 14
                || (55..90).contains(&dv) && (3..12).contains(&du)
        });
        let stripe = (u / 40 + v / 60) % 2 * 30;
        if inside { Rgb([30, 35, 60]) } else { Rgb([(170 + stripe) as u8, (165 + stripe) as u8, 150]) }
    })
}

fn person(x: i64, top: i64) -> PixelBox {
    PixelBox { left: x as f64 - 18.0, top: top as f64, width: 36.0, height: 90.0 }
}

fn options() -> DetectOptions {
    DetectOptions { min_height_px: 80.0, max_height_px: Some(110.0), ..DetectOptions::default() }
}

#[test]
fn a_camera_learns_its_own_people() {
    let places =
        [[(60, 40), (200, 60)], [(100, 90), (250, 30)], [(40, 100), (150, 50)], [(230, 100), (90, 20)]];
    let labelled: Vec<Labelled> = places
        .iter()
        .map(|heads| Labelled {
            image: picture(heads),
            people: heads.iter().map(|(x, top)| person(*x, *top)).collect(),
            ignored: Vec::new(),
        })
        .collect();
    let train_options = TrainOptions { detect: options(), ..TrainOptions::default() };
    let mut steps = 0;
    let (weights, report) = train::train(&labelled, &[picture(&[])], &train_options, || steps += 1).unwrap();
    assert_eq!((report.people, steps), (16, 15));
    assert!(report.background > 20, "{report:?}");
    // The same again with the detector read from its file, on new pictures.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.json");
    train::write(&path, &weights).unwrap();
    let detector = Detector::read(&path, options()).unwrap();
    for heads in [[(70, 70), (180, 40)], [(120, 30), (260, 80)]] {
        let found = detector.look(&picture(&heads)).unwrap();
        let hit =
            |head: &(i64, i64)| found.iter().take(2).any(|f| f.pixel_box.iou(&person(head.0, head.1)) > 0.5);
        assert!(heads.iter().all(hit), "{heads:?}: {found:?}");
    }
    assert!(detector.look(&picture(&[])).unwrap().len() <= 1);
    let again = train::train(&labelled, &[picture(&[])], &train_options, || {}).unwrap();
    assert_eq!(again.0, weights, "the same seed");
    let nobody = [Labelled { image: picture(&[]), people: Vec::new(), ignored: Vec::new() }];
    assert!(train::train(&nobody, &[], &train_options, || {}).unwrap_err().to_string().contains("labelled"));
}

#[test]
fn broken_models_and_odd_options_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.json");
    let said = |text: &str| {
        std::fs::write(&path, text).unwrap();
        Detector::read(&path, options()).err().unwrap().to_string()
    };
    assert!(said("{").contains("line 1"));
    assert!(said("{\"format\":7,\"weights\":[]}").contains("format"));
    assert!(said("{\"format\":1,\"weights\":[1.0,2.0]}").contains("3781"));
    std::fs::remove_file(&path).unwrap();
    assert!(Detector::read(&path, options()).err().unwrap().to_string().contains("own.json"));
    for (bad, name) in [
        (DetectOptions { min_height_px: 0.0, ..options() }, "min_height_px"),
        (DetectOptions { max_height_px: Some(10.0), ..options() }, "max_height_px"),
        (DetectOptions { scale_step: 1.0, ..options() }, "scale_step"),
        (DetectOptions { min_score: f64::NAN, ..options() }, "min_score"),
        (DetectOptions { max_overlap: 2.0, ..options() }, "max_overlap"),
    ] {
        assert!(bad.check().unwrap_err().to_string().contains(name));
    }
}

#[test]
fn of_overlapping_detections_only_the_highest_score_is_kept() {
    let found = |left: f64, score: f64| DetectedPerson {
        pixel_box: PixelBox { left, top: 0.0, width: 10.0, height: 20.0 },
        score,
    };
    // The second overlaps with the first, the third only with the second.
    let kept = suppress::keep_surest(&[found(0.0, 3.0), found(3.0, 2.0), found(7.0, 1.0)], 0.4);
    assert_eq!(kept, [found(0.0, 3.0), found(7.0, 1.0)]);
    assert_eq!(rows(4, &kept[1..]), "4,-1,7.00,0.00,10.00,20.00,1.0000,-1,-1,-1\n");
}
