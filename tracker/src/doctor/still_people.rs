//! Somebody in a film's empty scene: a person who stands still for most of a film is part of its median, and vanishes.
//!
//! The empty scene is compared with the room's reference picture of the camera. A place has changed where the pictures'
//! textures do not correlate, or where plain surfaces differ in level after the exposures are matched. A changed region is
//! a person's where its lower edge, on the floor, and its upper edge are a person's height apart; light that changed and
//! things that moved have other shapes.

use calib::Camera;
use image::GrayImage;
use nalgebra::Point2;

/// Side of the window over which textures are correlated, pixels; odd.
const WINDOW_PX: usize = 11;
/// Standard deviation from which on a window has a texture, levels.
const TEXTURE: f64 = 8.0;
/// Correlation below which two textures differ.
const LEAST_CORRELATION: f64 = 0.35;
/// Difference of two plain windows' levels.
const LEVELS: f64 = 30.0;
/// Side of a cell in which changed pixels are counted, pixels, and the share of them in a changed cell.
const CELL_PX: usize = 8;
const CELL_SHARE: f64 = 0.4;
/// Heights of people, metres: from somebody who sits.
const HEIGHT_M: std::ops::RangeInclusive<f64> = 1.1..=2.2;
/// Widths of people, metres.
const WIDTH_M: std::ops::RangeInclusive<f64> = 0.25..=1.2;
/// Farthest person that is looked for, metres.
const FARTHEST_M: f64 = 20.0;

/// A region in which an empty scene differs from the reference picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StillPerson {
    /// Pixel where the person stands.
    pub(super) foot: Point2<f64>,
    /// Estimated height, metres.
    pub(super) height_m: f64,
}

/// People in `scene` who are not in `reference`; both have the size of the camera's images.
pub(super) fn find(reference: &GrayImage, scene: &GrayImage, camera: &Camera) -> Vec<StillPerson> {
    let (width, height) = (reference.width() as usize, reference.height() as usize);
    if scene.dimensions() != reference.dimensions() || width < WINDOW_PX || height < WINDOW_PX {
        return Vec::new();
    }
    let changed = changed_cells(reference, scene);
    let columns = width.div_ceil(CELL_PX);
    let regions = regions(&changed, columns).into_iter();
    regions.filter_map(|region| person(&region, columns, camera)).collect()
}

/// Sums over rectangles from the top-left corner.
struct Sums {
    width: usize,
    sums: Vec<f64>,
}

impl Sums {
    fn of(width: usize, height: usize, value: impl Fn(usize, usize) -> f64) -> Self {
        let mut sums = vec![0.0; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0.0;
            for x in 0..width {
                row += value(x, y);
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
            }
        }
        Self { width, sums }
    }

    /// Mean over the window whose top-left pixel is given.
    fn mean(&self, x: usize, y: usize) -> f64 {
        let at = |x: usize, y: usize| self.sums[y * (self.width + 1) + x];
        let (right, bottom) = (x + WINDOW_PX, y + WINDOW_PX);
        (at(right, bottom) - at(x, bottom) - at(right, y) + at(x, y)) / (WINDOW_PX * WINDOW_PX) as f64
    }
}

