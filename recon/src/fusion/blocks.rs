//! Conversion of pixels to discs: a block of pixels on one plane becomes one disc, others are split down to single
//! pixels.

use glam::Vec3;
use scenes::geometry::Disc;

use crate::dense::Support;
use crate::surface::{DepthOrigin, Surface};

/// Side of the largest block, pixels.
const LARGEST: usize = 4;

/// Discs in the camera's own frame and scale, for the pixels marked in `keep`.
pub(super) fn discs(surface: &Surface, keep: &[bool], flatness: f32) -> Vec<Disc> {
    let mut out = Vec::new();
    for y in (0..surface.height()).step_by(LARGEST) {
        for x in (0..surface.width()).step_by(LARGEST) {
            split(surface, keep, flatness, (x, y), LARGEST, &mut out);
        }
    }
    out
}

fn split(
    surface: &Surface,
    keep: &[bool],
    flatness: f32,
    (x, y): (usize, usize),
    side: usize,
    out: &mut Vec<Disc>,
) {
    if side == 1 {
        let i = y * surface.width() + x;
        if x < surface.width() && y < surface.height() && keep[i] {
            out.extend(single(surface, i));
        }
        return;
    }
    if let Some(disc) = block(surface, keep, flatness, (x, y), side) {
        out.push(disc);
        return;
    }
    let half = side / 2;
    for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
        split(surface, keep, flatness, (x + dx, y + dy), half, out);
    }
}

fn single(surface: &Surface, i: usize) -> Option<Disc> {
    let (u, v) = ((i % surface.width()) as u32, (i / surface.width()) as u32);
    Some(Disc {
        center: surface.point(i)?,
        normal: surface.normal[i],
        radius: surface.radius(i),
        color: surface.picture.get_pixel(u, v).0,
        filled: surface.origin[i] != DepthOrigin::Stereo,
        confidence: confidence(surface, std::iter::once(i)),
    })
}

/// One disc for a whole block, if all of it lies on one plane and comes from one source.
fn block(
    surface: &Surface,
    keep: &[bool],
    flatness: f32,
    (x, y): (usize, usize),
    side: usize,
) -> Option<Disc> {
    let (width, height) = (surface.width(), surface.height());
    if x + side > width || y + side > height {
        return None;
    }
    let pixels = || (y..y + side).flat_map(move |v| (x..x + side).map(move |u| (u, v)));
    let first = surface.origin[y * width + x];
    if !pixels().all(|(u, v)| keep[v * width + u] && surface.origin[v * width + u] == first) {
        return None;
    }
    // Inverse depth is linear over a plane: least squares over the regular block has a closed form.
    let middle = 0.5 * (side as f32 - 1.0);
    let n = (side * side) as f32;
    let spread: f32 = pixels().map(|(u, _)| (u as f32 - x as f32 - middle).powi(2)).sum();
    let (mut w, mut gu, mut gv, mut color) = (0.0, 0.0, 0.0, Vec3::ZERO);
    for (u, v) in pixels() {
        let inverse = 1.0 / surface.depth[v * width + u];
        let (du, dv) = (u as f32 - x as f32 - middle, v as f32 - y as f32 - middle);
        w += inverse / n;
        gu += inverse * du / spread;
        gv += inverse * dv / spread;
        let [r, g, b] = surface.picture.get_pixel(u as u32, v as u32).0;
        color += Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / n;
    }
    let flat = pixels().all(|(u, v)| {
        let (du, dv) = (u as f32 - x as f32 - middle, v as f32 - y as f32 - middle);
        let predicted = w + gu * du + gv * dv;
        (surface.depth[v * width + u] * predicted - 1.0).abs() < flatness
    });
    if !flat {
        return None;
    }
    let camera = surface.pinhole();
    let (u, v) = (x as f32 + middle, y as f32 + middle);
    let (ray, normal) = (camera.ray(u, v), Support { w, gu, gv }.normal(u, v, &camera));
    let cosine = -normal.dot(ray) / ray.length();
    if cosine <= 0.0 {
        return None;
    }
    // Wide enough across the slope, and not so wide that it would reach far beyond its pixels there.
    let half_diagonal = std::f32::consts::FRAC_1_SQRT_2 * side as f32;
    let radius = half_diagonal / (w * camera.fx.min(camera.fy)) / cosine.sqrt();
    let center = ray / w;
    // Along a steep slope it would leave gaps.
    let last = (side - 1) as f32;
    let covered = [(0.0, 0.0), (last, 0.0), (0.0, last), (last, last)].into_iter().all(|(du, dv)| {
        let inverse = w + gu * (du - middle) + gv * (dv - middle);
        (camera.ray(x as f32 + du, y as f32 + dv) / inverse).distance(center) <= radius
    });
    if !covered {
        return None;
    }
    Some(Disc {
        center,
        normal,
        radius,
        color: color.round().to_array().map(|c| c as u8),
        filled: first != DepthOrigin::Stereo,
        confidence: confidence(surface, pixels().map(|(u, v)| v * width + u)),
    })
}

