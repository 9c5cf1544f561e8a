//! Replacements for the ends in a build without the feature `zenoh`.

use std::convert::Infallible;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use super::mesh::{Membership, MeshCounts};
use super::{Endpoints, ExpectedStations, Hello};
use crate::method::agents::{Packet, StationId};
use crate::observation::Feedback;
use crate::station::Event;
use crate::station::{Inbox, Port};
use crate::{Error, Result};

fn absent() -> Error {
    Error::option(
        "stations",
        "this program was built without stations in processes of their own; install it with them: cargo install --path \
         tracker --features zenoh",
    )
}

/// A station's end of the network; it cannot be opened in this build.
#[derive(Debug)]
pub struct Uplink(Infallible);

impl Uplink {
    /// Joins the network as the station of one camera.
    ///
    /// # Errors
    /// Always: this build has no network.
    pub fn open(_: Hello, _: &Endpoints) -> Result<(Self, Receiver<Feedback>)> {
        Err(absent())
    }

    /// Waits until the gatherer wants observations.
    pub fn wait_for_start(&self, _: Option<Duration>, _: &AtomicBool) -> Result<()> {
        match self.0 {}
    }

    /// Sends an event of the station.
    pub fn send(&mut self, _: Event) -> Result<()> {
        match self.0 {}
    }
}

/// A gatherer's end of the network; it cannot be opened in this build.
#[derive(Debug)]
pub struct Downlink(Infallible);

impl Downlink {
    /// Joins the network as the gatherer of a room.
    ///
    /// # Errors
    /// Always: this build has no network.
    pub fn open(
        _: ExpectedStations,
        _: &Endpoints,
        _: Duration,
        _: &AtomicBool,
        _: Inbox,
    ) -> Result<(Vec<Port>, Self)> {
        Err(absent())
    }

    /// Number of messages that were refused.
    pub fn garbage(&self) -> u64 {
        match self.0 {}
    }
}

/// A member of the mesh; it cannot be opened in this build.
#[derive(Debug)]
pub struct Mesh(Infallible);

impl Mesh {
    /// Joins the network.
    ///
    /// # Errors
    /// Always: this build has no network.
    pub fn open(_: &Membership, _: &Endpoints) -> Result<Self> {
        Err(absent())
    }

    /// Sends a packet at once.
    pub fn publish(&mut self, _: &Packet) -> Result<()> {
        match self.0 {}
    }

    /// Packets that have arrived since the last call.
    pub fn heard(&self) -> Vec<Packet> {
        match self.0 {}
    }

    /// Packets that have arrived since the last call; while there are none, waits for one.
    pub fn wait_received(&self, _: Duration) -> Vec<Packet> {
        match self.0 {}
    }

    /// Names of the cameras that have been heard, with their numbers.
    pub fn names(&self) -> Vec<(StationId, String)> {
        match self.0 {}
    }

    /// Counts of sent, received and refused packets.
    pub fn counts(&self) -> MeshCounts {
        match self.0 {}
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use super::*;
    use crate::wire::Fingerprint;

    #[test]
    fn errors_of_all_ends_tell_how_to_install_stations() {
        let room = Fingerprint([0; Fingerprint::BYTES]);
        let hello = Hello {
            room,
            camera: "a".into(),
            width: 1,
            height: 1,
            is_live: true,
            rate_hz: None,
            has_boxes_alone: false,
        };
        let line = Uplink::open(hello, &Endpoints::default()).unwrap_err().to_string();
        assert!(line.contains("--features zenoh") && !line.contains('\n'), "{line}");
        let expected = ExpectedStations { room, cameras: Vec::new() };
        let (inbox, _events) = mpsc::channel();
        let stop = AtomicBool::new(false);
        let opened = Downlink::open(expected, &Endpoints::default(), Duration::ZERO, &stop, inbox);
        assert_eq!(opened.unwrap_err().to_string(), line);
        let (hears, clock) = (Vec::new(), crate::wire::mesh::OwnClock::default());
        let member = Membership { room: Some(room), cameras: Vec::new(), station: None, hears, clock };
        assert_eq!(Mesh::open(&member, &Endpoints::default()).unwrap_err().to_string(), line);
    }
}
