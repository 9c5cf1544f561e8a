//! Lookup maps from a camera's image to its pinhole twin's, and back.
//!
//! Everything that renders or simulates works in the pinhole image ([`Intrinsics::pinhole`]), where straight
//! edges stay straight and an ellipsoid's outline is a conic; real images and masks are brought there once,
//! by these maps.

use image::{GrayImage, Rgb, RgbImage};
use nalgebra::{Point2, UnitQuaternion, Vector3};

use crate::Intrinsics;

/// Source pixel in the distorted image for each pixel of the pinhole image.
#[derive(Debug, Clone)]
pub struct UndistortMap {
    /// Width of the pinhole image.
    width: u32,
    /// Height of the pinhole image.
    height: u32,
    /// Width and height of the distorted image.
    filmed: (u32, u32),
    /// Row by row; `None` where the lens has no image. Empty when the camera has no distortion.
    source: Vec<Option<[f32; 2]>>,
    /// The index of the nearest pixel to each source, [`NOTHING`] for none.
    nearest: Vec<u32>,
}

/// Index for pixels where the lens has no image; beyond every image.
const NOTHING: u32 = u32::MAX;

impl UndistortMap {
    /// Computes the map of one camera to its pinhole twin.
    pub fn new(intrinsics: &Intrinsics) -> Self {
        Self::to(intrinsics, &intrinsics.pinhole())
    }

    /// Computes the map of one camera to a pinhole camera at the same place, of any size.
    pub fn to(intrinsics: &Intrinsics, pinhole: &Intrinsics) -> Self {
        if intrinsics == pinhole {
            let (width, height) = (intrinsics.width, intrinsics.height);
            return Self { width, height, filmed: (width, height), source: Vec::new(), nearest: Vec::new() };
        }
        Self::of_rays(intrinsics, pinhole, |ray| ray)
    }

    /// The map of a camera that has turned in place, to the pinhole image of the camera before: what it no longer sees
    /// there has no image.
    pub fn turned(
        intrinsics: &Intrinsics,
        pinhole: &Intrinsics,
        camera_from_before: &UnitQuaternion<f64>,
    ) -> Self {
        Self::of_rays(intrinsics, pinhole, |ray| camera_from_before * ray)
    }

    /// Map by which a ray of the pinhole image becomes one of the camera.
    fn of_rays(
        intrinsics: &Intrinsics,
        pinhole: &Intrinsics,
        of_camera: impl Fn(Vector3<f64>) -> Vector3<f64>,
    ) -> Self {
        let (width, height) = (pinhole.width, pinhole.height);
        let filmed = (intrinsics.width, intrinsics.height);
        let source: Vec<Option<[f32; 2]>> = (0..height)
            .flat_map(|v| (0..width).map(move |u| Point2::new(u as f64, v as f64)))
            .map(|pixel| {
                let ray = pinhole.unproject(&pixel)?;
                let seen = intrinsics.project(&of_camera(ray).into())?;
                intrinsics.contains(&seen).then_some([seen.x as f32, seen.y as f32])
            })
            .collect();
        let index = |[u, v]: [f32; 2]| {
            (v.round() as u32).min(filmed.1 - 1) * filmed.0 + (u.round() as u32).min(filmed.0 - 1)
        };
        let nearest = source.iter().map(|source| source.map_or(NOTHING, index)).collect();
        Self { width, height, filmed, source, nearest }
    }

    /// Tells whether the camera has no distortion, so that images need no change.
    pub fn is_identity(&self) -> bool {
        self.source.is_empty()
    }

    /// Index of the distorted image's nearest pixel for each pixel of the pinhole image, row by row; beyond every image
    /// where the lens has no image. Empty for an identity.
    pub fn nearest(&self) -> &[u32] {
        &self.nearest
    }

    /// Tells of each pixel of the pinhole image, row by row, whether the lens has an image of it.
    pub fn filmed(&self) -> Vec<bool> {
        if self.is_identity() {
            return vec![true; self.width as usize * self.height as usize];
        }
        self.source.iter().map(Option::is_some).collect()
    }

