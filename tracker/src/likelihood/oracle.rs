//! Reference implementation of the counts by one ray through every pixel: no conic, no spans, no packed bits, no state.
//! Slow and simple; the fast path is tested against it.

use image::GrayImage;
use nalgebra::{Point2, Point3, Vector3};

use super::Counts;
use crate::prepared_room::PreparedCamera;
use crate::silhouette::Ellipsoid;

/// Counts of one camera, pixel by pixel. `static_z_m` gives the depth along z of the static scene at a pixel, metres.
pub fn counts(
    camera: &PreparedCamera,
    bodies: &[Ellipsoid],
    mask: &GrayImage,
    static_z_m: impl Fn(u32, u32) -> f32,
) -> Counts {
    let mut counts = Counts::default();
    for (u, v, pixel) in mask.enumerate_pixels() {
        let foreground = pixel[0] != 0;
        let hidden_beyond = f64::from(static_z_m(u, v));
        let simulated = bodies.iter().any(|b| near_z_m(camera, b, u, v).is_some_and(|z| z < hidden_beyond));
        counts.foreground += i64::from(foreground);
        counts.simulated += i64::from(simulated);
        counts.both += i64::from(foreground && simulated);
    }
    counts
}

/// Depth along the camera's z of a body's near surface at a pixel, metres; 0 for a camera inside the body.
pub fn near_z_m(camera: &PreparedCamera, body: &Ellipsoid, u: u32, v: u32) -> Option<f64> {
    let ray = camera.pinhole.ray(&Point2::new(f64::from(u), f64::from(v)))?;
    let distance = first_hit(&camera.pinhole.center(), &ray, body)?;
    let along = camera.pinhole.camera_from_world.rotation * ray.into_inner();
    Some(distance * along.z)
}

/// Distance at which a ray enters an ellipsoid, by scaling it to the unit sphere.
fn first_hit(origin: &Point3<f64>, direction: &Vector3<f64>, body: &Ellipsoid) -> Option<f64> {
    let axes = body.semi_axes;
    let o = (origin - body.center).component_div(&axes);
    let d = direction.component_div(&axes);
    let (half_b, a, c) = (o.dot(&d), d.norm_squared(), o.norm_squared() - 1.0);
    if c <= 0.0 {
        return Some(0.0);
    }
    let discriminant = half_b * half_b - a * c;
    let entry = (discriminant >= 0.0).then(|| (-half_b - discriminant.sqrt()) / a)?;
    (entry > 0.0).then_some(entry)
}
