//! A station in a process of its own: from a frame and received packets to the packet to send and the estimates.

use std::sync::Arc;

use super::system::{body, estimate};
use super::{AgentStation, AgentsOptions, FieldOfView, Packet, StageView, StationId};
use crate::prepared_room::PreparedRoom;
use crate::silhouette::visibility::visible_fractions;
use crate::silhouette::{Body, View};
use crate::{CameraFrame, PersonEstimate, Result};

/// One station with the room that it needs.
#[derive(Debug)]
pub struct SoloStation {
    stage: PreparedRoom,
    station: AgentStation,
    view: View,
    hears: Vec<StationId>,
}

impl SoloStation {
    /// Prepares the station of one camera; `stage` has all cameras of the room.
    ///
    /// # Errors
    /// [`crate::Error::Option`] for an option that is out of range.
    pub fn new(stage: PreparedRoom, station: StationId, options: &AgentsOptions) -> Result<Self> {
        let fields: Arc<dyn FieldOfView> = Arc::new(StageView::new(&stage));
        let others = (0..stage.cameras.len()).map(|i| StationId(i as u8)).filter(|other| *other != station);
        let hears = others.filter(|other| fields.overlap(station, *other)).collect();
        let view = View::new(&stage.cameras[usize::from(station.0)]);
        Ok(Self { station: AgentStation::new(&stage, station, fields, options)?, stage, view, hears })
    }

    /// Stations whose fields of view overlap this station's.
    pub fn hears(&self) -> &[StationId] {
        &self.hears
    }

    /// Processes one frame and the packets received since the last one, with times on this station's clock. Returns the
    /// packet to send.
    ///
    /// # Errors
    /// [`crate::Error::FrameSize`] for a mask that does not fit the camera.
    pub fn step(
        &mut self,
        frame: u32,
        time_s: f64,
        camera: &CameraFrame,
        received: &[Packet],
    ) -> Result<Packet> {
        self.station.step(frame, time_s, camera, received).map(|(_, packet)| packet)
    }

    /// Estimates of all people in the room, by ascending id, measured here or only by other stations. Visibility is
    /// that in this station's camera alone.
    pub fn people(&self) -> Vec<PersonEstimate> {
        let mut beliefs = self.station.people();
        beliefs.retain(|belief| self.stage.floor.is_inside(belief.position.x, belief.position.y));
        let bodies: Vec<Body> = beliefs.iter().map(|belief| body(belief.position, belief.height_m)).collect();
        let visible = visible_fractions(std::slice::from_ref(&self.view), &bodies);
        beliefs.iter().zip(visible).map(|(belief, visible)| estimate(belief, visible)).collect()
    }

    /// Bodies of the people whom image tracking follows; they must not be learnt as background.
    pub fn bodies(&self) -> Vec<Body> {
        self.station.bodies()
    }
}
