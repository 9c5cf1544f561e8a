//! Pictures that show at a glance whether a build worked: the floor plan, and for each camera its reference image, its
//! depth in the finished room and the room rendered from its pose, side by side, above the build's verdict.

mod verdict_band;

use std::path::Path;

use calib::undistort::UndistortMap;
use image::imageops::{self, FilterType};
use image::{Rgb, RgbImage};
use scenes::depth::{self, DepthMap};
use scenes::plan::{FloorPlan, PlanOptions};
use scenes::raycast::RayScene;
use scenes::room::Room;
use scenes::view::{View, ViewOptions};
use shell::canvas::{Canvas, Color};

use crate::Result;
use crate::verdict::Verdict;
use verdict_band::VerdictBand;

/// Space between the pictures, pixels.
const GAP: u32 = 6;

/// Name of the floor plan; it is not in `preview/`, where a camera may have this name.
const PLAN: &str = "plan.png";

/// Writes `plan.png` and `preview/NAME.png` for each camera, in parallel; at half their size if `small`.
pub(super) fn write(
    dir: &Path,
    room: &Room,
    references: &[(&str, &RgbImage)],
    small: bool,
    verdict: &Verdict,
) -> Result<()> {
    let views = || write_views(dir, room, references, small, verdict);
    let (plan, views) = rayon::join(|| write_plan(dir, small), views);
    plan.and(views)
}

/// Draws the plan of the room as read from disk, through its cache: the first `tracker run` in it need not draw it
/// again.
fn write_plan(dir: &Path, small: bool) -> Result<()> {
    let mut options = PlanOptions { room_dir: Some(dir.to_owned()), ..PlanOptions::default() };
    if small {
        options.longest_side_px /= 2;
    }
    Ok(calib::picture::write(&dir.join(PLAN), &FloorPlan::new(&Room::read(dir)?, &options)?.into_image())?)
}

fn write_views(
    dir: &Path,
    room: &Room,
    references: &[(&str, &RgbImage)],
    small: bool,
    verdict: &Verdict,
) -> Result<()> {
    let Some(geometry) = &room.geometry else { return Ok(()) };
    let scene = RayScene::new(geometry)?;
    for (camera, (name, reference)) in room.cameras.iter().zip(references) {
        let mut pinhole = camera.camera.clone();
        pinhole.intrinsics = pinhole.intrinsics.pinhole();
        let mut processed = UndistortMap::new(&camera.camera.intrinsics).image(reference);
        if small {
            let (width, height) = (processed.width().div_ceil(2), processed.height().div_ceil(2));
            processed = imageops::resize(&processed, width, height, FilterType::Triangle);
            pinhole.intrinsics = pinhole.intrinsics.resized(width, height);
        }
        let depth = colored(&depth::render(&scene, &pinhole));
        let options = ViewOptions { samples: 1, shading: 0.0, brighten: false, ..ViewOptions::default() };
        let drawn = View::new(geometry, &scene, &pinhole, &options).image();
        let (width, height) = processed.dimensions();
        let band = VerdictBand::new(verdict, 3 * width + 2 * GAP);
        let mut canvas = Canvas::new(3 * width + 2 * GAP, height + band.height(), Color::PAPER);
        for (i, picture) in [&processed, &depth, &drawn].into_iter().enumerate() {
            canvas.blit(picture, i64::from((width + GAP) * i as u32), 0);
        }
        band.draw(&mut canvas, height);
        calib::picture::write(&dir.join("preview").join(format!("{name}.png")), &canvas.into_image())?;
    }
    Ok(())
}

/// Depth as colours: near is warm, far is dark, pixels without depth are black; equal steps of inverse depth, like
/// stereo's resolution.
fn colored(map: &DepthMap) -> RgbImage {
    let mut inverse: Vec<f32> = map.z_m.iter().filter(|z| **z > 0.0).map(|z| 1.0 / z).collect();
    inverse.sort_by(f32::total_cmp);
    let at = |share: f32| inverse.get((inverse.len() as f32 * share) as usize).copied().unwrap_or(1.0);
    let (far, near) = (at(0.01), at(0.99));
    RgbImage::from_fn(map.width, map.height, |u, v| {
        let z = map.at(u, v);
        if z > 0.0 { warm_to_cool((1.0 / z - far) / (near - far).max(1e-9)) } else { Rgb([0, 0, 0]) }
    })
}

/// Colour of an inverse depth from 0 (far: almost black) over blue and green to 1 (near: yellow, red and dark red).
/// Turbo (A. Mikhailov, "Turbo, an improved rainbow colormap for visualization", 2019) by its polynomial approximation
/// of fifth degree.
fn warm_to_cool(t: f32) -> Rgb<u8> {
    let t = t.clamp(0.0, 1.0);
    let polynomial = |c: [f32; 6]| c.iter().rev().fold(0.0, |sum, k| sum * t + k);
    let red = polynomial([0.135_721_4, 4.615_392_6, -42.660_324, 132.131_08, -152.942_4, 59.286_38]);
    let green = polynomial([0.091_402_61, 2.194_188_4, 4.842_966_6, -14.185_033, 4.277_298_6, 2.829_566]);
    let blue = polynomial([0.106_673_3, 12.641_946, -60.582_05, 110.362_77, -89.903_11, 27.348_25]);
    Rgb([red, green, blue].map(|c| (255.0 * c.clamp(0.0, 1.0)) as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_red_far_is_almost_black_and_nothing_is_black() {
        let map = DepthMap { width: 3, height: 1, z_m: vec![1.0, 8.0, 0.0] };
        let picture = colored(&map);
        let [near, far, nothing] = [0, 1, 2].map(|u| picture.get_pixel(u, 0).0);
        assert!(near[0] > 3 * near[1].max(near[2]) && near[0] > 100, "{near:?}");
        assert_eq!((far, nothing), ([34, 23, 27], [0, 0, 0]));
    }

    #[test]
    fn colours_run_from_blue_over_green_to_yellow() {
        let [blue, green, yellow] = [0.2, 0.5, 0.7].map(|t| warm_to_cool(t).0);
        assert!(blue[2] > blue[1] && blue[1] > blue[0], "{blue:?}");
        assert!(green[1] > green[0] && green[1] > 2 * green[2], "{green:?}");
        assert!(yellow[0].min(yellow[1]) > 2 * yellow[2], "{yellow:?}");
    }
}
