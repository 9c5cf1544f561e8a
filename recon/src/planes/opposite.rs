//! The plane opposite a wall or the floor: usually the ceiling. It is plain and seen at a glancing angle, so that few
//! neighbourhoods on it are measured well enough to make a plane of their own ([`super::detect`]), and the tilt of one
//! would be poorly known. Rooms have parallel sides: the opposite plane's direction is taken from the well-measured
//! plane, and only its distance from single pixels.

use std::cmp::Reverse;

use glam::Vec3;

use super::PlaneOptions;
use super::detect::ImagePlane;
use crate::surface::Surface;

/// Least cosine between a pixel's normal and the opposite direction for it to vote (60°: single pixels' normals are
/// rough).
pub(super) const LEAST_FACING: f32 = 0.5;
/// Least share of the votes that agree on the distance; other surfaces spread over many times its width.
const LEAST_AGREEING: f32 = 0.25;
/// Largest share of the pixels beyond the camera behind the plane, for it to enclose the room.
const LARGEST_BEHIND: f32 = 0.1;
/// Largest distance of a pixel from the plane, pixels of disparity.
const NOISE_PX: f32 = 2.5;
/// Half width of the window in which distances agree, in logarithms: a share of the distance.
const WINDOW: f32 = 0.04;
/// Size of a plane that was found there by its own neighbourhoods, as a share of the agreeing pixels, from which on it is kept.
const MEASURED: f32 = 0.4;

/// Adds, for each direction, the plane opposite to the largest enclosing one, where pixels support one. A plane that was found there
/// before is kept instead where it is well measured, as both floor and ceiling are by a wide lens; else it is removed.
pub(super) fn add(surface: &Surface, planes: &mut Vec<ImagePlane>, step: f32, options: &PlaneOptions) {
    let alike = options.facing_deg.to_radians().cos();
    let mut known: Vec<ImagePlane> = planes.iter().copied().filter(|p| p.encloses).collect();
    known.sort_by_key(|p| Reverse(p.pixels));
    let mut directions: Vec<Vec3> = Vec::new();
    for side in known {
        if directions.iter().any(|d| d.dot(side.normal).abs() > alike) {
            continue;
        }
        directions.push(side.normal);
        let Some(plane) = opposite(surface, side.normal, step, options) else { continue };
        let camera = surface.pinhole();
        let is_measured = |p: &ImagePlane| {
            p.normal.dot(plane.normal) >= alike
                && (p.distance(&camera) / plane.distance(&camera)).ln().abs() <= WINDOW
                && p.pixels as f32 >= MEASURED * plane.pixels as f32
        };
        if planes.iter().any(is_measured) {
            continue;
        }
        planes.retain(|p| p.normal.dot(plane.normal) < alike || p.pixels > plane.pixels);
        planes.push(plane);
    }
}

/// Plane that bounds the room in the direction `across`.
fn opposite(surface: &Surface, across: Vec3, step: f32, options: &PlaneOptions) -> Option<ImagePlane> {
    let mut beyond = 0;
    let mut votes: Vec<Vote> = Vec::new();
    for i in 0..surface.depth.len() {
        let Some(distance) = surface.point(i).map(|p| across.dot(p)).filter(|d| *d > 0.0) else { continue };
        beyond += 1;
        if across.dot(surface.normal[i]) < -LEAST_FACING {
            // Errors are equal in inverse depth, so as a share of the distance they grow with the depth.
            votes.push(Vote { log_distance: distance.ln(), weight: (step * surface.depth[i]).powi(-2) });
        }
    }
    let least = (options.least_share * surface.depth.len() as f32).max(LEAST_AGREEING * votes.len() as f32);
    votes.sort_by(|a, b| a.log_distance.total_cmp(&b.log_distance));
    let (log_distance, agreeing) = agreed(&votes).filter(|a| a.1 as f32 >= least)?;
    let plane = ImagePlane::facing(-across, log_distance.exp(), &surface.pinhole(), agreeing);
    let width = surface.width();
    let behind = (0..surface.depth.len())
        .filter(|i| surface.depth[*i] > 0.0)
        .filter(|i| {
            plane.at((i % width) as f32, (i / width) as f32) - 1.0 / surface.depth[*i] > NOISE_PX * step
        })
        .count();
    tracing::debug!("opposite {across}: {agreeing} of {} agree, {behind} of {beyond} behind", votes.len());
    ((behind as f32) < LARGEST_BEHIND * beyond as f32).then_some(plane)
}

