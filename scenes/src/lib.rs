//! The room model: what stands in a room, where its cameras are, where people can walk and come in.
//!
//! A *room* is a directory (`scene.toml` and its geometry) that `recon build` makes, a person may write by hand,
//! and everything else reads. Data flows down this list:
//!
//! * [`room`] — [`room::Room`]: cameras, zones, floor and geometry, read from and written to disk. Start here.
//! * [`geometry`] — triangles or oriented discs, PLY in and out; [`polygon`] — regions of the floor.
//! * [`raycast`] — [`raycast::RayScene`]: rays against the geometry; [`depth`] — what a camera sees of the empty room.
//! * [`exchange`] — rooms from and for other programs: COLMAP, nerfstudio.
//! * [`walkable`] — [`walkable::WalkableMap`]: where a person can stand.
//! * [`canvas`] — the one place that draws: shapes and text over pictures; [`view`] — the room seen from anywhere,
//!   with people in it; [`plan`] — its floor plan.
//! * [`loopback`] — pages that a program serves to its own machine; [`editor`] — that on which people draw zones.
//! * [`cache`] — what is worked out once and kept beside a room.
//! * [`synthetic`] — seeded rooms and walking people with everything known about them, for tests.
#![forbid(unsafe_code)]

pub mod cache;
pub mod canvas;
pub mod depth;
pub mod editor;
mod error;
pub mod exchange;
pub mod geometry;
pub mod loopback;
pub mod plan;
pub mod polygon;
pub mod raycast;
pub mod room;
mod sight;
pub mod synthetic;
pub mod view;
pub mod walkable;

pub use error::{Error, Result};
