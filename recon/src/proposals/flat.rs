//! Large planes rectified to a frontal view: a table, a floor or a wall looks alike from all sides once its slant is
//! removed (C. Wu, B. Clipp, X. Li, J.-M. Frahm and M. Pollefeys, "3D model matching with viewpoint-invariant patches",
//! CVPR 2008).

use image::{GrayImage, Luma};
use nalgebra::{Matrix3, Point2, Point3, SymmetricEigen, Vector3};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use crate::surface::Surface;

/// Largest number of planes, and the least share of the image of one.
const MOST: usize = 8;
const LEAST_SHARE: f64 = 0.02;
/// Largest distance of a point from its plane, as a share of its depth …
const TOLERANCE: f64 = 0.02;
/// … and least cosine between their normals.
const FACING: f64 = 0.85;
/// Number of planes tried, and of points that they are tried on.
const TRIES: usize = 300;
const SAMPLE: usize = 4000;
/// Number of rounds of refitting.
const ROUNDS: usize = 4;
/// Largest side of a plane's picture, pixels.
const LARGEST_PX: f64 = 1500.0;
/// Least number of the 5 × 5 pixels around a pixel of the plane that must lie on it.
const LEAST_AROUND: usize = 18;

/// A plane of a surface, `normal · x = offset` in the camera's frame.
pub(super) struct SurfacePlane {
    normal: Vector3<f64>,
    offset: f64,
    /// Whether each pixel lies on it.
    member: Vec<bool>,
}

/// Frontal picture of a plane.
pub(super) struct SquareOn {
    pub(super) picture: GrayImage,
    /// Position of the picture's first pixel, and the steps to the next along a row and to the next row.
    origin: Point3<f64>,
    along: Vector3<f64>,
    down: Vector3<f64>,
}

impl SquareOn {
    /// Position of a pixel of the picture, in the camera's frame.
    pub(super) fn position(&self, pixel: &Point2<f64>) -> Point3<f64> {
        self.origin + self.along * pixel.x + self.down * pixel.y
    }
}

/// Point and normal of a pixel.
struct Faced {
    pixel: usize,
    point: Vector3<f64>,
    normal: Vector3<f64>,
}

/// Large planes of the surface.
pub(super) fn find(surface: &Surface, rng: &mut Pcg64Mcg) -> Vec<SurfacePlane> {
    let mut left: Vec<Faced> = (0..surface.depth.len())
        .filter_map(|pixel| {
            let (point, normal) = (surface.point(pixel)?, surface.normal[pixel]);
            let double = |v: glam::Vec3| Vector3::new(v.x.into(), v.y.into(), v.z.into());
            Some(Faced { pixel, point: double(point), normal: double(normal) })
        })
        .collect();
    let least = (LEAST_SHARE * surface.depth.len() as f64) as usize;
    let mut found = Vec::new();
    for _ in 0..MOST {
        if left.len() <= least {
            break;
        }
        let Some((normal, offset)) = most_agreed(&left, rng) else { break };
        let on = |p: &Faced| lies_on(p, &normal, offset);
        let mut member = vec![false; surface.depth.len()];
        for point in left.iter().filter(|p| on(p)) {
            member[point.pixel] = true;
        }
        if member.iter().filter(|m| **m).count() >= least {
            found.push(SurfacePlane { normal, offset, member });
        }
        let before = left.len();
        left.retain(|p| (normal.dot(&p.point) - offset).abs() >= TOLERANCE * p.point.z);
        if left.len() == before {
            break;
        }
    }
    found
}

fn lies_on(p: &Faced, normal: &Vector3<f64>, offset: f64) -> bool {
    (normal.dot(&p.point) - offset).abs() < TOLERANCE * p.point.z && normal.dot(&p.normal) > FACING
}

