//! Edge images (section 4.2): Sobel gradient of a camera's picture.
//!
//! If the empty scene is known, the picture is first compared with it at the picture's exposure: the result is bright
//! where nothing has changed and dark where a person is. Its edges are the contours of people alone, and their inner
//! side is known. It is not a mask: there is no decision for single pixels, and nothing is learnt.

use image::RgbImage;

use super::options::{EdgeOptions, EdgeStrength};
use super::sobel::{FULL, RIM, Sobel};
use crate::foreground::exposure::Exposure;

/// Difference from the empty scene with half of the full effect, levels: twice the compression artefacts and noise of a
/// good camera.
const CHANGED_HALF: f32 = 16.0;
/// Number of picture sizes: heads of any size then have contours of about the same width relative to the head.
pub const LEVELS: usize = 3;
/// Largest half height of a head that is compared at full size, pixels; heads up to twice as large are compared at half
/// the size.
const LARGEST_HEAD_PX: f32 = 14.0;

/// Edges of one picture: for each pixel, along u and v, the gradient of brightness in units of 1/[`FULL`]; row by row.
#[derive(Debug, Clone, Default)]
pub struct EdgeImage {
    width: usize,
    height: usize,
    /// Levels of the image pyramid, each of half the size of the one before.
    levels: [EdgeLevel; LEVELS],
    /// Similarity of each pixel to the empty scene, 0 to 255; empty where that is not known.
    unchanged: Vec<u8>,
}

/// Edges at one size.
#[derive(Debug, Clone, Default)]
struct EdgeLevel {
    width: usize,
    height: usize,
    gradient: Vec<[i16; 2]>,
}

/// Points in the image with their unit normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlinePoints<const N: usize> {
    /// Columns.
    pub u: [f32; N],
    /// Rows.
    pub v: [f32; N],
    /// Normals, along u.
    pub normal_u: [f32; N],
    /// Normals, along v.
    pub normal_v: [f32; N],
}

/// Maker of the edge images of one camera.
#[derive(Debug, Clone)]
pub struct EdgeMaker {
    options: EdgeOptions,
    /// Empty scene.
    empty: Option<RgbImage>,
    /// Exposure of the latest picture relative to the empty scene.
    exposure: Exposure,
    /// Similarity, 0 to 255, for each difference from the empty scene in levels: 255 for none.
    unchanged: [i16; 256],
    /// Pixels inside the lens, off its border; `None` where that is the whole image.
    shown: Option<Vec<bool>>,
    sobel: Sobel,
}

impl EdgeImage {
    /// Edge at a pixel of the full size; zero outside the image.
    pub fn at(&self, u: i32, v: i32) -> [f32; 2] {
        let EdgeLevel { width, height, gradient } = &self.levels[0];
        let is_inside = (u as usize) < *width && (v as usize) < *height;
        if is_inside { gradient[v as usize * width + u as usize].map(f32::from) } else { [0.0; 2] }
    }

    /// Whether these are edges of differences from the empty scene: then the gradient always points out of a person.
    pub fn is_of_change(&self) -> bool {
        !self.unchanged.is_empty()
    }

    /// Mean share of change from the empty scene over some pixels; `None` where that is not known, or no pixel is in
    /// the image.
    pub fn changed(&self, pixels: impl Iterator<Item = [f32; 2]>) -> Option<f32> {
        if self.unchanged.is_empty() {
            return None;
        }
        let (mut sum, mut inside) = (0, 0);
        for [u, v] in pixels {
            let (column, row) = ((u + 0.5) as i32 as usize, (v + 0.5) as i32 as usize);
            if u > -0.5 && v > -0.5 && column < self.width && row < self.height {
                sum += 255 - u32::from(self.unchanged[row * self.width + column]);
                inside += 1;
            }
        }
        (inside > 0).then(|| sum as f32 / (255 * inside) as f32)
    }

