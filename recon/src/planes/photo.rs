//! Photo-consistency: agreement of the key frames' colours with a plane at a pixel.
//!
//! Stereo compares correlations, which a smooth gradient satisfies at any depth and which a patch's brightest edge
//! dominates. To decide between two candidate planes, colours are compared directly, over a small neighbourhood of
//! pixels of similar colour, so that other surfaces nearby have no influence.

use glam::{Affine3A, Vec2, Vec3};
use image::RgbImage;
use image::imageops::{self, FilterType};

use super::witness::Witnesses;
use crate::dense::{DenseView, Pinhole, Support};

/// Offsets of the samples in both directions, pixels; another one is in the middle.
const OFFSETS: [f32; 4] = [-3.0, -1.0, 1.0, 3.0];
const SAMPLES: usize = OFFSETS.len() * OFFSETS.len() + 1;
/// Largest number of views; more bring no improvement.
const MOST_VIEWS: usize = 16;
/// Least number of views.
const LEAST_VIEWS: usize = 2;
/// Difference in grey levels at which a sample's weight has fallen to 1/e.
const COLOUR_SIGMA: f32 = 20.0;
/// Difference in grey levels that is attributed to exposure and shading.
const EXPOSURE: f32 = 6.0;
/// Difference in grey levels at which the cost stops growing: a highlight, or an occluder.
const CAP: f32 = 30.0;

/// Reference picture and key frames for the comparison.
pub(super) struct PhotoConsistency<'a> {
    /// Reference picture at the key frames' size, so that both are equally sharp.
    reference: RgbImage,
    camera: Pinhole,
    /// Pixels of `reference` a pixel of the surface.
    scale: f32,
    views: &'a [(&'a DenseView, Pinhole, Affine3A)],
}

impl<'a> PhotoConsistency<'a> {
    /// Prepares the comparison; `None` without key frames.
    pub(super) fn new(view: &DenseView, witnesses: &'a Witnesses<'a>) -> Option<Self> {
        let (first, small, _) = witnesses.views.first()?;
        let (width, height) = first.picture.dimensions();
        let camera = view.pinhole();
        let reference = imageops::resize(&view.picture, width, height, FilterType::Triangle);
        Some(Self { reference, camera, scale: small.fx / camera.fx, views: &witnesses.views })
    }

    /// Mean difference of colour, grey levels, in the better half of the key frames that see the pixel's whole
    /// neighbourhood (it may be occluded in the others); `None` where fewer than two do.
    pub(super) fn cost(&self, x: usize, y: usize, support: &Support) -> Option<f32> {
        let samples = self.samples(x as f32, y as f32, support)?;
        let mut costs = [0.0; MOST_VIEWS];
        let mut seen = 0;
        for (view, camera, camera_from_reference) in self.views.iter().take(MOST_VIEWS) {
            if let Some(cost) = difference(&samples, &view.picture, camera, camera_from_reference) {
                costs[seen] = cost;
                seen += 1;
            }
        }
        let costs = &mut costs[..seen];
        costs.sort_unstable_by(f32::total_cmp);
        let better = costs.get(..seen.div_ceil(2).max(LEAST_VIEWS))?;
        Some(better.iter().sum::<f32>() / better.len() as f32)
    }

    /// Samples of the neighbourhood on the plane; `None` where it leaves the image or the plane lies behind.
    fn samples(&self, u: f32, v: f32, support: &Support) -> Option<[PhotoSample; SAMPLES]> {
        let color_at = |u: f32, v: f32| {
            let place = (Vec2::new(u, v) + 0.5) * self.scale - 0.5;
            between(&self.reference, place)
        };
        let centre = color_at(u, v)?;
        let mut samples = [PhotoSample { point: Vec3::ZERO, color: centre, weight: 1.0 }; SAMPLES];
        let around = OFFSETS.iter().flat_map(|dv| OFFSETS.iter().map(move |du| (*du, *dv)));
        for (sample, (du, dv)) in samples.iter_mut().zip(std::iter::once((0.0, 0.0)).chain(around)) {
            let w = Some(support.moved(du, dv).w).filter(|w| *w > 0.0)?;
            let color = color_at(u + du, v + dv)?;
            let weight = (-(color - centre).abs().max_element() / COLOUR_SIGMA).exp();
            *sample = PhotoSample { point: self.camera.ray(u + du, v + dv) / w, color, weight };
        }
        Some(samples)
    }
}

/// A point of the plane, in the reference's frame, and its colour in the reference picture.
#[derive(Clone, Copy)]
struct PhotoSample {
    point: Vec3,
    color: Vec3,
    weight: f32,
}

/// Mean difference of colour in one view; `None` where it does not see all samples.
fn difference(
    samples: &[PhotoSample; SAMPLES],
    picture: &RgbImage,
    camera: &Pinhole,
    camera_from_reference: &Affine3A,
) -> Option<f32> {
    let mut differences = [Vec3::ZERO; SAMPLES];
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for (difference, sample) in differences.iter_mut().zip(samples) {
        let p = Some(camera_from_reference.transform_point3(sample.point)).filter(|p| p.z > 0.0)?;
        let pixel = Vec2::new(camera.fx * p.x, camera.fy * p.y) / p.z + Vec2::new(camera.cx, camera.cy);
        *difference = between(picture, pixel)? - sample.color;
        sum += *difference * sample.weight;
        total += sample.weight;
    }
    let exposure = (sum / total).clamp(Vec3::splat(-EXPOSURE), Vec3::splat(EXPOSURE));
    let of = |(d, s): (&Vec3, &PhotoSample)| s.weight * ((*d - exposure).abs().element_sum() / 3.0).min(CAP);
    Some(differences.iter().zip(samples).map(of).sum::<f32>() / total)
}

/// Colour between pixels, bilinear; `None` outside.
fn between(picture: &RgbImage, at: Vec2) -> Option<Vec3> {
    let last = Vec2::new(picture.width() as f32, picture.height() as f32) - 1.0;
    if !(at.cmpge(Vec2::ZERO).all() && at.cmple(last).all()) {
        return None;
    }
    let (x, y) = (at.x as u32, at.y as u32);
    let color = |x: u32, y: u32| {
        let pixel = picture.get_pixel(x.min(picture.width() - 1), y.min(picture.height() - 1));
        Vec3::from(pixel.0.map(f32::from))
    };
    let part = at.fract();
    let upper = color(x, y).lerp(color(x + 1, y), part.x);
    let lower = color(x, y + 1).lerp(color(x + 1, y + 1), part.x);
    Some(upper.lerp(lower, part.y))
}