/// Plane of a point and its normal with most support, fitted to its inliers.
fn most_agreed(points: &[Faced], rng: &mut Pcg64Mcg) -> Option<(Vector3<f64>, f64)> {
    let sample: Vec<&Faced> = (0..SAMPLE).map(|_| &points[rng.random_range(0..points.len())]).collect();
    let (mut normal, mut offset) = sample
        .iter()
        .take(TRIES)
        .map(|p| (p.normal, p.normal.dot(&p.point)))
        .max_by_key(|(normal, offset)| sample.iter().filter(|p| lies_on(p, normal, *offset)).count())?;
    for _ in 0..ROUNDS {
        let inside: Vec<&Faced> = points.iter().filter(|p| lies_on(p, &normal, offset)).collect();
        // Stereo's error grows at least in proportion to depth.
        let weights: Vec<f64> = inside.iter().map(|p| p.point.z.powi(-2)).collect();
        let total: f64 = weights.iter().sum();
        let mean: Vector3<f64> =
            inside.iter().zip(&weights).map(|(p, w)| p.point * *w).sum::<Vector3<f64>>() / total;
        let scatter: Matrix3<f64> = inside
            .iter()
            .zip(&weights)
            .map(|(p, w)| *w * (p.point - mean) * (p.point - mean).transpose())
            .sum();
        if inside.len() < 3 || !scatter.iter().all(|v| v.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::new(scatter);
        let fitted: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into();
        normal = if fitted.dot(&mean) < 0.0 { fitted } else { -fitted };
        offset = normal.dot(&mean);
    }
    Some((normal, offset))
}

impl SurfacePlane {
    /// Tells whether a pixel of the reference picture and its neighbourhood lie on the plane.
    pub(super) fn holds(&self, surface: &Surface, pixel: &Point2<f64>) -> bool {
        let (width, height) = (surface.width() as isize, surface.height() as isize);
        let (x, y) = (pixel.x.round() as isize, pixel.y.round() as isize);
        if x < 2 || y < 2 || x >= width - 2 || y >= height - 2 {
            return false;
        }
        let around = (y - 2..=y + 2).flat_map(|v| (x - 2..=x + 2).map(move |u| v * width + u));
        around.filter(|i| self.member[*i as usize]).count() >= LEAST_AROUND
    }

    /// Frontal picture of the plane, at the resolution of the reference picture in its middle; `None` where it is too
    /// small.
    pub(super) fn square_on(&self, surface: &Surface, gray: &GrayImage) -> Option<SquareOn> {
        let across = self.normal.cross(&Vector3::z());
        // A plane that faces the camera has no direction of slant.
        let along = if across.norm() > 0.1 { across.normalize() } else { Vector3::x() };
        let along = (along - self.normal * self.normal.dot(&along)).normalize();
        let down = self.normal.cross(&along);
        let members = (0..self.member.len()).filter(|i| self.member[*i]);
        let points: Vec<Vector3<f64>> = members
            .filter_map(|i| surface.point(i))
            .map(|p| Vector3::new(p.x.into(), p.y.into(), p.z.into()))
            .collect();
        let middle = |values: &mut Vec<f64>, share: f64| {
            values.sort_by(f64::total_cmp);
            values.get((share * (values.len().saturating_sub(1)) as f64) as usize).copied()
        };
        let mut depths: Vec<f64> = points.iter().map(|p| p.z).collect();
        let mut texel = middle(&mut depths, 0.5)? / surface.intrinsics.fx;
        let extent = |axis: &Vector3<f64>| {
            let mut values: Vec<f64> = points.iter().map(|p| axis.dot(p)).collect();
            Some((middle(&mut values, 0.01)?, middle(&mut values, 0.99)?))
        };
        let ((left, right), (top, bottom)) = (extent(&along)?, extent(&down)?);
        texel = texel.max((right - left).max(bottom - top) / LARGEST_PX);
        let (width, height) = (((right - left) / texel) as u32 + 1, ((bottom - top) / texel) as u32 + 1);
        if width.min(height) < 16 {
            return None;
        }
        let origin = Point3::from(self.normal * self.offset + along * left + down * top);
        let mut square_on = SquareOn {
            picture: GrayImage::new(width, height),
            origin,
            along: along * texel,
            down: down * texel,
        };
        for y in 0..height {
            for x in 0..width {
                let seen = square_on.position(&Point2::new(x.into(), y.into()));
                let Some(pixel) = surface.intrinsics.project(&seen) else { continue };
                let value = image::imageops::interpolate_bilinear(gray, pixel.x as f32, pixel.y as f32);
                square_on.picture.put_pixel(x, y, value.unwrap_or(Luma([0])));
            }
        }
        Some(square_on)
    }
}
