//! What the joint refinement moves: the cameras' similarities and the picked points, as one vector of parameters.

use nalgebra::{DVector, Point3, Similarity3, Translation3, UnitQuaternion, Vector3};

/// Parameters a camera.
pub(super) const POSE: usize = 7;
/// Parameters a point.
pub(super) const POINT: usize = 3;

/// Cameras and points as they are now.
pub(super) struct State {
    /// From each camera's own frame into the common one.
    pub(super) poses: Vec<Similarity3<f64>>,
    /// In the common frame; `None` for a point that was left out.
    pub(super) points: Vec<Option<Point3<f64>>>,
}

impl State {
    /// All parameters moved.
    pub(super) fn moved(&self, by: &DVector<f64>) -> Self {
        let cameras = self.poses.len();
        let poses = self
            .poses
            .iter()
            .enumerate()
            .map(|(i, pose)| {
                if i == 0 {
                    return *pose;
                }
                let at = (i - 1) * POSE;
                move_pose(pose, &std::array::from_fn(|k| by[at + k]))
            })
            .collect();
        let points = self
            .points
            .iter()
            .enumerate()
            .map(|(i, point)| {
                let at = (cameras - 1) * POSE + i * POINT;
                point.map(|p| p + Vector3::new(by[at], by[at + 1], by[at + 2]))
            })
            .collect();
        Self { poses, points }
    }

    /// One parameter moved.
    pub(super) fn nudged(&self, parameter: usize, by: f64) -> Self {
        let mut moved = Self { poses: self.poses.clone(), points: self.points.clone() };
        let poses = (self.poses.len() - 1) * POSE;
        if parameter < poses {
            let mut delta = [0.0; POSE];
            delta[parameter % POSE] = by;
            let camera = 1 + parameter / POSE;
            moved.poses[camera] = move_pose(&self.poses[camera], &delta);
        } else if let Some(point) = &mut moved.points[(parameter - poses) / POINT] {
            point[(parameter - poses) % POINT] += by;
        }
        moved
    }
}

/// Scale, rotation about the camera's own centre, translation.
fn move_pose(pose: &Similarity3<f64>, delta: &[f64; POSE]) -> Similarity3<f64> {
    let [scale, rx, ry, rz, tx, ty, tz] = *delta;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz)) * pose.isometry.rotation;
    let translation = pose.isometry.translation.vector + Vector3::new(tx, ty, tz);
    Similarity3::from_parts(Translation3::from(translation), rotation, pose.scaling() * scale.exp())
}
