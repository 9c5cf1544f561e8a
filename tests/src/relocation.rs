//! Views of cameras that have been bumped: frames of a capture, taken nearby, turned further by a homography; or the
//! reference picture, seen from elsewhere by the true depth of its pixels.

use std::path::Path;

use calib::Intrinsics;
use calib::video::FrameSource;
use glam::Vec3;
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use scenes::depth::{DepthMap, png};
use scenes::geometry::{Geometry, Mesh};
use scenes::raycast::RayScene;

use crate::accuracy::{capture_truth, installed_truth};

/// Distance of a bumped camera from its installed place, metres.
const MOST_MOVED_M: f64 = 0.3;
/// Turn of a bumped camera, degrees.
const TURNED_DEG: std::ops::RangeInclusive<f64> = 1.0..=15.0;
/// Relative step of a depth map that is an edge.
const LARGEST_STEP: f32 = 0.05;
/// Widest hole of a depth map that is filled, pixels.
const WIDEST_HOLE_PX: i64 = 2;
/// Most turn by the homography, whose picture has a black border, degrees.
const MOST_WARPED_DEG: f64 = 12.0;

/// A picture of a bumped camera, and its true pose as seen from the installed camera.
pub struct BumpedView {
    /// The picture.
    pub picture: RgbImage,
    /// `X_now = now_from_installed · X_installed`.
    pub now_from_installed: Isometry3<f64>,
}

/// Views of one camera of a data set with a capture of its own; `count` of them, from all frames that are near.
///
/// # Errors
/// Files that cannot be read.
pub fn bumped_views(
    data: &Path,
    camera: &str,
    lens: &Intrinsics,
    count: usize,
    seed: u64,
) -> Result<Vec<BumpedView>, String> {
    let truth = data.join("truth.json");
    let installed = installed_truth(&truth, camera).ok_or("no true pose")?;
    let poses = capture_truth(&truth, camera).ok_or("no true poses of the capture")?;
    let frames = frames(data, camera)?;
    let seen_from_installed = |pose: &Isometry3<f64>| pose * installed.inverse();
    let near: Vec<(&RgbImage, Isometry3<f64>)> = frames
        .iter()
        .zip(&poses)
        .map(|(frame, pose)| (frame, seen_from_installed(pose)))
        .filter(|(_, pose)| pose.inverse().translation.vector.norm() <= MOST_MOVED_M)
        .filter(|(_, pose)| pose.rotation.angle().to_degrees() < TURNED_DEG.end() + 0.5 * MOST_WARPED_DEG)
        .collect();
    let mut random = Pcg64::seed_from_u64(seed);
    let mut views = Vec::with_capacity(count);
    while views.len() < count {
        // The last frame is the reference picture itself, which a turn alone makes another one.
        let (frame, pose) = &near[views.len() % near.len()];
        let axis = Vector3::new(
            random.random_range(-1.0..1.0),
            random.random_range(-1.0..1.0),
            random.random_range(-0.5..0.5),
        );
        let Some(axis) = axis.try_normalize(0.1) else { continue };
        let turn = UnitQuaternion::new(axis * random.random_range(0.0..MOST_WARPED_DEG).to_radians());
        let now = turn * pose;
        if !TURNED_DEG.contains(&now.rotation.angle().to_degrees()) {
            continue;
        }
        views.push(BumpedView { picture: turned(frame, lens, &turn), now_from_installed: now });
    }
    Ok(views)
}

/// Views of one camera of a data set without frames of a camera at rest: the reference picture on the surfaces of its
/// true depth, seen from elsewhere; black where nothing is known.
///
/// # Errors
/// Files that cannot be read.
pub fn rendered_views(
    data: &Path,
    camera: &str,
    lens: &Intrinsics,
    count: usize,
    seed: u64,
) -> Result<Vec<BumpedView>, String> {
    let picture = frames(data, camera)?.pop().ok_or("an empty capture")?;
    let mut depth = png::read(&data.join(format!("depth_{camera}.png"))).map_err(|e| e.to_string())?;
    close_holes(&mut depth);
    let scene = RayScene::new(&surface(&depth, lens)).map_err(|e| e.to_string())?;
    let mut random = Pcg64::seed_from_u64(seed);
    let mut direction = || Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal)).normalize();
    let turns: Vec<(Vector3<f64>, Vector3<f64>)> = (0..count).map(|_| (direction(), direction())).collect();
    let views = turns.iter().enumerate().map(|(i, (axis, to))| {
        // Both go evenly through their ranges, in different orders.
        let part = |step: f64| (0.5 + i as f64 * step).fract();
        let turned_deg = TURNED_DEG.start() + part(0.618) * (TURNED_DEG.end() - TURNED_DEG.start());
        let turn = UnitQuaternion::new(
            axis.component_mul(&Vector3::new(1.0, 1.0, 0.5)).normalize() * turned_deg.to_radians(),
        );
        let center = to * (MOST_MOVED_M * part(0.414));
        let now_from_installed = turn * Translation3::from(-center);
        let view = RgbImage::from_fn(lens.width, lens.height, |u, v| {
            let ray = lens.unproject(&Point2::new(f64::from(u), f64::from(v)));
            let hit = ray.and_then(|ray| {
                let ray = turn.inverse() * ray;
                let hit = scene.cast(glam(&center), glam(&ray))?;
                lens.project(&Point3::from(center + ray * f64::from(hit.distance)))
            });
            hit.and_then(|at| between(&picture, &at)).unwrap_or(Rgb([0; 3]))
        });
        BumpedView { picture: view, now_from_installed }
    });
    Ok(views.collect())
}

