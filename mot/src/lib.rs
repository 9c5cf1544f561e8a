//! Multiple object tracking after the fact: the files in which tracks stand, their evaluation against the truth, and the
//! linking of a whole recording's detections. Works on numbers alone: no pictures, no cameras, no OpenCV.
//!
//! * [`rows`] — MOTChallenge rows, boxes in an image or places on the floor. Start here.
//! * [`jsonl`] — `tracks.jsonl`: a line a frame, with all estimates of each person.
//! * [`count`] — probability distribution of the number of people.
//! * [`link`] — tracks of least total cost from a whole recording's detections.
//! * [`eval`] — evaluation of tracks against the truth: CLEAR MOT, identity, HOTA, position error.
//! * [`histogram`] — histograms of colours, by which detections and people are compared.
//! * [`white_noise_acceleration`] — the motion model between two sightings.
//! * [`chart`] — line charts.
//! * [`cli`] — the commands `tracker eval` and `tracker link`.
#![forbid(unsafe_code)]

mod camera_state;
pub mod chart;
pub mod cli;
pub mod count;
mod error;
pub mod eval;
pub mod histogram;
pub mod jsonl;
pub mod link;
pub mod rows;
mod track_id;
pub mod white_noise_acceleration;

pub use camera_state::CameraState;
pub use error::{Error, Result};
pub use track_id::TrackId;
