//! Cameras there and back, lenses in each of their forms, and what is refused.

use super::*;
use crate::exchange::{Selection, test_room};
use calib::{Fisheye, Rational};
use nalgebra::{Matrix4, Point3, Vector4};

/// The cameras of a file.
fn read(path: &Path) -> Result<Vec<RoomCamera>> {
    let model = super::read(path, &ModelOptions::default())?;
    Ok(model.cameras.into_iter().map(|camera| camera.entry).collect())
}

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
        read(&path)
            .map(|cameras| cameras[0].camera.intrinsics.distortion.coefficients())
            .map_err(|e| e.to_string())
    };
    let params = "\"distortion_params\": [-0.2, 0.05, 0.01, 0.0, 0.001, -0.002]";
    let expected = vec![-0.2, 0.05, 0.001, -0.002, 0.01];
    assert_eq!(lens(params), Ok(expected.clone()));
    assert_eq!(lens(&format!("{params}, \"k1\": 0.7")), Ok(expected.clone()));
    assert!(lens("\"distortion_params\": [0, 0, 0, 0.1, 0, 0]").unwrap_err().contains("`k4`"));
    assert!(lens("\"distortion_params\": [0.1, 0.2]").unwrap_err().contains("2 numbers"));
    // A frame's own numbers replace those for all frames as a whole.
    std::fs::write(&path, SHARED.replace("\"w\": 64", &format!("{params}, \"w\": 64"))).unwrap();
    assert_eq!(read(&path).unwrap()[0].camera.intrinsics.distortion.coefficients(), expected);
}

#[test]
fn a_fisheye_is_read_with_its_four_numbers_and_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    let text = SHARED.replace("PINHOLE", "OPENCV_FISHEYE");
    let with = |more: &str| {
        let from = "\"transform_matrix\"";
        std::fs::write(&path, text.replace(from, &format!("{more}, {from}"))).unwrap();
        read(&path).map_err(|e| e.to_string())
    };
    let cameras = with("\"k1\": -0.02, \"k2\": 0.004, \"k3\": -0.001, \"k4\": 0.0003").unwrap();
    let lens = cameras[0].camera.intrinsics.distortion;
    assert_eq!(lens, Fisheye::from([-0.02, 0.004, -0.001, 0.0003]).into());
    // Both ways of writing the numbers are the same lens, and no numbers are the equidistant one.
    let listed = with("\"distortion_params\": [-0.02, 0.004, -0.001, 0.0003, 0, 0]").unwrap();
    assert_eq!(listed[0].camera.intrinsics.distortion, lens);
    assert_eq!(with("\"k1\": 0").unwrap()[0].camera.intrinsics.distortion, Fisheye::from([0.0; 4]).into());
    assert!(with("\"k1\": 0.1, \"p2\": 0.1").unwrap_err().contains("`p2`"));

    // Beside an ordinary lens each frame has its own model.
    let mut room = test_room::room(2);
    room.cameras[1].camera.intrinsics.distortion = lens;
    write(&path, &room).unwrap();
    let back = read(&path).unwrap();
    for (found, entry) in back.iter().zip(&room.cameras) {
        assert_eq!(found.camera.intrinsics.distortion, entry.camera.intrinsics.distortion);
    }
    room.cameras[1].camera.intrinsics.distortion =
        Rational::from([0.1, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0]).into();
    assert!(write(&path, &room).unwrap_err().to_string().contains("COLMAP"));
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
        ("PINHOLE", "FISHEYE624", &["camera_model", "FISHEYE624"][..]),
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

/// Reads the file with options.
fn read_with(path: &Path, text: &str, options: &ModelOptions) -> std::result::Result<Model, String> {
    std::fs::write(path, text).unwrap();
    super::read(path, options).map_err(|e| e.to_string())
}

#[test]
fn angles_of_view_are_focal_lengths_and_the_picture_tells_its_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms_train.json");
    // As NeRF's synthetic scenes are: no size, no principal point, no extension.
    let text = r#"{"camera_angle_x": 0.6911112070083618, "frames": [{"file_path": "./train/r_0", "rotation": 0.01,
        "transform_matrix": [[1,0,0,0],[0,0,-1,0],[0,1,0,2],[0,0,0,1]]}]}"#;
    let said = read_with(&path, text, &ModelOptions::default()).unwrap_err();
    assert!(said.contains("`w` is missing") && said.contains("--images"), "{said}");
    std::fs::create_dir(folder.path().join("train")).unwrap();
    image::RgbImage::new(80, 60).save(folder.path().join("train/r_0.png")).unwrap();
    let lens = |text: &str| {
        let model = read_with(&path, text, &ModelOptions::default())?;
        Ok(model.cameras[0].entry.camera.intrinsics.clone())
    };
    let found: std::result::Result<_, String> = lens(text);
    // The published scenes' focal length is 1111.111 px at 800 px: 0.5 · 800 / tan(0.5 · 0.6911…).
    let found = found.unwrap();
    assert!((found.fx - 111.111_03).abs() < 1e-4 && (found.fx - found.fy).abs() < 1e-12, "{found:?}");
    assert_eq!((found.width, found.height, found.cx, found.cy), (80, 60, 39.5, 29.5));
    let both =
        lens(&text.replace("\"frames\"", "\"camera_angle_y\": 1.5707963267948966, \"frames\"")).unwrap();
    assert!((both.fy - 30.0).abs() < 1e-9 && (both.fx - found.fx).abs() < 1e-12, "{both:?}");
    let said = lens(&text.replace("0.6911112070083618", "39.6")).unwrap_err();
    assert!(said.contains("`camera_angle_x` is 39.6") && said.contains("radians"), "{said}");
    // A focal length outweighs the angle; a frame's own lens that of the file.
    let own =
        text.replace("\"rotation\": 0.01", "\"fl_x\": 70, \"cx\": 41, \"cy\": 29, \"w\": 90, \"h\": 50");
    let own = lens(&own).unwrap();
    assert_eq!((own.width, own.height, own.fx, own.fy, own.cx), (90, 50, 70.0, 70.0, 40.5));
}

