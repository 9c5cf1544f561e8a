//! Corners of reference pictures, registered in a new picture that was taken at a roughly known pose.
//!
//! A corner's patch is followed by [`crate::features`]' registration, which is more precise than the places at which a
//! detector finds one keypoint twice, and finds corners that descriptors do not tell apart. The rough pose and the scene's depth tell
//! where to begin, and how the patch is seen from there.

use calib::relocation::{self, SceneDepth, Sighting};
use calib::vision::flow;
use calib::{Camera, Intrinsics};
use image::{DynamicImage, GrayImage};
use nalgebra::{Isometry3, Matrix2, Point2, Point3, Vector2, Vector3};
use rayon::prelude::*;

use crate::Result;
use crate::features::{Intensity, Patch, Warp};

/// Most corners of a reference picture, their least quality (a share of the strongest one's) and distance, pixels.
const MOST_CORNERS: usize = 1500;
const QUALITY: f64 = 0.001;
const APART_PX: f64 = 5.0;
/// Window of the corner detector, pixels, and half the side of a patch.
const BLOCK_PX: u32 = 5;
const RADIUS_PX: i32 = 8;
/// Least correlation of a corner's patches in both pictures.
const LEAST_CORRELATION: f64 = 0.85;
/// Largest distance from the corner of a registration back into the reference picture, pixels.
const MOST_RETURN_PX: f64 = 0.7;
/// Standard deviation of a registered corner's pixel in a picture of middling sharpness; [`relocation::refined`] estimates that of
/// the picture at hand.
const PIXEL_SIGMA_PX: f64 = 0.2;
/// Factors of the depth that registration begins from, the likeliest first: surfaces are wrong by some percent.
const DEPTH_FACTORS: [f64; 5] = [1.0, 0.94, 1.06, 0.85, 1.18];
/// Least distance between two beginnings, pixels: registration reaches that far by itself.
const BEGIN_APART_PX: f64 = 2.0;

/// Corner of a reference picture with the scene's point behind it.
#[derive(Debug, Clone)]
struct Corner {
    pixel: Point2<f64>,
    /// Direction into the scene, z = 1 in the reference camera.
    ray: Vector3<f64>,
    depth: SceneDepth,
    patch: Patch,
}

/// Corners of one reference picture.
pub(super) struct ReferenceCorners {
    intensity: Intensity,
    camera: Camera,
    corners: Vec<Corner>,
}

impl ReferenceCorners {
    /// Corners of a picture of `camera`, whose intrinsics are those of the picture's size. `depth` has the scene's depth
    /// along a ray of the camera, whose z is 1; corners without depth are left out.
    ///
    /// # Errors
    /// [`crate::Error::Calib`] when OpenCV refuses.
    pub(super) fn of(
        picture: &GrayImage,
        camera: &Camera,
        depth: impl Fn(&Vector3<f64>) -> Option<SceneDepth>,
    ) -> Result<Self> {
        let intensity = intensity(picture);
        let pixels = flow::corners(picture, MOST_CORNERS, QUALITY, APART_PX, BLOCK_PX)?;
        let corner = |pixel: Point2<f64>| {
            let ray = camera.intrinsics.unproject(&pixel)?;
            let here = Warp { center: pixel, affine: Matrix2::identity() };
            let patch = Patch::cut(&intensity, &here, RADIUS_PX)?;
            Some(Corner { pixel, ray, depth: depth(&ray)?, patch })
        };
        let corners = pixels.into_iter().filter_map(corner).collect();
        Ok(Self { intensity, camera: camera.clone(), corners })
    }

