//! Restores the empty scene behind people who stand still for most of a recording: the median over time shows the person.
//!
//! A pixel that shows two colours for long shows the empty scene and a body. The empty scene comes back: it is visible before
//! and after the person. And it fits into its surroundings, while a body has an outline (R. Cucchiara et al. distinguish ghosts
//! from objects by it: "Detecting moving objects, ghosts, and shadows in video streams", PAMI 2003). A region whose other colour
//! comes back has that colour in the empty scene, unless the outline contradicts; where neither colour comes back, the outline
//! alone decides. Shadows have no outline that counts.

use image::RgbImage;

use super::median;

/// Share of frames with the median colour from which on there is no other.
const CLEAR_SHARE: f64 = 0.8;
/// Least share of the frames that show the other colour…
const OTHER_SHARE: f64 = 0.1;
/// …and of those that do not show the median.
const OTHER_OF_REST: f64 = 0.5;
/// Largest distance of two colours that count as the same, levels.
const NEAR_LEVELS: i32 = 20;
/// Least area of a region, as a share of the picture.
const LEAST_AREA: f64 = 0.0005;
/// Contrast of a region with its surroundings in the other colour, as a share of that in the median colour: below this the
/// other colour fits better…
const FITS_BETTER: f64 = 0.8;
/// …and above this worse.
const FITS_WORSE: f64 = 1.3;
/// Distance of the surroundings from a region, pixels: the edge of a shadow is soft.
const BESIDE_PX: usize = 4;
/// Two colours are shades of one surface if the ratios of their three channels differ by no more than this factor.
const SHADE_RATIO: f64 = 1.15;
/// Levels that are added before the division: those of dark colours are mostly noise.
const DARK: f64 = 4.0;
/// Share of shades in a region above which it is changed light, not a body.
const MOST_SHADE: f64 = 0.7;
/// Largest difference of levels that counts in a contrast.
const MOST_CONTRAST: u32 = 60;
/// Radius over which gaps between changed pixels are closed, as a divisor of the picture's height.
const GAP: usize = 160;

/// The other colour of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct OtherColor {
    pub(super) color: [u8; 3],
    /// Number of uninterrupted periods in which it is seen, minus that of the median colour.
    pub(super) returns: i8,
}

/// The other colour that a pixel shows for long in frames that are in the order of time; `None` for most pixels.
pub(super) fn other_color(
    frames: impl Iterator<Item = [u8; 3]> + Clone,
    median: [u8; 3],
) -> Option<OtherColor> {
    let (mut all, mut clear) = (0_usize, 0_usize);
    for color in frames.clone() {
        all += 1;
        clear += usize::from(is_near(color, median));
    }
    if clear as f64 >= CLEAR_SHARE * all as f64 {
        return None;
    }
    let rest: Vec<[u8; 3]> = frames.clone().filter(|color| !is_near(*color, median)).collect();
    let color: [u8; 3] = std::array::from_fn(|channel| {
        median::of_levels(&mut rest.iter().map(|color| color[channel]).collect::<Vec<u8>>())
    });
    let shown = rest.iter().filter(|seen| is_near(**seen, color)).count() as f64;
    if shown < OTHER_SHARE * all as f64 || shown < OTHER_OF_REST * rest.len() as f64 {
        return None;
    }
    let (mut stretches, mut latest) = ([0_i8; 2], None);
    for seen in frames {
        let which = if is_near(seen, median) {
            0
        } else if is_near(seen, color) {
            1
        } else {
            continue;
        };
        if latest.replace(which) != Some(which) {
            stretches[which] = stretches[which].saturating_add(1);
        }
    }
    Some(OtherColor { color, returns: stretches[1].saturating_sub(stretches[0]) })
}

fn is_near(a: [u8; 3], b: [u8; 3]) -> bool {
    let squared: i32 = (0..3).map(|c| (i32::from(a[c]) - i32::from(b[c])).pow(2)).sum();
    squared <= NEAR_LEVELS * NEAR_LEVELS
}

/// Replaces the bodies in a median picture by the other colours: those of the empty scene.
pub(super) fn restore(picture: &mut RgbImage, others: &[Option<OtherColor>]) {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let least = (LEAST_AREA * others.len() as f64).ceil() as usize;
    let median: Vec<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
    for region in regions(others, width, height) {
        if region.len() < least || !is_body(&region, others, &median, width) {
            continue;
        }
        for &pixel in &region {
            if let Some(other) = others[pixel] {
                picture.as_mut()[3 * pixel..3 * pixel + 3].copy_from_slice(&other.color);
            }
        }
    }
}

/// Whether a region's median colours are a body before the other colours.
fn is_body(region: &[usize], others: &[Option<OtherColor>], median: &[[u8; 3]], width: usize) -> bool {
    let returns: i64 = region.iter().filter_map(|pixel| Some(i64::from(others[*pixel]?.returns))).sum();
    let colors = region.len() as f64;
    if (returns as f64) < -0.25 * colors {
        return false;
    }
    let comes_back = returns as f64 > 0.25 * colors;
    let is_shade = |pixel: &&usize| others[**pixel].is_some_and(|o| are_shades(o.color, median[**pixel]));
    if !comes_back && region.iter().filter(is_shade).count() as f64 > MOST_SHADE * colors {
        return false;
    }
    let (mut of_median, mut of_other) = (0_u64, 0_u64);
    for &pixel in region {
        let Some(other) = others[pixel].filter(|other| !are_shades(other.color, median[pixel])) else {
            continue;
        };
        for beside in beside(pixel, width, others) {
            of_median += u64::from(contrast(median[pixel], median[beside]));
            of_other += u64::from(contrast(other.color, median[beside]));
        }
    }
    let most = if comes_back { FITS_WORSE } else { FITS_BETTER };
    (of_other as f64) < most * of_median as f64 || (comes_back && of_median == 0)
}

