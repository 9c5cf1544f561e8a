//! Visible part of each body before the room and the other bodies.

use super::{Body, ImageConic, Silhouette, View};

/// Visible part of each body in one view: the pixels that neither the room nor another body hides.
///
/// Returns one silhouette a body, in the given order; [`fraction`] gives its visible share. Where two bodies overlap,
/// the nearer surface wins pixel by pixel.
pub fn visible_parts(view: &View, bodies: &[Body]) -> Vec<Silhouette> {
    let whole: Vec<Silhouette> = bodies.iter().map(|b| Silhouette::new(view, &b.ellipsoid())).collect();
    let conics: Vec<ImageConic> = bodies.iter().map(|b| ImageConic::new(view, &b.ellipsoid())).collect();
    let mut parts = whole.clone();
    for (i, part) in parts.iter_mut().enumerate() {
        for (j, other) in whole.iter().enumerate() {
            if i != j && overlap(&whole[i], other) {
                part.retain(|u, v| {
                    let depth = |conic: &ImageConic| conic.row(v as i32).near_z_m(u as i32);
                    !other.contains(u, v) || depth(&conics[i]) <= depth(&conics[j])
                });
            }
        }
    }
    parts
}

/// Visible fraction of a body's silhouette within the image; 0 when no part of it is in the image.
pub fn fraction(part: &Silhouette) -> f64 {
    if part.area_px == 0 { 0.0 } else { f64::from(part.visible_px) / f64::from(part.area_px) }
}

/// Visible fractions of each body in each view.
pub fn visible_fractions(views: &[View], bodies: &[Body]) -> Vec<Vec<f64>> {
    let mut fractions = vec![Vec::with_capacity(views.len()); bodies.len()];
    for view in views {
        for (of_body, part) in fractions.iter_mut().zip(visible_parts(view, bodies)) {
            of_body.push(fraction(&part));
        }
    }
    fractions
}

fn overlap(a: &Silhouette, b: &Silhouette) -> bool {
    let meet = |a: std::ops::Range<usize>, b: std::ops::Range<usize>| a.start < b.end && b.start < a.end;
    meet(a.row_range(), b.row_range()) && meet(a.word_range(), b.word_range())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::oracle::near_z_m;
    use crate::prepared_room::PreparedCamera;
    use calib::{Camera, Intrinsics};
    use glam::Vec3;
    use nalgebra::{Isometry3, Point3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use scenes::depth;
    use scenes::geometry::{Disc, Geometry};
    use scenes::raycast::RayScene;

    /// Discs in front of a camera, and people among them: the nearest surface of every pixel is found by rays.
    #[test]
    fn visible_pixels_are_those_whose_ray_meets_the_body_first() {
        let mut rng = Pcg64Mcg::seed_from_u64(2);
        let (mut behind_room, mut behind_others) = (0, 0);
        for _ in 0..60 {
            let discs = (0..4).map(|_| Disc {
                center: Vec3::new(
                    rng.random_range(1.0..4.0),
                    rng.random_range(0.0..4.0),
                    rng.random_range(0.0..1.5),
                ),
                normal: Vec3::new(rng.random_range(0.5..1.0), rng.random_range(-0.5..0.5), 0.0).normalize(),
                radius: rng.random_range(0.2..0.6),
                color: [0; 3],
                filled: false,
                confidence: 1.0,
            });
            let scene = RayScene::new(&Geometry::Discs(discs.collect())).unwrap();
            let eye = Point3::new(0.0, rng.random_range(0.0..4.0), rng.random_range(1.0..2.5));
            let camera_from_world =
                Isometry3::face_towards(&eye, &Point3::new(3.0, 2.0, 0.8), &-Vector3::z()).inverse();
            let intrinsics = Intrinsics::from_horizontal_fov(90, 70, 80.0);
            let mut camera = PreparedCamera::new("c", &Camera { intrinsics, camera_from_world });
            for (z_m, met_m) in camera.static_z_m.iter_mut().zip(depth::render(&scene, &camera.pinhole).z_m) {
                *z_m = if met_m > 0.0 { met_m } else { f32::INFINITY };
            }
            let bodies: Vec<Body> = (0..4)
                .map(|_| Body {
                    x_m: rng.random_range(1.0..5.0),
                    y_m: rng.random_range(0.5..3.5),
                    radius_m: rng.random_range(0.2..0.35),
                    height_m: rng.random_range(1.2..2.0),
                })
                .collect();
            let fractions = visible_fractions(&[View::new(&camera)], &bodies);
            let near = |i: usize, u: u32, v: u32| near_z_m(&camera, &bodies[i].ellipsoid(), u, v);
            for (i, fractions) in fractions.iter().enumerate() {
                let (mut area, mut seen) = (0, 0);
                for (u, v) in (0..70).flat_map(|v| (0..90).map(move |u| (u, v))) {
                    let Some(own) = near(i, u, v) else { continue };
                    area += 1;
                    let is_room = f64::from(camera.static_z_m[(v * 90 + u) as usize]) <= own;
                    let is_other = (0..4).any(|j| j != i && near(j, u, v).is_some_and(|z| z < own));
                    behind_room += u32::from(is_room);
                    behind_others += u32::from(is_other);
                    seen += u32::from(!is_room && !is_other);
                }
                let expected = if area == 0 { 0.0 } else { f64::from(seen) / f64::from(area) };
                assert!(
                    (fractions[0] - expected).abs() < 1e-12,
                    "{} visible, {expected} by rays",
                    fractions[0]
                );
            }
        }
        assert!(behind_room > 1000 && behind_others > 1000, "{behind_room}, {behind_others}");
    }
}
