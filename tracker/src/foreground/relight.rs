//! Predicts the empty scene after a lamp was switched while people are in the picture: light changes by a factor that
//! varies slowly over the image, and most of the image shows no person.

use image::RgbImage;

/// Number of cells along the image's longer side; the light's factor is constant over a cell.
const CELLS: u32 = 12;
/// Added to levels before division: black surfaces hold no information about light.
const FLOOR: f32 = 4.0;
/// Width of a bin of the histograms of factors, as a factor; the bins reach from 1/8 to 8.
const BIN: f32 = 1.03;
const BINS: usize = 142;
/// Largest distance of an explained pixel from its prediction, levels…
const NEAR_LEVELS: f32 = 16.0;
/// …or as a share of the prediction: lamps differ in colour, surfaces in gloss.
const NEAR_SHARE: f32 = 0.15;
/// Share of explained pixels below which the light is not the cause: the camera was moved, or covered.
const LEAST_EXPLAINED: f64 = 0.5;

/// The empty scene in its new light.
#[derive(Debug, Clone)]
pub struct Relit {
    /// Prediction of the old empty scene in the new light.
    pub expected: RgbImage,
    /// Whether each pixel of the picture agrees with the prediction.
    pub explained: Vec<bool>,
}

impl Relit {
    /// Share of the changed pixels that the new light explains; 0 without any. `changed` has the pixels row by row.
    pub fn explained_share(&self, changed: impl Iterator<Item = bool>) -> f64 {
        let (mut all, mut explained) = (0_usize, 0_usize);
        for (_, is_explained) in changed.zip(&self.explained).filter(|(is_changed, _)| *is_changed) {
            all += 1;
            explained += usize::from(*is_explained);
        }
        explained as f64 / all.max(1) as f64
    }
}

/// Predicts the `background` in the light of the picture `now`; `None` where light does not explain the difference.
pub fn relit(background: &RgbImage, now: &RgbImage) -> Option<Relit> {
    let (width, height) = background.dimensions();
    let field = LightField::fit(background, now)?;
    let mut expected = RgbImage::new(width, height);
    let mut explained = Vec::with_capacity(expected.pixels().len());
    for (x, y, pixel) in expected.enumerate_pixels_mut() {
        let factor = field.at(x, y);
        let (b, seen) = (background.get_pixel(x, y), now.get_pixel(x, y));
        let mut off = 0.0;
        let mut brightness = 0.0;
        for c in 0..3 {
            let level = (factor[c] * (b[c] as f32 + FLOOR) - FLOOR).clamp(0.0, 255.0);
            pixel[c] = level.round() as u8;
            off += (level - seen[c] as f32).powi(2);
            brightness += level * level;
        }
        let near = NEAR_LEVELS.max(NEAR_SHARE * brightness.sqrt());
        explained.push(off <= near * near);
    }
    let count = explained.iter().filter(|e| **e).count();
    (count as f64 >= LEAST_EXPLAINED * explained.len() as f64).then_some(Relit { expected, explained })
}

/// Factor of the light for each cell and channel.
struct LightField {
    cell_px: u32,
    columns: usize,
    rows: usize,
    factors: Vec<[f32; 3]>,
}

