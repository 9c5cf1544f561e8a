//! Options of dense stereo.

use serde::{Deserialize, Serialize};

/// Options of dense stereo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DenseOptions {
    /// Number of key frames besides the reference.
    pub key_frames: usize,
    /// Number of views that a key frame itself is compared with, at most 8.
    pub sources: usize,
    /// Least share of the reference's sparse points that a key frame must see.
    pub least_shared_view: f64,
    /// Largest median angle between its and the reference's rays to the points, degrees.
    pub largest_parallax_deg: f64,
    /// Number of views, the best ones, that decide a hypothesis's cost.
    pub best_views: usize,
    /// Excess of a hypothesis's cost over the best so far, in the most informative views, above which the others are
    /// skipped.
    pub catching_up: f32,
    /// Difference in grey levels at which a neighbour's weight in a patch falls to 1/e.
    pub color_sigma: f32,
    /// Number of halvings of the images for the first rounds, from random hypotheses: at least one.
    pub halvings: usize,
    /// Rounds of propagation: at the smallest size, from random hypotheses; at each larger one up to half; at full size with the
    /// other views' depths known (with 0 rounds there, the planes of half size are only compared at full size).
    pub iterations: [usize; 3],
    /// Least number of key frames that must agree with a reliable depth …
    pub least_agreeing: usize,
    /// … the largest distance at which they agree, pixels of the reference image …
    pub agreement_px: f32,
    /// … and the largest cost of its patch: 1 − NCC, geometric disagreement included.
    pub largest_cost: f32,
    /// Whether surfaces seen only by key frames are added to the room.
    pub fuse_key_frames: bool,
    /// Seed of the random hypotheses; a build takes that of [`crate::pipeline::BuildOptions`].
    #[serde(skip)]
    pub seed: u64,
}

impl Default for DenseOptions {
    fn default() -> Self {
        Self {
            key_frames: 8,
            sources: 5,
            least_shared_view: 0.6,
            largest_parallax_deg: 35.0,
            best_views: 4,
            catching_up: 0.1,
            color_sigma: 10.0,
            halvings: 2,
            iterations: [3, 1, 2],
            least_agreeing: 2,
            agreement_px: 1.0,
            largest_cost: 0.6,
            fuse_key_frames: true,
            seed: 0,
        }
    }
}

impl DenseOptions {
    /// Options for a first look: fewer key frames and views, and planes found at half size only compared at full size.
    pub fn draft() -> Self {
        Self {
            key_frames: 5,
            sources: 4,
            best_views: 3,
            iterations: [3, 1, 0],
            fuse_key_frames: false,
            ..Self::default()
        }
    }

    /// Number of halvings of the smallest images.
    pub(super) fn most_halvings(&self) -> usize {
        self.halvings.max(1)
    }
}
