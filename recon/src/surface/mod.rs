//! Depth, normal and origin of each pixel of a camera's reference view.
//!
//! The frame is the camera's own (the identity), the scale the capture's; the picture and the pixels are those of the
//! pinhole camera.

#[cfg(test)]
pub(crate) mod rendered;

use calib::Intrinsics;
use glam::Vec3;
use image::RgbImage;
use nalgebra::{Point2, Point3};
use serde::{Deserialize, Serialize};

use crate::dense::{DenseView, Pinhole};

/// Origin of a pixel's depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum DepthOrigin {
    /// There is no depth.
    #[default]
    Unknown,
    /// Measured by stereo.
    Stereo,
    /// Filled in from a plane that stereo measured nearby.
    Filled,
    /// Assumed to be the floor, since nothing was measured: no evidence of anything else.
    Assumed,
}

/// A camera's reference view with depth.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Pinhole picture.
    pub picture: RgbImage,
    /// Camera of the picture, without distortion.
    pub intrinsics: Intrinsics,
    /// Depth along z a pixel, row by row; 0 where unknown.
    pub depth: Vec<f32>,
    /// Unit normal in camera coordinates, towards the camera.
    pub normal: Vec<Vec3>,
    /// Number of other views that agree: 0 for pixels that are not measured.
    pub agreeing: Vec<u8>,
    /// Origin of each depth.
    pub origin: Vec<DepthOrigin>,
    /// Change of inverse depth that shifts a pixel by one in the farthest view: the unit of stereo's errors.
    pub step: f32,
}

impl Surface {
    /// Reliable part of a dense view.
    pub fn from_view(view: &DenseView) -> Self {
        let (camera, width) = (view.pinhole(), view.map.width);
        let known = |i: usize| view.agreeing[i] > 0;
        let all = 0..view.map.supports.len();
        let normal = |i: usize| {
            let support = &view.map.supports[i];
            support.normal((i % width) as f32, (i / width) as f32, &camera)
        };
        Self {
            picture: view.picture.clone(),
            intrinsics: view.intrinsics.clone(),
            depth: all.clone().map(|i| if known(i) { 1.0 / view.map.supports[i].w } else { 0.0 }).collect(),
            normal: all.clone().map(|i| if known(i) { normal(i) } else { Vec3::ZERO }).collect(),
            agreeing: view.agreeing.clone(),
            origin: all.map(|i| if known(i) { DepthOrigin::Stereo } else { DepthOrigin::Unknown }).collect(),
            step: view.step,
        }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.intrinsics.width as usize
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.intrinsics.height as usize
    }

    /// Camera in single precision for inner loops.
    pub fn pinhole(&self) -> Pinhole {
        let k = &self.intrinsics;
        Pinhole { fx: k.fx as f32, fy: k.fy as f32, cx: k.cx as f32, cy: k.cy as f32 }
    }

    /// Point at pixel number `i`; `None` where unknown.
    pub fn point(&self, i: usize) -> Option<Vec3> {
        let (u, v) = ((i % self.width()) as f32, (i / self.width()) as f32);
        (self.depth[i] > 0.0).then(|| self.pinhole().ray(u, v) * self.depth[i])
    }

    /// Radius of the disc that covers pixel number `i`, with the surface's slant.
    pub fn radius(&self, i: usize) -> f32 {
        let (u, v) = ((i % self.width()) as f32, (i / self.width()) as f32);
        let camera = self.pinhole();
        let ray = camera.ray(u, v);
        let cosine = (-self.normal[i].dot(ray) / ray.length()).clamp(LEAST_COSINE, 1.0);
        // Half a pixel's diagonal, longer on a slanted surface; the square root shares that between both axes.
        std::f32::consts::FRAC_1_SQRT_2 * self.depth[i] / camera.fx.min(camera.fy) / cosine.sqrt()
    }

    /// Surface area at pixel number `i`, in the capture's units squared.
    pub fn area(&self, i: usize) -> f32 {
        let (u, v) = ((i % self.width()) as f32, (i / self.width()) as f32);
        let camera = self.pinhole();
        let ray = camera.ray(u, v);
        let towards = (-self.normal[i].dot(ray) / ray.length()).max(LEAST_COSINE);
        // A pixel's solid angle is 1 / (fx fy |ray|³); the surface lies at depth · |ray|.
        self.depth[i].powi(2) / (camera.fx * camera.fy * ray.length() * towards)
    }

    /// Relative standard deviation of a depth measured by stereo: a fraction of a pixel in the farthest view.
    pub fn depth_sigma(&self, depth: f32) -> f64 {
        STEREO_SIGMA_PX * f64::from(self.step * depth)
    }

