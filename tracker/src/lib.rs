//! Tracks every person in a room, in metres on its floor, from fixed calibrated cameras.
//!
//! Data flows down this list, one moment (the observations of all cameras at one time) after the other:
//!
//! * [`source`] — videos, folders of images, streams and ready-made masks, matched with the room's cameras; capture
//!   times.
//! * [`doctor`] — checks of the films before a run: do they fit the room, and each other?
//! * [`foreground`] — foreground masks from one camera's pictures.
//! * [`prepared_room`] — [`prepared_room::PreparedRoom`]: a room prepared for simulation. Everything below needs one.
//! * [`observation`] — [`observation::Observation`]: one camera's observation at one time; all data of a picture that
//!   the trackers need.
//! * [`station`] — one camera's work: source → picture with its capture time → observation.
//! * [`wire`] — stations in processes of their own, on other machines.
//! * [`gathering`] — observations of all stations → moments.
//! * [`offsets`] — offsets between the cameras' clocks, estimated from the people that several cameras see.
//! * [`moment`] — [`Moment`]: input of a tracker. [`PersonEstimate`]: output of a tracker, one person at one time.
//!   Start here.
//! * [`silhouette`] — predicted silhouette of a person in a camera, occluded by the room.
//! * [`likelihood`] — likelihood of the masks for a set of people: fast counts, and a slow oracle that tests compare
//!   them with.
//! * [`identity`] — re-identification after an encounter, by appearance.
//! * [`method`] — the [`method::Method`] trait, and one folder for each published tracker behind it.
//! * [`run`] — the pipeline behind the stations: moments → method → outputs, and feedback to the stations.
//! * [`tracks`] — the track files that a run writes, and their readers.
//! * [`film`] — each camera's picture with the tracker's estimates, beside the simulated view.
//! * [`events`] — what happened: appearances, stays, crossed lines, states of cameras; counts, heat map, groups.
//! * [`view`] — the same pictures live in the browser.
//! * [`publish`] — people, events, counts and figures for other programs, while the run goes on.
//! * [`serve`] — rooms that are followed day after day, and the people who walk between them.
//! * [`plan`] — the floor plan with all trajectories.
//! * [`detect`] — detections of people in one camera's pictures: input of [`mot::link`].
//! * [`report`] — one self-contained page about a run.
//! * [`export`] — a run in the formats of other programs: MCAP, `GeoJSON`.
//! * [`cli`] — the command line: one file a subcommand.
#![forbid(unsafe_code)]

pub mod cli;
pub mod detect;
pub mod doctor;
mod error;
pub mod events;
pub mod export;
pub mod film;
pub mod foreground;
pub mod gathering;
pub mod identity;
pub mod likelihood;
pub mod method;
pub mod moment;
pub mod observation;
pub mod offsets;
pub mod plan;
pub mod prepared_room;
pub mod publish;
pub mod report;
pub mod run;
pub mod serve;
pub mod silhouette;
pub mod source;
pub mod station;
pub mod tracks;
pub mod view;
pub mod wire;

pub use error::{Error, Result};
pub use moment::{CameraFrame, Moment, PersonEstimate};
pub use mot::TrackId;
