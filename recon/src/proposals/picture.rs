//! Picture by which a person confirms proposed points: all reference images, with the same number at the same point.

use image::RgbImage;
use nalgebra::Point2;
use shell::canvas::{Canvas, Color, Stroke, TextStyle};

use crate::project::PickedPoint;

/// Space between images, pixels.
const GAP: u32 = 6;
const RADIUS_PX: f64 = 6.0;
const LETTERS_PX: f32 = 13.0;

/// The reference images, as filmed, in rows, each with its camera's name and the numbered points.
pub fn draw(images: &[(&str, &RgbImage)], points: &[PickedPoint]) -> RgbImage {
    let columns = (images.len() as f64).sqrt().ceil().max(1.0) as usize;
    let widest = images.iter().map(|(_, i)| i.width() + GAP).max().unwrap_or(GAP + 1);
    let highest = images.iter().map(|(_, i)| i.height() + GAP).max().unwrap_or(GAP + 1);
    let rows = images.len().div_ceil(columns).max(1);
    let mut canvas = Canvas::new(widest * columns as u32 - GAP, highest * rows as u32 - GAP, Color::PAPER);
    for (camera, (name, image)) in images.iter().enumerate() {
        let (left, top) = ((camera % columns) as u32 * widest, (camera / columns) as u32 * highest);
        canvas.blit(image, i64::from(left), i64::from(top));
        let place = |pixel: Point2<f64>| Point2::new(pixel.x + f64::from(left), pixel.y + f64::from(top));
        for (number, point) in points.iter().enumerate() {
            let Some(pixel) = point.pixel(camera) else { continue };
            let color = Color::of_id(number as u32 + 1);
            canvas.stroke_circle(place(pixel), RADIUS_PX, &Stroke::solid(color, 2.0));
            let style =
                TextStyle::new(LETTERS_PX).color(color.text_on()).bold().on_plate(color).anchor(0.0, 0.5);
            let beside = place(Point2::new(pixel.x + RADIUS_PX + 2.0, pixel.y));
            canvas.text(beside, &(number + 1).to_string(), &style);
        }
        let style = TextStyle::new(LETTERS_PX).color(Color::INK).on_plate(Color::PAPER).anchor(0.0, 0.0);
        canvas.text(place(Point2::new(4.0, 4.0)), name, &style);
    }
    canvas.into_image()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    const GREY: Rgb<u8> = Rgb([120; 3]);

    #[test]
    fn each_image_is_marked_where_its_pick_is_and_nowhere_else() {
        let image = RgbImage::from_pixel(100, 80, GREY);
        let picks = vec![(0, Point2::new(30.0, 40.0)), (1, Point2::new(60.0, 50.0))];
        let picture = draw(&[("a", &image), ("b", &image)], &[PickedPoint { picks }]);
        assert_eq!(picture.dimensions(), (206, 80));
        let marked = |x: u32, y: u32| *picture.get_pixel(x, y) != GREY;
        assert!(marked(24, 40) && marked(106 + 54, 50));
        assert!(!marked(54, 50) && !marked(106 + 24, 40) && !marked(30, 40));
        assert_eq!(draw(&[], &[]).dimensions(), (1, 1));
    }

    #[test]
    fn many_cameras_stand_in_rows() {
        let image = RgbImage::from_pixel(50, 40, GREY);
        let images = [("a", &image); 5];
        let picks = vec![(1, Point2::new(20.0, 25.0)), (4, Point2::new(20.0, 25.0))];
        let picture = draw(&images, &[PickedPoint { picks }]);
        assert_eq!(picture.dimensions(), (3 * 56 - 6, 2 * 46 - 6));
        let marked = |column: u32, row: u32| *picture.get_pixel(56 * column + 14, 46 * row + 25) != GREY;
        assert!(marked(1, 0) && marked(1, 1) && !marked(0, 0) && !marked(2, 0) && !marked(0, 1));
    }
}