    /// Σ N·E over the outline of a head of this half height, in units of a full edge, and the number of its points in
    /// the image.
    pub fn along<const N: usize>(&self, head_px: f32, outline: &OutlinePoints<N>) -> (f32, u32) {
        /// 3 · 2²²: added to a number, it leaves the nearest integer in the lowest bits, without a branch or a call.
        /// Negative numbers, large ones and NaN end up beyond any image.
        const ROUNDS: f32 = 12_582_912.0;
        let level = match head_px / LARGEST_HEAD_PX {
            small if small <= 1.0 => 0,
            medium if medium <= 2.0 => 1,
            _ => 2,
        };
        let scale = 1.0 / (1 << level) as f32;
        let EdgeLevel { width, height, gradient } = &self.levels[level];
        // Pixels' edges, not their centres, coincide in all sizes.
        let shift = 0.5 * scale - 0.5;
        let pixel = |x: f32| (x * scale + shift + ROUNDS).to_bits().wrapping_sub(ROUNDS.to_bits());
        let (columns, rows) = (outline.u.map(pixel), outline.v.map(pixel));
        let (mut sum, mut inside) = (0.0, 0);
        for i in 0..N {
            let (column, row) = (columns[i] as usize, rows[i] as usize);
            if column < *width && row < *height {
                let [eu, ev] = gradient[row * width + column];
                sum += outline.normal_u[i] * f32::from(eu) + outline.normal_v[i] * f32::from(ev);
                inside += 1;
            }
        }
        (sum / FULL, inside)
    }
}

impl<const N: usize> Default for OutlinePoints<N> {
    fn default() -> Self {
        Self { u: [0.0; N], v: [0.0; N], normal_u: [0.0; N], normal_v: [0.0; N] }
    }
}

impl EdgeMaker {
    /// Maker for pictures of a camera. `shown` is true for each pixel inside the lens.
    pub fn new(options: EdgeOptions, width: u32, shown: &[bool]) -> Self {
        let is_whole = shown.iter().all(|s| *s);
        Self {
            options,
            empty: None,
            exposure: Exposure::default(),
            unchanged: std::array::from_fn(|d| {
                let (half, d) = (CHANGED_HALF * CHANGED_HALF, (d * d) as f32);
                (255.0 * half / (half + d)) as i16
            }),
            shown: (!is_whole).then(|| eroded(shown, width as usize)),
            sobel: Sobel::default(),
        }
    }

    /// Sets the picture of the empty scene.
    pub fn set_empty_scene(&mut self, picture: &RgbImage) {
        self.empty = Some(picture.clone());
    }

    /// Computes the edges of a picture into `edges`, whose buffers are reused.
    pub fn edges(&mut self, picture: &RgbImage, edges: &mut EdgeImage) {
        (edges.width, edges.height) = (picture.width() as usize, picture.height() as usize);
        edges.unchanged.clear();
        self.sobel.values.clear();
        let empty = self
            .empty
            .as_ref()
            .filter(|e| self.options.moving_only && e.dimensions() == picture.dimensions());
        let strength = if let Some(empty) = empty {
            self.exposure = Exposure::fit(empty, picture, &self.exposure);
            let table = self.exposure.table();
            let pairs = picture.as_raw().chunks_exact(3).zip(empty.as_raw().chunks_exact(3));
            self.sobel.values.extend(pairs.map(|(now, empty)| {
                let differs = |c: usize| now[c].abs_diff(table[c][empty[c] as usize]);
                self.unchanged[differs(0).max(differs(1)).max(differs(2)) as usize]
            }));
            edges.unchanged.extend(self.sobel.values.iter().map(|v| *v as u8));
            EdgeStrength::Linear
        } else {
            // Rec. 601 in 256ths.
            let luma = |p: &[u8]| (77 * u32::from(p[0]) + 150 * u32::from(p[1]) + 29 * u32::from(p[2])) >> 8;
            self.sobel.values.extend(picture.as_raw().chunks_exact(3).map(|p| luma(p) as i16));
            self.options.strength
        };
        let (mut width, mut height) = (edges.width, edges.height);
        for (i, level) in edges.levels.iter_mut().enumerate() {
            if i > 0 {
                (width, height) = self.sobel.halve(width, height);
            }
            self.sobel.answer(width, height);
            (level.width, level.height) = (width, height);
            self.sobel.store(strength, &mut level.gradient);
            if let Some(shown) = self.shown.as_ref().filter(|shown| shown.len() == edges.width * edges.height)
            {
                for (k, edge) in level.gradient.iter_mut().enumerate() {
                    let (column, row) = ((k % width) << i, (k / width) << i);
                    if !shown[row * edges.width + column] {
                        *edge = [0; 2];
                    }
                }
            }
        }
    }
}

