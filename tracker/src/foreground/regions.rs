//! Connected regions of a mask, found as runs of pixels joined row by row: small ones are removed, small holes filled.

use image::GrayImage;
use wide::u8x16;

/// Pixels `from..to` of one row.
#[derive(Debug, Clone, Copy)]
struct Run {
    row: u32,
    from: u32,
    to: u32,
    /// Index of an earlier run of the same region, or of this run.
    parent: u32,
}

/// Statistics of a region, stored at its first run.
#[derive(Debug, Clone, Copy, Default)]
struct Region {
    area: u32,
    strong: u32,
    touches_border: bool,
}

/// Finder and editor of regions; it keeps its buffers between frames.
#[derive(Debug, Default)]
pub struct Regions {
    runs: Vec<Run>,
    regions: Vec<Region>,
}

impl Regions {
    /// Removes foreground regions (8-connected) of fewer than `least_area` pixels, and those with fewer than
    /// `least_strong` pixels whose score is at least `strong`. Returns the number of remaining foreground pixels.
    pub fn remove_weak(
        &mut self,
        mask: &mut GrayImage,
        score: &GrayImage,
        strong: u8,
        least_area: u32,
        least_strong: u32,
    ) -> u32 {
        self.find(mask, true);
        self.count_strong(score, |level| level >= strong);
        let mut left = 0;
        for i in 0..self.runs.len() {
            let root = self.root(i as u32) as usize;
            let region = self.regions[root];
            let run = self.runs[i];
            if region.area < least_area || region.strong < least_strong {
                paint(mask, run, 0);
            } else {
                left += run.to - run.from;
            }
        }
        left
    }

    /// Adds to `marks` every foreground region (8-connected) of which at least the share `least` is marked (not 0)
    /// already.
    pub fn spread(&mut self, mask: &GrayImage, marks: &mut GrayImage, least: f64) {
        self.find(mask, true);
        self.count_strong(marks, |level| level > 0);
        for i in 0..self.runs.len() {
            let root = self.root(i as u32) as usize;
            let region = self.regions[root];
            if region.strong > 0 && f64::from(region.strong) >= least * f64::from(region.area) {
                paint(marks, self.runs[i], 255);
            }
        }
    }

    /// Fills background regions (4-connected) of at most `largest` pixels that do not touch the image's border.
    pub fn fill_holes(&mut self, mask: &mut GrayImage, largest: u32) {
        self.find(mask, false);
        for i in 0..self.runs.len() {
            let root = self.root(i as u32) as usize;
            let region = self.regions[root];
            if region.area <= largest && !region.touches_border {
                paint(mask, self.runs[i], 255);
            }
        }
    }

    /// Counts in each region the pixels whose level in an image of the mask's size is strong.
    fn count_strong(&mut self, levels: &GrayImage, is_strong: impl Fn(u8) -> bool) {
        let width = levels.width();
        for i in 0..self.runs.len() {
            let run = self.runs[i];
            let from = (run.row * width + run.from) as usize;
            let levels = &levels.as_raw()[from..from + (run.to - run.from) as usize];
            let root = self.root(i as u32) as usize;
            self.regions[root].strong += levels.iter().filter(|level| is_strong(**level)).count() as u32;
        }
    }

    /// Labels the regions of the foreground or of the background.
    fn find(&mut self, mask: &GrayImage, foreground: bool) {
        self.runs.clear();
        self.regions.clear();
        let (width, height) = mask.dimensions();
        // Foreground regions also join at corners.
        let reach = u32::from(foreground);
        let mut above = 0..0;
        for row in 0..height {
            let pixels = &mask.as_raw()[(row * width) as usize..((row + 1) * width) as usize];
            let first = self.runs.len();
            let mut next_above = above.start;
            let mut x = 0;
            loop {
                let from = next(pixels, x, foreground);
                if from >= pixels.len() {
                    break;
                }
                let to = next(pixels, from, !foreground);
                let me = self.runs.len() as u32;
                let (from, to) = (from as u32, to as u32);
                self.runs.push(Run { row, from, to, parent: me });
                let touches_border = row == 0 || row + 1 == height || from == 0 || to == width;
                self.regions.push(Region { area: to - from, strong: 0, touches_border });
                while next_above < above.end && self.runs[next_above].to + reach <= from {
                    next_above += 1;
                }
                let mut other = next_above;
                while other < above.end && self.runs[other].from < to + reach {
                    self.join(me, other as u32);
                    other += 1;
                }
                x = to as usize;
            }
            above = first..self.runs.len();
        }
    }

    fn root(&mut self, mut run: u32) -> u32 {
        while self.runs[run as usize].parent != run {
            let grand = self.runs[self.runs[run as usize].parent as usize].parent;
            self.runs[run as usize].parent = grand;
            run = grand;
        }
        run
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return;
        }
        let (first, second) = (a.min(b), a.max(b));
        self.runs[second as usize].parent = first;
        let absorbed = self.regions[second as usize];
        let kept = &mut self.regions[first as usize];
        kept.area += absorbed.area;
        kept.touches_border |= absorbed.touches_border;
    }
}

