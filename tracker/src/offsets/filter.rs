//! Matched filter: finds the cells of the floor where a mask shows a person of average build.
//!
//! The response of a cell is the share of foreground in the part of the image that such a person would fill, less the
//! share in the part that the same person would fill half a metre to either side, nearer or farther, but not at the
//! cell itself. So the response is localised in bearing by the person's sides and in range by feet and head. Both
//! shares count visible pixels alone: hidden pixels carry no information. Responses are squared, which leaves little
//! of the flanks.

use nalgebra::{Point2, Vector2};

use crate::likelihood::pack;
use crate::observation::Mask;
use crate::prepared_room::{PreparedRoom, resolution};
use crate::silhouette::{Body, Shape, Silhouette, View};
use crate::{Error, Result};

/// Side of a cell, metres: half of a person's width …
const CELL_M: f64 = 0.25;
/// … and more where the floor would have more cells than this.
const MOST_CELLS: f64 = 2500.0;
/// Distance of the surrounding cells that a cell is compared with, metres: about a person's width, on the flank of
/// the response.
const SURROUND_M: f64 = 0.6;
/// Least share of a person's pixels that must be visible for a camera to see the cell.
const LEAST_VISIBLE: f64 = 0.4;
/// Least share of foreground in a person's pixels; below it the response is 0.
const LEAST_FILLED: f32 = 0.2;
/// Factor by which blocks of the masks are finer than the sampler's: half of a block at the feet is 10 cm in range,
/// which is 0.1 s of a walk towards a camera.
const FINER: u8 = 2;
/// Quantized value of a response of 1.
const FULL: f32 = 127.0;

/// The matched filters of all cameras, on the cells of the floor that at least two of them see.
#[derive(Debug, Clone)]
pub(super) struct PersonFilters {
    cameras: Vec<CameraFilter>,
}

#[derive(Debug, Clone)]
struct CameraFilter {
    name: String,
    size: (u32, u32),
    view: View,
    /// Templates of each cell; `None` where this camera does not see it.
    cells: Vec<Option<Templates>>,
}

/// Pixels of a mask that are counted for one cell.
#[derive(Debug, Clone)]
struct Templates {
    person: Template,
    surround: Template,
}

/// Pixels of a packed mask.
#[derive(Debug, Clone)]
struct Template {
    /// Words of the mask that hold any of the pixels: index of the word, and its pixels.
    words: Vec<(u32, u64)>,
    pixels: u32,
}

impl PersonFilters {
    pub(super) fn new(room: &PreparedRoom) -> Self {
        let views = room.cameras.iter().map(|camera| {
            let block = (resolution::block(camera, &Body::ADULT, &room.floor) / FINER).max(1);
            let size = (camera.width(), camera.height());
            CameraFilter {
                name: camera.name.clone(),
                size,
                view: View::coarse(camera, block),
                cells: Vec::new(),
            }
        });
        let mut cameras: Vec<CameraFilter> = views.collect();
        for place in places(room) {
            let body = Body { x_m: place.x, y_m: place.y, ..Body::ADULT };
            let seen: Vec<_> = cameras.iter().map(|camera| Templates::of(&camera.view, &body)).collect();
            if seen.iter().flatten().count() >= 2 {
                cameras.iter_mut().zip(seen).for_each(|(camera, seen)| camera.cells.push(seen));
            }
        }
        Self { cameras }
    }

    /// Whether two cameras see a common cell of the floor.
    pub(super) fn share_floor(&self, a: usize, b: usize) -> bool {
        let cells = self.cameras[a].cells.iter().zip(&self.cameras[b].cells);
        cells.into_iter().any(|(a, b)| a.is_some() && b.is_some())
    }

    /// # Errors
    /// [`Error::FrameSize`] when the mask has not the size of the camera's images.
    pub(super) fn check(&self, camera: usize, frame: u32, mask: &Mask) -> Result<()> {
        let CameraFilter { name, size: (width, height), .. } = &self.cameras[camera];
        let (found_width, found_height) = mask.dimensions();
        if (found_width, found_height) == (*width, *height) {
            return Ok(());
        }
        let camera = name.clone();
        Err(Error::FrameSize { camera, frame, found_width, found_height, width: *width, height: *height })
    }

    /// Responses of a camera's cells to a mask, 0 to 1.
    pub(super) fn responses(&self, camera: usize, mask: &Mask) -> Vec<f32> {
        let camera = &self.cameras[camera];
        let packed = pack(mask, &camera.view);
        let response = |cell: &Option<Templates>| cell.as_ref().map_or(0.0, |cell| cell.response(&packed));
        camera.cells.iter().map(response).collect()
    }

