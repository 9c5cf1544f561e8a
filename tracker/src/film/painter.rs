//! Painter of one camera's frames: both panels, side by side.

use image::{Rgb, RgbImage};
use shell::canvas::Canvas;

use super::layers::SurfaceMap;
use super::lens::PanelLens;
use super::overlay::Panel;
use super::trails::Trails;
use super::{FilmOptions, Shot, simulated};
use crate::PersonEstimate;
use crate::observation::Mask;
use crate::prepared_room::{PreparedCamera, PreparedRoom};
use crate::silhouette::{Body, View};

/// Painter of the frames of one camera, in order, because trails depend on the frames before.
#[derive(Debug, Clone)]
pub struct Painter {
    camera: PreparedCamera,
    view: View,
    index: usize,
    lens: PanelLens,
    /// The simulated panel without people.
    empty_room: RgbImage,
    trails: Trails,
}

impl Painter {
    /// Painter for the prepared room's camera of that index.
    pub fn new(room: &PreparedRoom, index: usize, options: &FilmOptions) -> Self {
        let (width, height) = options.panel_px(&room.cameras[index]);
        let camera = room.cameras[index].resized(width, height);
        let lens = PanelLens::new(&camera);
        Self {
            view: View::new(&camera),
            empty_room: simulated::empty_room(&camera, &lens),
            lens,
            trails: Trails::new(options.trail_s),
            camera,
            index,
        }
    }

    /// Width and height of a frame, pixels: two panels beside each other.
    pub fn size(&self) -> (u32, u32) {
        (2 * self.lens.width, self.lens.height)
    }

    /// Draws one frame.
    pub fn paint(&mut self, frame: u32, time_s: f64, shot: &Shot, people: &[PersonEstimate]) -> RgbImage {
        self.trails.extend(time_s, people);
        // The farthest first, so that the nearest is drawn over the others.
        let mut order: Vec<(&PersonEstimate, Body)> = people.iter().map(|p| (p, Body::from(p))).collect();
        order.sort_by(|a, b| self.depth(&b.1).total_cmp(&self.depth(&a.1)));
        let bodies: Vec<Body> = order.iter().map(|(_, body)| *body).collect();
        let layers = SurfaceMap::new(&self.view, &bodies);
        let panel = Panel {
            camera: &self.camera,
            lens: &self.lens,
            layers: &layers,
            people: &order,
            index: self.index,
        };

        let mut real = self.backdrop(shot);
        panel.tint(&mut real);
        let mut real = Canvas::from_image(&real);
        panel.trails(&mut real, &self.trails);
        panel.silhouettes(&mut real, true);
        panel.labels(&mut real);
        panel.caption(&mut real, &format!("{}  frame {frame}  {time_s:.2} s", self.camera.name));

        let mask = shot.mask.as_ref().map(|mask| self.resized(mask));
        let picture = simulated::picture(&self.empty_room, &self.lens, &layers, &order, mask.as_deref());
        let mut simulated = Canvas::from_image(&picture);
        panel.silhouettes(&mut simulated, false);
        let seen = if mask.is_some() { "; white: what was seen" } else { "" };
        panel.caption(&mut simulated, &format!("simulated{seen}"));

        self.beside_each_other(&real.into_image(), &simulated.into_image())
    }

    fn beside_each_other(&self, left: &RgbImage, right: &RgbImage) -> RgbImage {
        let (width, height) = self.size();
        let mut both = RgbImage::new(width, height);
        let row_bytes = 3 * self.lens.width as usize;
        let rows = left.chunks_exact(row_bytes).zip(right.chunks_exact(row_bytes));
        for (both, (left, right)) in both.chunks_exact_mut(2 * row_bytes).zip(rows) {
            let (to_left, to_right) = both.split_at_mut(row_bytes);
            to_left.copy_from_slice(left);
            to_right.copy_from_slice(right);
        }
        both
    }

    fn depth(&self, body: &Body) -> f64 {
        (self.camera.pinhole.camera_from_world * body.ellipsoid().center).z
    }

    /// Mask at the panel's scale: foreground for each pixel of its pinhole image, row by row.
    fn resized(&self, mask: &Mask) -> Vec<bool> {
        let (width, height) = (self.lens.pinhole_width, self.lens.pinhole_height);
        let nearest =
            |i: u32, size: u32, whole: u32| ((2 * i + 1) * size / (2 * whole)).min(size.saturating_sub(1));
        if mask.width() == 0 || mask.height() == 0 {
            return vec![false; width as usize * height as usize];
        }
        let columns: Vec<u32> = (0..width).map(|x| nearest(x, mask.width(), width)).collect();
        let mut resized = Vec::with_capacity(width as usize * height as usize);
        for words in (0..height).map(|y| mask.row(nearest(y, mask.height(), height))) {
            resized.extend(columns.iter().map(|x| words[*x as usize / 64] >> (x % 64) & 1 == 1));
        }
        resized
    }

    /// The real picture; without one the foreground, pale on dark.
    fn backdrop(&self, shot: &Shot) -> RgbImage {
        let size = (self.lens.width, self.lens.height);
        match (&shot.image, &shot.mask) {
            (Some(image), _) if image.dimensions() == size => image.as_ref().clone(),
            (_, Some(mask)) => {
                let pale = |set: &bool| if *set { [168, 172, 180] } else { [24, 26, 31] };
                self.lens.picture(&self.resized(mask).iter().map(pale).collect::<Vec<_>>(), [24, 26, 31])
            }
            _ => RgbImage::from_pixel(self.lens.width, self.lens.height, Rgb([24, 26, 31])),
        }
    }
}
