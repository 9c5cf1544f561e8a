//! Line charts and scatter charts.

use std::path::Path;

use image::RgbImage;
use nalgebra::Point2;
use shell::canvas::{Canvas, Color, Stroke, TextStyle};

use crate::{Error, Result};

/// Width of a chart, pixels.
pub const WIDTH_PX: u32 = 900;
/// Height of a chart, pixels.
pub const HEIGHT_PX: u32 = 560;
/// Margins around the axes: left, right, top, bottom, pixels.
const RIM_PX: [f64; 4] = [84.0, 28.0, 58.0, 66.0];
const TEXT: TextStyle = TextStyle::new(16.0).color(Color::INK);
const MARKER_PX: f64 = 4.5;
/// Largest number of points of a line that are marked; longer lines have no markers.
const MOST_MARKED: usize = 40;

/// An axis of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity with its unit.
    pub name: String,
    /// Smallest and largest value.
    pub range: [f64; 2],
    /// Whether only whole numbers have a meaning.
    pub is_whole: bool,
}

/// A line, or a scatter of points.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Points; those with a coordinate that is not finite are left out.
    pub points: Vec<[f64; 2]>,
    /// Whether the points are joined by a line.
    pub is_line: bool,
    /// Colour; `None` chooses one by the index of the series.
    pub color: Option<Color>,
}

/// A chart of one or more series.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Title above the chart.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Series to draw.
    pub series: Vec<Series>,
}

impl Axis {
    /// Axis with the given range.
    pub fn new(name: &str, range: [f64; 2]) -> Self {
        Self { name: name.to_owned(), range, is_whole: false }
    }

    /// Axis that covers `values` and `at_least` and ends at ticks.
    pub fn fitting(name: &str, values: impl Iterator<Item = f64>, at_least: [f64; 2]) -> Self {
        let range = values.filter(|v| v.is_finite()).fold(at_least, |r, v| [r[0].min(v), r[1].max(v)]);
        let mut axis = Self::new(name, range);
        let step = axis.step();
        axis.range = [(range[0] / step).floor() * step, (range[1] / step).ceil() * step];
        axis
    }

    /// Restricts the ticks to whole numbers.
    #[must_use]
    pub fn whole(self) -> Self {
        Self { is_whole: true, ..self }
    }

    /// Distance between two ticks: a round number.
    fn step(&self) -> f64 {
        let span = (self.range[1] - self.range[0]).max(1e-12);
        let rough = span / 6.0;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|s| s * power).into_iter().find(|s| *s >= rough);
        let step = step.unwrap_or(10.0 * power);
        if self.is_whole { step.ceil() } else { step }
    }

    /// About six round values inside the range.
    pub fn ticks(&self) -> Vec<f64> {
        let step = self.step();
        let first = (self.range[0] / step - 1e-9).ceil() as i64;
        let last = (self.range[1] / step + 1e-9).floor() as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }

    /// Position of a value in the range: 0 at its beginning, 1 at its end.
    fn share(&self, value: f64) -> f64 {
        (value - self.range[0]) / (self.range[1] - self.range[0]).max(1e-12)
    }
}

impl Chart {
    /// Width of the axes' rectangle over its height.
    pub fn aspect() -> f64 {
        let [left, right, top, bottom] = RIM_PX;
        (f64::from(WIDTH_PX) - left - right) / (f64::from(HEIGHT_PX) - top - bottom)
    }

