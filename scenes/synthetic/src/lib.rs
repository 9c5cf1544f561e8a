//! Synthetic rooms and people with everything known about them, for the tests of every estimator.
//!
//! ```
//! use synthetic::{CaptureOptions, RoomOptions, SequenceOptions, WalkerOptions};
//!
//! let room = RoomOptions { seed: 7, image_px: [80, 60], ..RoomOptions::default() }.build()?;
//! // A camera moved by hand around its place: images and true poses, the last at the installed pose.
//! let camera = &room.room.cameras[0].camera;
//! let (images, poses) = room.capture(camera, &CaptureOptions { frames: 2, ..CaptureOptions::default() });
//! assert_eq!(poses[1], camera.camera_from_world);
//! # assert_eq!(images.len(), 2);
//! // People walking, seen by all cameras: images, masks, depth, ids, places, visible shares.
//! let walkers = room.walkers(&WalkerOptions { people: 2, ..WalkerOptions::default() });
//! let sequence = room.sequence(walkers, SequenceOptions { frames: 3, ..SequenceOptions::default() });
//! for frame in sequence.frames() {
//!     assert_eq!(frame.cameras.len(), room.room.cameras.len());
//! }
//! # Ok::<(), scenes::Error>(())
//! ```
//!
//! In the order of the data: [`RoomOptions`] → [`SyntheticRoom`] (its [`room`](SyntheticRoom::room) is what
//! [`scenes::room::Room::write`] writes) → [`SyntheticRoom::capture`], [`SyntheticRoom::walkers`] →
//! [`SyntheticRoom::sequence`]. [`tracks`] makes sparse points seen by cameras, without pictures.
//!
//! The same options give the same bytes at any number of threads. People are articulated figures in textured
//! clothes, not a tracker's ellipsoids; surfaces carry procedural textures, so that features can be followed.
#![forbid(unsafe_code)]

mod capture;
mod floor;
mod furnish;
mod furniture;
mod gait;
mod light;
mod path;
mod person;
mod proportions;
mod render;
mod room;
mod sequence;
mod shape;
mod shell;
mod surface;
mod texture;
pub mod tracks;
mod walkers;

pub use capture::CaptureOptions;
pub use furnish::RoomKind;
pub use furniture::{Furniture, Screen};
pub use person::Body;
pub use render::RenderOptions;
pub use room::{RoomOptions, SyntheticRoom};
pub use sequence::{CameraFrame, Frame, PersonTruth, Sequence, SequenceOptions};
pub use walkers::{Walker, WalkerOptions};

#[cfg(test)]
mod tests;
