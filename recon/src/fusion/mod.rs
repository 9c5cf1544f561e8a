//! Fusion of all cameras' surfaces to the room's oriented, coloured discs, in the world frame.
//!
//! Surfaces that another camera looks through are dropped ([`Witness`]). Of what is left, surfaces that two cameras see alike are
//! kept once: measured rather than filled in, then from the camera with the finer resolution. Smooth regions become larger discs
//! ([`blocks`]), so that a wall does not cost a disc a pixel. Surfaces seen only by key frames ([`key_frames`]) are added where no
//! camera sees the place itself. The floor that is assumed where nothing was measured ([`assumed_floor`]) is fused with them.

pub(crate) mod assumed_floor;
mod blocks;
pub(crate) mod key_frames;
mod witness;

use glam::Vec3;
use nalgebra::Similarity3;
use rayon::prelude::*;
use scenes::geometry::{Disc, point_from_vec3, vec3_from_point, vec3_from_vector, vector_from_vec3};
use serde::{Deserialize, Serialize};

use crate::surface::{DepthOrigin, Surface};
use witness::Witness;

/// Options of the fusion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FusionOptions {
    /// Relative difference of two cameras' depths below which they are the same surface.
    pub same_surface: f32,
    /// Largest radius of a disc in another camera's image, pixels; coarser discs are dropped, since that camera
    /// resolves the surface itself.
    pub largest_radius_px: f32,
    /// Largest relative distance of depths from a block's plane for the block to become one disc.
    pub flatness: f32,
}

impl Default for FusionOptions {
    fn default() -> Self {
        Self { same_surface: 0.03, largest_radius_px: 4.0, flatness: 0.003 }
    }
}

/// Report of the fusion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FusionReport {
    /// Number of pixels with a depth, of all cameras.
    pub pixels: usize,
    /// Pixels dropped since another camera shows the same surface finer.
    pub duplicates: usize,
    /// Pixels dropped since another camera looks through them.
    pub seen_through: usize,
    /// Pixels dropped since another camera stands so near that they would fill its view.
    pub too_coarse: usize,
    /// Number of discs.
    pub discs: usize,
    /// Number of these that were not measured but filled in.
    pub filled: usize,
    /// Number of these that only key frames saw.
    pub key_frame_discs: usize,
    /// Pixels without a measured surface that are assumed to show the floor.
    pub assumed_floor: usize,
}

