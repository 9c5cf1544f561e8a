//! One picture → one [`Observation`]: health, mask, colours.

use std::path::Path;
use std::sync::Arc;

use calib::undistort::UndistortMap;
use image::{GrayImage, RgbImage};

use super::pose_follower::{CameraPose, PoseFollower};
use crate::foreground::health::{self, Health};
use crate::foreground::{Foreground, Verdict};
use crate::method::Needs;
use crate::observation::{Colours, Feedback, Mask, Observation, PersonBox};
use crate::prepared_room::{PreparedCamera, PreparedRoom, resolution};
use crate::silhouette::{Body, Silhouette, View};
use crate::source::DetectedBox;
use crate::{Error, Result};

/// Largest fraction of foreground in a usable ready-made mask.
const MOST_FOREGROUND: f64 = 0.9;
/// Distance between two colour samples, in pixels of the sampler, along each side.
const COLOUR_BLOCKS: u8 = 2;
/// Least time between two drawings of the believed people, seconds: the background absorbs nothing within a minute.
const DRAW_EVERY_S: f64 = 1.0;
/// Margin around a believed person that is not learnt as background, as a fraction of their width: limbs and errors of
/// position.
const MARGIN: f64 = 0.35;

/// Origin of a camera's masks.
pub enum Masks {
    /// Background subtraction.
    Subtracted(Box<Foreground>),
    /// Ready-made masks: a pixel is foreground if any channel has at least this value.
    Ready {
        /// 1 for lossless masks, 128 for those with lossy compression.
        from: u8,
    },
    /// No masks are made; only the picture's health is checked.
    Unneeded(Health),
}

impl Masks {
    /// Ready-made masks of a source: PNG is lossless, video and JPEG are not.
    pub fn ready(spec: &str) -> Self {
        let is_png = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
        let path = Path::new(spec);
        let is_exact = match std::fs::read_dir(path) {
            Ok(entries) => entries.filter_map(std::result::Result::ok).any(|entry| is_png(&entry.path())),
            Err(_) => is_png(path),
        };
        Self::Ready { from: if is_exact { 1 } else { 128 } }
    }
}

/// Inputs of one frame; each may be missing.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameInput<'a> {
    /// Picture, of the observer's [size](Observer::size).
    pub picture: Option<&'a RgbImage>,
    /// Ready-made mask, of the same size.
    pub mask: Option<&'a RgbImage>,
    /// A detector's boxes, in pixels of what the camera films.
    pub boxes: Option<&'a [DetectedBox]>,
}

/// Makes the observations of one camera, frame by frame.
pub struct Observer {
    masks: Masks,
    needs: Needs,
    size: (u32, u32),
    undistort: UndistortMap,
    follower: Option<PoseFollower>,
    camera: PreparedCamera,
    colour_step: u8,
    /// The camera at the sampler's resolution, for the silhouettes of believed people.
    view: View,
    silhouette: Silhouette,
    /// Believed people, as drawn into `expected`.
    believed: Vec<Body>,
    /// Whether the believed people have moved since they were drawn.
    has_moved: bool,
    /// Time of the frame at which the believed people were drawn, seconds.
    drawn_s: Option<f64>,
    /// Silhouettes of believed people, in the image with distortion.
    expected: GrayImage,
    /// The same silhouettes in the pinhole image.
    expected_pinhole: GrayImage,
    mask: GrayImage,
    pinhole: GrayImage,
}

/// Result of observing one picture.
#[derive(Debug)]
pub struct Observed {
    /// Input of the trackers.
    pub observation: Observation,
    /// In the pinhole image, for methods that read pictures.
    pub pinhole: Option<Arc<RgbImage>>,
}

impl Observer {
    /// Observer of one of the prepared room's cameras, for a method with these needs.
    ///
    /// # Errors
    /// A camera that the room lacks.
    pub fn new(room: &PreparedRoom, camera: &str, masks: Masks, needs: Needs) -> Result<Self> {
        let Some(camera) = room.camera_index(camera).map(|i| &room.cameras[i]) else {
            return Err(Error::option("room", format!("the room has no camera `{camera}`")));
        };
        let block = resolution::block(camera, &Body::ADULT, &room.floor);
        let (size, pinhole_size) = (camera.real_size(), (camera.width(), camera.height()));
        Ok(Self {
            masks,
            needs,
            size,
            undistort: camera.undistort.clone(),
            follower: None,
            camera: camera.clone(),
            colour_step: block.saturating_mul(COLOUR_BLOCKS),
            view: View::coarse(camera, block),
            silhouette: Silhouette::default(),
            believed: Vec::new(),
            has_moved: false,
            drawn_s: None,
            expected: GrayImage::new(size.0, size.1),
            expected_pinhole: GrayImage::new(pinhole_size.0, pinhole_size.1),
            mask: GrayImage::new(size.0, size.1),
            pinhole: GrayImage::new(pinhole_size.0, pinhole_size.1),
        })
    }

    /// The same observer, which notices when the camera turns, sets it aside, and follows it on where its pose is certain:
    /// what the camera sees is then put where it saw it before. Only for pictures whose background is subtracted.
    #[must_use]
    pub fn with_pose_watch(self, follower: PoseFollower) -> Self {
        Self { follower: Some(follower), ..self }
    }