    /// The corners that are found in a picture near where a pose predicts them.
    pub(super) fn found_in(
        &self,
        picture: &Intensity,
        intrinsics: &Intrinsics,
        camera_from_world: &Isometry3<f64>,
    ) -> Vec<Sighting> {
        let world_from_reference = self.camera.camera_from_world.inverse();
        let camera_from_reference = camera_from_world * world_from_reference;
        let size = (self.camera.intrinsics.width, self.camera.intrinsics.height);
        let found = |corner: &Corner| {
            let pixel = self.registered(corner, picture, intrinsics, &camera_from_reference)?;
            Some(Sighting {
                world: world_from_reference * Point3::from(corner.ray * corner.depth.z_m),
                depth_step: world_from_reference * (corner.ray * corner.depth.sigma_m),
                pixel,
                pixel_sigma_px: PIXEL_SIGMA_PX,
                cell: relocation::cell(&corner.pixel, size),
            })
        };
        self.corners.par_iter().map(found).collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Pixel of a corner in the picture, by the best registration that leads back to the corner.
    fn registered(
        &self,
        corner: &Corner,
        picture: &Intensity,
        intrinsics: &Intrinsics,
        camera_from_reference: &Isometry3<f64>,
    ) -> Option<Point2<f64>> {
        let mut begun: Vec<Point2<f64>> = Vec::with_capacity(DEPTH_FACTORS.len());
        let mut best: Option<(f64, Warp)> = None;
        for factor in DEPTH_FACTORS {
            let z_m = factor * corner.depth.z_m;
            let Some(start) = self.predicted(corner, z_m, intrinsics, camera_from_reference) else {
                continue;
            };
            if begun.iter().any(|other| (other - start.center).norm() < BEGIN_APART_PX) {
                continue;
            }
            begun.push(start.center);
            let Some(found) = corner.patch.register(picture, &start) else { continue };
            if found.correlation >= LEAST_CORRELATION
                && best.is_none_or(|(correlation, _)| found.correlation > correlation)
            {
                best = Some((found.correlation, found.warp));
            }
        }
        let (_, warp) = best?;
        let here = Warp { center: corner.pixel, affine: Matrix2::identity() };
        let back = Patch::cut(picture, &warp, RADIUS_PX)?.register(&self.intensity, &here)?;
        ((back.warp.center - corner.pixel).norm() <= MOST_RETURN_PX).then_some(warp.center)
    }

    /// A corner's patch as it would be seen at a depth, its surface parallel to the reference picture.
    fn predicted(
        &self,
        corner: &Corner,
        z_m: f64,
        intrinsics: &Intrinsics,
        camera_from_reference: &Isometry3<f64>,
    ) -> Option<Warp> {
        let seen = |right: f64, down: f64| {
            let ray = self.camera.intrinsics.unproject(&(corner.pixel + Vector2::new(right, down)))?;
            intrinsics.project(&(camera_from_reference * Point3::from(ray * z_m)))
        };
        let center = seen(0.0, 0.0)?;
        let affine = Matrix2::from_columns(&[seen(1.0, 0.0)? - center, seen(0.0, 1.0)? - center]);
        Some(Warp { center, affine })
    }
}

/// Brightness as registration reads it.
pub(super) fn intensity(picture: &GrayImage) -> Intensity {
    Intensity::new(&DynamicImage::ImageLuma8(picture.clone()).into_rgb8())
}

#[cfg(test)]
mod tests {
    use image::Luma;
    use nalgebra::{Translation3, UnitQuaternion};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Depth of a wall that is parallel to the reference picture, metres.
    const WALL_M: f64 = 2.0;

    /// Brightness of the wall at a place: waves of 4 to 20 cm in all directions.
    fn texture() -> impl Fn(f64, f64) -> f64 {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let wave = |_| {
            let frequency = std::f64::consts::TAU / rng.random_range(0.04..0.2);
            let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
            (frequency * angle.cos(), frequency * angle.sin(), rng.random_range(0.0..std::f64::consts::TAU))
        };
        let waves: Vec<(f64, f64, f64)> = (0..30).map(wave).collect();
        move |x_m, y_m| {
            let sum: f64 = waves.iter().map(|(fx, fy, phase)| (fx * x_m + fy * y_m + phase).sin()).sum();
            128.0 + 12.0 * sum
        }
    }