/// Whether each cell has changed, row by row.
fn changed_cells(reference: &GrayImage, scene: &GrayImage) -> Vec<bool> {
    let (width, height) = (reference.width() as usize, reference.height() as usize);
    let level = |picture: &GrayImage, x: usize, y: usize| f64::from(picture.as_raw()[y * width + x]);
    let (gain, shift) = exposure(reference, scene);
    let (a, b) = (|x, y| gain * level(reference, x, y) + shift, |x, y| level(scene, x, y));
    let sums = |value: &dyn Fn(usize, usize) -> f64| Sums::of(width, height, value);
    let (sum_a, sum_b) = (sums(&a), sums(&b));
    let (sum_aa, sum_bb) = (sums(&|x, y| a(x, y).powi(2)), sums(&|x, y| b(x, y).powi(2)));
    let sum_ab = sums(&|x, y| a(x, y) * b(x, y));
    let columns = width.div_ceil(CELL_PX);
    let mut counts = vec![(0_usize, 0_usize); columns * height.div_ceil(CELL_PX)];
    for y in 0..=height - WINDOW_PX {
        for x in 0..=width - WINDOW_PX {
            let (mean_a, mean_b) = (sum_a.mean(x, y), sum_b.mean(x, y));
            let deviation = |sum: &Sums, mean: f64| (sum.mean(x, y) - mean * mean).max(0.0).sqrt();
            let (of_a, of_b) = (deviation(&sum_aa, mean_a), deviation(&sum_bb, mean_b));
            let is_changed = if of_a.max(of_b) >= TEXTURE {
                // A plain window correlates with none.
                let product = (of_a * of_b).max(TEXTURE);
                (sum_ab.mean(x, y) - mean_a * mean_b) / product < LEAST_CORRELATION
            } else {
                (mean_a - mean_b).abs() >= LEVELS
            };
            let middle = WINDOW_PX / 2;
            let (count, all) = &mut counts[(y + middle) / CELL_PX * columns + (x + middle) / CELL_PX];
            *count += usize::from(is_changed);
            *all += 1;
        }
    }
    counts.into_iter().map(|(count, all)| all > 0 && count as f64 >= CELL_SHARE * all as f64).collect()
}

/// Gain and shift of levels from the reference to the scene: those of the quartiles, which changed places hardly move.
fn exposure(reference: &GrayImage, scene: &GrayImage) -> (f64, f64) {
    let quartiles = |picture: &GrayImage| {
        let mut levels = picture.as_raw().clone();
        levels.sort_unstable();
        let at = |part: usize| f64::from(levels[levels.len() * part / 4]);
        (at(1), at(3))
    };
    let ((low_a, high_a), (low_b, high_b)) = (quartiles(reference), quartiles(scene));
    let gain =
        if high_a - low_a >= 1.0 { ((high_b - low_b) / (high_a - low_a)).clamp(0.25, 4.0) } else { 1.0 };
    (gain, low_b - gain * low_a)
}

/// Smallest and largest column and row of each connected region of changed cells, and its number of cells.
fn regions(changed: &[bool], columns: usize) -> Vec<([usize; 4], usize)> {
    let mut left = changed.to_vec();
    let mut regions = Vec::new();
    for start in 0..left.len() {
        if !left[start] {
            continue;
        }
        let (mut bounds, mut cells, mut open) = ([usize::MAX, usize::MAX, 0, 0], 0, vec![start]);
        left[start] = false;
        while let Some(cell) = open.pop() {
            let (x, y) = (cell % columns, cell / columns);
            bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
            cells += 1;
            for (next_x, next_y) in [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)] {
                let next = next_y.wrapping_mul(columns).wrapping_add(next_x);
                if next_x < columns && next < left.len() && left[next] {
                    left[next] = false;
                    open.push(next);
                }
            }
        }
        regions.push((bounds, cells));
    }
    regions
}

