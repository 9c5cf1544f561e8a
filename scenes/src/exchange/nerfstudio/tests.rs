//! Cameras there and back, lenses in each of their forms, and what is refused.

use super::*;
use crate::exchange::test_room;
use nalgebra::{Point3, Vector4};

#[test]
fn points_fall_where_the_room_sees_them() {
    let room = test_room::room(1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    write(&path, &room).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    let place = Point3::new(3.0, 2.5, 0.4);
    for (frame, entry) in file["frames"].as_array().unwrap().iter().zip(&room.cameras) {
        let number = |key: &str| frame[key].as_f64().unwrap();
        let rows = &frame["transform_matrix"];
        let world_from_camera = Matrix4::from_fn(|r, c| rows[r][c].as_f64().unwrap());
        let p = world_from_camera.try_inverse().unwrap() * Vector4::new(place.x, place.y, place.z, 1.0);
        // OpenGL looks along −z, with y up.
        let u = number("fl_x") * p.x / -p.z + number("cx") - 0.5;
        let v = number("fl_y") * p.y / p.z + number("cy") - 0.5;
        let expected = entry.camera.project(&place).unwrap();
        assert!((u - expected.x).abs() < 1e-6 && (v - expected.y).abs() < 1e-6, "{u} {v} {expected}");
        assert_eq!(frame["file_path"], format!("{}.jpg", entry.name));
    }
}

#[test]
fn cameras_come_back() {
    let mut room = test_room::room(2);
    room.cameras[1].camera.intrinsics.distortion = [-0.2, 0.1, 1e-3, -2e-3, 0.05].into();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    write(&path, &room).unwrap();
    let found = read(&path).unwrap();
    assert_eq!(found.len(), 2);
    for (f, e) in found.iter().zip(&room.cameras) {
        let (a, b) = (&f.camera.intrinsics, &e.camera.intrinsics);
        assert_eq!((&f.name, a.width, a.height, a.distortion), (&e.name, b.width, b.height, b.distortion));
        assert!((a.matrix() - b.matrix()).norm() < 1e-9);
        let off = f.camera.camera_from_world * e.camera.camera_from_world.inverse();
        assert!(off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-7, "{off}");
    }
}

/// One lens for all frames; a camera 2 up that looks along the world's y.
const SHARED: &str = r#"{"camera_model": "PINHOLE", "w": 64, "h": 48, "fl_x": 60, "cx": 32, "cy": 24, "frames": [
    {"file_path": "images/left.png", "transform_matrix": [[1,0,0,0],[0,0,-1,0],[0,1,0,2],[0,0,0,1]]}]}"#;

#[test]
fn one_lens_for_all_frames_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    std::fs::write(&path, SHARED).unwrap();
    let cameras = read(&path).unwrap();
    assert_eq!(cameras[0].name, "left");
    let pixel = cameras[0].camera.project(&Point3::new(0.5, 3.0, 2.1)).unwrap();
    // 0.5 to the right and 0.1 up, 3 away.
    assert!((pixel.x - 41.5).abs() < 1e-9 && (pixel.y - 21.5).abs() < 1e-9, "{pixel}");
}

#[test]
fn a_frames_distortion_parameters_come_first() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    let lens = |more: &str| {
        let from = "\"transform_matrix\"";
        std::fs::write(&path, SHARED.replace(from, &format!("{more}, {from}"))).unwrap();
        read(&path).map(|cameras| cameras[0].camera.intrinsics.distortion.into()).map_err(|e| e.to_string())
    };
    let params = "\"distortion_params\": [-0.2, 0.05, 0.01, 0.0, 0.001, -0.002]";
    let expected: [f64; 5] = [-0.2, 0.05, 0.001, -0.002, 0.01];
    assert_eq!(lens(params), Ok(expected));
    assert_eq!(lens(&format!("{params}, \"k1\": 0.7")), Ok(expected));
    assert!(lens("\"distortion_params\": [0, 0, 0, 0.1, 0, 0]").unwrap_err().contains("`k4`"));
    assert!(lens("\"distortion_params\": [0.1, 0.2]").unwrap_err().contains("2 numbers"));
    // A frame's own numbers replace those for all frames as a whole.
    std::fs::write(&path, SHARED.replace("\"w\": 64", &format!("{params}, \"w\": 64"))).unwrap();
    let found = <[f64; 5]>::from(read(&path).unwrap()[0].camera.intrinsics.distortion);
    assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits));
}

#[test]
fn keys_that_change_the_lens_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    for (key, is_refused) in [
        ("\"is_fisheye\": true", true),
        ("\"is_fisheye\": false", false),
        ("\"is_latlong\": true", true),
        ("\"ftheta_p0\": 0.1", true),
        ("\"ftheta_p0\": 0", false),
        ("\"k5\": 0.001", true),
        ("\"k6\": 0.0", false),
        ("\"s1\": 1e-3", true),
        ("\"camera_model\": \"EQUIRECTANGULAR\"", true),
        ("\"camera_model\": \"OPENCV\"", false),
        ("\"rolling_shutter\": [0, 0, 0, 0.02]", true),
        ("\"sharpness\": 12.5", false),
        ("\"aabb_scale\": 16", false),
    ] {
        for from in ["\"w\": 64", "\"transform_matrix\""] {
            let text = SHARED
                .replace("\"camera_model\": \"PINHOLE\", ", "")
                .replace(from, &format!("{key}, {from}"));
            std::fs::write(&path, text).unwrap();
            let found = read(&path).map_err(|e| e.to_string());
            assert_eq!(found.is_err(), is_refused, "{key}: {found:?}");
            let name = key.split('"').nth(1).unwrap();
            assert!(found.err().is_none_or(|line| line.contains(name) && !line.contains('\n')), "{key}");
        }
    }
}

#[test]
fn defects_of_transforms_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    for (from, to, words) in [
        ("PINHOLE", "OPENCV_FISHEYE", &["camera_model", "OPENCV_FISHEYE"][..]),
        ("\"w\": 64", "\"w\": 64.5", &["frame 1", "left.png", "`w`"]),
        ("\"w\": 64,", "", &["frame 1", "`w` is missing"]),
        ("\"fl_x\": 60", "\"fl_x\": -60", &["frame 1", "positive"]),
        ("\"cy\": 24", "\"cy\": 24, \"k4\": 0.1", &["frame 1", "`k4`"]),
        ("[0,0,-1,0]", "[0,0,-1]", &["frame 1", "4 numbers"]),
        ("[0,0,-1,0]", "[0,0,-2,0]", &["frame 1", "transform_matrix"]),
        ("[0,0,0,1]", "[0,0,0,2]", &["frame 1", "0 0 0 1"]),
        ("[0,1,0,2]", "[0,1,0,\"2\"]", &["line 2", "no transforms.json"]),
        ("\"frames\"", "\"pictures\"", &["line", "`frames`"]),
    ] {
        assert!(SHARED.contains(from), "{from}");
        std::fs::write(&path, SHARED.replace(from, to)).unwrap();
        let line = read(&path).unwrap_err().to_string();
        assert!(words.iter().all(|word| line.contains(word)) && !line.contains('\n'), "{line}");
    }
    std::fs::write(&path, "{\"frames\": []}").unwrap();
    assert!(read(&path).unwrap_err().to_string().contains("no camera"));
    assert!(read(&folder.path().join("nowhere.json")).unwrap_err().to_string().contains("nowhere"));
}