    fn intrinsics() -> Intrinsics {
        Intrinsics::from_horizontal_fov(320, 240, 60.0)
    }

    /// Picture of the wall by a camera.
    fn picture(camera: &Camera, texture: &impl Fn(f64, f64) -> f64) -> GrayImage {
        let world_from_camera = camera.camera_from_world.inverse();
        let center = camera.center();
        GrayImage::from_fn(camera.intrinsics.width, camera.intrinsics.height, |x, y| {
            let ray = camera.intrinsics.unproject(&Point2::new(f64::from(x), f64::from(y))).unwrap();
            let direction = world_from_camera * ray;
            let place = center + direction * ((WALL_M - center.z) / direction.z);
            Luma([texture(place.x, place.y).round() as u8])
        })
    }

    fn camera(right_m: f64, turned_deg: f64) -> Camera {
        let turn =
            UnitQuaternion::from_euler_angles(0.0, turned_deg.to_radians(), 0.5 * turned_deg.to_radians());
        let pose = Isometry3::from_parts(Translation3::new(right_m, 0.02, -0.5 * right_m), turn);
        Camera { intrinsics: intrinsics(), camera_from_world: pose.inverse() }
    }

    #[test]
    fn corners_are_found_to_a_tenth_of_a_pixel_from_a_rough_pose_and_a_wrong_depth() {
        let texture = texture();
        let (reference, moved) = (camera(0.0, 0.0), camera(0.12, 4.0));
        let new_picture = intensity(&picture(&moved, &texture));
        let reference_picture = picture(&reference, &texture);
        for wrong in [1.0, 1.08] {
            let depth = |_: &Vector3<f64>| Some(SceneDepth { z_m: wrong * WALL_M, sigma_m: 0.05 });
            let corners = ReferenceCorners::of(&reference_picture, &reference, depth).unwrap();
            let rough = camera(0.10, 4.4).camera_from_world;
            let found = corners.found_in(&new_picture, &intrinsics(), &rough);
            assert!(found.len() > 100, "{} of {} corners", found.len(), corners.corners.len());
            let error_px = |sighting: &Sighting| {
                let from_reference = reference.camera_from_world * sighting.world;
                let on_wall =
                    reference.camera_from_world.inverse() * Point3::from(from_reference.coords / wrong);
                (moved.project(&on_wall).unwrap() - sighting.pixel).norm()
            };
            let mut errors: Vec<f64> = found.iter().map(error_px).collect();
            errors.sort_by(f64::total_cmp);
            let (median, high) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
            assert!(median < 0.1 && high < 0.3, "depth × {wrong}: {median} and {high} px");
        }
    }

    #[test]
    fn corners_that_are_found_in_the_picture_of_another_wall_agree_on_no_pose() {
        let texture = texture();
        let (reference, moved) = (camera(0.0, 0.0), camera(0.12, 4.0));
        let depth = |_: &Vector3<f64>| Some(SceneDepth { z_m: WALL_M, sigma_m: 0.05 });
        let corners = ReferenceCorners::of(&picture(&reference, &texture), &reference, depth).unwrap();
        let refined = |wall: &dyn Fn(f64, f64) -> f64| {
            let shown = intensity(&picture(&moved, &wall));
            let found = corners.found_in(&shown, &intrinsics(), &moved.camera_from_world);
            relocation::refined(&intrinsics(), &found, &moved.camera_from_world, found.len())
        };
        let (same, distance_m) = refined(&texture).unwrap();
        assert!(same.certain(distance_m).is_ok());
        for aside_m in [3.0, 7.0, 11.0, 15.0, 19.0, 23.0] {
            let other = refined(&|x_m, y_m| texture(5.0 - y_m, aside_m + x_m));
            assert!(other.is_err(), "{aside_m} m aside: {other:?}");
        }
    }
}
