//! The room from straight above, cut open below the ceiling: colours, cut walls, and shade in the corners.

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use rayon::prelude::*;

use crate::Result;
use crate::geometry::Geometry;
use crate::raycast::RayScene;
use crate::view::{exposure, first_normal, first_seen, surrounded};
use shell::canvas::Color;

/// Rays along each side of a pixel.
const SAMPLES: u32 = 2;
/// Rays a pixel.
const RAYS: usize = (SAMPLES * SAMPLES) as usize;
/// Colour of solid things that are cut through.
const CUT: Vec3 = Vec3::new(58.0, 62.0, 72.0);
/// Share of the paper's colour in the picture, so that lines and labels stand out.
const PALENESS: f32 = 0.22;
/// Heights, as shares of the cut's, at which walls are detected.
const WALL_HEIGHTS: [f32; 3] = [0.7, 0.85, 0.98];

/// A raster of the floor, row by row from the largest y downwards.
pub(super) struct Raster {
    pub width: u32,
    pub height: u32,
    /// World position of the top left pixel's centre.
    pub origin: Vec2,
    pub pixel_m: f32,
}

impl Raster {
    fn place(&self, column: f32, row: f32) -> Vec2 {
        self.origin + Vec2::new(column, -row) * self.pixel_m
    }

    /// Column and row of each pixel, in order.
    fn pixels(&self) -> impl IndexedParallelIterator<Item = (f32, f32)> {
        let width = self.width as usize;
        (0..width * self.height as usize)
            .into_par_iter()
            .map(move |i| ((i % width) as f32, (i / width) as f32))
    }

    /// Index of a pixel, if it is on the raster.
    fn index(&self, column: i64, row: i64) -> Option<usize> {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        ((0..width).contains(&column) && (0..height).contains(&row))
            .then_some((row * width + column) as usize)
    }
}

/// Topmost surface hit by a ray from above.
#[derive(Debug, Clone, Copy)]
struct Top {
    color: Vec3,
    height_m: f32,
}

/// Renders the raster on paper.
pub(super) fn picture(geometry: &Geometry, raster: &Raster, cut_m: f32) -> Result<RgbImage> {
    let scene = RayScene::new(geometry)?;
    let paper = Vec3::new(f32::from(Color::PAPER.r), f32::from(Color::PAPER.g), f32::from(Color::PAPER.b));
    let colors = render(geometry, &scene, raster, cut_m, paper);
    let mut picture = RgbImage::new(raster.width, raster.height);
    for (pixel, color) in picture.pixels_mut().zip(colors) {
        *pixel = Rgb(color.to_array().map(|c| c.round().clamp(0.0, 255.0) as u8));
    }
    Ok(picture)
}

/// Renders the raster; `paper` where nothing is hit. Colours 0 to 255.
fn render(geometry: &Geometry, scene: &RayScene, raster: &Raster, cut_m: f32, paper: Vec3) -> Vec<Vec3> {
    let gain = exposure(geometry);
    let look_down = |place: Vec2| {
        let seen = first_seen(geometry, scene, place.extend(cut_m), Vec3::NEG_Z, |_, _| true)?;
        let shade = 0.8 + 0.2 * seen.normal.z.abs();
        let color = (seen.color * (gain * shade)).min(Vec3::splat(255.0)).lerp(paper, PALENESS);
        Some(Top { color, height_m: cut_m - seen.distance })
    };
    let mut tops = tops(raster, &look_down);
    let bare: Vec<bool> = tops.iter().map(|tops| tops.iter().all(Option::is_none)).collect();
    let solid = solid(geometry, scene, raster, cut_m, &bare);
    if matches!(geometry, Geometry::Discs(_)) {
        close_gaps(&mut tops, raster);
    }
    let heights: Vec<f32> = tops
        .iter()
        .zip(&solid)
        .map(|(tops, solid)| match solid {
            true => cut_m,
            false => tops.iter().flatten().map(|top| top.height_m).sum::<f32>() / RAYS as f32,
        })
        .collect();
    let light = corner_light(heights, raster);
    let walls = walls(scene, raster, cut_m);
    let pixel = |i: usize| {
        let colors = tops[i].iter().map(|top| top.map_or(paper, |top| top.color * light[i]));
        let color = if solid[i] { CUT } else { colors.sum::<Vec3>() / RAYS as f32 };
        color.lerp(CUT, walls[i])
    };
    (0..tops.len()).into_par_iter().map(pixel).collect()
}

