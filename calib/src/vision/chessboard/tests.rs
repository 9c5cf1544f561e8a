//! Boards that are described wrongly, found in pictures, and calibrated from.

use super::*;
use crate::{Fisheye, Rational};
use nalgebra::Rotation3;

#[test]
fn patterns_are_read_and_refused() {
    assert_eq!("9x6".parse(), Ok(Chessboard { columns: 9, rows: 6 }));
    for bad in ["", "9", "9x", "x6", "2x9", "9x-6", "9 x 6"] {
        assert!(bad.parse::<Chessboard>().is_err(), "{bad}");
    }
}

/// Exact corners of a board of 25 mm squares half a metre away, turned by these angles, at (x, y) from the axis.
fn seen(tilts_deg: &[[f64; 2]], places_m: &[[f64; 2]]) -> Vec<Vec<Point2<f64>>> {
    seen_by(&Intrinsics::from_horizontal_fov(640, 480, 60.0), tilts_deg, places_m, 0.5)
}

fn seen_by(
    camera: &Intrinsics,
    tilts_deg: &[[f64; 2]],
    places_m: &[[f64; 2]],
    away_m: f64,
) -> Vec<Vec<Point2<f64>>> {
    let view = |([around_x, around_y], [x, y]): (&[f64; 2], &[f64; 2])| {
        let turn = Rotation3::from_euler_angles(around_x.to_radians(), around_y.to_radians(), 0.0);
        let corner = |i: u32| {
            let on_board = Vector3::new(f64::from(i % 9) - 4.0, f64::from(i / 9) - 2.5, 0.0);
            let at = turn * (on_board * 0.025) + Vector3::new(*x, *y, away_m);
            camera.project(&at.into()).unwrap()
        };
        (0..54).map(corner).collect()
    };
    tilts_deg.iter().zip(places_m).map(view).collect()
}

const PLACES_M: [[f64; 2]; 5] = [[0.0, 0.0], [0.08, 0.03], [-0.07, 0.05], [0.05, -0.06], [-0.05, -0.04]];

#[test]
fn views_that_tell_no_lens_are_refused() {
    let board: Chessboard = "9x6".parse().unwrap();
    let tilted = [[0.0, 0.0], [30.0, 0.0], [-25.0, 20.0], [0.0, 30.0], [10.0, -30.0]];
    let found =
        board.calibrate(&seen(&tilted, &PLACES_M), (640, 480), 0.025, LensModel::BrownConrady).unwrap();
    let expected = Intrinsics::from_horizontal_fov(640, 480, 60.0).fx;
    assert!((found.intrinsics.fx / expected - 1.0).abs() < 0.01, "{found:?}");
    let refused = |views: &[Vec<Point2<f64>>]| {
        let said =
            board.calibrate(views, (640, 480), 0.025, LensModel::BrownConrady).unwrap_err().to_string();
        assert!(said.contains("focal length") && said.contains("tilt the board"), "{said}");
    };
    // All parallel, facing the camera or aslant; one view three times.
    refused(&seen(&[[0.0, 0.0]; 5], &PLACES_M));
    refused(&seen(&[[2.0, -1.0], [0.0, 2.0], [-1.0, 0.0], [1.0, 1.0], [-2.0, 0.0]], &PLACES_M));
    refused(&seen(&[[20.0, 10.0]; 5], &PLACES_M));
    refused(&seen(&[[30.0, 10.0]; 3], &[[0.02, 0.01]; 3]));
}