/// Pixels of one colour near a pixel at the border of its region, in the four directions in which the region ends.
fn beside(pixel: usize, width: usize, others: &[Option<OtherColor>]) -> impl Iterator<Item = usize> {
    let (x, y, height) = (pixel % width, pixel / width, others.len() / width);
    let at = move |step: usize| {
        [
            x.checked_sub(step).map(|u| y * width + u),
            Some(x + step).filter(|u| *u < width).map(|u| y * width + u),
            y.checked_sub(step).map(|v| v * width + x),
            Some(y + step).filter(|v| *v < height).map(|v| v * width + x),
        ]
    };
    let ends = at(1).into_iter().zip(at(BESIDE_PX));
    ends.filter_map(|(next, beside)| Some((next?, beside?)))
        .filter(|(next, beside)| others[*next].is_none() && others[*beside].is_none())
        .map(|(_, beside)| beside)
}

fn contrast(a: [u8; 3], b: [u8; 3]) -> u32 {
    (0..3).map(|c| u32::from(a[c].abs_diff(b[c]))).sum::<u32>().min(MOST_CONTRAST)
}

/// Whether two colours are those of one surface in more and less light: a shadow has no outline of its own.
fn are_shades(a: [u8; 3], b: [u8; 3]) -> bool {
    let ratio = |c: usize| (f64::from(a[c]) + DARK) / (f64::from(b[c]) + DARK);
    let ratios = [ratio(0), ratio(1), ratio(2)];
    let (least, most) = ratios.iter().fold((f64::MAX, 0.0_f64), |(l, m), r| (l.min(*r), m.max(*r)));
    most < SHADE_RATIO * least
}

/// Connected regions of pixels with another colour; gaps of a few pixels do not part them.
fn regions(others: &[Option<OtherColor>], width: usize, height: usize) -> Vec<Vec<usize>> {
    let reach = (height / GAP).max(1) as isize;
    let mut is_left: Vec<bool> = others.iter().map(Option::is_some).collect();
    let mut regions = Vec::new();
    for start in 0..others.len() {
        if !is_left[start] {
            continue;
        }
        is_left[start] = false;
        let (mut region, mut next) = (vec![start], 0);
        while let Some(&pixel) = region.get(next) {
            next += 1;
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            for v in (y - reach).max(0)..=(y + reach).min(height as isize - 1) {
                for u in (x - reach).max(0)..=(x + reach).min(width as isize - 1) {
                    let beside = v as usize * width + u as usize;
                    if is_left[beside] {
                        is_left[beside] = false;
                        region.push(beside);
                    }
                }
            }
        }
        regions.push(region);
    }
    regions
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    const SIZE: (u32, u32) = (120, 90);
    const FRAMES: usize = 40;

    fn room(u: u32, v: u32) -> [u8; 3] {
        let tile = if (u / 9 + v / 7).is_multiple_of(2) { 0 } else { 14 };
        [110 + tile, 100 + tile, 90 + (u / 8) as u8]
    }

    /// Median and other colours of frames with a body in some of them, as wide and as high as given; what is restored.
    fn restored(is_there: impl Fn(usize) -> bool, [wide, high]: [u32; 2]) -> (RgbImage, RgbImage) {
        let is_body = |u: u32, v: u32| (50..50 + wide).contains(&u) && (20..20 + high).contains(&v);
        let color = |t: usize, u: u32, v: u32| {
            if is_there(t) && is_body(u, v) { [30, 40 + (v % 5) as u8, 130] } else { room(u, v) }
        };
        let mut picture = RgbImage::from_fn(SIZE.0, SIZE.1, |u, v| {
            let shown = (0..FRAMES).filter(|t| is_there(*t)).count();
            let t = (0..FRAMES).find(|t| is_there(*t) == (2 * shown > FRAMES)).unwrap();
            Rgb(color(t, u, v))
        });
        let before = picture.clone();
        let others: Vec<Option<OtherColor>> = picture
            .enumerate_pixels()
            .map(|(u, v, median)| other_color((0..FRAMES).map(|t| color(t, u, v)), median.0))
            .collect();
        restore(&mut picture, &others);
        (before, picture)
    }

    fn empty() -> RgbImage {
        RgbImage::from_fn(SIZE.0, SIZE.1, |u, v| Rgb(room(u, v)))
    }

    #[test]
    fn the_room_behind_somebody_who_is_still_for_most_of_the_time_is_found() {
        // Came and went; came twice; came and stayed; was there at the start.
        for is_there in [
            &(|t: usize| (10..34).contains(&t)) as &dyn Fn(usize) -> bool,
            &|t| (4..16).contains(&t) || (20..34).contains(&t),
            &|t| t >= 15,
            &|t| t < 25,
        ] {
            let (median, found) = restored(is_there, [16, 50]);
            assert!(median != empty(), "the median shows the body");
            assert!(found == empty());
        }
    }

    #[test]
    fn the_room_stays_where_the_median_has_it() {
        // Somebody who sits at the start and at the end; somebody who comes, and stays; a shadow.
        let (median, found) = restored(|t: usize| !(8..32).contains(&t), [16, 50]);
        assert!(median == empty() && found == empty());
        let (median, found) = restored(|t| t >= 30, [16, 50]);
        assert!(median == empty() && found == empty());
        assert!(are_shades([50, 60, 70], [100, 120, 140]) && !are_shades([50, 60, 70], [100, 120, 70]));
    }
}
