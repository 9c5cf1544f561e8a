//! Follows every person in a room, in metres on its floor, from fixed calibrated cameras.
//!
//! Data flows down this list, one moment (the observations of all cameras at one time) after the other:
//!
//! * [`source`] — videos, folders of images, streams and ready-made masks, matched with the room's cameras; capture times.
//! * [`foreground`] — from one camera's pictures to foreground masks.
//! * [`stage`] — [`stage::Stage`]: a room made ready for simulation. Everything below needs one.
//! * [`observation`] — [`observation::Observation`]: what one camera saw at one time; all that the trackers need of a picture.
//! * [`station`] — one camera's work, alone: source → picture with its capture time → observation.
//! * [`wire`] — stations in processes of their own, on other machines.
//! * [`gathering`] — observations of all stations → moments.
//! * [`offsets`] — the offsets between the cameras' clocks, from the people that several cameras see.
//! * [`moment`] — [`Moment`]: what a tracker is given. [`PersonEstimate`]: a person at one time; what a tracker gives back.
//!   Start here.
//! * [`silhouette`] — what a person would look like to a camera, cut by what the room hides.
//! * [`likelihood`] — how well a set of people explains the masks: fast counts, and the slow oracle they are held to.
//! * [`offsets`] — how far the cameras' clocks are apart, estimated from the people whom several of them see.
//! * [`identity`] — who is who after an encounter, by what people look like.
//! * [`method`] — the [`method::Method`] trait, and one folder for each published tracker behind it.
//! * [`run`] — the pipeline behind the stations: moments → method → outputs, and feedback to the stations.
//! * [`tracks`] — the files of tracks that a run writes, and their readers.
//! * [`film`] — what each camera saw, with what the tracker believes, beside the simulated view.
//! * [`view`] — the same in the browser, while the run goes on.
//! * [`plan`] — the floor plan with everybody's way on it.
//! * [`detect`] — people in one camera's pictures: what is linked where nobody else detects them.
//! * [`link`] — a whole recording's detections to the tracks of least total cost.
//! * [`eval`] — tracks against the truth: CLEAR MOT, identity, HOTA, position error.
//! * [`chart`] — line charts.
//! * [`report`] — one self-contained page about a run.
#![forbid(unsafe_code)]

pub mod chart;
pub mod detect;
mod error;
pub mod eval;
pub mod film;
pub mod foreground;
pub mod gathering;
pub mod identity;
pub mod likelihood;
pub mod link;
pub mod method;
pub mod moment;
pub mod observation;
pub mod offsets;
pub mod plan;
pub mod report;
pub mod run;
pub mod silhouette;
pub mod source;
pub mod stage;
pub mod station;
pub mod tracks;
pub mod view;
pub mod wire;

pub use error::{Error, Result};
pub use moment::{CameraFrame, Moment, PersonEstimate, TrackId};
