//! Stations in processes of their own, on other machines.
//!
//! A *station* observes one camera and sends its observations; a *gatherer* (`tracker run --stations`) receives those
//! of all cameras and sends back its estimates of the people. Only observations leave a station: masks, colours of the
//! foreground, health and times; and the filmed picture, if the station is configured to send it.
//!
//! Stations can also track together, without a gatherer: then only packets leave them ([`mesh`]).
//!
//! * [`mesh`], [`packet`] — stations that track together, and the bytes of their packets.
//! * [`encoding`] — the bytes of the messages. Lossless, versioned, limited; hostile bytes are refused.
//! * [`Fingerprint`] — digest of the facts about the room that both sides must agree on.
//! * [`Endpoints`] — addresses, TLS, and the peers that are accepted.
//! * [`Uplink`] — a station's end: takes [`Event`](crate::station::Event)s out and brings feedback in.
//! * [`Downlink`] — a gatherer's end: one [`Port`](crate::station::Port) a camera, events into the
//!   [`Inbox`](crate::station::Inbox).
//!
//! The transport is Zenoh, behind the cargo feature `zenoh`. Without it [`Uplink::open`], [`Downlink::open`] and
//! [`Mesh::open`] return an error that tells how to install it; everything else is the same. Both ends must be used
//! from threads without an async runtime.
//!
//! ```no_run
//! use std::sync::{atomic::AtomicBool, mpsc};
//! use std::time::Duration;
//! use tracker::wire::{Downlink, Endpoints, Expected, ExpectedCamera, Fingerprint, Hello, Uplink};
//! # fn observe() -> Option<tracker::station::Event> { None }
//! # fn main() -> tracker::Result<()> {
//! # let room = scenes::room::Room::default();
//! let is_interrupted = AtomicBool::new(false);
//! let room = Fingerprint::of(&room);
//!
//! // On the gatherer's machine: waits for all stations, then starts them together.
//! let endpoints = Endpoints { listen: vec!["0.0.0.0:7447".parse().unwrap()], ..Endpoints::default() };
//! let cameras = vec![ExpectedCamera { name: "cam0".into(), width: 640, height: 480 }];
//! let (inbox, events) = mpsc::channel();
//! let bound = Duration::from_secs(60);
//! let (ports, downlink) = Downlink::open(Expected { room, cameras }, &endpoints, bound, &is_interrupted, inbox)?;
//! // … gather `events`, give feedback through `ports`; at last:
//! drop(downlink);
//!
//! // On the camera's machine.
//! let endpoints = Endpoints { connect: vec!["gatherer:7447".parse().unwrap()], ..Endpoints::default() };
//! let hello =
//!     Hello { room, camera: "cam0".into(), width: 640, height: 480, is_live: false, rate_hz: Some(12.0), has_boxes_alone: false };
//! let (mut uplink, feedback) = Uplink::open(hello, &endpoints)?;
//! uplink.wait_for_start(Some(bound), &is_interrupted)?;
//! while let Some(event) = observe() {
//!     // … take `feedback` before an observation, as a station in the gatherer's process does.
//!     uplink.send(event)?;
//! }
//! # Ok(())
//! # }
//! ```

pub mod encoding;
mod endpoints;
mod fingerprint;
pub mod mesh;
pub mod packet;

#[cfg(not(feature = "zenoh"))]
mod absent;
#[cfg(feature = "zenoh")]
mod enrolment;
#[cfg(feature = "zenoh")]
mod keys;
#[cfg(feature = "zenoh")]
mod network;
#[cfg(feature = "zenoh")]
mod roster;
#[cfg(feature = "zenoh")]
#[cfg(test)]
mod test_loopback;

#[cfg(not(feature = "zenoh"))]
pub use self::absent::{Downlink, Mesh, Uplink};
pub use self::endpoints::{Endpoint, Endpoints, Tls};
pub use self::fingerprint::Fingerprint;
#[cfg(feature = "zenoh")]
pub use self::mesh::Mesh;
#[cfg(feature = "zenoh")]
pub use self::network::{Downlink, Uplink};

/// Properties of a station: its first message.
#[derive(Debug, Clone, PartialEq)]
pub struct Hello {
    /// Room of the station's camera.
    pub room: Fingerprint,
    /// Name of the camera in that room, at most [`encoding::LONGEST_NAME`] bytes.
    pub camera: String,
    /// Width of the station's masks, pixels.
    pub width: u32,
    /// Height of the station's masks, pixels.
    pub height: u32,
    /// Whether the source is live; otherwise it is a recording.
    pub is_live: bool,
    /// Mean frame rate, frames a second, if the source states it.
    pub rate_hz: Option<f64>,
    /// Whether a detector's boxes are all that the station observes.
    pub has_boxes_alone: bool,
}

/// Stations that a gatherer expects.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedStations {
    /// Room; stations of other rooms are ignored.
    pub room: Fingerprint,
    /// Cameras of the prepared room, in its order.
    pub cameras: Vec<ExpectedCamera>,
}

/// A camera of a room, and the size of its masks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExpectedCamera {
    /// Name in the room.
    pub name: String,
    /// Width of its masks, pixels.
    pub width: u32,
    /// Height of its masks, pixels.
    pub height: u32,
}
