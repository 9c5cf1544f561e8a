//! One station: image tracking of its camera, and a rule that turns sightings and received packets into agents.

use std::sync::Arc;

use super::{
    AgentsOptions, Belief, FieldOfView, ImageTracking, Packet, Restart, Rule, RuleOptions, Sightings,
    StationId,
};
use crate::method::agents::modern::Modern;
use crate::method::agents::published::Published;
use crate::method::mcmc::McmcOptions;
use crate::prepared_room::PreparedRoom;
use crate::silhouette::Body;
use crate::{CameraFrame, Result};

/// One camera's image tracking and agents.
pub struct AgentStation {
    tracking: ImageTracking,
    rule: Box<dyn Rule>,
    restarts: Vec<Restart>,
}

impl AgentStation {
    /// Prepares the station of one camera of a room. `fields` are the fields of view of all its cameras.
    ///
    /// # Errors
    /// [`crate::Error::Option`] for an option that is out of range.
    pub fn new(
        stage: &PreparedRoom,
        station: StationId,
        fields: Arc<dyn FieldOfView>,
        options: &AgentsOptions,
    ) -> Result<Self> {
        let camera = usize::from(station.0);
        let seed = options.sampler.seed.wrapping_add(camera as u64);
        let sampler = McmcOptions { seed, ..options.sampler.clone() };
        let stations = stage.cameras.len() as u8;
        let rule: Box<dyn Rule> = match &options.rule {
            RuleOptions::Modern(modern) => {
                modern.validate()?;
                Box::new(Modern::new(station, stations, fields, *modern))
            }
            RuleOptions::Published(published) => {
                published.validate()?;
                Box::new(Published::new(station, stations, fields, *published))
            }
        };
        Ok(Self { tracking: ImageTracking::new(stage, camera, &sampler)?, rule, restarts: Vec::new() })
    }

    /// Processes one frame and the packets received since the last one, with times on this station's clock. Returns the
    /// station's sightings and the packet to send.
    ///
    /// # Errors
    /// [`crate::Error::FrameSize`] for a mask that does not fit the camera.
    pub fn step(
        &mut self,
        frame: u32,
        time_s: f64,
        camera: &CameraFrame,
        received: &[Packet],
    ) -> Result<(Sightings, Packet)> {
        let sightings = self.tracking.track(frame, time_s, camera, &self.restarts)?;
        let step = self.rule.step(&sightings, received);
        self.restarts = step.restarts;
        self.tracking.end(&step.ended);
        if let Some(followed) = self.rule.followed() {
            self.tracking.follow(&followed);
        }
        // A person whom this station does not measure may come into view anywhere. Image tracking proposes a birth near
        // the predicted place, and accepts it only where foreground is unexplained.
        let unseen = self.rule.people().into_iter().filter(|person| person.agent.is_none());
        self.restarts
            .extend(unseen.map(|person| Restart { position: person.position, height_m: person.height_m }));
        Ok((sightings, step.packet))
    }

    /// Estimates of all people whom the station knows of, by ascending target.
    pub fn people(&self) -> Vec<Belief> {
        self.rule.people()
    }

    /// Bodies of the people whom image tracking follows.
    pub fn bodies(&self) -> Vec<Body> {
        self.tracking.bodies()
    }
}

impl std::fmt::Debug for AgentStation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AgentStation").field("tracking", &self.tracking).finish_non_exhaustive()
    }
}
