//! Camera motion from captures against the true poses, and captures that must be refused.

use std::ops::Range;
use std::path::Path;

use calib::Intrinsics;
use image::{Rgb, RgbImage};
use nalgebra::{Point2, Point3, UnitQuaternion, Vector3};
use recon::capture::{Capture, ReferenceFrame, Sampled};
use recon::motion::{LensOrigin, Motion, MotionOptions, MotionReport, estimate};
use tests::accuracy::{self, MotionError};

fn lens(folder: &Path, file: &str) -> Intrinsics {
    calib::files::read_intrinsics(&folder.join(file)).unwrap()
}

fn shipped(camera: &str) -> Capture {
    let office = tests::data::office();
    let film = office.join(format!("capture/{camera}.mp4"));
    Capture::load(camera, &film, ReferenceFrame::Last, Some(lens(&office, &format!("{camera}.toml"))))
        .unwrap()
}

fn measured(folder: &Path, capture: &Capture, motion: &Motion, report: &MotionReport) -> MotionError {
    let truth = accuracy::capture_truth(&folder.join("truth.json"), &capture.name).unwrap();
    let error = accuracy::motion(&motion.camera_from_world, &truth).unwrap();
    eprintln!("{}: {error:?} {report:?}", capture.name);
    error
}

#[test]
fn the_office_captures_are_followed_to_a_millimetre() {
    for camera in ["cam0", "cam1"] {
        let capture = shipped(camera);
        let (motion, report) = estimate(&capture, &MotionOptions::default()).unwrap();
        let error = measured(&tests::data::office(), &capture, &motion, &report);
        assert_eq!(error.frames, capture.frames.len());
        assert!(error.position_rms_cm <= 0.1 && error.rotation_rms_deg <= 0.02, "{error:?}");
        let reference = motion.camera_from_world[capture.reference].unwrap();
        assert_eq!(reference, nalgebra::Isometry3::identity());
    }
}

#[test]
fn a_real_kitchen_of_shared_data_is_followed_to_its_truths_own_error() {
    let Some(folder) = tests::data::shared("hololens") else { return };
    for (camera, position_cm, rotation_deg) in [("a", 2.0, 0.6), ("b", 2.2, 0.36)] {
        let source = folder.join("capture").join(camera);
        let lens = lens(&folder, "intrinsics.toml");
        let capture = Capture::load(camera, &source, ReferenceFrame::Last, Some(lens)).unwrap();
        let (motion, report) = estimate(&capture, &MotionOptions::default()).unwrap();
        let error = measured(&folder, &capture, &motion, &report);
        assert_eq!(error.frames, capture.frames.len());
        assert!(error.position_rms_cm <= position_cm && error.rotation_rms_deg <= rotation_deg, "{error:?}");
    }
}

#[test]
fn the_focal_length_is_found_where_no_intrinsics_are_given() {
    let mut capture = shipped("cam0");
    let truth = capture.intrinsics.take().unwrap();
    let (motion, report) = estimate(&capture, &MotionOptions::default()).unwrap();
    let error = measured(&tests::data::office(), &capture, &motion, &report);
    let off = (motion.intrinsics.fx / truth.fx - 1.0).abs();
    let sigma = report.focal_sigma.unwrap();
    assert!(off < 0.01 && sigma < 0.01 && off < 4.0 * sigma, "{off}, sigma {sigma}");
    assert!(error.position_rms_cm <= 0.3 && error.rotation_rms_deg <= 0.1, "{error:?}");
}

#[test]
fn wrong_intrinsics_are_contradicted_and_refined_when_asked() {
    let mut capture = shipped("cam1");
    capture.frames.drain(..25);
    capture.reference = capture.frames.len() - 1;
    let run = |factor: f64, refine_lens: bool| {
        let mut capture = capture.clone();
        let given = capture.intrinsics.as_mut().unwrap();
        given.fx *= factor;
        given.fy *= factor;
        let given = given.clone();
        let (motion, report) =
            estimate(&capture, &MotionOptions { refine_lens, ..MotionOptions::default() }).unwrap();
        (given, motion.intrinsics, report)
    };
    let truth = capture.intrinsics.clone().unwrap();
    // A correct lens is kept, though refining it is allowed.
    let (given, used, report) = run(1.0, true);
    assert_eq!((&used, report.lens), (&given, LensOrigin::Given));
    let (given, used, report) = run(1.03, false);
    assert_eq!((&used, report.lens, report.focal_sigma), (&given, LensOrigin::Contradicted, None));
    let (_, used, report) = run(1.03, true);
    let off = (used.fx / truth.fx - 1.0).abs();
    let sigma = report.focal_sigma.unwrap();
    eprintln!("{used:?} {sigma}");
    assert_eq!(report.lens, LensOrigin::Refined);
    assert!(off < 0.005 && sigma < 0.005 && off < 4.0 * sigma, "{used:?} {sigma}");
}

#[test]
fn threads_change_no_byte() {
    let mut capture = shipped("cam1");
    capture.frames.drain(..38);
    capture.reference = capture.frames.len() - 1;
    let run = |threads: usize| {
        let pool = rayon_pool(threads);
        pool.install(|| estimate(&capture, &MotionOptions::default()).unwrap().0)
    };
    assert_eq!(run(1), run(3));
}

fn rayon_pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