/// Pixels whose whole neighbourhood of the operator is shown.
fn eroded(shown: &[bool], width: usize) -> Vec<bool> {
    let height = shown.len() / width.max(1);
    let reach = |at: usize, size: usize| at.saturating_sub(RIM)..(at + RIM + 1).min(size);
    (0..shown.len())
        .map(|i| {
            let (column, row) = (i % width, i / width);
            reach(row, height).all(|v| reach(column, width).all(|u| shown[v * width + u]))
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // zeros and ones that are set, not computed
mod tests {
    use super::*;
    use crate::method::condensation::sobel::STEEPEST;
    use image::Rgb;

    fn picture(of: impl Fn(u32, u32) -> u8) -> RgbImage {
        RgbImage::from_fn(40, 30, |u, v| Rgb([of(u, v); 3]))
    }

    fn edges(options: EdgeOptions, empty: Option<&RgbImage>, picture: &RgbImage) -> EdgeImage {
        let mut maker = EdgeMaker::new(options, 40, &[true; 1200]);
        if let Some(empty) = empty {
            maker.set_empty_scene(empty);
        }
        let mut edges = EdgeImage::default();
        maker.edges(picture, &mut edges);
        edges
    }

    /// A point whose normal points to the right.
    fn across(u: f32, v: f32) -> OutlinePoints<1> {
        OutlinePoints { u: [u], v: [v], normal_u: [1.0], normal_v: [0.0] }
    }

    fn linear() -> EdgeOptions {
        EdgeOptions { strength: EdgeStrength::Linear, ..EdgeOptions::default() }
    }

    #[test]
    fn a_plane_has_its_own_gradient_everywhere() {
        // Brightness 20 + 3 u + 2 v: the operator must give (3, 2) levels a pixel whatever its size.
        let edges = edges(linear(), None, &picture(|u, v| (20 + 3 * u + 2 * v) as u8));
        for (u, v) in [(2, 2), (20, 15), (37, 27)] {
            let [eu, ev] = edges.at(u, v).map(|e| e / FULL * STEEPEST);
            assert!((eu - 3.0).abs() < 0.1 && (ev - 2.0).abs() < 0.1, "({u}, {v}): {eu} {ev}");
        }
        assert_eq!(edges.at(1, 15), [0.0; 2], "no answer where the operator leaves the image");
        assert_eq!((edges.at(-1, 3), edges.at(40, 3), edges.at(3, 30)), ([0.0; 2], [0.0; 2], [0.0; 2]));
    }

    #[test]
    fn strength_counts_fully_or_hardly() {
        let step = |by: u8| picture(move |u, _| if u < 20 { 60 } else { 60 + by });
        let ratio = |options: EdgeOptions| {
            edges(options, None, &step(160)).at(19, 15)[0] / edges(options, None, &step(40)).at(19, 15)[0]
        };
        assert!((ratio(linear()) - 4.0).abs() < 0.1);
        let saturating =
            EdgeOptions { strength: EdgeStrength::Saturating { half_at: 8.0 }, ..EdgeOptions::default() };
        // Slopes of 60 and 15 levels a pixel: 60/68 against 15/23.
        assert!((ratio(saturating) - (60.0 / 68.0) / (15.0 / 23.0)).abs() < 0.02, "{}", ratio(saturating));
    }

    #[test]
    fn edges_of_the_empty_scene_vanish_and_people_are_dark_inside_in_any_clothes() {
        let step = |dark: u8, bright: u8| move |u: u32| if u < 20 { dark } else { bright };
        let empty = picture(|u, _| step(60, 140)(u));
        // Two posts, one darker and one brighter than their background, at an exposure 10 % brighter.
        let with = picture(|u, v| match (u, v) {
            (6..12, 8..) => 10,
            (28..34, 8..) => 230,
            _ => step(66, 154)(u),
        });
        let moving = edges(EdgeOptions::default(), Some(&empty), &with);
        assert!(moving.is_of_change());
        assert!(moving.at(19, 15)[0].abs() < 10.0, "the step itself: {:?}", moving.at(19, 15));
        for (left, right) in [(6, 11), (28, 33)] {
            assert!(moving.at(left, 20)[0] < -300.0 && moving.at(right, 20)[0] > 300.0, "outwards, {left}");
        }
        let changed = |u: f32| moving.changed([[u, 20.0]].into_iter()).unwrap();
        assert!(changed(9.0) > 0.8 && changed(31.0) > 0.8 && changed(16.0) < 0.2 && changed(24.0) < 0.2);
        assert_eq!(moving.changed([[-3.0, 5.0], [40.0, 5.0]].into_iter()), None);
        let all = edges(linear(), None, &with);
        assert!(
            all.at(19, 4)[0] > 100.0
                && !all.is_of_change()
                && all.changed([[9.0, 20.0]].into_iter()).is_none()
        );
        let unused = edges(EdgeOptions { moving_only: false, ..linear() }, Some(&empty), &with);
        assert_eq!(unused.at(19, 4), all.at(19, 4));
    }

    #[test]
    fn sums_run_along_normals_and_count_what_is_inside() {
        let edges = edges(linear(), None, &picture(|u, _| (20 + 3 * u) as u8));
        let outline = OutlinePoints {
            u: [10.2, 20.0, 30.0],
            v: [10.0, 10.0, 9.6],
            normal_u: [1.0, 0.0, -0.5],
            normal_v: [0.0, 1.0, 0.0],
        };
        let (sum, inside) = edges.along(6.0, &outline);
        assert!((sum * STEEPEST - 1.5).abs() < 0.1 && inside == 3, "{sum} {inside}");
        for (u, v) in [(-0.6, 5.0), (39.6, 5.0), (5.0, 29.6), (f32::NAN, 5.0), (1e30, 5.0), (5.0, -1e30)] {
            assert_eq!(edges.along(6.0, &across(u, v)), (0.0, 0), "{u} {v}");
        }
    }

    #[test]
    fn large_heads_are_looked_at_in_smaller_pictures() {
        let edges = edges(linear(), None, &picture(|u, _| (20 + 3 * u) as u8));
        // The same slope is twice as steep at half the size.
        let at = |head_px: f32| edges.along(head_px, &across(20.0, 15.0)).0 * STEEPEST;
        assert!(
            (at(10.0) - 3.0).abs() < 0.1 && (at(20.0) - 6.0).abs() < 0.1 && (at(99.0) - 12.0).abs() < 0.2
        );
        // A step between columns 19 and 20 stays in place.
        let step = self::edges(linear(), None, &picture(|u, _| if u < 20 { 60 } else { 160 }));
        let best = |head_px: f32| {
            let at = |u: f32| step.along(head_px, &across(u, 15.0)).0;
            let most = (0..160).map(|i| at(i as f32 * 0.25)).fold(0.0, f32::max);
            let (sum, count) = (0..160)
                .map(|i| i as f32 * 0.25)
                .filter(|u| at(*u) > 0.9 * most)
                .fold((0.0, 0), |(sum, count), u| (sum + u, count + 1));
            sum / count as f32
        };
        assert!(
            [10.0, 20.0, 40.0].iter().all(|px| (best(*px) - 19.5).abs() < 0.6),
            "{} {} {}",
            best(10.0),
            best(20.0),
            best(40.0)
        );
    }

    #[test]
    fn the_border_of_a_lens_is_no_edge() {
        let shown: Vec<bool> = (0..1200).map(|i| i % 40 >= 8).collect();
        let mut maker = EdgeMaker::new(linear(), 40, &shown);
        let mut edges = EdgeImage::default();
        maker.edges(&picture(|u, _| if u < 8 { 0 } else { 200 }), &mut edges);
        assert!((0..40).all(|u| edges.at(u, 15) == [0.0; 2]));
    }

    #[test]
    fn tiny_pictures_have_no_edges() {
        let mut maker = EdgeMaker::new(linear(), 3, &[true; 9]);
        let mut edges = EdgeImage::default();
        maker.edges(&RgbImage::from_fn(3, 3, |u, _| Rgb([(u * 90) as u8; 3])), &mut edges);
        assert_eq!(edges.at(1, 1), [0.0; 2]);
    }
}
