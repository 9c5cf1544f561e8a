//! Finished runs in the formats of other programs.
//!
//! * [`mcap`] — a recording for Foxglove and Rerun.
//! * [`geojson`] — zones, regions, lines and tracks for maps.

pub mod geojson;
pub mod mcap;