/// Capture of a camera that only turns: one frame, warped by rotations.
fn turning(picture: &RgbImage, wide: &Intrinsics, frames: u32) -> Capture {
    let narrow = Intrinsics::from_horizontal_fov(400, 300, 40.0);
    let seen = |turn: &UnitQuaternion<f64>| {
        RgbImage::from_fn(narrow.width, narrow.height, |u, v| {
            let ray = narrow.unproject(&Point2::new(f64::from(u), f64::from(v))).unwrap();
            let Some(at) = wide.project(&Point3::from(turn * ray)) else { return Rgb([0; 3]) };
            bilinear(picture, &at)
        })
    };
    let turns = (0..frames).map(|f| {
        let s = f64::from(f) * 0.12;
        UnitQuaternion::from_scaled_axis(Vector3::new(0.1 * s.sin(), 0.2 * (0.7 * s).sin(), 0.05 * s))
    });
    Capture {
        name: "turning".into(),
        frames: turns.map(|t| seen(&t)).collect(),
        sampled: Sampled::ALL,
        reference: frames as usize - 1,
        intrinsics: Some(narrow),
        exif_focal_px: None,
        larger: None,
    }
}

fn bilinear(picture: &RgbImage, at: &Point2<f64>) -> Rgb<u8> {
    let (x, y) = (at.x.clamp(0.0, 638.0), at.y.clamp(0.0, 478.0));
    let (left, top) = (x.floor(), y.floor());
    let pixel = |dx: u32, dy: u32| picture.get_pixel(left as u32 + dx, top as u32 + dy).0.map(f64::from);
    let corners = [pixel(0, 0), pixel(1, 0), pixel(0, 1), pixel(1, 1)];
    let (fx, fy) = (x - left, y - top);
    Rgb(std::array::from_fn(|c| {
        let above = corners[0][c] * (1.0 - fx) + corners[1][c] * fx;
        let below = corners[2][c] * (1.0 - fx) + corners[3][c] * fx;
        (above * (1.0 - fy) + below * fy).round() as u8
    }))
}

#[test]
fn a_camera_that_only_turns_is_told_to_move() {
    let office = shipped("cam0");
    let wide = office.intrinsics.clone().unwrap();
    let said = estimate(&turning(&office.frames[49], &wide, 24), &MotionOptions::default());
    let said = said.map(|(_, report)| report).unwrap_err().to_string();
    eprintln!("{said}");
    assert!(said.contains("`turning`") && said.contains("sideways"), "{said}");
}

/// The capture with a moving poster that covers these columns (as shares of the width); posters of different phases
/// move differently.
fn with_a_moving_poster(mut capture: Capture, columns: Range<f64>, phase: i64) -> Capture {
    let poster = shipped("cam1").frames.swap_remove(20);
    let (width, height) = poster.dimensions();
    let column = |share: f64| (share * f64::from(width)) as u32;
    for (index, frame) in (phase..).zip(&mut capture.frames) {
        // To and fro, and up and down, unlike any static thing's apparent motion.
        let (dx, dy) = (4 * (index % 7 - 3).abs(), 4 * ((index + 2) % 5 - 2).abs());
        for v in 0..height {
            for u in column(columns.start)..column(columns.end) {
                let (x, y) = ((i64::from(u) + dx) as u32, (i64::from(v) + dy) as u32);
                *frame.get_pixel_mut(u, v) = *poster.get_pixel(x.min(width - 1), y.min(height - 1));
            }
        }
    }
    capture
}

#[test]
fn moving_things_are_left_out_and_mostly_moving_scenes_are_reported() {
    let mut capture = shipped("cam0");
    capture.frames.drain(..30);
    capture.reference = capture.frames.len() - 1;
    let truth = accuracy::capture_truth(&tests::data::office().join("truth.json"), "cam0").unwrap();
    let little = with_a_moving_poster(capture.clone(), 0.0..0.25, 0);
    let (motion, report) = estimate(&little, &MotionOptions::default()).unwrap();
    let error = accuracy::motion(&motion.camera_from_world, &truth[30..]).unwrap();
    eprintln!("{error:?} {report:?}");
    assert!(error.position_rms_cm < 0.1 && error.rotation_rms_deg < 0.02, "{error:?}");
    assert!(report.explained_share < 0.85, "{report:?}");

    // Two posters: a single one could be explained by a camera that moves before it.
    let most = with_a_moving_poster(with_a_moving_poster(capture, 0.0..0.45, 0), 0.5..1.0, 3);
    let said = estimate(&most, &MotionOptions::default()).map(|r| r.1).unwrap_err().to_string();
    assert!(said.contains("`cam0`") && said.contains("move through"), "{said}");
}

#[test]
fn a_capture_that_does_not_show_its_reference_is_told_so() {
    let mut capture = shipped("cam0");
    // The last frame is another camera's, as if the camera had been installed elsewhere.
    let elsewhere = shipped("cam1").frames.pop().unwrap();
    capture.frames.drain(..30);
    capture.reference = capture.frames.len() - 1;
    capture.frames[capture.reference] = elsewhere;
    let said = estimate(&capture, &MotionOptions::default()).map(|r| r.1).unwrap_err().to_string();
    eprintln!("{said}");
    assert!(said.contains("`cam0`") && said.contains("reference frame (frame 20)"), "{said}");
}

#[test]
fn dark_frames_and_still_cameras_are_refused() {
    let mut capture = shipped("cam0");
    let still = Capture { frames: vec![capture.frames[49].clone(); 12], reference: 11, ..capture.clone() };
    let said = estimate(&still, &MotionOptions::default()).map(|r| r.1).unwrap_err().to_string();
    eprintln!("{said}");
    assert!(said.contains("sideways"), "{said}");

    capture.frames = vec![RgbImage::from_pixel(640, 480, Rgb([4; 3])); 10];
    capture.reference = 9;
    let said = estimate(&capture, &MotionOptions::default()).map(|r| r.1).unwrap_err().to_string();
    eprintln!("{said}");
    assert!(said.contains("more light"), "{said}");
    capture.frames.clear();
    assert!(estimate(&capture, &MotionOptions::default()).is_err());
}
