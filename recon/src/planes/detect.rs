//! Detection of planes shared by many neighbourhoods: of random ones the one with most support is refined and taken,
//! and the search continues in the rest (RANSAC, in the manner of R. Schnabel, R. Wahl, R. Klein, "Efficient RANSAC for
//! point-cloud shape detection", Computer Graphics Forum 2007).

use std::cmp::Reverse;

use glam::Vec3;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::PlaneOptions;
use super::local::{CELL, Cells};
use crate::dense::{Pinhole, Support};
use crate::surface::Surface;

/// A plane as a function of the pixel: `1/z = a u + b v + c`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagePlane {
    coefficients: [f32; 3],
    /// Unit normal in camera coordinates, towards the camera.
    pub normal: Vec3,
    /// Number of pixels on the plane.
    pub pixels: usize,
    /// Whether almost nothing lies behind it: a wall, the floor or the ceiling of the room.
    pub encloses: bool,
    /// Whether its direction is that of the opposite plane, and only its distance was measured.
    pub(super) opposite: bool,
}

impl ImagePlane {
    /// Plane with this unit normal towards the camera, at this distance from it, that bounds the room.
    pub(super) fn facing(normal: Vec3, distance: f32, camera: &Pinhole, pixels: usize) -> Self {
        // On the plane −normal · ray · z = distance.
        let scaled = -normal / distance;
        let (a, b) = (scaled.x / camera.fx, scaled.y / camera.fy);
        let c = scaled.z - a * camera.cx - b * camera.cy;
        Self { coefficients: [a, b, c], normal, pixels, encloses: true, opposite: true }
    }

    /// Inverse depth at a pixel; not positive where the ray does not hit the plane.
    pub fn at(&self, u: f32, v: f32) -> f32 {
        self.coefficients[0] * u + self.coefficients[1] * v + self.coefficients[2]
    }

    /// Distance from the camera.
    pub(super) fn distance(&self, camera: &Pinhole) -> f32 {
        let [a, b, c] = self.coefficients;
        1.0 / Vec3::new(a * camera.fx, b * camera.fy, a * camera.cx + b * camera.cy + c).length()
    }

    /// Tells whether a surface at a pixel at this depth lies behind the plane, by more than stereo's noise. `step`:
    /// inverse depth of a pixel of disparity.
    pub(crate) fn hides(&self, u: f32, v: f32, depth: f32, step: f32) -> bool {
        /// Noise of the disparity, pixels.
        const BEHIND_PX: f32 = 1.5;
        self.at(u, v) - 1.0 / depth > BEHIND_PX * step
    }

    /// The plane as a support at a pixel.
    pub fn support(&self, u: f32, v: f32) -> Support {
        Support { w: self.at(u, v), gu: self.coefficients[0], gv: self.coefficients[1] }
    }
}

/// Number of neighbourhoods tried for each plane.
const TRIES: usize = 400;
/// Largest share of the measured surface behind an enclosing plane.
const LARGEST_BEHIND: f32 = 0.01;

/// Planes of a view, usually the largest first.
pub(super) fn planes(surface: &Surface, cells: &Cells, step: f32, options: &PlaneOptions) -> Vec<ImagePlane> {
    let camera = surface.pinhole();
    let mut left: Vec<(usize, Support, Vec3)> = cells
        .supports
        .iter()
        .enumerate()
        .filter_map(|(cell, support)| {
            let (u, v) = cells.middle(cell);
            Some((cell, (*support)?, support.as_ref()?.normal(u, v, &camera)))
        })
        .collect();
    let all = left.clone();
    let tolerance = options.tolerance_px * step;
    let facing = options.facing_deg.to_radians().cos();
    let least = ((options.least_share * surface.depth.len() as f32) as usize / (CELL * CELL)).max(3);
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    let mut found = Vec::new();
    let inside = |cell: &(usize, Support, Vec3), plane: &ImagePlane| {
        let (u, v) = cells.middle(cell.0);
        (plane.at(u, v) - cell.1.w).abs() < tolerance && cell.2.dot(plane.normal) > facing
    };
    while found.len() < options.most_planes && left.len() >= least {
        let drawn: Vec<usize> = (0..TRIES).map(|_| rng.random_range(0..left.len())).collect();
        let tried = drawn.par_iter().enumerate().map(|(order, of)| {
            let (cell, support, normal) = left[*of];
            let (u, v) = cells.middle(cell);
            let c = support.moved(-u, -v).w;
            let plane = ImagePlane {
                coefficients: [support.gu, support.gv, c],
                normal,
                pixels: 0,
                encloses: false,
                opposite: false,
            };
            let count = left.iter().filter(|cell| inside(cell, &plane)).count();
            (count, Reverse(order), plane)
        });
        let Some((_, _, mut plane)) = tried.max_by_key(|(count, order, _)| (*count, *order)) else { break };
        for _ in 0..4 {
            let members: Vec<_> = left.iter().filter(|cell| inside(cell, &plane)).collect();
            let Some(refined) = least_squares(&members, cells, &camera) else { break };
            plane = refined;
        }
        let before = left.len();
        let members = left.iter().filter(|cell| inside(cell, &plane)).count();
        if members < least {
            break;
        }
        left.retain(|cell| !inside(cell, &plane));
        plane.pixels = (before - left.len()) * CELL * CELL;
        plane.encloses = behind(&all, cells, &plane, step) < LARGEST_BEHIND;
        tracing::debug!("{plane:?}: {:.3} behind", behind(&all, cells, &plane, step));
        found.push(plane);
    }
    found
}

fn least_squares(members: &[&(usize, Support, Vec3)], cells: &Cells, camera: &Pinhole) -> Option<ImagePlane> {
    let (mut normal, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
    for (cell, support, _) in members {
        let (u, v) = cells.middle(*cell);
        let q = Vector3::new(f64::from(u), f64::from(v), 1.0);
        normal += q * q.transpose();
        right += q * f64::from(support.w);
    }
    let solved = normal.cholesky()?.solve(&right);
    let coefficients = [solved.x as f32, solved.y as f32, solved.z as f32];
    let (u, v) = cells.middle(members.first()?.0);
    let support = Support {
        w: coefficients[0] * u + coefficients[1] * v + coefficients[2],
        gu: coefficients[0],
        gv: coefficients[1],
    };
    Some(ImagePlane {
        coefficients,
        normal: support.normal(u, v, camera),
        pixels: 0,
        encloses: false,
        opposite: false,
    })
}

/// Share of all neighbourhoods that lie well behind a plane.
fn behind(all: &[(usize, Support, Vec3)], cells: &Cells, plane: &ImagePlane, step: f32) -> f32 {
    let count = all
        .iter()
        .filter(|(cell, support, _)| {
            let (u, v) = cells.middle(*cell);
            plane.at(u, v) - support.w > 1.5 * step
        })
        .count();
    count as f32 / all.len().max(1) as f32
}
