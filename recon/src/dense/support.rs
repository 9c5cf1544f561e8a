//! Slanted supports: a plane in space, written as an inverse depth that is linear over the image.
//!
//! Along a plane the inverse depth 1/z is an affine function of the pixel, so a hypothesis of PatchMatch stereo (M.
//! Bleyer et al., "PatchMatch stereo", BMVC 2011) is three numbers: the inverse depth at the pixel and its two
//! derivatives. Moving a hypothesis to a neighbouring pixel is then one multiplication an axis, and the homography that
//! a plane induces between two views is `A + b mᵀ` with `m` the plane's affine coefficients.

use glam::Vec3;

/// A plane hypothesis at one pixel: `1/z = w + gu·Δu + gv·Δv`. Inverse depth in the capture's own units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Support {
    /// Inverse depth at the pixel.
    pub w: f32,
    /// Its change a pixel to the right.
    pub gu: f32,
    /// Its change a pixel downwards.
    pub gv: f32,
}

/// A pinhole camera in single precision, for inner loops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Focal lengths, pixels.
    pub fx: f32,
    /// Focal length along y, pixels.
    pub fy: f32,
    /// Principal point, x.
    pub cx: f32,
    /// Principal point, y.
    pub cy: f32,
}

impl Pinhole {
    /// Point of a pixel's ray at z = 1.
    pub fn ray(&self, u: f32, v: f32) -> Vec3 {
        Vec3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0)
    }
}

impl Support {
    /// Least cosine between the ray and the normal of an accepted plane, 87.7°: a ceiling just above a camera is seen
    /// that flat.
    pub const LEAST_COSINE: f32 = 0.04;

    /// Plane through inverse depth `w` on `ray` with this normal; `None` when it is seen edge-on or from behind.
    pub fn from_normal(w: f32, normal: Vec3, ray: Vec3, camera: &Pinhole) -> Option<Self> {
        let towards = normal.dot(ray);
        if towards >= -Self::LEAST_COSINE * ray.length() * normal.length() {
            return None;
        }
        let scale = w / towards;
        Some(Self { w, gu: normal.x * scale / camera.fx, gv: normal.y * scale / camera.fy })
    }

    /// Unit normal of the plane in camera coordinates, towards the camera; (u, v) is the support's own pixel.
    pub fn normal(&self, u: f32, v: f32, camera: &Pinhole) -> Vec3 {
        let m = Vec3::new(self.gu, self.gv, self.w - self.gu * u - self.gv * v);
        // Kᵀ m, the plane's vector in space: dot with a point of the plane is 1.
        let plane = Vec3::new(camera.fx * m.x, camera.fy * m.y, camera.cx * m.x + camera.cy * m.y + m.z);
        -plane.normalize_or_zero()
    }

    /// The same plane, expressed at the pixel `du`, `dv` away.
    #[must_use]
    pub fn moved(&self, du: f32, dv: f32) -> Self {
        Self { w: self.w + self.gu * du + self.gv * dv, ..*self }
    }

    /// The same plane in an image `factor` times as large.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        Self { w: self.w, gu: self.gu / factor, gv: self.gv / factor }
    }
}

/// A support for each pixel of an image, row by row, with the cost at which it was found.
#[derive(Debug, Clone, Default)]
pub struct SupportMap {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Support of each pixel.
    pub supports: Vec<Support>,
    /// Matching cost: 0 perfect, 1 uncorrelated, above: worse than chance.
    pub costs: Vec<f32>,
}

impl SupportMap {
    /// Map for the image twice as large, each support expressed at its new pixel.
    #[must_use]
    pub fn doubled(&self, width: usize, height: usize) -> Self {
        let nearest = |i: usize, n: usize| (i / 2).min(n.saturating_sub(1));
        let mut supports = Vec::with_capacity(width * height);
        let mut costs = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let (cx, cy) = (nearest(x, self.width), nearest(y, self.height));
                let coarse = cy * self.width + cx;
                let (du, dv) = (x as f32 - (2 * cx) as f32 - 0.5, y as f32 - (2 * cy) as f32 - 0.5);
                supports.push(self.supports[coarse].scaled(2.0).moved(du, dv));
                costs.push(self.costs[coarse]);
            }
        }
        Self { width, height, supports, costs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    const CAMERA: Pinhole = Pinhole { fx: 430.0, fy: 425.0, cx: 319.5, cy: 239.5 };

    proptest! {
        #[test]
        fn a_support_is_the_plane_it_was_made_from(
            u in 0.0f32..640.0, v in 0.0f32..480.0, z in 0.5f32..8.0,
            nx in -0.7f32..0.7, ny in -0.7f32..0.7, du in -9.0f32..9.0, dv in -9.0f32..9.0,
        ) {
            let normal = Vec3::new(nx, ny, -1.0).normalize();
            let ray = CAMERA.ray(u, v);
            let Some(support) = Support::from_normal(1.0 / z, normal, ray, &CAMERA) else { return Ok(()) };
            prop_assert!((support.normal(u, v, &CAMERA) - normal).length() < 1e-3);
            // Closed form: intersection of the neighbour's ray with the plane through z · ray.
            let other = CAMERA.ray(u + du, v + dv);
            let depth = normal.dot(ray * z) / normal.dot(other);
            prop_assume!(depth > 0.1 && depth < 100.0);
            prop_assert!((support.moved(du, dv).w * depth - 1.0).abs() < 2e-3);
        }
    }

    #[test]
    fn planes_seen_edge_on_or_from_behind_are_refused() {
        let ray = CAMERA.ray(319.5, 239.5);
        for normal in [Vec3::X, Vec3::Z, Vec3::new(1.0, 0.0, -0.02), Vec3::ZERO] {
            assert!(Support::from_normal(0.5, normal.normalize_or_zero(), ray, &CAMERA).is_none());
        }
    }

    #[test]
    fn doubling_keeps_the_plane() {
        let plane = |u: f32, v: f32| 0.3 + 0.002 * u - 0.001 * v;
        let supports: Vec<Support> = (0..6)
            .flat_map(|y| (0..8).map(move |x| (x as f32, y as f32)))
            .map(|(u, v)| Support { w: plane(u, v), gu: 0.002, gv: -0.001 })
            .collect();
        let small = SupportMap { width: 8, height: 6, costs: vec![0.0; 48], supports };
        let large = small.doubled(16, 12);
        for (i, support) in large.supports.iter().enumerate() {
            let (u, v) = ((i % 16) as f32, (i / 16) as f32);
            assert_relative_eq!(support.w, plane(0.5 * u - 0.25, 0.5 * v - 0.25), epsilon = 1e-6);
        }
    }
}
