//! Right panel: the room's geometry, the people in it, and the outline of the observed foreground.

use image::{Rgb, RgbImage};
use nalgebra::Point3;
use shell::canvas::{Canvas, Color, Stroke};

use super::clay;
use super::layers::SurfaceMap;
use super::lens::PanelLens;
use crate::PersonEstimate;
use crate::prepared_room::PreparedCamera;
use crate::silhouette::Body;

/// Colour of the outline of the observed foreground.
const SEEN: Rgb<u8> = Rgb([255, 255, 255]);
/// Reach of the floor's grid from the point below the camera, metres, in a room without geometry.
const GRID_REACH_M: i32 = 15;

/// The empty room, which is the same in every frame: in clay or, without geometry, as a floor of one-metre squares that
/// shows the camera's pose.
pub(super) fn empty_room(camera: &PreparedCamera, lens: &PanelLens) -> RgbImage {
    let room = lens.picture(&clay::render(camera), clay::VOID);
    if camera.static_z_m.iter().any(|z| z.is_finite() && *z > 0.0) {
        return room;
    }
    let mut canvas = Canvas::from_image(&room);
    let below = camera.pinhole.center();
    let (x0, y0) = (below.x.round() as i32, below.y.round() as i32);
    let stroke = Stroke::solid(Color::WHITE.alpha(0.16), 1.0);
    let project =
        |x: i32, y: i32| camera.real.project(&Point3::new(f64::from(x0 + x), f64::from(y0 + y), 0.0));
    for i in -GRID_REACH_M..=GRID_REACH_M {
        for j in -GRID_REACH_M..GRID_REACH_M {
            for (from, to) in [((i, j), (i, j + 1)), ((j, i), (j + 1, i))] {
                if let Some((a, b)) = project(from.0, from.1).zip(project(to.0, to.1)) {
                    canvas.stroke_polyline(&[a, b], &stroke);
                }
            }
        }
    }
    canvas.into_image()
}

/// The room with the people in it, and the rim of the foreground.
pub(super) fn picture(
    empty_room: &RgbImage,
    lens: &PanelLens,
    layers: &SurfaceMap,
    people: &[(&PersonEstimate, Body)],
    mask: Option<&[bool]>,
) -> RgbImage {
    let mut panel = empty_room.clone();
    let colors: Vec<Color> = people.iter().map(|(person, _)| Color::of_id(person.id.0)).collect();
    lens.for_each_pixel(&mut panel, &layers.surfaces, |pixel, surface| {
        if let Some(color) = surface.owner().and_then(|i| colors.get(i)) {
            let lit = 0.35 + 0.65 * surface.facing;
            *pixel = Rgb([color.r, color.g, color.b].map(|c| (f32::from(c) * lit) as u8));
        }
    });
    if let Some(mask) = mask.filter(|mask| mask.len() == layers.surfaces.len()) {
        lens.for_each_pixel(&mut panel, &rim(mask, lens.pinhole_width as usize), |pixel, is_rim| {
            if *is_rim {
                *pixel = SEEN;
            }
        });
    }
    panel
}

/// Pixels just outside the set ones in a mask of this width, row by row.
fn rim(set: &[bool], width: usize) -> Vec<bool> {
    let height = set.len() / width.max(1);
    let mut rim = vec![false; set.len()];
    for v in 1..height.saturating_sub(1) {
        if set[(v - 1) * width..(v + 2) * width].iter().all(|set| !set) {
            continue;
        }
        for at in v * width + 1..(v + 1) * width - 1 {
            let is_beside = [at - 1, at + 1, at - width, at + width].iter().any(|beside| set[*beside]);
            rim[at] = !set[at] && is_beside;
        }
    }
    rim
}