/// Vote of a pixel for the plane's distance.
#[derive(Debug, Clone, Copy)]
struct Vote {
    log_distance: f32,
    weight: f32,
}

/// Distance (its logarithm) on which most sorted votes agree, and their number.
fn agreed(votes: &[Vote]) -> Option<(f32, usize)> {
    let mut fullest = 0..0;
    let mut end = 0;
    for start in 0..votes.len() {
        while end < votes.len() && votes[end].log_distance - votes[start].log_distance <= 2.0 * WINDOW {
            end += 1;
        }
        if end - start > fullest.len() {
            fullest = start..end;
        }
    }
    let mut middle = weighted_median(&votes[fullest])?;
    let mut within: &[Vote] = &[];
    // The median of the fullest window may be off its middle: a few steps centre the window on it.
    for _ in 0..5 {
        let first = votes.partition_point(|v| v.log_distance < middle - WINDOW);
        let last = votes.partition_point(|v| v.log_distance <= middle + WINDOW);
        within = &votes[first..last];
        middle = weighted_median(within)?;
    }
    Some((middle, within.len()))
}

/// Weighted median of sorted votes.
fn weighted_median(votes: &[Vote]) -> Option<f32> {
    let half = 0.5 * votes.iter().map(|v| v.weight).sum::<f32>();
    let mut sum = 0.0;
    votes.iter().find_map(|vote| {
        sum += vote.weight;
        (sum >= half).then_some(vote.log_distance)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::DepthOrigin;
    use calib::Intrinsics;
    use image::RgbImage;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const SIZE: (u32, u32) = (160, 120);
    const STEP: f32 = 0.004;
    /// Downwards in the camera, which looks down a little.
    const DOWN: Vec3 = Vec3::new(0.0, 0.995, 0.0999);
    const FLOOR_M: f32 = 1.8;
    const WALL_M: f32 = 5.0;

    /// A room whose ceiling lies `ceiling_m` above the camera: exact floor and back wall; two ceiling pixels of three
    /// unknown, the others off by up to two pixels of disparity and with normals anywhere within 40°.
    fn room(ceiling_m: f32) -> (Surface, Vec<ImagePlane>) {
        let intrinsics = Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 70.0);
        let count = (SIZE.0 * SIZE.1) as usize;
        let mut surface = Surface {
            picture: RgbImage::new(SIZE.0, SIZE.1),
            intrinsics,
            depth: vec![0.0; count],
            normal: vec![Vec3::ZERO; count],
            agreeing: vec![4; count],
            origin: vec![DepthOrigin::Stereo; count],
            step: STEP,
        };
        let camera = surface.pinhole();
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        for i in 0..count {
            let ray = camera.ray((i % SIZE.0 as usize) as f32, (i / SIZE.0 as usize) as f32);
            let sides = [
                (-DOWN, DOWN.dot(ray) / FLOOR_M),
                (-Vec3::Z, 1.0 / WALL_M),
                (DOWN, -DOWN.dot(ray) / ceiling_m),
            ];
            let (normal, w) = sides.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            let mut off = || 2.0 * rng.random::<f32>() - 1.0;
            let (noise, tilt) = (2.0 * STEP * off(), 0.7 * Vec3::new(off(), off(), off()));
            if normal != DOWN {
                (surface.depth[i], surface.normal[i]) = (1.0 / w, normal);
            } else if i % 3 == 0 && w + noise > 0.0 {
                (surface.depth[i], surface.normal[i]) = (1.0 / (w + noise), (normal + tilt).normalize());
            }
        }
        let floor = ImagePlane::facing(-DOWN, FLOOR_M, &camera, 5000);
        let wall = ImagePlane::facing(-Vec3::Z, WALL_M, &camera, 3000);
        (surface, vec![wall, floor])
    }

    #[test]
    fn a_ceiling_hardly_seen_lies_where_it_is() {
        for ceiling_m in [0.4, 0.8, 1.3] {
            let (surface, mut planes) = room(ceiling_m);
            let before = planes.len();
            add(&surface, &mut planes, STEP, &PlaneOptions::default());
            assert_eq!(planes.len(), before + 1);
            let ceiling = planes[before];
            assert!(ceiling.encloses && ceiling.opposite && ceiling.normal.dot(DOWN) > 0.9999);
            let top = surface.pinhole().ray(80.0, 0.0);
            let found_m = -DOWN.dot(top) / ceiling.at(80.0, 0.0);
            assert!((found_m / ceiling_m - 1.0).abs() < 0.01, "{found_m} {ceiling_m}");
        }
    }

    #[test]
    fn a_floor_that_is_measured_stays_so_under_a_ceiling_that_is_larger() {
        let (surface, planes) = room(1.3);
        let [wall, floor] = planes[..] else { panic!("{planes:?}") };
        let camera = surface.pinhole();
        let ceiling = ImagePlane::facing(DOWN, 1.3, &camera, 9000);
        // Its neighbourhoods are fewer than its pixels, and it is not quite opposite.
        let tilted = (-DOWN + 0.01 * Vec3::X).normalize();
        let seen = surface.normal.iter().filter(|normal| **normal == -DOWN).count();
        let floor_found =
            |share: f32| ImagePlane::facing(tilted, FLOOR_M, &camera, (share * seen as f32) as usize);
        let mut known = vec![wall, ceiling, floor_found(0.6)];
        add(&surface, &mut known, STEP, &PlaneOptions::default());
        assert_eq!(known[1..3], [ceiling, floor_found(0.6)]);
        // One found in a few places alone gives way to that which is parallel to the ceiling.
        let mut poor = vec![wall, ceiling, floor_found(0.1)];
        add(&surface, &mut poor, STEP, &PlaneOptions::default());
        let below: Vec<_> = poor.iter().filter(|p| p.normal.dot(floor.normal) > 0.9).collect();
        assert!(below.len() == 1 && below[0].normal.dot(-DOWN) > 0.99999, "{below:?}");
    }

    #[test]
    fn a_poorer_plane_gives_way_and_nothing_is_made_up() {
        let (surface, mut planes) = room(0.8);
        let crooked = Vec3::new(0.1, 0.985, 0.14).normalize();
        planes.push(ImagePlane::facing(crooked, 0.7, &surface.pinhole(), 40));
        add(&surface, &mut planes, STEP, &PlaneOptions::default());
        assert_eq!(planes.len(), 3);
        assert!(planes.iter().all(|p| p.normal != crooked));

        // No ceiling in view: the wall continues to the image's top.
        let (surface, planes) = room(50.0);
        let mut more = planes.clone();
        add(&surface, &mut more, STEP, &PlaneOptions::default());
        assert_eq!(more, planes);
        // A shelf above the camera, past which the wall is visible, bounds no room.
        let (mut surface, planes) = room(0.8);
        for (i, (depth, normal)) in surface.depth.iter_mut().zip(&mut surface.normal).enumerate() {
            if i % SIZE.0 as usize > 60 && *normal != -DOWN {
                (*depth, *normal) = (WALL_M, -Vec3::Z);
            }
        }
        let mut more = planes.clone();
        add(&surface, &mut more, STEP, &PlaneOptions::default());
        assert_eq!(more, planes);
    }
}
