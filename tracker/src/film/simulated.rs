//! The right panel: the room as its geometry says, the people in it, and the foreground that was really seen.

use image::{GrayImage, RgbImage};
use scenes::canvas::Color;

use super::clay;
use super::layers::Layers;
use super::lens::Lens;
use crate::PersonEstimate;
use crate::silhouette::Body;
use crate::stage::StageCamera;

/// Colour of the seen foreground's outline.
const SEEN: [u8; 3] = [255, 255, 255];

/// The picture under the outlines. `room` is the clay room of [`clay::render`].
pub(super) fn picture(
    camera: &StageCamera,
    lens: &Lens,
    room: &[[u8; 3]],
    layers: &Layers,
    people: &[(&PersonEstimate, Body)],
    mask: Option<&GrayImage>,
) -> RgbImage {
    let mut pixels = room.to_vec();
    let colors: Vec<Color> = people.iter().map(|(person, _)| Color::of_id(person.id.0)).collect();
    for ((pixel, owner), facing) in pixels.iter_mut().zip(&layers.owner).zip(&layers.facing) {
        if let Some(color) = usize::from(*owner).checked_sub(1).and_then(|i| colors.get(i)) {
            let lit = 0.35 + 0.65 * facing;
            *pixel = [color.r, color.g, color.b].map(|c| (f32::from(c) * lit) as u8);
        }
    }
    if let Some(mask) = mask.filter(|m| m.dimensions() == (camera.width(), camera.height())) {
        outline(mask, &mut pixels);
    }
    lens.picture(&pixels, clay::VOID)
}

/// Draws the outer rim of what is set in a mask.
fn outline(mask: &GrayImage, pixels: &mut [[u8; 3]]) {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let is_set = |u: usize, v: usize| mask.as_raw()[v * width + u] != 0;
    for v in 1..height.saturating_sub(1) {
        if mask.as_raw()[(v - 1) * width..(v + 2) * width].iter().all(|m| *m == 0) {
            continue;
        }
        for u in 1..width.saturating_sub(1) {
            let has_set_neighbour =
                is_set(u - 1, v) || is_set(u + 1, v) || is_set(u, v - 1) || is_set(u, v + 1);
            if !is_set(u, v) && has_set_neighbour {
                pixels[v * width + u] = SEEN;
            }
        }
    }
}