#[test]
fn equal_file_names_in_several_folders_are_two_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    let frame = SHARED[SHARED.find("{\"file_path\"").unwrap()..SHARED.rfind(']').unwrap()].to_owned();
    let text = SHARED.replace(
        &frame,
        &format!("{frame}, {}, {}", frame.replace("images/", "rear/"), frame.replace("left", "mid")),
    );
    let names = |entries: &[&str]| {
        let selection = Selection { entries: entries.iter().map(|e| (*e).to_owned()).collect() };
        let model = read_with(&path, &text, &ModelOptions { selection, ..ModelOptions::default() })?;
        Ok(model.cameras.into_iter().map(|c| (c.entry.name, c.picture)).collect::<Vec<_>>())
    };
    let named = |name: &str, picture: &str| (name.to_owned(), picture.to_owned());
    let all: std::result::Result<_, String> = names(&[]);
    assert_eq!(
        all.unwrap(),
        [
            named("images_left", "images/left.png"),
            named("rear_left", "rear/left.png"),
            named("mid", "images/mid.png")
        ]
    );
    assert_eq!(names(&["back=rear/left.png"]).unwrap(), [named("back", "rear/left.png")]);
    assert!(names(&["left"]).unwrap_err().contains("2 pictures"));
}

#[test]
fn frames_that_are_not_chosen_need_no_lens_of_ours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    let fisheye = SHARED
        .replace("\"transform_matrix\"", "\"camera_model\": \"FISHEYE624\", \"transform_matrix\"")
        .replace("left", "wide");
    let frame = fisheye[fisheye.find("{\"file_path\"").unwrap()..fisheye.rfind(']').unwrap()].to_owned();
    let text = SHARED.replace("\"frames\": [", &format!("\"frames\": [{frame}, "));
    assert!(
        read_with(&path, &text, &ModelOptions::default())
            .unwrap_err()
            .contains("frame 1 (`images/wide.png`)")
    );
    let selection = Selection { entries: vec!["left".into()] };
    let model = read_with(&path, &text, &ModelOptions { selection, ..ModelOptions::default() }).unwrap();
    assert_eq!(model.cameras[0].entry.name, "left");
}

#[test]
fn applied_transforms_are_undone_where_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("transforms.json");
    let original = read_with(&path, SHARED, &ModelOptions::default()).unwrap().cameras.remove(0).entry.camera;
    // The transform of `ns-process-data` from COLMAP's world (y becomes −z, z becomes y), and a scale.
    let (applied, scale) = (Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0), 0.25);
    let offset = Vector3::new(0.5, -2.0, 3.0);
    let pose = original.camera_from_world.inverse();
    let (turned, moved) = (
        applied * pose.rotation.to_rotation_matrix().matrix(),
        (applied * pose.translation.vector + offset) * scale,
    );
    let rows: Vec<[f64; 4]> =
        (0..3).map(|r| [turned[(r, 0)], -turned[(r, 1)], -turned[(r, 2)], moved[r]]).collect();
    let text = SHARED.replace("[[1,0,0,0],[0,0,-1,0],[0,1,0,2],[0,0,0,1]]", &format!("{rows:?}")).replace(
        "\"frames\"",
        "\"applied_scale\": 0.25, \"applied_transform\": [[1,0,0,0.5],[0,0,1,-2],[0,-1,0,3]], \"ply_file_path\": \"sparse.ply\", \"frames\"",
    );
    let undone = ModelOptions { undo_applied: true, ..ModelOptions::default() };
    let model = read_with(&path, &text, &undone).unwrap();
    let off = model.cameras[0].entry.camera.camera_from_world * original.camera_from_world.inverse();
    assert!(off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-9, "{off}");
    assert!(matches!(model.geometry, ModelGeometry::None), "there is no sparse.ply");
    // The points' file is in the same world as the frames.
    std::fs::write(folder.path().join("sparse.ply"), "ply").unwrap();
    let ModelGeometry::File { model_from_file, path: file } =
        read_with(&path, &text, &undone).unwrap().geometry
    else {
        panic!("the file is there")
    };
    assert_eq!(file, folder.path().join("sparse.ply"));
    let place = Point3::new(0.3, 4.0, -1.0);
    let in_file = Point3::from((applied * place.coords + offset) * scale);
    assert!((model_from_file * in_file - place).norm() < 1e-9);
    let kept = read_with(&path, &text, &ModelOptions::default()).unwrap();
    assert!((kept.cameras[0].entry.camera.center().coords - moved).norm() < 1e-9);
    for (from, to, word) in [
        ("\"applied_scale\": 0.25", "\"applied_scale\": 0", "applied_scale"),
        ("[0,-1,0,3]", "[0,1,0,3]", "applied_transform"),
        ("[0,-1,0,3]", "[0,-1,3]", "applied_transform"),
    ] {
        let said = read_with(&path, &text.replace(from, to), &undone).unwrap_err();
        assert!(said.contains(word), "{said}");
    }
}
