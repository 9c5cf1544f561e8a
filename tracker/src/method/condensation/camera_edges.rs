//! Edge images of all cameras at one moment (step 1 of a moment). They depend on the pictures, the empty scene and [`EdgeOptions`],
//! and on nothing of the people: trackers with other weights or motion can share them ([`super::Condensation::follow`]).

use image::RgbImage;
use rayon::prelude::*;

use super::edges::{EdgeImage, EdgeMaker};
use super::options::EdgeOptions;
use crate::Moment;
use crate::prepared_room::PreparedCamera;

/// Makers of all cameras' edge images, and the images of the latest moment.
#[derive(Debug, Clone, Default)]
pub struct CameraEdges {
    makers: Vec<EdgeMaker>,
    images: Vec<Option<EdgeImage>>,
    /// Unused edge images, kept for their buffers.
    spare: Vec<EdgeImage>,
}

impl CameraEdges {
    /// Makers for a room's cameras, without pictures of the empty scene.
    pub fn new(cameras: &[PreparedCamera], options: EdgeOptions) -> Self {
        let maker = |c: &PreparedCamera| {
            let shown: Vec<bool> = c.static_z_m.iter().map(|z| *z > 0.0).collect();
            EdgeMaker::new(options, c.width(), &shown)
        };
        Self {
            makers: cameras.iter().map(maker).collect(),
            images: cameras.iter().map(|_| None).collect(),
            spare: Vec::new(),
        }
    }

    /// Sets a camera's picture of the empty scene.
    pub fn set_empty_scene(&mut self, camera: usize, picture: &RgbImage) {
        if let Some(maker) = self.makers.get_mut(camera) {
            maker.set_empty_scene(picture);
        }
    }

    /// Computes the edges of every camera's picture, in parallel.
    pub fn find(&mut self, moment: &Moment<'_>) {
        for (edges, frame) in self.images.iter_mut().zip(moment.cameras) {
            match (frame.image.is_some(), edges.is_some()) {
                (true, false) => *edges = Some(self.spare.pop().unwrap_or_default()),
                (false, true) => self.spare.extend(edges.take()),
                _ => {}
            }
        }
        let cameras = self.makers.par_iter_mut().zip(&mut self.images).zip(moment.cameras);
        cameras.for_each(|((maker, edges), frame)| {
            if let (Some(image), Some(edges)) = (&frame.image, edges) {
                maker.edges(image, edges);
            }
        });
    }

    /// The latest moment's edges by camera; `None` for a camera without a picture.
    pub fn images(&self) -> &[Option<EdgeImage>] {
        &self.images
    }
}
