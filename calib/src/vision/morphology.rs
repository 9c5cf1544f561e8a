//! OpenCV's neighbourhood filters on masks and scores: opening, closing, box blur.

use image::GrayImage;
use opencv::core::{BORDER_REPLICATE, Mat, Point, Size};
use opencv::imgproc;
use opencv::prelude::*;

use super::adapter;
use crate::Result;

/// Filters for pictures of any size; keeps its scratch picture and its structuring elements between calls.
#[derive(Default)]
pub struct Morphology {
    scratch: Mat,
    /// Round structuring elements already made, by radius.
    brushes: Vec<(u32, Mat)>,
}

impl Morphology {
    /// Opens a mask: removes parts narrower than a disc of this radius (0: nothing).
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn open(&mut self, mask: &mut GrayImage, radius_px: u32) -> Result<()> {
        self.apply(mask, imgproc::MORPH_OPEN, radius_px)
    }

    /// Closes a mask: fills gaps narrower than a disc of this radius (0: nothing). The image border closes nothing.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn close(&mut self, mask: &mut GrayImage, radius_px: u32) -> Result<()> {
        self.apply(mask, imgproc::MORPH_CLOSE, radius_px)
    }

    /// Dilates a mask by a disc of this radius.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn dilate(&mut self, mask: &mut GrayImage, radius_px: u32) -> Result<()> {
        self.apply(mask, imgproc::MORPH_DILATE, radius_px)
    }

    fn apply(&mut self, mask: &mut GrayImage, operation: i32, radius_px: u32) -> Result<()> {
        if radius_px == 0 || mask.is_empty() {
            return Ok(());
        }
        let filtering = adapter::refused("filtering a mask");
        let known = self.brushes.iter().position(|(radius, _)| *radius == radius_px);
        let brush = if let Some(index) = known {
            index
        } else {
            let side = 2 * radius_px as i32 + 1;
            let brush = imgproc::get_structuring_element_def(imgproc::MORPH_ELLIPSE, Size::new(side, side))
                .map_err(&filtering)?;
            self.brushes.push((radius_px, brush));
            self.brushes.len() - 1
        };
        let brush = &self.brushes[brush].1;
        imgproc::morphology_ex_def(&adapter::gray(mask)?, &mut self.scratch, operation, brush)
            .map_err(&filtering)?;
        self.scratch.copy_to(&mut adapter::gray_mut(mask)?).map_err(&filtering)
    }

    /// Mean of each pixel over the square of side `2 radius + 1` around it; at the border the last pixel repeats.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn box_blur(&mut self, from: &GrayImage, radius_px: u32, into: &mut GrayImage) -> Result<()> {
        if into.dimensions() != from.dimensions() {
            *into = GrayImage::new(from.width(), from.height());
        }
        if from.is_empty() {
            return Ok(());
        }
        let side = 2 * radius_px as i32 + 1;
        imgproc::box_filter(
            &adapter::gray(from)?,
            &mut adapter::gray_mut(into)?,
            -1,
            Size::new(side, side),
            Point::new(-1, -1),
            true,
            BORDER_REPLICATE,
        )
        .map_err(adapter::refused("blurring a picture"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    fn block(width: u32) -> GrayImage {
        GrayImage::from_fn(40, 30, |u, v| {
            Luma([if (10..10 + width).contains(&u) && (5..25).contains(&v) { 255 } else { 0 }])
        })
    }

    #[test]
    fn opening_removes_the_narrow_and_keeps_the_wide() {
        let mut filters = Morphology::default();
        let mut narrow = block(2);
        filters.open(&mut narrow, 1).unwrap();
        assert!(narrow.iter().all(|p| *p == 0));
        let mut wide = block(12);
        filters.open(&mut wide, 1).unwrap();
        // A disc rounds the four corners off.
        let changed = wide.iter().zip(block(12).iter()).filter(|(a, b)| a != b).count();
        assert_eq!(changed, 4);
    }

    #[test]
    fn closing_fills_a_slit_but_not_from_the_border() {
        let mut filters = Morphology::default();
        let mut slit = block(12);
        (0..30).for_each(|v| slit.put_pixel(15, v, Luma([0])));
        filters.close(&mut slit, 2).unwrap();
        assert_eq!(slit.get_pixel(15, 12)[0], 255);
        let mut nothing = GrayImage::new(40, 30);
        filters.close(&mut nothing, 3).unwrap();
        assert!(nothing.iter().all(|p| *p == 0));
    }

    #[test]
    fn a_box_blur_is_the_mean() {
        let from = GrayImage::from_fn(20, 10, |u, v| Luma([((u * 31 + v * 17) % 256) as u8]));
        let mut into = GrayImage::default();
        Morphology::default().box_blur(&from, 1, &mut into).unwrap();
        let sum: u32 = (4..7)
            .flat_map(|u| (6..9).map(move |v| (u, v)))
            .map(|(u, v)| from.get_pixel(u, v)[0] as u32)
            .sum();
        assert!(into.get_pixel(5, 7)[0].abs_diff((sum as f64 / 9.0).round() as u8) <= 1);
    }
}
