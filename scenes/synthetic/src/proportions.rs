//! A person's proportions, as shares of the standing height: R. Drillis and R. Contini, "Body segment parameters"
//! (1966).

/// Height of the hips.
pub(super) const HIP: f32 = 0.53;
/// Length of the thigh.
pub(super) const THIGH: f32 = 0.245;
/// Length of the shank.
pub(super) const SHANK: f32 = 0.246;
/// Height of the ankle.
pub(super) const ANKLE: f32 = 0.039;
/// Distance from the middle to each hip joint.
pub(super) const HIP_HALF_WIDTH: f32 = 0.052;
/// Radius of the foot's capsule.
pub(super) const SOLE: f32 = 0.02;