    /// Draws the chart.
    pub fn draw(&self) -> RgbImage {
        let mut canvas = Canvas::new(WIDTH_PX, HEIGHT_PX, Color::PAPER);
        let [left, right, top, bottom] =
            [RIM_PX[0], f64::from(WIDTH_PX) - RIM_PX[1], RIM_PX[2], f64::from(HEIGHT_PX) - RIM_PX[3]];
        let place = |x: f64, y: f64| {
            Point2::new(left + self.x.share(x) * (right - left), bottom - self.y.share(y) * (bottom - top))
        };
        let grid = Stroke::solid(Color::INK.alpha(0.12), 1.0);
        for x in self.x.ticks() {
            let at = place(x, self.y.range[0]);
            canvas.stroke_polyline(&[at, Point2::new(at.x, top)], &grid);
            canvas.text(Point2::new(at.x, bottom + 10.0), &short(x), &TEXT.anchor(0.5, 0.0));
        }
        for y in self.y.ticks() {
            let at = place(self.x.range[0], y);
            canvas.stroke_polyline(&[at, Point2::new(right, at.y)], &grid);
            canvas.text(Point2::new(left - 10.0, at.y), &short(y), &TEXT.anchor(1.0, 0.5));
        }
        for (index, series) in self.series.iter().enumerate() {
            let color = series.color(index);
            let points: Vec<Point2<f64>> = series
                .points
                .iter()
                .filter(|p| p[0].is_finite() && p[1].is_finite())
                .map(|p| place(p[0], p[1]))
                .collect();
            if series.is_line {
                canvas.stroke_polyline(&points, &Stroke::solid(color, 2.5));
            }
            if !series.is_line || points.len() <= MOST_MARKED {
                for point in &points {
                    canvas.fill_circle(*point, MARKER_PX, color);
                }
            }
        }
        self.legend(&mut canvas, Point2::new(left, top - 16.0));
        let axis = Stroke::solid(Color::INK, 1.5);
        let corner = Point2::new(left, bottom);
        canvas.stroke_polyline(&[Point2::new(left, top), corner, Point2::new(right, bottom)], &axis);
        canvas.text(Point2::new(left, 8.0), &self.title, &TEXT.bold().anchor(0.0, 0.0));
        let middle = Point2::new(0.5 * (left + right), f64::from(HEIGHT_PX) - 12.0);
        canvas.text(middle, &self.x.name, &TEXT.anchor(0.5, 1.0));
        canvas.text(Point2::new(right, 8.0), &self.y.name, &TEXT.anchor(1.0, 0.0));
        canvas.into_image()
    }

    fn legend(&self, canvas: &mut Canvas, at: Point2<f64>) {
        let mut x = at.x;
        for (index, series) in self.series.iter().enumerate().filter(|(_, s)| !s.name.is_empty()) {
            canvas.fill_circle(Point2::new(x + 6.0, at.y), 6.0, series.color(index));
            let drawn = canvas.text(Point2::new(x + 18.0, at.y), &series.name, &TEXT.anchor(0.0, 0.5));
            x += 18.0 + f64::from(TEXT.size(&series.name)[0]).max(drawn[2] - drawn[0]) + 26.0;
        }
    }
}

impl Series {
    fn color(&self, index: usize) -> Color {
        self.color.unwrap_or_else(|| series_color(index))
    }
}

/// Colours that show as lines on paper, too: no yellow.
fn series_color(index: usize) -> Color {
    const IDS: [u32; 5] = [5, 0, 2, 4, 6];
    Color::of_id(IDS[index % IDS.len()])
}

/// A tick's number without noise behind the point.
fn short(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Writes a picture, whole or not at all.
///
/// # Errors
/// Naming the file.
pub fn save(image: &RgbImage, path: &Path) -> Result<()> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|e| Error::content(path, "whole file", format!("cannot be written ({e})")))?;
    Ok(calib::files::write_atomic(path, bytes.get_ref())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_cover_the_range() {
        let axis = |low: f64, high: f64| Axis::new("", [low, high]);
        assert_eq!(axis(0.0, 1.0).ticks(), [0.0, 0.2, 0.4, 3.0 * 0.2, 0.8, 1.0]);
        assert_eq!(axis(0.0, 3.0).ticks().len(), 7);
        assert_eq!(axis(37.0, 1234.0).ticks(), [200.0, 400.0, 600.0, 800.0, 1000.0, 1200.0]);
        assert_eq!(axis(5.0, 5.0).ticks(), [5.0]);
        assert_eq!(axis(0.0, 3.0).whole().ticks(), [0.0, 1.0, 2.0, 3.0]);
        // Nothing lies on the rim unless it is a round number.
        let fitting = Axis::fitting("", [42.4, f64::NAN].into_iter(), [0.0, 10.0]);
        assert_eq!(fitting.ticks().last(), Some(&50.0));
        assert_eq!((short(3.0 * 0.2), short(-0.0), short(250.0)), ("0.6".into(), "0".into(), "250".into()));
    }

    #[test]
    fn points_land_where_they_belong_and_odd_ones_are_left_out() {
        let chart = Chart {
            title: "t".into(),
            x: Axis::new("x", [0.0, 1.0]),
            y: Axis::new("y", [0.0, 1.0]),
            series: vec![Series {
                name: String::new(),
                points: vec![[0.5, 0.5], [f64::NAN, 0.2]],
                is_line: true,
                color: None,
            }],
        };
        let image = chart.draw();
        let u = (RIM_PX[0] + f64::from(WIDTH_PX) - RIM_PX[1]) / 2.0;
        let v = (RIM_PX[2] + f64::from(HEIGHT_PX) - RIM_PX[3]) / 2.0;
        let color = series_color(0);
        assert_eq!(image.get_pixel(u as u32, v as u32).0, [color.r, color.g, color.b]);
    }
}
