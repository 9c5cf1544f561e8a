//! Growth of planes into pixels that stereo measured a little before or behind them, wherever the key frames' colours
//! fit the plane better than the measured depth: soft shadows and shading match at any depth, so that a plain wall
//! beside a box leans towards the box. The box itself stops the plane: its own depth explains its outline better.

use rayon::prelude::*;

use super::photo::PhotoConsistency;
use super::speckles::neighbours;
use super::{ImagePlane, PlaneOptions};
use crate::surface::Surface;

/// Extends `labels` from pixel to pixel (region growing, first come first served): all pixels beside the present border are tried
/// at once, and those that fit are the next border.
pub(super) fn grow(
    surface: &Surface,
    planes: &[ImagePlane],
    labels: &mut [Option<u16>],
    photo: &PhotoConsistency<'_>,
    step: f32,
    options: &PlaneOptions,
) {
    let (width, height) = (surface.width(), surface.height());
    let fits = |pixel: usize, plane: u16| {
        let (x, y) = (pixel % width, pixel / width);
        let (Some(own), Some(plane)) = (surface.support(pixel), planes.get(usize::from(plane))) else {
            return false;
        };
        let grown = plane.support(x as f32, y as f32);
        if (grown.w - own.w).abs() > options.loose_tolerance_px * step {
            return false;
        }
        let costs = photo.cost(x, y, &grown).zip(photo.cost(x, y, &own));
        costs.is_some_and(|(grown, own)| grown < own)
    };
    let mut border: Vec<usize> = (0..labels.len()).filter(|i| labels[*i].is_some()).collect();
    // The plane that was offered last to each pixel: once is enough.
    let mut offered: Vec<Option<u16>> = vec![None; labels.len()];
    while !border.is_empty() {
        let mut offers: Vec<(usize, u16)> = Vec::new();
        for i in border.drain(..) {
            let Some(plane) = labels[i] else { continue };
            for j in neighbours(i, width, height) {
                if labels[j].is_none() && offered[j] != Some(plane) {
                    offered[j] = Some(plane);
                    offers.push((j, plane));
                }
            }
        }
        let fitting: Vec<bool> = offers.par_iter().map(|(pixel, plane)| fits(*pixel, *plane)).collect();
        for ((pixel, plane), fits) in offers.into_iter().zip(fitting) {
            if fits && labels[pixel].is_none() {
                labels[pixel] = Some(plane);
                border.push(pixel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::{DenseView, Support, SupportMap};
    use crate::planes::witness::Witnesses;
    use calib::Intrinsics;
    use glam::Vec3;
    use image::{Rgb, RgbImage};
    use nalgebra::Isometry3;

    const SIZE: (usize, usize) = (160, 120);
    const WALL_M: f32 = 4.0;
    /// The farthest view's baseline.
    const BASELINE_M: f32 = 0.6;
    /// Disparity of a board before the wall, pixels in the farthest view.
    const BOARD_PX: f32 = 2.0;

    fn lens() -> Intrinsics {
        Intrinsics::from_horizontal_fov(SIZE.0 as u32, SIZE.1 as u32, 70.0)
    }

    fn step() -> f32 {
        1.0 / (lens().fx as f32 * BASELINE_M)
    }

    /// Surface hit by a ray from `eye` along (x, y, 1): whether it is the board, its inverse depth and its brightness.
    fn shown(eye: Vec3, x: f32, y: f32) -> (bool, f32, u8) {
        let wave = |p: Vec3, k: f32| (k * p.x + 1.0).sin() + (0.7 * k * p.y).cos() + (k * (p.x + p.y)).sin();
        let board = 1.0 / WALL_M + BOARD_PX * step();
        let p = eye + Vec3::new(x, y, 1.0) / board;
        if p.x.abs() < 0.9 && p.y.abs() < 0.6 {
            return (true, board, (150.0 + 30.0 * wave(p, 17.0)) as u8);
        }
        let p = eye + Vec3::new(x, y, 1.0) * WALL_M;
        (false, 1.0 / WALL_M, (90.0 + 12.0 * wave(p, 9.0)) as u8)
    }

    fn each_pixel(eye: Vec3) -> impl Iterator<Item = (bool, f32, u8)> {
        let k = lens();
        (0..SIZE.0 * SIZE.1).map(move |i| {
            let (u, v) = ((i % SIZE.0) as f32, (i / SIZE.0) as f32);
            shown(eye, (u - k.cx as f32) / k.fx as f32, (v - k.cy as f32) / k.fy as f32)
        })
    }

    fn view_from(eye: Vec3) -> DenseView {
        let mut picture = RgbImage::new(SIZE.0 as u32, SIZE.1 as u32);
        let mut supports = Vec::new();
        for (pixel, (_, w, brightness)) in picture.pixels_mut().zip(each_pixel(eye)) {
            *pixel = Rgb([brightness; 3]);
            supports.push(Support { w, gu: 0.0, gv: 0.0 });
        }
        let costs = vec![0.1; supports.len()];
        DenseView {
            picture,
            intrinsics: lens(),
            camera_from_reference: Isometry3::translation(
                f64::from(-eye.x),
                f64::from(-eye.y),
                f64::from(-eye.z),
            ),
            filmed: vec![true; supports.len()],
            agreeing: vec![4; supports.len()],
            map: SupportMap { width: SIZE.0, height: SIZE.1, supports, costs },
            step: step(),
        }
    }

    fn film() -> (DenseView, Vec<DenseView>) {
        let eyes = [(-BASELINE_M, 0.0), (BASELINE_M, 0.1), (0.1, 0.4), (-0.1, -0.4)];
        let others = eyes.map(|(x, y)| view_from(Vec3::new(x, y, 0.0)));
        (view_from(Vec3::ZERO), others.to_vec())
    }

    #[test]
    fn the_wall_takes_back_a_boards_rim_and_not_the_board() {
        const RIM_PX: isize = 6;
        let (mut view, others) = film();
        let on_board: Vec<bool> = each_pixel(Vec3::ZERO).map(|shown| shown.0).collect();
        let reached = |i: usize| {
            let (x, y) = ((i % SIZE.0) as isize, (i / SIZE.0) as isize);
            let near = |x: isize, y: isize| {
                (0..SIZE.0 as isize).contains(&x)
                    && (0..SIZE.1 as isize).contains(&y)
                    && on_board[y as usize * SIZE.0 + x as usize]
            };
            (-RIM_PX..=RIM_PX).any(|d| near(x + d, y) || near(x, y + d))
        };
        // Stereo gave the wall beside the board the board's depth.
        let rim: Vec<usize> = (0..on_board.len()).filter(|i| !on_board[*i] && reached(*i)).collect();
        for i in &rim {
            view.map.supports[*i].w = 1.0 / WALL_M + BOARD_PX * step();
        }
        let mut labels: Vec<Option<u16>> =
            (0..on_board.len()).map(|i| (!reached(i) && !on_board[i]).then_some(0)).collect();
        let surface = Surface::from_view(&view);
        let wall = ImagePlane::facing(-Vec3::Z, WALL_M, &view.pinhole(), 5000);
        let witnesses = Witnesses::new(&others);
        let photo = PhotoConsistency::new(&view, &witnesses).unwrap();
        grow(&surface, &[wall], &mut labels, &photo, step(), &PlaneOptions::default());
        let taken = rim.iter().filter(|i| labels[**i].is_some()).count();
        let lost = (0..labels.len()).filter(|i| on_board[*i] && labels[*i].is_some()).count();
        let board = on_board.iter().filter(|b| **b).count();
        assert!(board > 1500 && rim.len() > 800, "{board} {}", rim.len());
        assert!(taken > rim.len() * 9 / 10, "{taken} of {}", rim.len());
        assert!(lost < board / 20, "{lost} of {board}");

        // Pixels farther off than noise and rims belong to another surface.
        let mut labels: Vec<Option<u16>> = labels.iter().map(|label| label.filter(|_| false)).collect();
        labels[30 * SIZE.0 + 20] = Some(0);
        let options = PlaneOptions { loose_tolerance_px: 0.5 * BOARD_PX, ..PlaneOptions::default() };
        let mut off = surface.clone();
        off.depth.fill(1.0 / (1.0 / WALL_M + BOARD_PX * step()));
        grow(&off, &[wall], &mut labels, &photo, step(), &options);
        assert_eq!(labels.iter().flatten().count(), 1);
    }

    #[test]
    fn the_true_plane_looks_the_same_in_all_views() {
        let (view, others) = film();
        let witnesses = Witnesses::new(&others);
        let photo = PhotoConsistency::new(&view, &witnesses).unwrap();
        let cost = |x, y, w| photo.cost(x, y, &Support { w, gu: 0.0, gv: 0.0 });
        // The board in the middle, the wall above it.
        for (x, y, w) in [(80, 60, 1.0 / WALL_M + BOARD_PX * step()), (80, 22, 1.0 / WALL_M)] {
            let truth = cost(x, y, w).unwrap();
            assert!(truth < 2.0, "{truth}");
            for off in [-2.0, -1.0, 1.0, 2.0] {
                assert!(cost(x, y, w + off * step()).unwrap() > truth + 0.5, "{x}, {y}: {off}");
            }
        }
        assert!(cost(0, 0, 1.0 / WALL_M).is_none(), "the neighbourhood leaves the image");
        assert!(cost(80, 60, -0.1).is_none() && cost(80, 60, f32::NAN).is_none());
        let one = Witnesses::new(&others[..1]);
        let alone = PhotoConsistency::new(&view, &one).unwrap();
        assert!(alone.cost(80, 60, &view.map.supports[60 * SIZE.0 + 80]).is_none());
        assert!(PhotoConsistency::new(&view, &Witnesses::new(&[])).is_none());
    }
}