/// Mean number of views that agree with the measured ones of these pixels of one origin.
fn confidence(surface: &Surface, pixels: impl Iterator<Item = usize> + Clone) -> f32 {
    let measured = pixels.clone().filter(|i| surface.origin[*i] == DepthOrigin::Stereo);
    let agreeing: u32 = measured.map(|i| u32::from(surface.agreeing[i])).sum();
    agreeing as f32 / pixels.count().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;
    use image::RgbImage;

    #[test]
    fn a_slanted_plane_becomes_blocks_that_lie_on_it_and_an_edge_does_not() {
        let intrinsics = Intrinsics::from_horizontal_fov(32, 16, 60.0);
        let plane = |u: usize| 0.4 + 0.005 * u as f32;
        // To the right of column 18 another plane stands 1 unit nearer.
        let depth: Vec<f32> = (0..512)
            .map(|i| i % 32)
            .map(|u| if u > 18 { 1.0 / plane(u) - 0.5 } else { 1.0 / plane(u) })
            .collect();
        let surface = Surface {
            picture: RgbImage::new(32, 16),
            intrinsics,
            depth,
            normal: vec![-Vec3::Z; 512],
            agreeing: vec![3; 512],
            origin: vec![DepthOrigin::Stereo; 512],
            step: 0.005,
        };
        let discs = discs(&surface, &[true; 512], 1e-3);
        let camera = surface.pinhole();
        let column = |d: &Disc| d.center.x / d.center.z * camera.fx + camera.cx;
        let far: Vec<&Disc> = discs.iter().filter(|d| column(d) < 15.0).collect();
        assert_eq!(far.len(), 16, "four blocks by four");
        for disc in far {
            let expected = 0.4 + 0.005 * column(disc);
            assert!((disc.center.z * expected - 1.0).abs() < 1e-4);
        }
        // No disc hangs between the two planes.
        for disc in &discs {
            let w = 0.4 + 0.005 * column(disc);
            let off = (disc.center.z - 1.0 / w).abs().min((disc.center.z - 1.0 / w + 0.5).abs());
            assert!(off < 0.01, "{off}");
        }
        let half: Vec<bool> = (0..512).map(|i| i % 32 < 16).collect();
        assert!(super::discs(&surface, &half, 1e-3).len() < discs.len());
        assert!(super::discs(&surface, &[false; 512], 1e-3).is_empty());
    }

    /// Planes that fall away along the columns, and along both axes, seen at 45 to 10° and flatter.
    #[test]
    fn no_pixel_of_a_steep_plane_is_left_open() {
        let intrinsics = Intrinsics::from_horizontal_fov(64, 64, 60.0);
        for (along_u, along_v) in [(0.0, 1.0), (0.7, 0.7)] {
            for slope in [0.008, 0.018, 0.04, 0.09] {
                let inverse =
                    |u: usize, v: usize| 0.2 + slope * (along_u * u as f32 + along_v * (v as f32 - 8.0));
                let pixels = || (0..64 * 64).map(|i| (i % 64, i / 64)).filter(|(_, v)| *v >= 8);
                let mut surface = Surface {
                    picture: RgbImage::new(64, 64),
                    intrinsics: intrinsics.clone(),
                    depth: vec![0.0; 64 * 64],
                    normal: vec![-Vec3::Z; 64 * 64],
                    agreeing: vec![3; 64 * 64],
                    origin: vec![DepthOrigin::Stereo; 64 * 64],
                    step: 0.005,
                };
                let camera = surface.pinhole();
                for (u, v) in pixels() {
                    let w = inverse(u, v);
                    let plane = Support { w, gu: slope * along_u, gv: slope * along_v };
                    surface.depth[v * 64 + u] = 1.0 / w;
                    surface.normal[v * 64 + u] = plane.normal(u as f32, v as f32, &camera);
                }
                let keep: Vec<bool> = surface.depth.iter().map(|z| *z > 0.0).collect();
                let discs = discs(&surface, &keep, 1e-3);
                assert!(discs.len() <= pixels().count());
                let is_open = |(u, v): &(usize, usize)| {
                    let place = camera.ray(*u as f32, *v as f32) / inverse(*u, *v);
                    !discs.iter().any(|disc| disc.center.distance(place) <= 1.001 * disc.radius)
                };
                assert_eq!(pixels().find(is_open), None, "slope {slope}: {} discs", discs.len());
            }
        }
    }
}
