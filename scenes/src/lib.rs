//! The room model: a room's geometry, its cameras, the walkable floor and the zones where people enter and leave.
//!
//! A *room* is a directory (`scene.toml` and its geometry) that `recon build` makes, a person may write by hand,
//! and everything else reads. Data flows down this list:
//!
//! * [`room`] — [`room::Room`]: cameras, zones, floor and geometry, read from and written to disk. Start here.
//! * [`geometry`] — triangles or oriented discs, PLY in and out; [`polygon`] — regions of the floor.
//! * [`raycast`] — [`raycast::RayScene`]: rays against the geometry; [`depth`] — depth maps of the empty room.
//! * [`exchange`] — rooms from and for other programs: COLMAP, nerfstudio.
//! * [`floor`] — the plane of the floor and the world frame that stands on it, found among surfaces.
//! * [`walkable`] — [`walkable::WalkableMap`]: the floor on which a person can stand.
//! * [`view`] — the room seen from anywhere, with people in it; [`plan`] — its floor plan.
//! * [`space`] — the room in 3-D on a page.
//! * [`editor`] — the page on which people draw zones.
//! * [`cache`] — files of computed results beside a room.
//! * [`cli`] — the command line: one file a subcommand.
#![forbid(unsafe_code)]

pub mod cache;
pub mod cli;
pub mod depth;
pub mod editor;
mod error;
pub mod exchange;
pub mod floor;
pub mod geometry;
pub mod plan;
pub mod polygon;
pub mod raycast;
pub mod room;
pub mod space;
pub mod view;
mod visibility;
pub mod walkable;

pub use error::{Error, Result};