impl LightField {
    /// Median factor around each cell, over two cells to each side: a person covers less than half of that.
    fn fit(background: &RgbImage, now: &RgbImage) -> Option<Self> {
        let (width, height) = background.dimensions();
        let cell_px = width.max(height).div_ceil(CELLS).max(1);
        let (columns, rows) = (width.div_ceil(cell_px) as usize, height.div_ceil(cell_px) as usize);
        let mut histograms = vec![[[0_u32; BINS]; 3]; columns * rows];
        for ((x, y, b), seen) in background.enumerate_pixels().zip(now.pixels()) {
            let histogram = &mut histograms[(y / cell_px) as usize * columns + (x / cell_px) as usize];
            for c in 0..3 {
                // Levels clipped by the sensor.
                if b[c] < 250 && seen[c] < 250 {
                    let factor = (seen[c] as f32 + FLOOR) / (b[c] as f32 + FLOOR);
                    let bin = (factor.ln() / BIN.ln() + BINS as f32 / 2.0).clamp(0.0, BINS as f32 - 1.0);
                    histogram[c][bin as usize] += 1;
                }
            }
        }
        let around = |i: usize, end: usize| i.saturating_sub(2)..(i + 3).min(end);
        let factor = |row: usize, column: usize, c: usize| {
            let mut sum = [0_u32; BINS];
            for cell in around(row, rows).flat_map(|r| around(column, columns).map(move |k| r * columns + k))
            {
                sum.iter_mut().zip(&histograms[cell][c]).for_each(|(sum, count)| *sum += count);
            }
            let all: u32 = sum.iter().sum();
            let mut below = 0;
            let median = sum.iter().position(|count| {
                below += count;
                2 * below > all
            })?;
            Some(BIN.powf(median as f32 + 0.5 - BINS as f32 / 2.0))
        };
        let mut factors = Vec::with_capacity(columns * rows);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            factors.push([factor(row, column, 0)?, factor(row, column, 1)?, factor(row, column, 2)?]);
        }
        (!factors.is_empty()).then_some(Self { cell_px, columns, rows, factors })
    }

    /// Factor at a pixel, interpolated between the cells' middles.
    fn at(&self, x: u32, y: u32) -> [f32; 3] {
        let place = |pixel: u32, count: usize| {
            let at = ((pixel as f32 + 0.5) / self.cell_px as f32 - 0.5).clamp(0.0, count as f32 - 1.0);
            (at as usize, (at as usize + 1).min(count - 1), at.fract())
        };
        let ((left, right, u), (top, bottom, v)) = (place(x, self.columns), place(y, self.rows));
        let cell = |row: usize, column: usize| &self.factors[row * self.columns + column];
        std::array::from_fn(|c| {
            let upper = cell(top, left)[c] * (1.0 - u) + cell(top, right)[c] * u;
            let lower = cell(bottom, left)[c] * (1.0 - u) + cell(bottom, right)[c] * u;
            upper * (1.0 - v) + lower * v
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    fn room() -> RgbImage {
        RgbImage::from_fn(160, 120, |u, v| {
            let tile = if (u / 9 + v / 7) % 2 == 0 { 0 } else { 40 };
            Rgb([70 + tile, 60 + tile + (v / 4) as u8, 50 + (u / 3) as u8])
        })
    }

    /// A lamp in the upper left corner, reddish.
    fn lit(level: u8, u: u32, v: u32, channel: usize) -> u8 {
        let near = 1.0 / (1.0 + ((u * u + v * v) as f32) / 6000.0);
        (level as f32 * (0.5 + 1.2 * near * [1.2, 1.0, 0.8][channel])).min(255.0) as u8
    }

    #[test]
    fn the_room_behind_people_is_known_in_its_new_light() {
        let before = room();
        let is_person = |u: u32, v: u32| (60..84).contains(&u) && (30..100).contains(&v);
        let after = RgbImage::from_fn(160, 120, |u, v| {
            let b = before.get_pixel(u, v);
            if is_person(u, v) {
                Rgb([20, 30, 140])
            } else {
                Rgb(std::array::from_fn(|c| lit(b[c], u, v, c)))
            }
        });
        let found = relit(&before, &after).unwrap();
        let mut wrong = 0;
        for (i, (u, v, expected)) in found.expected.enumerate_pixels().enumerate() {
            assert!(!(found.explained[i] && is_person(u, v)), "somebody at {u}, {v} is the room");
            let b = before.get_pixel(u, v);
            wrong += usize::from((0..3).any(|c| expected[c].abs_diff(lit(b[c], u, v, c)) > 16));
            wrong += usize::from(!found.explained[i] && !is_person(u, v));
        }
        assert!(wrong < 160 * 120 / 25, "{wrong} pixels");
    }

    #[test]
    fn another_view_is_no_other_light() {
        let before = room();
        let shifted = RgbImage::from_fn(160, 120, |u, v| {
            let stripe = ((u * 13 + v * 29) % 97) as u8;
            Rgb([200 - stripe, 2 * stripe, 90 + stripe])
        });
        assert!(relit(&before, &shifted).is_none());
        assert!(relit(&RgbImage::new(0, 0), &RgbImage::new(0, 0)).is_none());
        assert!(relit(&before, &before).unwrap().explained.iter().all(|e| *e));
    }
}
