//! Verification of a similarity that features suggest, by both cameras' surfaces and pictures.
//!
//! Rooms have repetitions: two corners with the same wallpaper, lamps and doors look alike, and features alone confuse
//! them consistently. But where two surfaces coincide, their pictures must agree; and a space that one camera looks
//! through cannot be filled by the other's surfaces.

use nalgebra::{Matrix2, Point2, Point3, Similarity3, Vector3};
use rayon::prelude::*;

use crate::features::{Intensity, Patch, Reading, Warp};
use crate::surface::{DepthOrigin, Surface};

/// Step between the pixels that are compared.
const STRIDE: usize = 6;
/// Largest relative difference in depth of coinciding surfaces …
const SAME: f64 = 0.04;
/// … least cosine between their normals; and relative distance by which a nearer surface obstructs the other's view.
const FACING: f64 = 0.85;
const BEFORE: f64 = 0.06;
/// Half the side of the patches that are compared.
const RADIUS_PX: i32 = 7;

/// A reference view prepared for the comparison.
pub(super) struct ComparedView<'a> {
    pub(super) surface: &'a Surface,
    pub(super) intensity: Intensity,
}

/// Evidence for a similarity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SimilarityEvidence {
    /// Number of pixels of either camera with a surface within the other's view.
    pub(crate) overlapping: usize,
    /// Share of one camera's surface within the other's view that obstructs that view.
    pub(crate) in_the_way: f64,
    /// Number of places that both see and that have texture.
    pub(crate) compared: usize,
    /// Median correlation of their pictures.
    pub(crate) correlation: f64,
}

/// Relation of one camera's surface point to the other's view.
enum Relation {
    InTheWay,
    Apart,
    Correlation(Option<f64>),
}

/// Evidence in both directions.
pub(super) fn of(seen: [&ComparedView<'_>; 2], first_from_second: &Similarity3<f64>) -> SimilarityEvidence {
    let mut told = one_way(seen[0], seen[1], &first_from_second.inverse());
    told.extend(one_way(seen[1], seen[0], first_from_second));
    let in_the_way = told.iter().filter(|t| matches!(t, Relation::InTheWay)).count();
    let mut correlations: Vec<f64> =
        told.iter().filter_map(|t| if let Relation::Correlation(c) = t { *c } else { None }).collect();
    correlations.sort_by(f64::total_cmp);
    SimilarityEvidence {
        overlapping: told.len(),
        in_the_way: in_the_way as f64 / told.len().max(1) as f64,
        compared: correlations.len(),
        correlation: correlations.get(correlations.len() / 2).copied().unwrap_or(0.0),
    }
}

fn one_way(from: &ComparedView<'_>, onto: &ComparedView<'_>, onto_from: &Similarity3<f64>) -> Vec<Relation> {
    let (width, height) = (from.surface.width(), from.surface.height());
    let rows: Vec<usize> = (STRIDE / 2..height).step_by(STRIDE).collect();
    let tell = |x: usize, y: usize| tell(from, onto, onto_from, (x, y));
    rows.par_iter()
        .flat_map_iter(|y| (STRIDE / 2..width).step_by(STRIDE).filter_map(move |x| tell(x, *y)))
        .collect()
}

/// Relation of one pixel; `None` where either surface is unknown or the pixel is outside the other's view.
fn tell(
    from: &ComparedView<'_>,
    onto: &ComparedView<'_>,
    onto_from: &Similarity3<f64>,
    (x, y): (usize, usize),
) -> Option<Relation> {
    let i = y * from.surface.width() + x;
    if from.surface.origin[i] != DepthOrigin::Stereo {
        return None;
    }
    let point = from.surface.point(i)?;
    let there = onto_from * Point3::new(point.x.into(), point.y.into(), point.z.into());
    let pixel = onto.surface.intrinsics.project(&there).filter(|_| there.z > 0.0)?;
    let (u, v) = (pixel.x.round(), pixel.y.round());
    let (width, height) = (onto.surface.width(), onto.surface.height());
    if u < 0.0 || v < 0.0 || u >= width as f64 || v >= height as f64 {
        return None;
    }
    let j = v as usize * width + u as usize;
    let depth = f64::from(onto.surface.depth[j]);
    if depth <= 0.0 {
        return None;
    }
    let ratio = there.z / depth;
    if ratio < 1.0 - BEFORE {
        return Some(Relation::InTheWay);
    }
    let double = |n: glam::Vec3| Vector3::<f64>::new(n.x.into(), n.y.into(), n.z.into());
    let turned = onto_from.isometry.rotation * double(from.surface.normal[i]);
    if (ratio - 1.0).abs() > SAME || turned.dot(&double(onto.surface.normal[j])) < FACING {
        return Some(Relation::Apart);
    }
    let home = Point2::new(x as f64, y as f64);
    Some(Relation::Correlation(correlation(from, onto, onto_from, &home)))
}

/// Correlation of the pictures around a pixel; `None` without texture, or at an image's border.
fn correlation(
    from: &ComparedView<'_>,
    onto: &ComparedView<'_>,
    onto_from: &Similarity3<f64>,
    pixel: &Point2<f64>,
) -> Option<f64> {
    let warp = carried(from.surface, onto.surface, onto_from, pixel)?;
    let reach = f64::from(RADIUS_PX + 1);
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
    let inside = corners.iter().all(|(x, y)| {
        let corner = warp.center + warp.affine * nalgebra::Vector2::new(x * reach, y * reach);
        onto.intensity.holds(corner.x, corner.y)
    });
    let home = Warp { center: *pixel, affine: Matrix2::identity() };
    let patch = Patch::cut(&from.intensity, &home, RADIUS_PX).filter(|_| inside)?;
    // Texture in one picture and none in the other counts as no correlation.
    Some(patch.correlation(&onto.intensity, &warp, &mut Reading::default()).unwrap_or(0.0))
}

/// Warp of the surface around a pixel into the other camera's picture.
pub(super) fn carried(
    from: &Surface,
    onto: &Surface,
    onto_from: &Similarity3<f64>,
    pixel: &Point2<f64>,
) -> Option<Warp> {
    let normal = from.normal_at(pixel)?;
    let normal = Vector3::<f64>::new(normal.x.into(), normal.y.into(), normal.z.into());
    let offset = normal.dot(&from.point_at(pixel)?.coords);
    let project = |pixel: Point2<f64>| {
        let ray = from.intrinsics.unproject(&pixel)?;
        let depth = offset / normal.dot(&ray);
        let there = onto_from * Point3::from(ray * depth);
        onto.intrinsics.project(&there).filter(|_| depth > 0.0 && there.z > 0.0)
    };
    let center = project(*pixel)?;
    let step = |x: f64, y: f64| Some(project(pixel + nalgebra::Vector2::new(x, y))? - center);
    Some(Warp { center, affine: Matrix2::from_columns(&[step(1.0, 0.0)?, step(0.0, 1.0)?]) })
}
