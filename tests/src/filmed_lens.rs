//! Captures as another lens would have filmed them: pictures of a pinhole, bent.

use calib::undistort::UndistortMap;
use calib::{Distortion, Fisheye, Intrinsics};
use image::RgbImage;
use nalgebra::{Point2, Point3, Vector2};

/// Distortion of a lens by name: `pinhole`, `barrel` (k1 = −0.35, k2 = 0.12) or `fisheye` (equidistant); `None` for another name.
pub fn distortion(lens: &str) -> Option<Distortion> {
    match lens {
        "pinhole" => Some(Distortion::NONE),
        "barrel" => Some([-0.35, 0.12, 0.0, 0.0, 0.0].into()),
        "fisheye" => Some(Fisheye::from([0.0; 4]).into()),
        _ => None,
    }
}

/// Replaces a pinhole lens by a bent one of the same size, and bends its pictures accordingly.
#[derive(Debug, Clone)]
pub struct FilmedLens {
    filmed: Intrinsics,
    /// The lens that the pictures come to have.
    pub lens: Intrinsics,
    map: UndistortMap,
}

impl FilmedLens {
    /// Lens with a distortion, of the shortest focal length with which the whole picture shows what `filmed` shows.
    pub fn new(filmed: &Intrinsics, distortion: Distortion) -> Self {
        let corners = [0.0, f64::from(filmed.width) - 1.0]
            .into_iter()
            .flat_map(|x| [0.0, f64::from(filmed.height) - 1.0].map(|y| Point2::new(x, y)));
        let scale = corners
            .map(|corner| {
                let n = Vector2::new((corner.x - filmed.cx) / filmed.fx, (corner.y - filmed.cy) / filmed.fy);
                n.norm() / distortion.distort(n).norm()
            })
            .fold(1.0, f64::max);
        let lens = Intrinsics { fx: scale * filmed.fx, fy: scale * filmed.fy, distortion, ..filmed.clone() };
        let map = UndistortMap::to(filmed, &lens);
        Self { filmed: filmed.clone(), lens, map }
    }

    /// A picture through the bent lens.
    pub fn picture(&self, filmed: &RgbImage) -> RgbImage {
        self.map.image(filmed)
    }

    /// Pixel in the bent picture; `None` where the lens shows nothing.
    pub fn pixel(&self, filmed: &Point2<f64>) -> Option<Point2<f64>> {
        self.lens.project(&Point3::from(self.filmed.unproject(filmed)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn a_bent_picture_shows_a_place_where_its_lens_projects_it() {
        let filmed = Intrinsics::from_horizontal_fov(160, 120, 70.0);
        let bent = FilmedLens::new(&filmed, distortion("barrel").unwrap());
        // A white picture is white to its corners: the lens sees no farther than what was filmed.
        let white = bent.picture(&RgbImage::from_pixel(160, 120, Rgb([255; 3])));
        assert!(white.pixels().all(|pixel| pixel[0] == 255));
        let dot = |x, y| if (x as i32 - 130).abs() < 3 && (y as i32 - 90).abs() < 3 { 255 } else { 0 };
        let seen = bent.picture(&RgbImage::from_fn(160, 120, |x, y| Rgb([dot(x, y); 3])));
        let at = bent.pixel(&Point2::new(130.0, 90.0)).unwrap();
        assert!(seen.get_pixel(at.x.round() as u32, at.y.round() as u32)[0] == 255, "{at}");
        assert!((at - Point2::new(130.0, 90.0)).norm() > 3.0);
    }
}
