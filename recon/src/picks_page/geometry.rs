//! Geometry of the page: residuals of picks and epipolar lines, for one pair of cameras at a time.
//!
//! Each camera's capture has become a surface, so three picks of a pair already join the two; they are joined as a build
//! begins to, which gives each pick's distance from where the others put it ([`crate::merge`]).

use nalgebra::{Point2, Point3, Similarity3};
use serde::Serialize;

use crate::merge::{self, MergeOptions};
use crate::pipeline::ReferenceView;
use crate::project::{LEAST_SHARED_POINTS, PickedPoint, Project, ProjectCamera};

/// Nearest and farthest depth of an epipolar line, in shares of the surface's median depth, …
const NEAREST: f64 = 0.1;
const FARTHEST: f64 = 30.0;
/// … and number of its points.
const STEPS: i32 = 96;

/// Two cameras joined by their picks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JoinedPair {
    pub(super) first_from_second: Similarity3<f64>,
    /// Distance of each pick from where the others put it: index of the point, camera of the pair (0 or 1), pixels.
    pub(super) misfits: Vec<(usize, usize, f64)>,
    /// Indices of points that were left out.
    pub(super) left_out: Vec<usize>,
}

/// Joins two cameras by their points in common (filmed pixels; `None` in either where it is not picked).
///
/// # Errors
/// One line, where they share too few points or these contradict each other.
pub(super) fn join(
    views: [&ReferenceView; 2],
    points: &[[Option<Point2<f64>>; 2]],
) -> Result<JoinedPair, String> {
    let shared = points.iter().enumerate().filter_map(|(index, [a, b])| {
        let picks = vec![(0, views[0].pinhole(&(*a)?)?), (1, views[1].pinhole(&(*b)?)?)];
        Some((index, PickedPoint { picks }))
    });
    let (indices, points): (Vec<usize>, Vec<PickedPoint>) = shared.unzip();
    if points.len() < LEAST_SHARED_POINTS {
        return Err(format!("{} of {LEAST_SHARED_POINTS} points", points.len()));
    }
    let camera = |view: &ReferenceView| ProjectCamera {
        name: view.name.clone(),
        capture: view.name.clone().into(),
        reference: crate::capture::ReferenceFrame::Last,
        intrinsics: None,
    };
    let project = Project {
        path: "picks".into(),
        cameras: views.map(camera).into(),
        points,
        are_points_proposed: false,
        lengths: Vec::new(),
        control_points: Vec::new(),
    };
    let surfaces = views.map(|view| view.surface.clone());
    let lenses = views.map(|view| view.surface.intrinsics.clone());
    let joined = merge::merge(&project, &surfaces, &lenses, &[vec![], vec![]], &MergeOptions::default());
    let (merged, report) = joined.map_err(|error| {
        // The points of the pair are numbered as the page has them.
        let text = error.to_string();
        let text = text.trim_start_matches("picks: ").trim_start_matches("[[point]]: ");
        indices.iter().enumerate().rev().fold(text.to_owned(), |text, (own, index)| {
            text.replace(&format!("[[point]] {},", own + 1), &format!("point {}, camera", index + 1))
        })
    })?;
    let misfits = report.misfits_px.iter().chain(&report.outliers);
    Ok(JoinedPair {
        first_from_second: merged.common_from_camera[0].inverse() * merged.common_from_camera[1],
        misfits: misfits.map(|(number, camera, px)| (indices[number - 1], *camera, *px)).collect(),
        left_out: report.outliers.iter().map(|(number, ..)| indices[number - 1]).collect(),
    })
}

/// Positions of a pixel in another camera's picture.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct EpipolarLine {
    /// Its places at all depths, filmed pixels, from near to far.
    pub(super) line: Vec<Point2<f64>>,
    /// Its place at the depth that its own capture measured, if it is in the picture.
    pub(super) guess: Option<Point2<f64>>,
}

/// Epipolar line of a filmed pixel of `from` in the picture of `onto`.
pub(super) fn epipolar(
    from: &ReferenceView,
    onto: &ReferenceView,
    onto_from: &Similarity3<f64>,
    pixel: &Point2<f64>,
) -> Option<EpipolarLine> {
    let pinhole = from.pinhole(pixel)?;
    let ray = from.surface.intrinsics.unproject(&pinhole)?;
    let seen = |point: Point3<f64>| {
        let there = onto_from * point;
        let pinhole = onto.surface.intrinsics.project(&there).filter(|_| there.z > 0.0)?;
        onto.filmed(&pinhole)
    };
    let typical = median_depth(from)?;
    let depth = |step: i32| typical * NEAREST * (FARTHEST / NEAREST).powf(f64::from(step) / f64::from(STEPS));
    let line = (0..=STEPS).filter_map(|step| seen(Point3::from(ray * depth(step)))).collect();
    let guess = from.surface.point_at(&pinhole).and_then(seen);
    Some(EpipolarLine { line, guess })
}

fn median_depth(view: &ReferenceView) -> Option<f64> {
    let mut depths: Vec<f32> = view.surface.depth.iter().step_by(17).copied().filter(|z| *z > 0.0).collect();
    depths.sort_by(f32::total_cmp);
    depths.get(depths.len() / 2).map(|z| f64::from(*z))
}