/// Fuses all surfaces; `world_from_camera` in metres, one a surface. `key_frame_discs`: for each the discs that only
/// its key frames saw ([`key_frames::discs`]), in its camera's frame and unit.
pub fn fuse(
    surfaces: &[Surface],
    key_frame_discs: &[&[Disc]],
    world_from_camera: &[Similarity3<f64>],
    options: &FusionOptions,
) -> (Vec<Disc>, FusionReport) {
    let mut report = FusionReport::default();
    let witnesses = |index: usize| {
        let others = surfaces.iter().enumerate().filter(move |(other, _)| *other != index);
        others.map(move |(other, witness)| {
            let witness_from_camera = world_from_camera[other].inverse() * world_from_camera[index];
            Witness::new(witness, &witness_from_camera, other < index)
        })
    };
    // A surface that is dropped itself is no reason to drop another camera's.
    let without_duplicates: Vec<Vec<PixelVerdict>> = surfaces
        .iter()
        .enumerate()
        .map(|(index, surface)| {
            let others: Vec<Witness<'_>> = witnesses(index).collect();
            (0..surface.depth.len())
                .into_par_iter()
                .map(|i| contradiction(surface, i, &others, options))
                .collect()
        })
        .collect();
    let mut discs = Vec::new();
    for (index, surface) in surfaces.iter().enumerate() {
        let others: Vec<Witness<'_>> = witnesses(index).collect();
        let verdicts = without_duplicates.iter().enumerate().filter(|(other, _)| *other != index);
        let judged: Vec<(&Witness<'_>, &Vec<PixelVerdict>)> =
            others.iter().zip(verdicts.map(|(_, verdicts)| verdicts)).collect();
        let verdict = |i: usize| match without_duplicates[index][i] {
            PixelVerdict::Keep if is_duplicate(surface, i, &judged, options) => PixelVerdict::Duplicate,
            verdict => verdict,
        };
        let verdicts: Vec<PixelVerdict> = (0..surface.depth.len()).into_par_iter().map(verdict).collect();
        report.assumed_floor += surface.origin.iter().filter(|o| **o == DepthOrigin::Assumed).count();
        report.pixels += verdicts.iter().filter(|v| **v != PixelVerdict::Nothing).count();
        report.duplicates += verdicts.iter().filter(|v| **v == PixelVerdict::Duplicate).count();
        report.seen_through += verdicts.iter().filter(|v| **v == PixelVerdict::SeenThrough).count();
        report.too_coarse += verdicts.iter().filter(|v| **v == PixelVerdict::TooCoarse).count();
        let keep: Vec<bool> = verdicts.iter().map(|v| *v == PixelVerdict::Keep).collect();
        let world = &world_from_camera[index];
        discs.extend(
            blocks::discs(surface, &keep, options.flatness).into_iter().map(|disc| moved(&disc, world)),
        );
        let unseen = |disc: &&Disc| others.iter().all(|other| key_frames::is_new(disc, other, options));
        let found = key_frame_discs.get(index).copied().unwrap_or_default().iter().filter(unseen);
        let before = discs.len();
        discs.extend(found.map(|disc| moved(disc, world)));
        report.key_frame_discs += discs.len() - before;
    }
    report.discs = discs.len();
    report.filled = discs.iter().filter(|d| d.filled).count();
    (discs, report)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PixelVerdict {
    Nothing,
    Keep,
    Duplicate,
    SeenThrough,
    TooCoarse,
}

/// Verdict about a pixel's surface by the cameras that look at it from elsewhere; duplicates stay.
fn contradiction(
    surface: &Surface,
    i: usize,
    others: &[Witness<'_>],
    options: &FusionOptions,
) -> PixelVerdict {
    let Some(point) = surface.point(i) else { return PixelVerdict::Nothing };
    for witness in others {
        let Some((u, v, z)) = witness.pixel(point) else { continue };
        if surface.radius(i) * witness.scale * witness.camera.fx > options.largest_radius_px * z {
            return PixelVerdict::TooCoarse;
        }
        let j = v * witness.surface.width() + u;
        let seen = witness.surface.depth[j];
        let is_measured = seen > 0.0 && witness.surface.origin[j] == DepthOrigin::Stereo;
        if is_measured && witness.looks_past((u, v), z, options.same_surface) {
            let filled = surface.origin[i] != DepthOrigin::Stereo;
            if filled || surface.agreeing[i] <= witness.surface.agreeing[j] {
                return PixelVerdict::SeenThrough;
            }
        }
    }
    PixelVerdict::Keep
}

/// Tells whether another camera, whose pixels have these verdicts, shows the surface of a pixel better, and keeps it.
fn is_duplicate(
    surface: &Surface,
    i: usize,
    others: &[(&Witness<'_>, &Vec<PixelVerdict>)],
    options: &FusionOptions,
) -> bool {
    let Some(point) = surface.point(i) else { return false };
    others.iter().any(|(witness, verdicts)| {
        let Some((u, v, z)) = witness.pixel(point) else { return false };
        let j = v * witness.surface.width() + u;
        let seen = witness.surface.depth[j];
        let is_same = seen > 0.0 && (z / seen - 1.0).abs() < options.same_surface;
        if !is_same || verdicts[j] != PixelVerdict::Keep {
            return false;
        }
        let (own, other) = (surface.radius(i) * witness.scale, witness.surface.radius(j));
        let is_measured = [surface.origin[i], witness.surface.origin[j]].map(|o| o == DepthOrigin::Stereo);
        match is_measured {
            [true, false] => false,
            [false, true] => true,
            // The finer, then that of the camera that comes first.
            _ => other < 0.999 * own || (witness.first && other < 1.001 * own),
        }
    })
}

fn moved(disc: &Disc, world: &Similarity3<f64>) -> Disc {
    Disc {
        center: vec3_from_point(&(world * point_from_vec3(disc.center))),
        normal: vec3_from_vector(&(world.isometry.rotation * vector_from_vec3(disc.normal)))
            .normalize_or(Vec3::Z),
        radius: disc.radius * world.scaling() as f32,
        ..*disc
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;
    use image::{Rgb, RgbImage};

    /// A camera that faces a wall at depth `z` squarely.
    fn wall(z: f32, size: u32, origin: DepthOrigin) -> Surface {
        let count = (size * size) as usize;
        Surface {
            picture: RgbImage::from_pixel(size, size, Rgb([90, 120, 150])),
            intrinsics: Intrinsics::from_horizontal_fov(size, size, 60.0),
            depth: vec![z; count],
            normal: vec![-Vec3::Z; count],
            agreeing: vec![4; count],
            origin: vec![origin; count],
            step: 0.005,
        }
    }

    #[test]
    fn surfaces_seen_alike_are_kept_once_from_the_finer_camera() {
        let views = [wall(2.0, 32, DepthOrigin::Stereo), wall(2.0, 64, DepthOrigin::Stereo)];
        let still = [Similarity3::identity(), Similarity3::identity()];
        let (discs, report) = fuse(&views, &[], &still, &FusionOptions::default());
        // The coarse camera keeps its outermost ring, where the fine one's lookup would leave its image.
        assert!(report.duplicates >= 900, "{report:?}");
        assert!(
            discs
                .iter()
                .filter(|d| d.center.x.abs() < 0.9 && d.center.y.abs() < 0.9)
                .all(|d| d.radius < 0.15)
        );
    }

    /// The second camera's wall is finer, but a third one sees through its left half: the first camera keeps its own there.
    #[test]
    fn a_finer_surface_that_is_dropped_itself_takes_nothing_with_it() {
        let mut through = wall(4.0, 64, DepthOrigin::Stereo);
        for (i, agreeing) in through.agreeing.iter_mut().enumerate() {
            *agreeing = if i % 64 < 32 { 4 } else { 0 };
            through.depth[i] = if i % 64 < 32 { 4.0 } else { 0.0 };
        }
        let mut trusted = wall(2.0, 32, DepthOrigin::Stereo);
        trusted.agreeing.fill(9);
        let views = [trusted, wall(2.0, 64, DepthOrigin::Stereo), through];
        let still = [Similarity3::identity(); 3];
        let (discs, report) = fuse(&views, &[], &still, &FusionOptions::default());
        assert!(report.seen_through > 1700 && report.duplicates > 400, "{report:?}");
        let covered = |x: f32| {
            discs.iter().any(|d| {
                (d.center.z - 2.0).abs() < 1e-3 && (d.center.x - x).hypot(d.center.y - 0.3) <= d.radius
            })
        };
        assert!([-0.9, -0.5, -0.1, 0.1, 0.5, 0.9].into_iter().all(covered), "{report:?}");
    }

    #[test]
    fn of_two_equally_fine_surfaces_the_first_cameras_is_kept() {
        let still = [Similarity3::identity(); 2];
        for origin in [DepthOrigin::Stereo, DepthOrigin::Filled] {
            let views = [wall(2.0, 32, origin), wall(2.02, 32, origin)];
            let (discs, report) = fuse(&views, &[], &still, &FusionOptions::default());
            assert!(report.duplicates >= 900 && report.seen_through == 0, "{report:?}");
            let middle = |d: &&Disc| d.center.x.abs() < 0.9 && d.center.y.abs() < 0.9;
            assert!(discs.iter().filter(middle).all(|d| d.center.z < 2.01));
        }
    }

    #[test]
    fn surfaces_another_camera_looks_through_are_dropped() {
        let views = [wall(1.0, 32, DepthOrigin::Filled), wall(2.0, 32, DepthOrigin::Stereo)];
        let still = [Similarity3::identity(), Similarity3::identity()];
        let (_, report) = fuse(&views, &[], &still, &FusionOptions::default());
        assert!(report.seen_through >= 900, "{report:?}");
        // In the opposite order there is no contradiction: a filled wall behind a measured one is only hidden.
        let views = [wall(1.0, 32, DepthOrigin::Stereo), wall(2.0, 32, DepthOrigin::Filled)];
        assert_eq!(fuse(&views, &[], &still, &FusionOptions::default()).1.seen_through, 0);
    }

    #[test]
    fn a_disc_tells_how_many_views_agree_with_it() {
        // The upper half, 16 rows or four blocks, was seen by one view more in each second column.
        let mut measured = wall(2.0, 32, DepthOrigin::Stereo);
        for (i, agreeing) in measured.agreeing.iter_mut().enumerate().take(16 * 32) {
            *agreeing += (i % 2) as u8;
        }
        let (discs, _) = fuse(&[measured], &[], &[Similarity3::identity()], &FusionOptions::default());
        for disc in &discs {
            let expected = if disc.center.y < 0.0 { 4.5 } else { 4.0 };
            assert!((disc.confidence - expected).abs() < 1e-6, "{disc:?}");
        }
        let filled = wall(2.0, 32, DepthOrigin::Filled);
        let (discs, _) = fuse(&[filled], &[], &[Similarity3::identity()], &FusionOptions::default());
        assert!(discs.iter().all(|d| d.filled && d.confidence.to_bits() == 0));
    }

    #[test]
    fn key_frame_surfaces_are_added_unless_another_camera_sees_the_place() {
        let disc = |z: f32| Disc {
            center: Vec3::new(0.0, 0.0, z),
            normal: -Vec3::Z,
            radius: 0.01,
            color: [1, 2, 3],
            filled: false,
            confidence: 2.0,
        };
        // Behind the second camera's wall, before it, and behind its back.
        let key_frame_discs = [disc(5.0), disc(1.0), disc(-1.0)];
        let views = [wall(4.0, 32, DepthOrigin::Stereo), wall(2.0, 32, DepthOrigin::Stereo)];
        let twice = Similarity3::from_scaling(2.0);
        let (discs, report) =
            fuse(&views, &[&key_frame_discs, &[]], &[twice, twice], &FusionOptions::default());
        let told: Vec<f32> = discs.iter().filter(|d| d.color == [1, 2, 3]).map(|d| d.center.z).collect();
        assert_eq!((told, report.key_frame_discs), (vec![10.0, -2.0], 2));
    }

    /// A disc that the first camera's key frames saw stands before a surface of the second camera: it stays where that surface is only
    /// assumed.
    #[test]
    fn an_assumed_floor_drops_nothing() {
        let before = Disc {
            center: Vec3::new(0.0, 0.0, 1.0),
            normal: -Vec3::Z,
            radius: 0.01,
            color: [1, 2, 3],
            filled: false,
            confidence: 2.0,
        };
        let kept = |origin: DepthOrigin| {
            let views = [wall(4.0, 32, DepthOrigin::Stereo), wall(2.0, 32, origin)];
            let (discs, _) =
                fuse(&views, &[&[before], &[]], &[Similarity3::identity(); 2], &FusionOptions::default());
            discs.iter().any(|disc| disc.color == [1, 2, 3])
        };
        assert!(!kept(DepthOrigin::Filled) && kept(DepthOrigin::Assumed));
    }

    #[test]
    fn discs_stand_in_the_world_with_its_scale() {
        let world = Similarity3::new(nalgebra::Vector3::new(1.0, 2.0, 3.0), nalgebra::Vector3::zeros(), 2.0);
        let (discs, report) =
            fuse(&[wall(2.0, 32, DepthOrigin::Stereo)], &[], &[world], &FusionOptions::default());
        assert_eq!((report.discs, report.filled, report.pixels), (discs.len(), 0, 1024));
        assert!(discs.iter().all(|d| (d.center.z - 7.0).abs() < 1e-5 && d.color == [90, 120, 150]));
        // All discs together cover the wall: 2 · 2 · tan 30° · 2 wide.
        let side = 8.0 * (30f32).to_radians().tan();
        let area: f32 = discs.iter().map(|d| std::f32::consts::PI * d.radius * d.radius).sum();
        assert!(area > side * side && area < 2.0 * side * side, "{area}");
    }
}
