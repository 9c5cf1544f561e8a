//! Points on the surfaces of a room's geometry, for the search of its floor.

use glam::Vec3;
use nalgebra::Point3;

use super::SurfacePoint;
use crate::geometry::sample::each_sample;
use crate::geometry::{Geometry, point_from_vec3, vec3_from_point, vector_from_vec3};

/// Largest number of points: the search takes time with each of them.
const MOST_POINTS: usize = 60_000;

/// Points all over the surfaces, each facing the nearest of the cameras at `eyes` as discs do already.
pub fn surface_points(geometry: &Geometry, eyes: &[Point3<f64>]) -> Vec<SurfacePoint> {
    let point = |position: Vec3, normal: Vec3, area: f64| SurfacePoint {
        position: point_from_vec3(position),
        normal: vector_from_vec3(normal).normalize(),
        area,
        sigma: 0.0,
    };
    let mesh = match geometry {
        Geometry::Discs(discs) => {
            let step = discs.len().div_ceil(MOST_POINTS).max(1);
            let area = |radius: f32| step as f64 * std::f64::consts::PI * f64::from(radius).powi(2);
            return discs.iter().step_by(step).map(|d| point(d.center, d.normal, area(d.radius))).collect();
        }
        Geometry::Mesh(mesh) => mesh,
    };
    let eyes: Vec<Vec3> = eyes.iter().map(vec3_from_point).collect();
    let area_m2: f64 = mesh.triangles.iter().map(|t| area(mesh.corners(*t))).sum();
    // Half of the points by their area; each triangle has one at least.
    let spacing = (2.0 * area_m2 / MOST_POINTS as f64).sqrt().max(1e-6) as f32;
    let mut points = Vec::new();
    each_sample(geometry, spacing, &mut |place, normal, area| {
        let nearest =
            eyes.iter().min_by(|a, b| a.distance_squared(place).total_cmp(&b.distance_squared(place)));
        let is_away = nearest.is_some_and(|eye| normal.dot(*eye - place) < 0.0);
        points.push(point(place, if is_away { -normal } else { normal }, f64::from(area)));
    });
    let step = points.len().div_ceil(2 * MOST_POINTS).max(1);
    points.into_iter().step_by(step).collect()
}

fn area(corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    0.5 * (b - a).cross(c - a).length()
}
