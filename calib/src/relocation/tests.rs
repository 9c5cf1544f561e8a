//! Synthetic sightings, whose pose is known.
