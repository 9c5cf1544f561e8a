//! The trackers that work moment by moment, behind one trait.
//!
//! What comes before (sources, synchronisation, masks) and after (files, film, page, evaluation) is shared; a method
//! only turns one [`Moment`] into the people it believes are there.

pub mod agents;
mod capacity;
pub mod condensation;
pub mod mcmc;

use image::RgbImage;

use self::agents::Packet;
use crate::{Moment, PersonEstimate, Result};

/// Kinds of observations that a method needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needs {
    /// Foreground masks, and where there are pictures the colours of the foreground.
    pub masks: bool,
    /// Whole pictures, in the pinhole image.
    pub pictures: bool,
    /// Each camera's view of the empty room, where that is known ([`Method::set_empty_scene`]).
    pub empty_scene: bool,
}

/// A tracker that is fed one moment at a time, in order.
///
/// A method is built from a [`crate::stage::Stage`] and its own options, keeps its own seeded generator, and gives the
/// same bytes for the same moments whatever the number of threads.
pub trait Method {
    /// Takes in one moment and returns the people believed to be there, by ascending id.
    ///
    /// # Errors
    /// When a mask or image does not fit its camera ([`crate::Error::FrameSize`]).
    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>>;

    /// Kinds of observations that the method needs; constant during a run.
    fn needs(&self) -> Needs;

    /// Sets a camera's view of the empty room, in its pinhole image at the working size.
    fn set_empty_scene(&mut self, _camera: usize, _picture: &RgbImage) {}

    /// How long it pays to wait after a moment before its people are told, in seconds.
    fn lag_s(&self) -> f64 {
        0.0
    }

    /// Packets that the stations of a distributed method sent at the last moment; other methods have none.
    fn packets(&self) -> &[Packet] {
        &[]
    }

    /// The people of an earlier moment, by ascending id, as they are known now. Asked at most once for each moment, in order; `None`
    /// when nothing better is known than [`Self::step`] gave.
    fn hindsight(&mut self, _frame: u32) -> Option<Vec<PersonEstimate>> {
        None
    }
}
