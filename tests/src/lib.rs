//! Shared parts of the end-to-end tests and the benchmarks: paths of the data, and errors of results against the truth.
//!
//! * [`data`] — the office shipped beside this crate, the larger data sets where available, the programs.
//! * [`chain`] — the programs, run as a person runs them, with measurements.
//! * [`office_room`] — the office's room, built once for all tests.
//! * [`crossing_boxes`] — boxes of people who pass each other in one picture, for linking.
//! * [`events`] — events against those of true paths, at regions and lines in any room.
//! * [`filmed_lens`] — captures as another lens would have filmed them.
//! * [`hall`] — a synthetic hall with true heads, for the head tracker's experiments.
//! * [`folder_files`] — all files below a folder.
//! * [`full_disk`] — commands whose files cannot grow beyond some bytes.
//! * [`kills`] — programs that are killed at random moments, and what they leave.
//! * [`mask_recording`] — exact masks of synthetic people in the files that `tracker run` reads.
//! * [`mix_ups`] — films of synthetic rooms with one of the usual mix-ups, for the check before a run.
//! * [`project`] — a synthetic room's captures, as `recon build` takes them.
//! * [`spoilt`] — the same with one of the usual mistakes, for the verdict of a build.
//! * [`readers`] — readers of files and packets, with something good for each to read.
//! * [`relocation`] — pictures of cameras that have been bumped, with their true poses.
//! * [`network_camera`] — a fake network camera with a clock, losses and faults of its own.
//! * [`live`] — scenarios of live input, with figures of a run on such cameras.
//! * [`board`] — a calibration board, drawn into pictures.
//! * [`broker`] — a real MQTT broker, and a subscriber.
//! * [`turned_camera`] — a run in which a camera turns.
//! * [`watched_room`] — hours before a camera that nobody touches.
//! * [`accuracy`] — errors of camera motion, of a finished room and of its depth, against ground truth.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod board;
pub mod broker;
pub mod chain;
pub mod crossing_boxes;
pub mod data;
pub mod events;
pub mod filmed_lens;
pub mod folder_files;
pub mod full_disk;
pub mod hall;
pub mod kills;
pub mod live;
pub mod mask_recording;
pub mod mix_ups;
pub mod network_camera;
pub mod office_room;
pub mod project;
pub mod readers;
pub mod relocation;
pub mod spoilt;
pub mod turned_camera;
pub mod watched_room;
