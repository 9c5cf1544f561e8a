//! Camera motion of one capture against its true poses, after alignment: the estimate's frame and scale are free.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Residual of the best similarity between estimated and true motion.
#[derive(Debug, Clone, Copy)]
pub struct MotionError {
    /// Root mean square distance between camera centres, centimetres.
    pub position_rms_cm: f64,
    /// Root mean square angle between orientations, degrees.
    pub rotation_rms_deg: f64,
    /// Frames that have an estimate.
    pub frames: usize,
}

/// Aligns by rotations, then by centres (scale and shift), and measures. `None` for fewer than three frames.
///
/// Rotations first, because the centres of a short hand-held path hardly fix a rotation.
pub fn motion(estimated: &[Option<Isometry3<f64>>], truth: &[Isometry3<f64>]) -> Option<MotionError> {
    let pairs: Vec<(Isometry3<f64>, &Isometry3<f64>)> =
        estimated.iter().zip(truth).filter_map(|(e, t)| Some(((*e)?, t))).collect();
    if pairs.len() < 3 {
        return None;
    }
    // true_from_estimated = R_true⁻¹ R_estimated in every frame; their chordal mean is the sum projected onto SO(3).
    let sum: Matrix3<f64> =
        pairs.iter().map(|(e, t)| *(t.rotation.inverse() * e.rotation).to_rotation_matrix().matrix()).sum();
    let mean = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&sum));

    let center = |pose: &Isometry3<f64>| pose.inverse() * Point3::origin();
    let from: Vec<Vector3<f64>> = pairs.iter().map(|(e, _)| mean * center(e).coords).collect();
    let to: Vec<Vector3<f64>> = pairs.iter().map(|(_, t)| center(t).coords).collect();
    let n = pairs.len() as f64;
    let (from_mean, to_mean) = (from.iter().sum::<Vector3<f64>>() / n, to.iter().sum::<Vector3<f64>>() / n);
    let along: f64 = from.iter().zip(&to).map(|(f, t)| (f - from_mean).dot(&(t - to_mean))).sum();
    let spread: f64 = from.iter().map(|f| (f - from_mean).norm_squared()).sum();
    let scale = along / spread;

    let position: f64 =
        from.iter().zip(&to).map(|(f, t)| ((f - from_mean) * scale - (t - to_mean)).norm_squared()).sum();
    let rotation: f64 = pairs
        .iter()
        .map(|(e, t)| (t.rotation.inverse() * e.rotation).angle_to(&mean).to_degrees().powi(2))
        .sum();
    Some(MotionError {
        position_rms_cm: 100.0 * (position / n).sqrt(),
        rotation_rms_deg: (rotation / n).sqrt(),
        frames: pairs.len(),
    })
}

/// True poses (`camera_from_world`) of one camera's capture, from a data set's `truth.json`.
pub fn capture_truth(truth_json: &Path, camera: &str) -> Option<Vec<Isometry3<f64>>> {
    camera_truth(truth_json, camera)?["capture"].as_array()?.iter().map(pose).collect()
}

/// True pose (`camera_from_world`) of one installed camera, from a data set's `truth.json`.
pub fn installed_truth(truth_json: &Path, camera: &str) -> Option<Isometry3<f64>> {
    pose(&camera_truth(truth_json, camera)?)
}

fn camera_truth(truth_json: &Path, camera: &str) -> Option<serde_json::Value> {
    let text = std::fs::read_to_string(truth_json).ok()?;
    let mut truth: serde_json::Value = serde_json::from_str(&text).ok()?;
    Some(truth["cameras"][camera].take())
}

/// `R` row by row, and `t`.
fn pose(value: &serde_json::Value) -> Option<Isometry3<f64>> {
    let number = |v: &serde_json::Value| v.as_f64();
    let mut rotation = Matrix3::zeros();
    for (index, entry) in rotation.iter_mut().enumerate() {
        *entry = number(&value["R"][index % 3][index / 3])?; // nalgebra iterates column by column
    }
    let t = Vector3::new(number(&value["t"][0])?, number(&value["t"][1])?, number(&value["t"][2])?);
    let rotation = calib::rotation::from_matrix(&rotation).ok()?;
    Some(Isometry3::from_parts(Translation3::from(t), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path() -> Vec<Isometry3<f64>> {
        (0..20)
            .map(|i| {
                let s = i as f64 * 0.3;
                Isometry3::new(
                    Vector3::new(s.sin(), 0.4 * s.cos(), 0.1 * s),
                    Vector3::new(0.02 * s, -0.05 * s, 0.1),
                )
            })
            .collect()
    }

    #[test]
    fn another_frame_and_scale_is_no_error() {
        let truth = path();
        let estimated_from_true = Isometry3::new(Vector3::new(3.0, -1.0, 2.0), Vector3::new(0.5, 1.0, -0.2));
        let estimated: Vec<_> = truth
            .iter()
            .map(|pose| {
                let mut moved = pose * estimated_from_true.inverse();
                moved.translation.vector *= 7.0;
                Some(moved)
            })
            .collect();
        let error = motion(&estimated, &truth).unwrap();
        assert!(error.position_rms_cm < 1e-6 && error.rotation_rms_deg < 1e-6, "{error:?}");
    }

    #[test]
    fn a_known_disturbance_is_measured() {
        let truth = path();
        let mut estimated: Vec<_> = truth.iter().copied().map(Some).collect();
        // One frame of twenty turned by 2°: rms 2/√20, less the little that the mean follows.
        let turn = Isometry3::rotation(Vector3::z() * 2.0_f64.to_radians());
        estimated[7] = estimated[7].map(|pose| turn * pose);
        let error = motion(&estimated, &truth).unwrap();
        assert!((error.rotation_rms_deg - 2.0 / 20.0_f64.sqrt()).abs() < 0.02, "{error:?}");
        assert!(motion(&estimated[..2], &truth[..2]).is_none());
    }
}
