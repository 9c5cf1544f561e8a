//! A method whose ids go on above those of an earlier run.

use image::RgbImage;

use super::agents::Packet;
use super::{Method, Needs};
use crate::prepared_room::PreparedRoom;
use crate::{Moment, PersonEstimate, Result};

/// Method that gives the ids of another one, each raised by the same number.
pub struct RaisedIds {
    method: Box<dyn Method>,
    by: u32,
}

impl RaisedIds {
    /// The method with ids from `first` on; its own ids begin with 1.
    pub fn new(method: Box<dyn Method>, first: u32) -> Self {
        Self { method, by: first.saturating_sub(1) }
    }

    fn raised(&self, mut people: Vec<PersonEstimate>) -> Vec<PersonEstimate> {
        for person in &mut people {
            person.id.0 = person.id.0.saturating_add(self.by);
        }
        people
    }
}

impl Method for RaisedIds {
    fn step(&mut self, moment: &Moment<'_>) -> Result<Vec<PersonEstimate>> {
        let people = self.method.step(moment)?;
        Ok(self.raised(people))
    }

    fn needs(&self) -> Needs {
        self.method.needs()
    }

    fn set_empty_scene(&mut self, camera: usize, picture: &RgbImage) {
        self.method.set_empty_scene(camera, picture);
    }

    fn lag_s(&self) -> f64 {
        self.method.lag_s()
    }

    fn packets(&self) -> &[Packet] {
        self.method.packets()
    }

    fn replace_zones(&mut self, room: &PreparedRoom) -> bool {
        self.method.replace_zones(room)
    }

    fn smoothed(&mut self, frame: u32) -> Option<Vec<PersonEstimate>> {
        let people = self.method.smoothed(frame)?;
        Some(self.raised(people))
    }
}