    /// Width and height of the pictures and masks that it takes, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Observes one frame.
    ///
    /// # Errors
    /// An error of OpenCV.
    pub fn observe(&mut self, sequence: u64, time_s: f64, frame: &FrameInput<'_>) -> Result<Observed> {
        self.draw_believed(time_s)?;
        let FrameInput { picture, mask, boxes } = *frame;
        let health = match (&mut self.masks, picture, mask) {
            (Masks::Subtracted(foreground), Some(picture), _) => {
                let pose = match &mut self.follower {
                    Some(follower) => follower.look(picture, time_s)?,
                    None => CameraPose::AsBefore,
                };
                if let CameraPose::Turned(turn) = &pose {
                    let (real, pinhole) = (&self.camera.real.intrinsics, &self.camera.pinhole.intrinsics);
                    self.undistort = UndistortMap::turned(real, pinhole, turn);
                    let scene = self.follower.as_mut().and_then(PoseFollower::take_scene);
                    **foreground = foreground.begun_anew(scene)?;
                }
                match pose {
                    CameraPose::SetAside => Verdict::Moved,
                    _ => foreground.mask(picture, time_s, &mut self.mask)?,
                }
            }
            (Masks::Ready { from }, _, Some(given)) => take_mask(given, *from, &mut self.mask),
            (Masks::Unneeded(health), Some(picture), _) => match () {
                () if health::is_dark(picture) => Verdict::Dark,
                () if health.is_frozen(picture, time_s) => Verdict::Frozen,
                () => Verdict::Usable,
            },
            (_, None, None) if boxes.is_some() => Verdict::Usable,
            _ => Verdict::Lost,
        };
        let mut observation = Observation::unusable(sequence, time_s, health);
        if !matches!(health, Verdict::Frozen | Verdict::Dark | Verdict::Lost | Verdict::Moved) {
            let in_pinhole = |detected: &DetectedBox| PersonBox {
                appearance: detected.appearance.clone(),
                ..self.camera.to_pinhole_box(&detected.pixels)
            };
            observation.boxes = boxes.map(|boxes| boxes.iter().map(in_pinhole).collect());
        }
        if health != Verdict::Usable {
            return Ok(Observed { observation, pinhole: None });
        }
        if self.needs.masks && (picture.is_some() || mask.is_some()) {
            let mask = self.pinhole_mask();
            observation.colours = picture.map(|picture| self.colours(&mask, picture));
            observation.mask = Some(mask);
        }
        let pinhole = picture.filter(|_| self.needs.pictures).map(|p| Arc::new(self.undistort.image(p)));
        Ok(Observed { observation, pinhole })
    }

    /// Mask of the latest frame in the pinhole image.
    fn pinhole_mask(&mut self) -> Mask {
        if self.undistort.is_identity() {
            return Mask::from(&self.mask);
        }
        self.undistort.mask(&self.mask, &mut self.pinhole);
        Mask::from(&self.pinhole)
    }

    /// Colours of the foreground, read through the lens distortion where there is any.
    fn colours(&self, mask: &Mask, picture: &RgbImage) -> Colours {
        if self.undistort.is_identity() {
            return Colours::of_picture(mask, self.colour_step, picture);
        }
        let (width, filmed_width) = (self.camera.width(), self.size.0);
        let nearest = self.undistort.nearest();
        Colours::sample(mask, self.colour_step, |x, y| {
            // Foreground exists only inside the lens.
            let index = nearest[(y * width + x) as usize];
            *picture.get_pixel(index % filmed_width, index / filmed_width)
        })
    }

    /// Sets the estimates of the people: the background under them is not updated from the next frame on.
    pub fn expect(&mut self, feedback: &Feedback) {
        if !feedback.is_like(&self.believed) {
            self.believed.clone_from(&feedback.people);
            self.has_moved = true;
        }
    }

    /// Draws the believed people, if they have moved, for the background subtraction.
    fn draw_believed(&mut self, time_s: f64) -> Result<()> {
        let Masks::Subtracted(foreground) = &mut self.masks else { return Ok(()) };
        if !self.has_moved
            || self.drawn_s.is_some_and(|drawn| (0.0..DRAW_EVERY_S).contains(&(time_s - drawn)))
        {
            return Ok(());
        }
        (self.has_moved, self.drawn_s) = (false, Some(time_s));
        self.expected_pinhole.fill(0);
        let (width, height) = self.expected_pinhole.dimensions();
        let block = u32::from(self.view.block);
        for body in &self.believed {
            let wide = Body { radius_m: body.radius_m * (1.0 + MARGIN), ..*body };
            self.silhouette.draw(&self.view, &wide.ellipsoid());
            for (column, row) in self.silhouette.pixels() {
                for y in row * block..((row + 1) * block).min(height) {
                    let start = (y * width + column * block) as usize;
                    let end = (y * width + ((column + 1) * block).min(width)) as usize;
                    self.expected_pinhole.as_flat_samples_mut().samples[start..end].fill(255);
                }
            }
        }
        if self.undistort.is_identity() {
            self.expected.copy_from_slice(&self.expected_pinhole);
        } else {
            self.expected.fill(0);
            let places = self.undistort.nearest().iter().zip(self.expected_pinhole.iter());
            for (index, _) in places.filter(|(_, set)| **set != 0) {
                if let Some(pixel) = self.expected.as_flat_samples_mut().samples.get_mut(*index as usize) {
                    *pixel = 255;
                }
            }
        }
        foreground.expect(&self.expected)
    }
}

/// Ready-made mask: pixels of at least `from` in some channel are foreground.
fn take_mask(given: &RgbImage, from: u8, mask: &mut GrayImage) -> Verdict {
    let mut foreground = 0;
    for (mask, p) in mask.iter_mut().zip(given.as_raw().chunks_exact(3)) {
        // Without a short circuit the compiler vectorises the comparison.
        let set = p[0].max(p[1]).max(p[2]) >= from;
        *mask = if set { 255 } else { 0 };
        foreground += usize::from(set);
    }
    if foreground as f64 > MOST_FOREGROUND * mask.len() as f64 {
        Verdict::AllForeground
    } else {
        Verdict::Usable
    }
}