/// The person of a region, if it has a person's shape on the floor.
fn person((bounds, cells): &([usize; 4], usize), columns: usize, camera: &Camera) -> Option<StillPerson> {
    let [left, top, right, bottom] = bounds.map(|cell| cell as f64);
    let (wide, high) = (right - left + 1.0, bottom - top + 1.0);
    // A person fills most of the box, and does not touch the picture's sides.
    let is_filled = *cells as f64 >= 0.4 * wide * high;
    if !is_filled || high < 1.2 * wide || high < 3.0 || left == 0.0 || right as usize + 1 >= columns {
        return None;
    }
    let pixel = |x: f64, y: f64| Point2::new(x * CELL_PX as f64, y * CELL_PX as f64);
    let middle = 0.5 * (left + right + 1.0);
    let foot = pixel(middle, bottom + 1.0);
    let eye = camera.center();
    let down = camera.ray(&foot)?;
    if eye.z <= 0.0 || down.z >= -1e-3 {
        return None;
    }
    let place = eye + down.into_inner() * (eye.z / -down.z);
    let distance_m = (place - eye).xy().norm();
    if !(0.3..=FARTHEST_M).contains(&distance_m) {
        return None;
    }
    let up = camera.ray(&pixel(middle, top))?;
    let height_m = eye.z + up.z * distance_m / up.xy().norm();
    let side = camera.camera_from_world * place;
    let width_m = wide * CELL_PX as f64 * side.z / camera.intrinsics.fx;
    (HEIGHT_M.contains(&height_m) && WIDTH_M.contains(&width_m)).then_some(StillPerson { foot, height_m })
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;
    use image::Luma;
    use nalgebra::{Isometry3, Point3, Vector3};

    fn camera() -> Camera {
        let pose =
            Isometry3::face_towards(&Point3::new(0.0, 0.0, 2.4), &Point3::new(4.0, 0.0, 0.8), &-Vector3::z());
        Camera {
            intrinsics: Intrinsics::from_horizontal_fov(640, 480, 70.0),
            camera_from_world: pose.inverse(),
        }
    }

    /// Mottled walls and floor; `light` gives each pixel's brightness.
    fn room(light: impl Fn(u32, u32) -> f64) -> GrayImage {
        GrayImage::from_fn(640, 480, |x, y| {
            let cell = (x / 9).wrapping_mul(374_761_393) ^ (y / 9).wrapping_mul(668_265_263);
            let grain = (x * 7919 + y * 104_729).wrapping_mul(2_654_435_761) >> 30;
            let level = 60.0 + f64::from(cell.wrapping_mul(2_246_822_519) >> 26) + f64::from(grain);
            Luma([(level * light(x, y)).clamp(0.0, 255.0) as u8])
        })
    }

    /// Draws something of this width and height that stands at (x, y).
    fn put(picture: &mut GrayImage, [x, y]: [f64; 2], width_m: f64, height_m: f64) {
        let camera = camera();
        let (foot, head) = (Point3::new(x, y, 0.0), Point3::new(x, y, height_m));
        let [foot_px, head_px] = [foot, head].map(|p| camera.project(&p).unwrap());
        let half = 0.5 * width_m * camera.intrinsics.fx / (camera.camera_from_world * foot).z;
        for (u, v, pixel) in picture.enumerate_pixels_mut() {
            let (u, v) = (f64::from(u), f64::from(v));
            if (u - foot_px.x).abs() <= half && (head_px.y..=foot_px.y).contains(&v) {
                *pixel = Luma([if ((u + v) as u32 / 6).is_multiple_of(2) { 30 } else { 190 }]);
            }
        }
    }

    #[test]
    fn people_who_stand_still_are_found_where_they_stand() {
        let reference = room(|_, _| 1.0);
        for (at, height_m) in [([4.0, 0.3], 1.75), ([3.0, -1.0], 1.6), ([6.0, 1.5], 1.85)] {
            let mut scene = room(|_, _| 1.15);
            put(&mut scene, at, 0.5, height_m);
            let found = find(&reference, &scene, &camera());
            assert_eq!(found.len(), 1, "{at:?}: {found:?}");
            assert!((found[0].height_m - height_m).abs() < 0.25, "{at:?}: {found:?}");
            let foot = camera().project(&Point3::new(at[0], at[1], 0.0)).unwrap();
            assert!((found[0].foot - foot).norm() < 16.0, "{at:?}: {found:?}");
        }
    }

    #[test]
    fn light_and_furniture_are_no_people() {
        let reference = room(|_, _| 1.0);
        let scenes = [
            room(|_, _| 1.0),
            room(|_, _| 1.6),
            room(|_, _| 0.5),
            // A lamp on one half; a soft shadow.
            room(|x, _| if x < 300 { 1.7 } else { 1.0 }),
            room(|x, y| if (250..330).contains(&x) && (150..400).contains(&y) { 0.75 } else { 1.0 }),
        ];
        for (case, scene) in scenes.iter().enumerate() {
            assert_eq!(find(&reference, scene, &camera()), [], "{case}");
        }
        let mut chair = room(|_, _| 1.0);
        put(&mut chair, [4.0, 0.3], 0.5, 0.8);
        put(&mut chair, [5.0, -1.5], 2.0, 1.2);
        assert_eq!(find(&reference, &chair, &camera()), []);
    }
}