    /// Share of pixels with a depth.
    pub fn coverage(&self) -> f64 {
        self.depth.iter().filter(|z| **z > 0.0).count() as f64 / self.depth.len().max(1) as f64
    }

    /// Point at a pinhole pixel, from its neighbourhood: an edge belongs to the nearer surface, since a person picks
    /// corners of things and not the wall behind them.
    pub fn point_at(&self, pixel: &Point2<f64>) -> Option<Point3<f64>> {
        for radius in [2isize, 4, 8] {
            if let Some(depth) = self.neighbourhood_depth(pixel, radius) {
                let ray = self.intrinsics.unproject(pixel)?;
                return Some(Point3::from(ray * depth));
            }
        }
        None
    }

    /// Normal at a pinhole pixel; `None` where it is unknown.
    pub fn normal_at(&self, pixel: &Point2<f64>) -> Option<Vec3> {
        let (x, y) = (pixel.x.round(), pixel.y.round());
        if !(0.0..self.width() as f64).contains(&x) || !(0.0..self.height() as f64).contains(&y) {
            return None;
        }
        let i = y as usize * self.width() + x as usize;
        (self.depth[i] > 0.0).then(|| self.normal[i])
    }

    /// Median depth of the nearer surface around a pixel; `None` when too little is known there.
    fn neighbourhood_depth(&self, pixel: &Point2<f64>, radius: isize) -> Option<f64> {
        let (cx, cy) = (pixel.x.round() as isize, pixel.y.round() as isize);
        let mut depths: Vec<f32> = Vec::with_capacity((2 * radius as usize + 1).pow(2));
        for y in cy - radius..=cy + radius {
            for x in cx - radius..=cx + radius {
                if x < 0 || y < 0 || x >= self.width() as isize || y >= self.height() as isize {
                    continue;
                }
                let depth = self.depth[y as usize * self.width() + x as usize];
                if depth > 0.0 {
                    depths.push(depth);
                }
            }
        }
        let area = (2 * radius as usize + 1).pow(2);
        if depths.len() < area / 4 {
            return None;
        }
        depths.sort_by(f32::total_cmp);
        let gap = (1..depths.len())
            .max_by(|a, b| (depths[*a] / depths[a - 1]).total_cmp(&(depths[*b] / depths[b - 1])));
        let nearer = match gap {
            Some(at) if depths[at] > SURFACE_GAP * depths[at - 1] && at >= depths.len() / 5 => &depths[..at],
            Some(at) if depths[at] > SURFACE_GAP * depths[at - 1] => &depths[at..],
            _ => &depths[..],
        };
        Some(f64::from(nearer[nearer.len() / 2]))
    }
}

/// Least cosine (84°) as which flatter surfaces are drawn and weighted.
const LEAST_COSINE: f32 = 0.1;
/// Standard deviation of stereo, pixels in the farthest view.
const STEREO_SIGMA_PX: f64 = 0.3;
/// Ratio of the depths of neighbouring pixels from which on they show two surfaces.
const SURFACE_GAP: f32 = 1.02;

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// A wall at 4 with a box at 3 in its right half, square on.
    fn boxed() -> Surface {
        let intrinsics = Intrinsics::from_horizontal_fov(40, 30, 60.0);
        let depth: Vec<f32> = (0..1200).map(|i| if i % 40 >= 20 { 3.0 } else { 4.0 }).collect();
        Surface {
            picture: RgbImage::new(40, 30),
            intrinsics,
            depth,
            normal: vec![-Vec3::Z; 1200],
            agreeing: vec![3; 1200],
            origin: vec![DepthOrigin::Stereo; 1200],
            step: 0.005,
        }
    }

    #[test]
    fn picks_at_an_edge_belong_to_the_nearer_surface() {
        let surface = boxed();
        for (x, z) in [(5.0, 4.0), (19.6, 3.0), (20.4, 3.0), (30.0, 3.0)] {
            assert_relative_eq!(surface.point_at(&Point2::new(x, 12.0)).unwrap().z, z, epsilon = 1e-6);
        }
    }

    #[test]
    fn unknown_pixels_have_no_point() {
        let mut surface = boxed();
        surface.depth.fill(0.0);
        assert!(surface.point_at(&Point2::new(10.0, 10.0)).is_none());
        surface.depth[10 * 40 + 12] = 3.0;
        assert!(surface.point_at(&Point2::new(10.0, 10.0)).is_none(), "one pixel is no surface");
    }

    #[test]
    fn areas_add_up_to_the_wall() {
        let mut surface = boxed();
        surface.depth.fill(2.0);
        let total: f32 = (0..1200).map(|i| surface.area(i)).sum();
        let width = 2.0 * 40.0 / surface.intrinsics.fx as f32;
        assert_relative_eq!(total, width * width * 0.75, epsilon = 1e-3);
    }
}
