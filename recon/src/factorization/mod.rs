//! Motion and shape without an initial guess: the factorization method, for long sequences with gaps.
//!
//! [`affine`] factorizes a window's measurements, [`metric`] upgrades them (orthographic, paraperspective),
//! [`perspective`] iterates to the perspective camera with both depth readings. [`windows`] covers a sequence with
//! overlapping windows and chains them by absolute orientation on the points they share.

pub(crate) mod affine;
pub(crate) mod metric;
pub(crate) mod perspective;
pub(crate) mod windows;

#[cfg(test)]
mod tests;
