//! The tracking methods, behind one trait.
//!
//! Everything before a method (sources, synchronisation, masks) and after it (files, film, page, evaluation) is shared;
//! a method only turns one [`Moment`] into estimates of the people.

pub mod agents;
mod capacity;
pub mod condensation;
pub mod mcmc;
mod raised_ids;

use image::RgbImage;

use self::agents::Packet;
pub use self::raised_ids::RaisedIds;
use crate::prepared_room::PreparedRoom;
use crate::{Moment, PersonEstimate, Result};

/// Observations that a method needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Foreground masks and, if there are pictures, the colours of the foreground.
    pub masks: bool,
    /// Whole pictures, in the pinhole image.
    pub pictures: bool,
    /// Each camera's picture of the empty room, if it is known ([`Method::set_empty_scene`]).
    pub empty_scene: bool,
}

/// An online tracker, which processes one moment at a time, in order.
///
/// A method is built from a [`crate::prepared_room::PreparedRoom`] and its own options and has its own seeded
/// generator; its results for the same moments are equal to the last bit for any number of threads.
pub trait Method {
    /// Processes one moment. Returns the estimated people by ascending id.
    ///
    /// # Errors
    /// [`crate::Error::FrameSize`] for a mask or picture that does not fit its camera.
    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>>;

    /// Observations that the method needs; constant during a run.
    fn needs(&self) -> Needs;

    /// Sets a camera's picture of the empty room, in its pinhole image at the working size.
    fn set_empty_scene(&mut self, _camera: usize, _picture: &RgbImage) {}

    /// Useful lag, seconds: the time after which [`Self::smoothed`] does not improve further.
    fn lag_s(&self) -> f64 {
        0.0
    }

    /// Goes on with the zones of a room whose cameras and geometry are the same; nobody is lost. Returns whether the method
    /// can do that.
    fn replace_zones(&mut self, _room: &PreparedRoom) -> bool {
        false
    }

    /// Packets that the stations of a distributed method sent at the latest moment; empty for other methods.
    fn packets(&self) -> &[Packet] {
        &[]
    }

    /// Smoothed estimates of an earlier moment, by ascending id; `None` when they are those of [`Self::step`].
    /// Called at most once for each moment, in order.
    fn smoothed(&mut self, _frame: u32) -> Option<Vec<PersonEstimate>> {
        None
    }
}