    /// Resamples a mask to the pinhole image: the nearest pixel's value, 0 where the lens has no image.
    pub fn mask(&self, distorted: &GrayImage, into: &mut GrayImage) {
        if self.is_identity() {
            into.copy_from_slice(distorted);
            return;
        }
        let distorted = distorted.as_raw();
        for (pixel, nearest) in into.iter_mut().zip(&self.nearest) {
            // `NOTHING` is beyond every image.
            *pixel = distorted.get(*nearest as usize).copied().unwrap_or(0);
        }
    }

    /// Resamples a picture to the pinhole image bilinearly; black where the lens has no image.
    pub fn image(&self, distorted: &RgbImage) -> RgbImage {
        if self.is_identity() {
            return distorted.clone();
        }
        RgbImage::from_fn(self.width, self.height, |x, y| {
            let source = self.source[(y * self.width + x) as usize];
            let sampled = source.and_then(|[u, v]| {
                let (right, bottom) = (self.filmed.0 as f32 - 1.0, self.filmed.1 as f32 - 1.0);
                let (u, v) = (u.clamp(0.0, right), v.clamp(0.0, bottom));
                image::imageops::interpolate_bilinear(distorted, u, v)
            });
            sampled.unwrap_or(Rgb([0, 0, 0]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;
    use nalgebra::Point3;

    fn barrel() -> Intrinsics {
        let mut k = Intrinsics::from_horizontal_fov(160, 120, 80.0);
        k.distortion = [-0.25, 0.08, 0.002, -0.001, 0.0].into();
        k
    }

    #[test]
    fn a_distorted_straight_line_comes_out_straight() {
        let k = barrel();
        // Draw the image of the plane x = 0.3 z: a curve in the distorted image, a vertical line in the pinhole's.
        let seen = RgbImage::from_fn(k.width, k.height, |u, v| {
            let ray = k.unproject(&Point2::new(u as f64, v as f64)).unwrap();
            if ray.x < 0.3 { Rgb([255, 255, 255]) } else { Rgb([0, 0, 0]) }
        });
        let straight = UndistortMap::new(&k).image(&seen);
        let twin = k.pinhole();
        let edge = twin.project(&Point3::new(0.3, 0.0, 1.0)).unwrap().x;
        for part in [0.1, 0.3, 0.5, 0.7, 0.9] {
            let v = (part * f64::from(twin.height)) as u32;
            let last_white = (0..twin.width).rev().find(|u| straight.get_pixel(*u, v)[0] > 127).unwrap();
            // Half a pixel from drawing the edge, one from sampling it.
            assert!((last_white as f64 - edge).abs() <= 1.5, "row {v}: {last_white} against {edge}");
        }
    }

    #[test]
    fn masks_follow_the_same_map_and_pinholes_pass_through() {
        let k = barrel();
        let full = GrayImage::from_pixel(k.width, k.height, Luma([255]));
        let twin = k.pinhole();
        let mut seen = GrayImage::new(twin.width, twin.height);
        UndistortMap::new(&k).mask(&full, &mut seen);
        let middle = twin.project(&Point3::new(0.0, 0.0, 1.0)).unwrap();
        assert!(seen.get_pixel(middle.x as u32, middle.y as u32)[0] == 255);
        // The same pixels are told to be filmed: of a barrel those within its outline, of a pinhole all.
        let filmed = UndistortMap::new(&k).filmed();
        assert!(filmed.iter().zip(seen.pixels()).all(|(filmed, seen)| *filmed == (seen[0] == 255)));
        assert!(filmed.iter().any(|filmed| !filmed));

        let mut out = GrayImage::new(k.width, k.height);
        let checker = GrayImage::from_fn(k.width, k.height, |u, v| Luma([((u * v) % 251) as u8]));
        let map = UndistortMap::new(&k.without_distortion());
        map.mask(&checker, &mut out);
        assert!(map.is_identity() && out == checker && map.filmed() == vec![true; checker.len()]);
    }
}