/// Index of the first foreground (or background) pixel from `start` on; the end if there is none.
fn next(pixels: &[u8], start: usize, foreground: bool) -> usize {
    const CHUNK: usize = 16;
    let is_it = |p: &u8| (*p != 0) == foreground;
    let all = (1 << CHUNK) - 1;
    let (chunks, rest) = pixels[start..].as_chunks::<CHUNK>();
    for (nth, chunk) in chunks.iter().enumerate() {
        let background = u8x16::new(*chunk).simd_eq(u8x16::ZERO).to_bitmask();
        let found = if foreground { background ^ all } else { background };
        if found != 0 {
            return start + nth * CHUNK + found.trailing_zeros() as usize;
        }
    }
    pixels.len() - rest.len() + rest.iter().position(is_it).unwrap_or(rest.len())
}

fn paint(mask: &mut GrayImage, run: Run, value: u8) {
    let row = (run.row * mask.width()) as usize;
    mask.as_mut()[row + run.from as usize..row + run.to as usize].fill(value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;
    use proptest::prelude::*;

    /// Labels regions by flood fill, pixel by pixel: slow and simple.
    fn flooded(mask: &GrayImage, foreground: bool) -> Vec<Vec<(u32, u32)>> {
        let mut seen = vec![false; mask.len()];
        let mut regions = Vec::new();
        let steps: &[(i32, i32)] = &[(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
        let steps = if foreground { steps } else { &steps[..4] };
        for (x, y, p) in mask.enumerate_pixels() {
            if (p[0] != 0) != foreground || seen[(y * mask.width() + x) as usize] {
                continue;
            }
            let (mut region, mut open) = (Vec::new(), vec![(x, y)]);
            seen[(y * mask.width() + x) as usize] = true;
            while let Some((x, y)) = open.pop() {
                region.push((x, y));
                for (dx, dy) in steps {
                    let (Some(x), Some(y)) = (x.checked_add_signed(*dx), y.checked_add_signed(*dy)) else {
                        continue;
                    };
                    if x < mask.width() && y < mask.height() {
                        let i = (y * mask.width() + x) as usize;
                        if !seen[i] && (mask.as_raw()[i] != 0) == foreground {
                            seen[i] = true;
                            open.push((x, y));
                        }
                    }
                }
            }
            regions.push(region);
        }
        regions
    }

    proptest! {
        // Wider than one chunk; from nearly empty to nearly full.
        #[test]
        fn regions_agree_with_flooding(
            bits in prop::collection::vec(0..100_u8, 75 * 9),
            share in 0..=100_u8,
            least in 1..12_u32,
        ) {
            let mask = GrayImage::from_fn(75, 9, |x, y| {
                Luma([if bits[(y * 75 + x) as usize] < share { 255 } else { 0 }])
            });
            let mut regions = Regions::default();

            let mut kept = mask.clone();
            let left = regions.remove_weak(&mut kept, &mask, 255, least, 0);
            let mut truth = mask.clone();
            for region in flooded(&mask, true).into_iter().filter(|r| (r.len() as u32) < least) {
                for (x, y) in region {
                    truth.put_pixel(x, y, Luma([0]));
                }
            }
            prop_assert_eq!(&kept, &truth);
            prop_assert_eq!(left as usize, truth.iter().filter(|p| **p > 0).count());

            let mut filled = mask.clone();
            regions.fill_holes(&mut filled, least);
            let mut truth = mask.clone();
            for region in flooded(&mask, false) {
                let border = region.iter().any(|(x, y)| *x == 0 || *y == 0 || *x == 74 || *y == 8);
                if !border && region.len() as u32 <= least {
                    for (x, y) in region {
                        truth.put_pixel(x, y, Luma([255]));
                    }
                }
            }
            prop_assert_eq!(&filled, &truth);
        }
    }

    #[test]
    fn a_region_without_strong_pixels_goes() {
        let mask = GrayImage::from_fn(20, 10, |x, _| Luma([if (5..=12).contains(&x) { 0 } else { 255 }]));
        let score = GrayImage::from_fn(20, 10, |x, _| Luma([if x < 5 { 90 } else { 200 }]));
        let mut kept = mask.clone();
        Regions::default().remove_weak(&mut kept, &score, 150, 1, 3);
        assert!(kept.get_pixel(2, 5)[0] == 0 && kept.get_pixel(15, 5)[0] == 255);
    }

    #[test]
    fn empty_and_full_masks_pass() {
        let mut regions = Regions::default();
        for size in [(0, 0), (1, 1), (7, 1), (1, 9)] {
            for value in [0, 255] {
                let mut mask = GrayImage::from_pixel(size.0, size.1, Luma([value]));
                let before = mask.clone();
                let left = regions.remove_weak(&mut mask, &before, 1, 1, 1);
                regions.fill_holes(&mut mask, 100);
                assert_eq!(mask, before);
                assert_eq!(left, if value == 255 { size.0 * size.1 } else { 0 });
            }
        }
    }
}