/// Fills lines and dots of a pixel or two that a depth map which was carried over from another camera leaves open, where
/// the depths on both sides are one surface's. A camera's picture would show that surface there, not black.
fn close_holes(depth: &mut DepthMap) {
    let known = depth.clone();
    let at = |u: i64, v: i64| {
        let inside = (0..i64::from(known.width)).contains(&u) && (0..i64::from(known.height)).contains(&v);
        inside.then(|| known.at(u as u32, v as u32)).filter(|z| *z > 0.0)
    };
    for v in 0..i64::from(known.height) {
        for u in 0..i64::from(known.width) {
            if at(u, v).is_some() {
                continue;
            }
            let nearest =
                |du: i64, dv: i64| (1..=WIDEST_HOLE_PX).find_map(|k| Some((k, at(u + k * du, v + k * dv)?)));
            let across = [(1, 0), (0, 1), (1, 1), (1, -1)].into_iter().filter_map(|(du, dv)| {
                let ((k, one), (l, other)) = (nearest(du, dv)?, nearest(-du, -dv)?);
                let is_one_surface = (one - other).abs() < LARGEST_STEP * one.min(other);
                (is_one_surface && k + l <= WIDEST_HOLE_PX + 1)
                    .then(|| (k + l, (one * l as f32 + other * k as f32) / (k + l) as f32))
            });
            if let Some((_, z)) = across.min_by_key(|(width, _)| *width) {
                depth.z_m[(v * i64::from(known.width) + u) as usize] = z;
            }
        }
    }
}

/// Surfaces of a depth map, in the coordinates of its camera; open where the depth has a step.
fn surface(depth: &DepthMap, lens: &Intrinsics) -> Geometry {
    let at = |u: u32, v: u32| v * depth.width + u;
    let mut vertices = Vec::with_capacity(depth.z_m.len());
    for v in 0..depth.height {
        for u in 0..depth.width {
            let ray = lens.unproject(&Point2::new(f64::from(u), f64::from(v))).unwrap_or_default();
            vertices.push(glam(&(ray * f64::from(depth.at(u, v)))));
        }
    }
    let mut triangles = Vec::new();
    for v in 0..depth.height - 1 {
        for u in 0..depth.width - 1 {
            for corners in [[(u, v), (u + 1, v), (u, v + 1)], [(u + 1, v), (u + 1, v + 1), (u, v + 1)]] {
                let z = corners.map(|(u, v)| depth.at(u, v));
                let (near, far) = (z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2]));
                if near > 0.0 && far - near < LARGEST_STEP * near {
                    triangles.push(corners.map(|(u, v)| at(u, v)));
                }
            }
        }
    }
    Geometry::Mesh(Mesh { colors: vec![[0; 3]; vertices.len()], vertices, triangles })
}

fn glam(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}

/// Pictures of a capture, a folder or a film, in their order.
fn frames(data: &Path, camera: &str) -> Result<Vec<RgbImage>, String> {
    let folder = data.join("capture").join(camera);
    let capture = if folder.is_dir() { folder } else { folder.with_extension("mp4") };
    let mut film = FrameSource::open(&capture.to_string_lossy()).map_err(|e| e.to_string())?;
    let (width, height) = film.size();
    let mut frames = Vec::new();
    loop {
        let mut frame = RgbImage::new(width, height);
        if !film.read(&mut frame).map_err(|e| e.to_string())? {
            return Ok(frames);
        }
        frames.push(frame);
    }
}

/// Picture of a camera after it has turned in place, `now_from_before`; black where the picture before has nothing.
pub fn turned(picture: &RgbImage, lens: &Intrinsics, now_from_before: &UnitQuaternion<f64>) -> RgbImage {
    let (width, height) = picture.dimensions();
    let before_from_now = now_from_before.inverse();
    RgbImage::from_fn(width, height, |u, v| {
        let ray = lens.unproject(&Point2::new(f64::from(u), f64::from(v)));
        let seen = ray.and_then(|ray| lens.project(&Point3::from(before_from_now * ray)));
        seen.and_then(|at| between(picture, &at)).unwrap_or(Rgb([0; 3]))
    })
}

/// Bilinear interpolation of a picture.
fn between(picture: &RgbImage, at: &Point2<f64>) -> Option<Rgb<u8>> {
    let (u, v) = (at.x.floor(), at.y.floor());
    let (width, height) = picture.dimensions();
    if !(u >= 0.0 && v >= 0.0 && u + 1.0 < f64::from(width) && v + 1.0 < f64::from(height)) {
        return None;
    }
    let (a, b, u, v) = (at.x - u, at.y - v, u as u32, v as u32);
    let level = |c: usize| {
        let of = |du: u32, dv: u32| f64::from(picture[(u + du, v + dv)][c]);
        let (above, below) = ((1.0 - a) * of(0, 0) + a * of(1, 0), (1.0 - a) * of(0, 1) + a * of(1, 1));
        ((1.0 - b) * above + b * below).round() as u8
    };
    Some(Rgb([level(0), level(1), level(2)]))
}
