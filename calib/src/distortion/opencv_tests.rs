//! Each model held to OpenCV's own projection.
#![cfg(feature = "vision")]

use nalgebra::{Point2, Point3};
use opencv::calib3d;
use opencv::core::{Mat, Point2d, Point3d, Vector};
use proptest::prelude::*;

use super::{Distortion, LensModel};
use crate::Intrinsics;

/// Pixel of a point in camera coordinates by OpenCV.
fn projected(k: &Intrinsics, p: &Point3<f64>) -> Point2<f64> {
    let matrix = Mat::from_slice_2d(&[[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]]).unwrap();
    let coefficients = Vector::from_slice(&k.distortion.coefficients());
    let points = Vector::<Point3d>::from_slice(&[Point3d::new(p.x, p.y, p.z)]);
    let none = Vector::<f64>::from_slice(&[0.0; 3]);
    let mut pixels = Vector::<Point2d>::new();
    if k.distortion.model() == LensModel::Fisheye {
        let d = Mat::from_slice(coefficients.as_slice()).unwrap().clone_pointee();
        calib3d::fisheye_project_points_vec_def(&points, &mut pixels, &none, &none, &matrix, &d).unwrap();
    } else {
        let mut jacobian = Mat::default();
        calib3d::project_points(
            &points,
            &none,
            &none,
            &matrix,
            &coefficients,
            &mut pixels,
            &mut jacobian,
            0.0,
        )
        .unwrap();
    }
    let pixel = pixels.get(0).unwrap();
    Point2::new(pixel.x, pixel.y)
}

fn lens(model: LensModel, numbers: &[f64]) -> Intrinsics {
    let size = model.coefficient_names().len();
    let distortion = Distortion::new(model, &numbers[..size]).unwrap();
    Intrinsics { width: 640, height: 480, fx: 310.0, fy: 305.0, cx: 322.0, cy: 237.5, distortion }
}

proptest! {
    #[test]
    fn every_model_projects_as_opencv_does(
        which in 0..3usize,
        shares in prop::array::uniform8(-1.0..1.0f64),
        (x, y, z) in (-1.2..1.2f64, -0.9..0.9f64, 0.3..9.0f64),
    ) {
        // Radial numbers of a tenth, tangential ones of a hundredth; a fisheye's higher ones are smaller.
        let sizes = [[0.1, 0.05, 0.01, 0.01, 0.01, 0.0, 0.0, 0.0],
            [0.3, 0.1, 0.01, 0.01, 0.02, 0.3, 0.1, 0.02],
            [0.1, 0.03, 0.01, 0.003, 0.0, 0.0, 0.0, 0.0]];
        let numbers: Vec<f64> = shares.iter().zip(sizes[which]).map(|(share, size)| share * size).collect();
        let k = lens(LensModel::ALL[which], &numbers);
        let p = Point3::new(x * z, y * z, z);
        if let Some(own) = k.project(&p) {
            let theirs = projected(&k, &p);
            prop_assert!((own - theirs).norm() < 1e-9 * (1.0 + own.coords.norm()), "{own} against {theirs}: {k:?}");
        }
    }
}

#[test]
fn a_lens_round_trips_over_its_picture() {
    let lenses = [
        lens(LensModel::BrownConrady, &[-0.1, 0.02, 1e-3, -1e-3, 0.0]),
        lens(LensModel::Rational, &[0.1, 0.01, 1e-3, -1e-3, 0.0, 0.3, 0.03, 0.0]),
        lens(LensModel::Fisheye, &[-0.02, 0.005, -0.002, 0.0003]),
    ];
    for k in lenses {
        for (u, v) in (0..=32).flat_map(|i| (0..=24).map(move |j| (20.0 * f64::from(i), 20.0 * f64::from(j))))
        {
            let pixel = Point2::new(u - 0.5, v - 0.5);
            let ray = k.unproject(&pixel).unwrap_or_else(|| panic!("{pixel} has no ray: {k:?}"));
            let back = projected(&k, &Point3::from(ray * 2.5));
            assert!((back - pixel).norm() < 1e-8, "{pixel} came back as {back}: {k:?}");
        }
    }
}
