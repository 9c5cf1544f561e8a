//! Reference views of a project's captures, without a room: for `recon picks`.

use std::path::Path;

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::Point2;

use super::cache::{Keys, StageCache};
use super::{BuildOptions, BuildStep, STEPS_A_CAMERA, files_of, process_all};
use crate::Result;
use crate::merge::pinhole_pixel;
use crate::project::ProjectCamera;
use crate::rolling_shutter::RollingShutter;
use crate::surface::Surface;
use crate::working_size::WorkingSize;

/// A camera's reference image and its surface.
#[derive(Debug, Clone)]
pub struct ReferenceView {
    /// The camera's name.
    pub name: String,
    /// The reference image as filmed.
    pub picture: RgbImage,
    /// Surface of the view, in the capture's own unit.
    pub surface: Surface,
    lens: Intrinsics,
    size: WorkingSize,
    /// Rolling-shutter model, and the index of the reference frame.
    shutter: Option<(RollingShutter, usize)>,
}

impl ReferenceView {
    /// View of a surface without distortion, with its picture.
    #[cfg(test)]
    pub(crate) fn of_surface(name: &str, surface: Surface) -> Self {
        let (picture, lens) = (surface.picture.clone(), surface.intrinsics.clone());
        let size = WorkingSize::of((lens.width, lens.height));
        Self { name: name.into(), picture, surface, lens, size, shutter: None }
    }

    /// Filmed position of a pixel of the surface's pinhole picture; `None` outside the image.
    pub fn filmed(&self, pinhole: &Point2<f64>) -> Option<Point2<f64>> {
        let ray = self.surface.intrinsics.unproject(pinhole)?;
        let at_once = self.lens.project(&ray.into())?;
        let filmed = match &self.shutter {
            Some((shutter, frame)) => shutter.filmed(&self.lens, *frame, &at_once)?,
            None => at_once,
        };
        self.lens.contains(&filmed).then(|| self.size.filmed_pixel(&filmed))
    }

    /// Position of a filmed pixel in the surface's pinhole picture.
    pub fn pinhole(&self, filmed: &Point2<f64>) -> Option<Point2<f64>> {
        let filmed = self.size.worked_pixel(filmed);
        let at_once = match &self.shutter {
            Some((shutter, frame)) => shutter.rectified(&self.lens, *frame, &filmed)?,
            None => filmed,
        };
        pinhole_pixel(&self.lens, &at_once)
    }
}

/// Processes the captures of all cameras. Results cached for `room` are taken from there, and new ones are cached for
/// it, as [`super::build`] does.
///
/// # Errors
/// The error of the first capture that cannot be read or processed.
pub fn reference_views(
    cameras: &[ProjectCamera],
    room: Option<&Path>,
    options: &BuildOptions,
    progress: &mut (dyn FnMut(&BuildStep) + Send),
) -> Result<Vec<ReferenceView>> {
    options.check()?;
    let of = cameras.len() * STEPS_A_CAMERA;
    let mut number = 0;
    let mut step = |what: String| {
        progress(&BuildStep { number, of, what });
        number += 1;
    };
    let files = files_of(cameras, options.memory)?;
    let cache = room.map(StageCache::beside);
    let done = process_all(&files, cache.as_ref(), options, &mut step, &|_, capture, _| capture.reference)?;
    let view = |(camera, _, reference): (super::CameraResult, Keys, usize)| ReferenceView {
        shutter: camera.processed.shutter().map(|shutter| (shutter, reference)),
        name: camera.name,
        picture: camera.reference,
        surface: camera.processed.surface,
        lens: camera.processed.lens,
        size: camera.size,
    };
    Ok(done.into_iter().map(view).collect())
}
