//! Cameras from the files of `calib`: a lens as `calib intrinsics` writes it, a pose as `calib pose` does.

use std::path::Path;

use calib::Camera;
use calib::files::{matrix_from_rows, read_intrinsics, read_toml};
use nalgebra::{Isometry3, Translation3};
use serde::Deserialize;

use crate::room::RoomCamera;
use crate::{Error, Result};

/// The part of a pose file that is used; files of `calib pose` hold their residual besides.
#[derive(Deserialize)]
struct PoseInput {
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
}

/// Camera with a lens and a pose, world to camera in metres.
///
/// # Errors
/// [`Error::Calib`] when a file cannot be read or parsed, [`Error::File`] when it holds no camera or no pose.
pub fn camera(name: &str, lens: &Path, pose: &Path) -> Result<RoomCamera> {
    let intrinsics = read_intrinsics(lens)?;
    let PoseInput { rotation, translation } = read_toml(pose)?;
    let rotation = calib::rotation::from_matrix(&matrix_from_rows(&rotation))
        .map_err(|e| Error::content(pose, "rotation", e.to_string()))?;
    if !translation.iter().all(|t| t.is_finite()) {
        return Err(Error::content(pose, "translation", "a number is not finite; run `calib pose` again"));
    }
    let camera_from_world = Isometry3::from_parts(Translation3::from(translation), rotation);
    Ok(RoomCamera {
        name: name.to_owned(),
        camera: Camera { intrinsics, camera_from_world },
        reference: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_and_a_pose_make_a_camera_and_what_is_wrong_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let (lens, pose) = (folder.path().join("lens.toml"), folder.path().join("pose.toml"));
        let room = crate::exchange::test_room::room(1);
        let expected = &room.cameras[0];
        calib::files::write_intrinsics(&lens, &expected.camera.intrinsics).unwrap();
        let rotation = expected.camera.camera_from_world.rotation.to_rotation_matrix();
        let rows = calib::files::rows_of_matrix(rotation.matrix());
        let t = expected.camera.camera_from_world.translation.vector;
        let good = format!("rotation = {rows:?}\ntranslation = [{}, {}, {}]\nrms_px = 0.4\n", t.x, t.y, t.z);
        std::fs::write(&pose, &good).unwrap();
        let found = camera("door", &lens, &pose).unwrap();
        assert_eq!((found.name.as_str(), &found.camera.intrinsics), ("door", &expected.camera.intrinsics));
        let off = found.camera.camera_from_world * expected.camera.camera_from_world.inverse();
        assert!(off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-9, "{off}");
        for (content, words) in [
            (good.replace("translation = [", "translation = [nan, "), "pose.toml"),
            (
                format!("rotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\ntranslation = [{}, 0, 0]", t.x),
                "rotation",
            ),
            (good.replace(&format!("[{}, ", t.x), "[nan, "), "translation"),
            ("translation = [0, 0, 0]".to_owned(), "rotation"),
        ] {
            std::fs::write(&pose, content).unwrap();
            let line = camera("door", &lens, &pose).unwrap_err().to_string();
            assert!(line.contains("pose.toml") && line.contains(words) && !line.contains('\n'), "{line}");
        }
    }
}
