//! Colours of detections, from the video in which they were found: a histogram of the middle quarter of each box
//! (section 4, third threshold).

use std::ops::Range;
use std::sync::Arc;

use image::RgbImage;

use super::detection::Detections;
use crate::histogram::Histogram;
use crate::rows::PixelBox;

/// Share of the width and of the height that is sampled: a quarter of the area.
const MIDDLE: f64 = 0.5;
/// Largest number of samples along each side: enough for 216 colours, whatever the size of the box.
const MOST_LOOKS: f64 = 24.0;

/// Error of a picture that does not contain a frame's detections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outside {
    /// Frame whose box has its middle outside the picture.
    pub frame: u32,
}

/// Sets the colours of the detections `nodes`, which belong to the picture's frame. Floor positions have none.
///
/// # Errors
/// A box whose middle lies outside the picture, because it was found in another.
pub fn look(detections: &mut Detections, nodes: Range<usize>, image: &RgbImage) -> Result<(), Outside> {
    for detection in &mut detections.all[nodes] {
        let Some(pixel_box) = detection.pixel_box else { continue };
        let seen = middle(image, &pixel_box).ok_or(Outside { frame: detection.frame })?;
        detection.colours = Some(Arc::new(seen));
    }
    Ok(())
}

/// Colours of a box's middle; `None` where it does not touch the picture.
fn middle(image: &RgbImage, pixel_box: &PixelBox) -> Option<Histogram> {
    let along = |start: f64, length: f64, size: u32| {
        let first = (start + 0.5 * (1.0 - MIDDLE) * length).round().max(0.0);
        let end = (start + 0.5 * (1.0 + MIDDLE) * length).round().max(first + 1.0).min(f64::from(size));
        let step = ((end - first) / MOST_LOOKS).ceil().max(1.0) as usize;
        (first as u32..end as u32).step_by(step)
    };
    let columns = along(pixel_box.left, pixel_box.width, image.width());
    let mut histogram = Histogram::default();
    let mut is_seen = false;
    for v in along(pixel_box.top, pixel_box.height, image.height()) {
        for u in columns.clone() {
            histogram.count(*image.get_pixel(u, v));
            is_seen = true;
        }
    }
    is_seen.then_some(histogram)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::RowFile;
    use image::Rgb;

    #[test]
    fn only_the_middle_counts_and_boxes_of_another_picture_are_refused() {
        let (red, blue) = (Rgb([220, 0, 0]), Rgb([0, 0, 220]));
        // A red figure with a blue rim, twice; another in blue alone.
        let image = RgbImage::from_fn(300, 120, |u, v| {
            if u < 200 && (25..75).contains(&(u % 100)) && (30..90).contains(&v) { red } else { blue }
        });
        let text = "1,-1,0,0,100,120,1\n1,-1,100,0,100,120,1\n1,-1,200,0,100,120,1\n";
        let read = |text: &str| {
            let file = RowFile::parse("boxes.txt".as_ref(), text).unwrap();
            Detections::from_rows(&file, |_| true).unwrap()
        };
        let mut found = read(text);
        look(&mut found, 0..3, &image).unwrap();
        let distance =
            |a: usize, b: usize| super::super::detection::colour_distance(&found.all[a], &found.all[b]);
        assert!(distance(0, 1).unwrap() < 1e-7 && distance(0, 2).unwrap() > 0.99);
        let mut other = read("7,-1,900,10,30,60,1\n");
        assert_eq!(look(&mut other, 0..1, &image), Err(Outside { frame: 7 }));
        assert!(other.all[0].colours.is_none());
    }
}
