//! A station in a process of its own: from a frame and the packets heard since the last to what it tells and writes.

use std::sync::Arc;

use super::system::{body, estimate};
use super::{AgentStation, AgentsOptions, FieldOfView, Packet, StageView, StationId};
use crate::prepared_room::PreparedRoom;
use crate::silhouette::visibility::visible_fractions;
use crate::silhouette::{Body, View};
use crate::{CameraFrame, PersonEstimate, Result};

/// One station with what it needs of the stage.
#[derive(Debug)]
pub struct SoloStation {
    stage: PreparedRoom,
    station: AgentStation,
    view: View,
    hears: Vec<StationId>,
}

impl SoloStation {
    /// Prepares the station of a camera of the stage, which has all cameras of the room.
    ///
    /// # Errors
    /// [`crate::Error::Option`] when an option makes no sense.
    pub fn new(stage: PreparedRoom, station: StationId, options: &AgentsOptions) -> Result<Self> {
        let fields: Arc<dyn FieldOfView> = Arc::new(StageView::new(&stage));
        let others = (0..stage.cameras.len()).map(|i| StationId(i as u8)).filter(|other| *other != station);
        let hears = others.filter(|other| fields.overlap(station, *other)).collect();
        let view = View::new(&stage.cameras[usize::from(station.0)]);
        Ok(Self { station: AgentStation::new(&stage, station, fields, options)?, stage, view, hears })
    }

    /// The stations whose fields of view overlap its own.
    pub fn hears(&self) -> &[StationId] {
        &self.hears
    }

    /// Takes in one frame, and the packets heard since the last with times on this station's clock. Returns what is to
    /// be sent.
    ///
    /// # Errors
    /// When the mask does not fit the camera ([`crate::Error::FrameSize`]).
    pub fn step(
        &mut self,
        frame: u32,
        time_s: f64,
        camera: &CameraFrame,
        heard: &[Packet],
    ) -> Result<Packet> {
        self.station.step(frame, time_s, camera, heard).map(|(_, packet)| packet)
    }

    /// Everybody in the room whom the station knows of, seen or only heard of, by ascending id; visible in its camera
    /// alone.
    pub fn people(&self) -> Vec<PersonEstimate> {
        let mut beliefs = self.station.people();
        beliefs.retain(|belief| self.stage.floor.is_inside(belief.position.x, belief.position.y));
        let bodies: Vec<Body> = beliefs.iter().map(|belief| body(belief.position, belief.height_m)).collect();
        let visible = visible_fractions(std::slice::from_ref(&self.view), &bodies);
        beliefs.iter().zip(visible).map(|(belief, visible)| estimate(belief, visible)).collect()
    }

    /// Bodies of the people whom its image tracking follows: not to be learnt as background.
    pub fn bodies(&self) -> Vec<Body> {
        self.station.bodies()
    }
}
