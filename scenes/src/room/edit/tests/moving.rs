//! A camera's other pose in a `scene.toml`, and the bytes beside it.

use nalgebra::{Isometry3, Vector3};

use super::*;

fn moved<'a>(before: &'a crate::room::RoomCamera, picture: &'a [u8]) -> MovedCamera<'a> {
    let camera_from_world = Isometry3::new(Vector3::new(0.1, -0.2, 3.0), Vector3::new(0.0, 0.1, 0.0));
    MovedCamera { before, camera_from_world, picture, ending: "png" }
}

#[test]
fn only_the_pose_and_the_reference_of_the_moved_camera_change() {
    for ends in ["\n", "\r\n"] {
        let before = SCENE.replace('\n', ends);
        let folder = room(&before);
        let camera = Room::read(folder.path()).unwrap().cameras[0].clone();
        let reference = save_moved_camera(folder.path(), &moved(&camera, b"a picture")).unwrap();
        assert_eq!(reference, Path::new("reference/cam-2.png"));
        assert_eq!(std::fs::read(folder.path().join(&reference)).unwrap(), b"a picture");
        let after = text(folder.path());
        let is_of_pose = |line: &&str| {
            ["rotation =", "translation =", "reference ="].iter().any(|key| line.starts_with(key))
        };
        let others = |text: &str| -> Vec<String> {
            text.split(ends).filter(|line| !is_of_pose(line)).map(str::to_owned).collect()
        };
        assert_eq!(others(&after), others(&before));
        let now = Room::read(folder.path()).unwrap().cameras[0].clone();
        let expected = moved(&camera, b"").camera_from_world;
        let off = (now.camera.camera_from_world.to_homogeneous() - expected.to_homogeneous()).amax();
        assert!(off < 1e-11, "{off:e}");
        assert_eq!(
            (now.camera.intrinsics, now.reference),
            (camera.camera.intrinsics.clone(), Some(reference))
        );

        // The second time: the picture has another name again, and what the file has by then counts.
        let said = save_moved_camera(folder.path(), &moved(&camera, b"")).unwrap_err().to_string();
        assert!(said.contains("camera `cam`") && said.contains("meanwhile"), "{said}");
        assert_eq!(text(folder.path()), after);
    }
}

#[test]
fn a_camera_in_a_list_of_values_is_moved_too() {
    let scene = "format = 1\ncamera = [{ name = \"a\", width = 6, height = 4, matrix = [[5, 0, 3], [0, 5, 2], [0, 0, 1]], \
                 rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], translation = [0, 0, 1], reference = \"a.jpg\" }]\n";
    let folder = room(scene);
    std::fs::write(folder.path().join("a-2.png"), "taken").unwrap();
    let camera = Room::read(folder.path()).unwrap().cameras[0].clone();
    let reference = save_moved_camera(folder.path(), &moved(&camera, b"b")).unwrap();
    assert_eq!(reference, Path::new("a-3.png"));
    assert_eq!(std::fs::read(folder.path().join("a-2.png")).unwrap(), b"taken");
    let now = Room::read(folder.path()).unwrap().cameras[0].clone();
    assert!((now.camera.camera_from_world.translation.z - 3.0).abs() < 1e-12);
}