/// Topmost surfaces of the rays of each pixel. Where a pixel's first ray hits the same even surface as the first rays of its
/// neighbours, its other rays are not cast and have the first one's surface; at edges all rays are cast.
fn tops(raster: &Raster, look_down: &(impl Fn(Vec2) -> Option<Top> + Sync)) -> Vec<[Option<Top>; RAYS]> {
    let offset = |i: usize| (i as f32 + 0.5) / SAMPLES as f32 - 0.5;
    let ray = |(column, row): (f32, f32), i: usize| {
        look_down(raster.place(column + offset(i % SAMPLES as usize), row + offset(i / SAMPLES as usize)))
    };
    let first: Vec<Option<Top>> = raster.pixels().map(|pixel| ray(pixel, 0)).collect();
    let of_pixel = |(pixel, here): ((f32, f32), &Option<Top>)| {
        let beside = |(right, down): (i64, i64)| raster.index(pixel.0 as i64 + right, pixel.1 as i64 + down);
        let mut around = [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().filter_map(beside);
        if around.all(|i| is_alike(here.as_ref(), first[i].as_ref())) {
            return [*here; RAYS];
        }
        std::array::from_fn(|i| if i == 0 { *here } else { ray(pixel, i) })
    };
    raster.pixels().zip(&first).map(of_pixel).collect()
}

/// Tells whether two neighbouring rays hit one even surface, or both hit nothing.
fn is_alike(a: Option<&Top>, b: Option<&Top>) -> bool {
    /// Largest difference in height on an even surface, metres, and in each channel of its colour, 0 to 255.
    const HEIGHT_STEP_M: f32 = 0.02;
    const COLOR_STEP: f32 = 12.0;
    match (a, b) {
        (Some(a), Some(b)) => {
            (a.height_m - b.height_m).abs() <= HEIGHT_STEP_M
                && (a.color - b.color).abs().max_element() <= COLOR_STEP
        }
        (None, None) => true,
        _ => false,
    }
}

/// Fills the small gaps between discs with the colours around them.
fn close_gaps(tops: &mut [[Option<Top>; RAYS]], raster: &Raster) {
    /// Half the width of the widest gap that is closed.
    const REACH_M: f32 = 0.03;
    // Rays of a pixel that hit nothing take the surface that another ray of the pixel hits.
    for samples in tops.iter_mut() {
        if let Some(first) = samples.iter().flatten().next().copied() {
            for sample in samples {
                sample.get_or_insert(first);
            }
        }
    }
    let reach = (REACH_M / raster.pixel_m).round().max(1.0) as usize;
    let empty: Vec<bool> = tops.iter().map(|samples| samples[0].is_none()).collect();
    for (i, around) in surrounded(raster.width as usize, &|i| empty[i], empty.len(), reach) {
        let found: Vec<Top> = around.iter().filter_map(|j| tops[*j][0]).collect();
        let count = found.len().max(1) as f32;
        let color = found.iter().map(|top| top.color).sum::<Vec3>() / count;
        let height_m = found.iter().map(|top| top.height_m).sum::<f32>() / count;
        tops[i] = [Some(Top { color, height_m }); RAYS];
    }
}

/// Marks pixels at which the cut goes through something solid: a closed surface is seen from its back in every
/// direction. `bare` marks pixels with nothing below; the inside of a cloud's closed surface is bare.
fn solid(geometry: &Geometry, scene: &RayScene, raster: &Raster, cut_m: f32, bare: &[bool]) -> Vec<bool> {
    /// Largest size for which a cloud counts as closed: pillars can be filmed from all around, houses not.
    const WIDEST_OF_DISCS_M: f32 = 0.8;
    // Rays slip between discs, so that rays at several heights vote.
    let (widest, heights, least): (f32, &[f32], usize) = match geometry {
        Geometry::Mesh(_) => (f32::INFINITY, &[1.0], 4),
        Geometry::Discs(_) => (WIDEST_OF_DISCS_M, &[1.0, 0.9, 0.8, 0.7, 0.6], 12),
    };
    let is_back = |from: Vec3, direction: Vec3| {
        let normal = first_normal(geometry, scene, from, direction, widest);
        normal.is_some_and(|normal| normal.dot(direction) > 0.0)
    };
    let is_mesh = matches!(geometry, Geometry::Mesh(_));
    let solid: Vec<bool> = raster
        .pixels()
        .zip(bare)
        .map(|((column, row), bare)| {
            if !is_mesh && !bare {
                return false;
            }
            let place = raster.place(column, row);
            let backs = |height: &f32| {
                let from = place.extend(cut_m * height);
                [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y].iter().filter(|d| is_back(from, **d)).count()
            };
            let mut missing = least;
            // Most pixels are decided by the first heights.
            for (i, height) in heights.iter().enumerate() {
                missing = missing.saturating_sub(backs(height));
                if missing == 0 || missing > 4 * (heights.len() - 1 - i) {
                    break;
                }
            }
            missing == 0
        })
        .collect();
    // Where most of the floor seems solid the mesh is wound the other way round, and nothing is known about insides.
    let count = solid.iter().filter(|s| **s).count();
    if 4 * count > solid.len() { vec![false; solid.len()] } else { solid }
}

/// Darkness of each pixel by the walls in it, 0 to 1: surfaces that block the way to the next pixel, high above the
/// floor.
fn walls(scene: &RayScene, raster: &Raster, cut_m: f32) -> Vec<f32> {
    let [width, height] = [raster.width as usize, raster.height as usize];
    let mut blocked = vec![0.0_f32; width * height];
    for share in WALL_HEIGHTS {
        let at = |u: f32, v: f32| raster.place(u, v).extend(cut_m * share);
        let row = |v: usize| {
            blocked_pixels(width, |from, to| scene.is_blocked(at(from, v as f32), at(to, v as f32)))
        };
        let column = |u: usize| {
            blocked_pixels(height, |from, to| scene.is_blocked(at(u as f32, from), at(u as f32, to)))
        };
        let rows: Vec<Vec<bool>> = (0..height).into_par_iter().map(row).collect();
        let columns: Vec<Vec<bool>> = (0..width).into_par_iter().map(column).collect();
        for (i, blocked) in blocked.iter_mut().enumerate() {
            let (u, v) = (i % width, i / width);
            if rows[v][u] || columns[u][v] {
                *blocked += 1.0;
            }
        }
    }
    let blocked: Vec<f32> = blocked.into_iter().map(|heights| heights / WALL_HEIGHTS.len() as f32).collect();
    // A stroke around the trace, softer at its corners.
    let strongest = |column: i64, row: i64| {
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        around
            .filter_map(|(dx, dy)| {
                let weight = if dx == 0 || dy == 0 { 0.95 } else { 0.5 };
                Some(weight * blocked[raster.index(column + dx, row + dy)?])
            })
            .fold(0.0, f32::max)
    };
    raster.pixels().map(|(column, row)| strongest(column as i64, row as i64)).collect()
}

/// Tells of each of `count` pixels in a line whether a segment along the line, from a little before the pixel to a little behind
/// it, is blocked. A stretch of pixels is halved until it is not blocked as a whole: of a line through a room few are tested.
///
/// `is_blocked` tells it of a segment from one place along the line to another, in pixels.
fn blocked_pixels(count: usize, is_blocked: impl Fn(f32, f32) -> bool) -> Vec<bool> {
    /// Reach of the segments, a little more than a pixel: hits at their very ends do not count as blocked.
    const REACH: f32 = 0.75;
    let mut blocked = vec![false; count];
    let mut stretches = vec![(0, count)];
    while let Some((first, end)) = stretches.pop() {
        if first == end || !is_blocked(first as f32 - REACH, (end - 1) as f32 + REACH) {
            continue;
        }
        let middle = usize::midpoint(first, end);
        if middle == first {
            blocked[first] = true;
        } else {
            stretches.extend([(first, middle), (middle, end)]);
        }
    }
    blocked
}

/// Soft light over the height field: the darker the higher the smoothed surroundings rise above a point.
fn corner_light(mut heights: Vec<f32>, raster: &Raster) -> Vec<f32> {
    /// Reach of the shade; three box filters of that half width approximate a Gaussian.
    const REACH_M: f32 = 0.07;
    /// Height above which things do not shade more.
    const HIGHEST_M: f32 = 1.0;
    const STRENGTH: f32 = 0.8;
    for h in &mut heights {
        *h = h.clamp(0.0, HIGHEST_M);
    }
    let (width, height) = (raster.width as usize, raster.height as usize);
    let reach = (REACH_M / raster.pixel_m).round().max(1.0) as usize;
    let mut smooth = heights.clone();
    for _ in 0..3 {
        smooth.par_chunks_exact_mut(width).for_each(|row| box_filter(row, reach));
        let mut columns = transposed(&smooth, width, height);
        columns.par_chunks_exact_mut(height).for_each(|column| box_filter(column, reach));
        smooth = transposed(&columns, height, width);
    }
    let rise = smooth.iter().zip(&heights).map(|(around, here)| (around - here).max(0.0) / HIGHEST_M);
    rise.map(|rise| 1.0 - STRENGTH * rise).collect()
}

/// Mean over `reach` neighbours on either side; the rim's value is repeated beyond it.
fn box_filter(line: &mut [f32], reach: usize) {
    let source = line.to_vec();
    let last = source.len() - 1;
    let at = |i: isize| source[i.clamp(0, last as isize) as usize];
    let reach = reach as isize;
    let mut sum: f32 = (-reach..=reach).map(at).sum();
    for (i, value) in line.iter_mut().enumerate() {
        *value = sum / (2 * reach + 1) as f32;
        sum += at(i as isize + reach + 1) - at(i as isize - reach);
    }
}

fn transposed(values: &[f32], width: usize, height: usize) -> Vec<f32> {
    (0..width * height).map(|i| values[i % height * width + i / height]).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::geometry::Disc;

    /// A floor that ends at 0.9 m, whose colour changes over a metre, and a round table on it.
    fn room(place: Vec2) -> Option<Top> {
        let light = Vec3::splat(90.0 + 80.0 * place.x);
        let (is_table, is_floor) = (place.distance(Vec2::splat(0.5)) < 0.23, place.y < 0.9);
        let table = Top { color: Vec3::new(40.0, 120.0, 200.0), height_m: 0.7 };
        is_table.then_some(table).or_else(|| is_floor.then_some(Top { color: light, height_m: 0.0 }))
    }

    /// Number of a pixel's rays that hit something, their mean colour and height.
    fn seen(tops: &[Option<Top>; RAYS]) -> (usize, Vec3, f32) {
        let hit: Vec<&Top> = tops.iter().flatten().collect();
        let share = 1.0 / hit.len().max(1) as f32;
        let color = hit.iter().map(|top| top.color * share).sum();
        (hit.len(), color, hit.iter().map(|top| top.height_m * share).sum())
    }

    #[test]
    fn few_rays_show_what_all_rays_do() {
        let raster = Raster { width: 100, height: 110, origin: Vec2::new(0.0, 1.05), pixel_m: 0.01 };
        let rays = AtomicUsize::new(0);
        let counted = |place: Vec2| {
            rays.fetch_add(1, Ordering::Relaxed);
            room(place)
        };
        let few = tops(&raster, &counted);
        // All rays of each pixel, by their places alone.
        let all = raster.pixels().map(|(column, row)| {
            [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)]
                .map(|(right, down)| room(Vec2::new(0.01 * (column + right), 1.05 - 0.01 * (row + down))))
        });
        let all: Vec<[Option<Top>; RAYS]> = all.collect();
        for (i, (few, all)) in few.iter().zip(&all).enumerate() {
            let ((hits, color, height_m), (all_hits, true_color, true_height_m)) = (seen(few), seen(all));
            let off = (color - true_color).abs().max_element();
            let is_same = hits == all_hits && off < 1.0 && (height_m - true_height_m).abs() < 1e-6;
            assert!(is_same, "pixel {i}: {few:?} {all:?}");
        }
        assert!(2 * rays.into_inner() < RAYS * few.len());
    }

    /// Discs on the four sides of a square shaft from the floor to 2 m, seen from outside.
    fn shaft(side_m: f32) -> Geometry {
        let steps = (side_m / 0.04) as i32;
        let mut discs = Vec::new();
        for (normal, along) in
            [(Vec3::X, Vec3::Y), (Vec3::NEG_X, Vec3::Y), (Vec3::Y, Vec3::X), (Vec3::NEG_Y, Vec3::X)]
        {
            for (step, level) in (0..=steps).flat_map(|step| (0..=50).map(move |level| (step, level))) {
                let aside = side_m * (step as f32 / steps as f32 - 0.5);
                let center = 0.5 * side_m * normal + aside * along + 0.04 * level as f32 * Vec3::Z;
                discs.push(Disc {
                    center,
                    normal,
                    radius: 0.04,
                    color: [120; 3],
                    filled: false,
                    confidence: 2.0,
                });
            }
        }
        Geometry::Discs(discs)
    }

    #[test]
    fn halved_stretches_find_the_blocked_pixels_that_segments_of_a_pixel_do() {
        let raster = Raster { width: 90, height: 70, origin: Vec2::new(-1.2, 1.1), pixel_m: 0.03 };
        let scene = RayScene::new(&shaft(1.0)).unwrap();
        for (line, count) in [(0, 0), (33, 90), (36, 90), (66, 90)] {
            let is_blocked = |from: f32, to: f32| {
                let at = |u: f32| raster.place(u, line as f32).extend(1.3);
                scene.is_blocked(at(from), at(to))
            };
            let alone: Vec<bool> = (0..count).map(|u| is_blocked(u as f32 - 0.75, u as f32 + 0.75)).collect();
            assert_eq!(blocked_pixels(count, is_blocked), alone);
            assert!(line == 0 || line == 66 || alone.iter().filter(|blocked| **blocked).count() >= 2);
        }
    }

    #[test]
    fn a_pillar_of_discs_is_solid_and_a_house_is_not() {
        let raster = Raster { width: 100, height: 100, origin: Vec2::new(-2.5, 2.5), pixel_m: 0.05 };
        let bare = vec![true; 100 * 100];
        for (side_m, is_solid) in [(0.3, true), (0.6, true), (1.8, false)] {
            let geometry = shaft(side_m);
            let scene = RayScene::new(&geometry).unwrap();
            let solid = solid(&geometry, &scene, &raster, 1.9, &bare);
            assert_eq!((solid[50 * 100 + 50], solid[0]), (is_solid, false), "{side_m} m");
        }
    }
}