    /// Norms of `camera`'s quantized responses, one for each camera, over the cells that both see; 0 for `camera`
    /// itself.
    pub(super) fn norms(&self, camera: usize, responses: &[i8]) -> Vec<f32> {
        let norm = |other: &CameraFilter| {
            let shared = responses.iter().zip(&other.cells).filter(|(_, seen)| seen.is_some());
            let squares: i32 = shared.map(|(response, _)| i32::from(*response).pow(2)).sum();
            (squares as f32).sqrt() / FULL
        };
        self.cameras
            .iter()
            .enumerate()
            .map(|(i, other)| if i == camera { 0.0 } else { norm(other) })
            .collect()
    }
}

/// Response, or its difference from a mean, quantized to one byte.
pub(super) fn quantized(response: f32) -> i8 {
    (FULL * response).round() as i8
}

/// Scalar product of two cameras' [`quantized`] responses; cells that one of them does not see are 0.
pub(super) fn product(a: &[i8], b: &[i8]) -> f32 {
    let sum: i32 = a.iter().zip(b).map(|(a, b)| i32::from(*a) * i32::from(*b)).sum();
    sum as f32 / (FULL * FULL)
}

/// Centres of the floor's cells, metres.
fn places(room: &PreparedRoom) -> impl Iterator<Item = Point2<f64>> {
    let (low, high) = room.floor.bounds();
    let size = high - low;
    let cell_m = (size.x * size.y / MOST_CELLS).sqrt().max(CELL_M);
    let (columns, rows) = ((size.x / cell_m).ceil() as usize, (size.y / cell_m).ceil() as usize);
    (0..columns * rows)
        .map(move |i| low + Vector2::new((i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5) * cell_m)
        .filter(|place| room.floor.is_standable(place.x, place.y))
}

impl Templates {
    /// Pixels that a body and its surround fill in the image; `None` where too little of the body is visible.
    fn of(view: &View, body: &Body) -> Option<Self> {
        let person = Silhouette::new(view, &Shape::CORE.of(body));
        if person.visible_px == 0 || f64::from(person.visible_px) < LEAST_VISIBLE * f64::from(person.area_px)
        {
            return None;
        }
        let away = (Vector2::new(body.x_m, body.y_m) - view.center.coords.xy()).try_normalize(0.0)?;
        let side = Vector2::new(-away.y, away.x);
        let mut surround = Packed::new(view);
        for step in [away, -away, side, -side].map(|direction| direction * SURROUND_M) {
            let moved = Body { x_m: body.x_m + step.x, y_m: body.y_m + step.y, ..*body };
            surround.insert(&Silhouette::new(view, &Shape::LIMBS.of(&moved)));
        }
        surround.remove(&Silhouette::new(view, &Shape::LIMBS.of(body)));
        let surround = surround.template();
        let mut own = Packed::new(view);
        own.insert(&person);
        (surround.pixels > 0).then(|| Self { person: own.template(), surround })
    }

    /// Response of the cell to a packed mask, 0 to 1.
    fn response(&self, mask: &[u64]) -> f32 {
        let filled = self.person.share(mask);
        if filled < LEAST_FILLED {
            return 0.0;
        }
        (filled - self.surround.share(mask)).max(0.0).powi(2)
    }
}

impl Template {
    /// Share of the template's pixels that are foreground, 0 to 1.
    fn share(&self, mask: &[u64]) -> f32 {
        let found: u32 = self.words.iter().map(|(at, bits)| (mask[*at as usize] & bits).count_ones()).sum();
        found as f32 / self.pixels as f32
    }
}

/// Packed image into which silhouettes are drawn.
struct Packed {
    words_per_row: usize,
    words: Vec<u64>,
}

impl Packed {
    fn new(view: &View) -> Self {
        let words_per_row = view.words_per_row;
        Self { words_per_row, words: vec![0; words_per_row * view.height as usize] }
    }

    fn insert(&mut self, silhouette: &Silhouette) {
        self.change(silhouette, |word, bits| *word |= bits);
    }

    fn remove(&mut self, silhouette: &Silhouette) {
        self.change(silhouette, |word, bits| *word &= !bits);
    }

    fn change(&mut self, silhouette: &Silhouette, change: impl Fn(&mut u64, u64)) {
        for (row, bits) in silhouette.rows() {
            let start = row * self.words_per_row + silhouette.word_range().start;
            for (word, bits) in self.words[start..].iter_mut().zip(bits) {
                change(word, *bits);
            }
        }
    }

    fn template(&self) -> Template {
        let words = self.words.iter().enumerate().filter(|(_, word)| **word != 0);
        let words: Vec<(u32, u64)> = words.map(|(at, word)| (at as u32, *word)).collect();
        Template { pixels: words.iter().map(|(_, word)| word.count_ones()).sum(), words }
    }
}