#[test]
fn real_views_agree_with_the_reference_calibration_of_shared_data() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/chessboard");
    let Ok(entries) = std::fs::read_dir(folder) else {
        eprintln!("skipped: {folder} is not here");
        return;
    };
    let mut paths: Vec<_> =
        entries.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "jpg")).collect();
    paths.sort();
    let board: Chessboard = "9x6".parse().unwrap();
    let views: Vec<_> =
        paths.iter().filter_map(|p| board.find(&image::open(p).unwrap().into_luma8()).unwrap()).collect();
    assert_eq!(views.len(), 13);
    let found = board.calibrate(&views, (640, 480), 0.025, LensModel::BrownConrady).unwrap();
    // OpenCV's own sample calibration of these images (left_intrinsics.yml): f 535.9, c (342.3, 235.6), 0.39 px.
    assert!(
        (found.intrinsics.fx - 535.9).abs() < 4.0 && (found.intrinsics.fy - 535.9).abs() < 4.0,
        "{found:?}"
    );
    assert!(
        (found.intrinsics.cx - 342.3).abs() < 3.0 && (found.intrinsics.cy - 235.6).abs() < 3.0,
        "{found:?}"
    );
    assert!(found.rms_px < 0.45 && found.view_rms_px.len() == 13, "{found:?}");
    for view in &views {
        let copies = [view.clone(), view.clone(), view.clone()];
        let said =
            board.calibrate(&copies, (640, 480), 0.025, LensModel::BrownConrady).unwrap_err().to_string();
        assert!(said.contains("tilt the board"), "{said}");
    }
    for three in views.windows(3) {
        board.calibrate(three, (640, 480), 0.025, LensModel::BrownConrady).unwrap();
    }
}

/// Corners of a lens of the model, with noise of a twentieth of a pixel, give the lens back, and its uncertainty.
#[test]
fn wide_lenses_are_found_with_their_model() {
    let board: Chessboard = "9x6".parse().unwrap();
    let lenses: [Distortion; 2] = [
        Rational::from([0.25, 0.03, 0.001, -0.001, 0.001, 0.55, 0.1, 0.005]).into(),
        Fisheye::from([0.02, -0.006, 0.001, -0.0002]).into(),
    ];
    for distortion in lenses {
        let truth = Intrinsics {
            fx: 265.0,
            fy: 264.0,
            distortion,
            ..Intrinsics::from_horizontal_fov(640, 480, 60.0)
        };
        let tilts = [[10.0, 5.0], [30.0, 0.0], [-25.0, 20.0], [0.0, 30.0], [10.0, -30.0], [-30.0, -10.0]];
        let places = [[0.0, 0.0], [0.25, 0.1], [-0.25, 0.1], [0.2, -0.12], [-0.2, -0.1], [0.1, 0.14]];
        let mut views = Vec::new();
        for (at, place) in places.iter().enumerate() {
            for turned in 0..2 {
                let tilt = tilts[(at + 2 * turned) % 6];
                views.extend(seen_by(&truth, &[tilt], &[*place], 0.25));
            }
        }
        for (i, pixel) in views.iter_mut().flatten().enumerate() {
            let wave = |step: f64| 0.07 * (step * i as f64).sin();
            *pixel += Vector2::new(wave(12.9898), wave(78.233));
        }
        let found = board.calibrate(&views, (640, 480), 0.025, distortion.model()).unwrap();
        assert!(found.rms_px < 0.1, "{found:?}");
        let sigma = found.sigma_px[0];
        assert!(sigma > 0.0 && (found.intrinsics.fx - truth.fx).abs() < 6.0 * sigma.max(0.05), "{found:?}");
        for (u, v) in [(320.0, 240.0), (100.0, 240.0), (540.0, 380.0)] {
            let pixel = Point2::new(u, v);
            let [own, true_ray] = [&found.intrinsics, &truth].map(|k| k.unproject(&pixel).unwrap());
            assert!(own.angle(&true_ray) < 3e-3, "{pixel}: {} rad", own.angle(&true_ray));
        }
    }
}

#[test]
fn no_board_is_no_error_and_no_views_are() {
    let board: Chessboard = "9x6".parse().unwrap();
    assert_eq!(board.find(&GrayImage::new(64, 48)).unwrap(), None);
    assert!(
        board
            .calibrate(&[], (64, 48), 0.025, LensModel::BrownConrady)
            .unwrap_err()
            .to_string()
            .contains("at least 3")
    );
}
