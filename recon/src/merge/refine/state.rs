//! Parameters of the joint refinement: the cameras' similarities and the picked points, as one vector.

use nalgebra::{DVector, Point3, SMatrix, Similarity3, Translation3, UnitQuaternion, Vector3};

/// Number of parameters of a camera.
pub(super) const POSE: usize = 7;
/// Number of parameters of a point.
pub(super) const POINT: usize = 3;

/// Derivatives of a residual by a pose: a row for each component.
pub(super) type ByCamera = SMatrix<f64, 2, POSE>;
/// Derivatives of a residual by a point.
pub(super) type ByPoint = SMatrix<f64, 2, POINT>;

/// Present cameras and points.
#[derive(Clone)]
pub(super) struct RefinementState {
    /// Similarities from each camera's own frame into the common one.
    pub(super) poses: Vec<Similarity3<f64>>,
    /// Points in the common frame; `None` for a point that was left out.
    pub(super) points: Vec<Option<Point3<f64>>>,
}

impl RefinementState {
    /// State after a step of all parameters.
    pub(super) fn moved(&self, by: &DVector<f64>) -> Self {
        let poses = self
            .poses
            .iter()
            .enumerate()
            .map(|(i, pose)| {
                let moved = |at: usize| move_pose(pose, &std::array::from_fn(|k| by[at + k]));
                pose_at(i).map_or(*pose, moved)
            })
            .collect();
        let points = self
            .points
            .iter()
            .enumerate()
            .map(|(i, point)| {
                let at = self.point_at(i);
                point.map(|p| p + Vector3::new(by[at], by[at + 1], by[at + 2]))
            })
            .collect();
        Self { poses, points }
    }

    /// Number of parameters.
    pub(super) fn parameters(&self) -> usize {
        self.point_at(self.points.len())
    }

    /// Index of a point's first parameter.
    pub(super) fn point_at(&self, point: usize) -> usize {
        (self.poses.len() - 1) * POSE + point * POINT
    }
}

/// Index of a camera's first parameter; `None` for the first camera, which is fixed.
pub(super) fn pose_at(camera: usize) -> Option<usize> {
    camera.checked_sub(1).map(|moving| moving * POSE)
}

/// Similarity after a step: scale, rotation about the camera's own centre, translation.
fn move_pose(pose: &Similarity3<f64>, delta: &[f64; POSE]) -> Similarity3<f64> {
    let [scale, rx, ry, rz, tx, ty, tz] = *delta;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz)) * pose.isometry.rotation;
    let translation = pose.isometry.translation.vector + Vector3::new(tx, ty, tz);
    Similarity3::from_parts(Translation3::from(translation), rotation, pose.scaling() * scale.exp())
}
