//! `scenes import` and `scenes export` as a person runs them: what other programs wrote comes in where it belongs.
#![allow(clippy::unwrap_used)] // a test that cannot go on should stop
#![allow(clippy::float_cmp, clippy::format_collect)] // numbers that are only copied stay as they are; small files

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use nalgebra::Point3;
use scenes::geometry::Geometry;
use scenes::room::{Room, Source};
use tempfile::TempDir;

fn scenes(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_scenes")).args(arguments).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A model of COLMAP in millimetres with Y down, as reconstructions of a level first picture are: cameras `a.jpg` and
/// `b.jpg` at (0, -2000, 0) and (1000, -2000, 0), which look along z, and a floor of points at y = 0 before them.
fn model(scale: f64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, content: String| std::fs::write(folder.path().join(name), content).unwrap();
    put("cameras.txt", "1 PINHOLE 64 48 60 60 32 24\n".into());
    let image = |id: i32, x: f64, name: &str| {
        format!("{id} 1 0 0 0 {} {} 0 1 {name}\n\n", -x * scale, 2000.0 * scale)
    };
    put("images.txt", image(1, 0.0, "hall/a.jpg") + &image(2, 1000.0, "hall/b.jpg"));
    let point = |i: i32| {
        let (x, z) = (100.0 * f64::from(i % 20), 3000.0 + 100.0 * f64::from(i / 20));
        format!("{i} {} 0 {} 10 20 30 0\n", x * scale, z * scale)
    };
    put("points3D.txt", (1..400).map(point).collect());
    folder
}

/// A finished import, which must succeed: the room, and what was said.
fn import(arguments: &[&str]) -> (Room, String, TempDir) {
    let out = tempfile::tempdir().unwrap();
    let room = out.path().join("room");
    let output = scenes(&[&["import"], arguments, &["--out", text(&room)]].concat());
    let said = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{said}");
    (Room::read(&room).unwrap(), said, out)
}

fn refusal(arguments: &[&str]) -> String {
    let out = tempfile::tempdir().unwrap();
    let room = out.path().join("room");
    let output = scenes(&[&["import"], arguments, &["--out", text(&room)]].concat());
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().filter(|line| !line.contains("WARN")).count(), 1, "{said}");
    assert!(!room.exists());
    said
}

fn center(room: &Room, name: &str) -> Point3<f64> {
    room.camera(name).unwrap().camera.center()
}

#[test]
fn scale_and_up_bring_a_model_to_metres_with_z_up() {
    let model = model(1.0);
    let (room, said, _out) = import(&[text(model.path()), "--scale", "0.001", "--up=-y"]);
    assert!(said.is_empty(), "{said}");
    // y down becomes z up: the shortest turn takes −y to z, and so z to y.
    assert!((center(&room, "hall_a") - Point3::new(0.0, 0.0, 2.0)).norm() < 1e-9);
    assert!((center(&room, "hall_b") - Point3::new(1.0, 0.0, 2.0)).norm() < 1e-9);
    let Some(Geometry::Discs(discs)) = &room.geometry else { panic!("the model's points") };
    assert!(discs.iter().all(|d| d.center.z.abs() < 1e-4 && d.normal.z > 0.99 && d.radius < 0.2));
    assert!(discs.iter().all(|d| d.center.y > 2.9 && d.color == [10, 20, 30]));
    // The cameras see the floor's points where they saw them before.
    let pixel = room.camera("hall_a").unwrap().camera.project(&Point3::new(0.5, 4.0, 0.0)).unwrap();
    assert!((pixel.x - (60.0 * 0.5 / 4.0 + 31.5)).abs() < 1e-9, "{pixel}");
    assert!((pixel.y - (60.0 * 2.0 / 4.0 + 23.5)).abs() < 1e-9, "{pixel}");
}

#[test]
fn a_model_in_millimetres_is_told_of_with_the_mend() {
    let model = model(1.0);
    let (_, said, out) = import(&[text(model.path()), "--up=-y"]);
    assert!(said.contains("2000 m above the floor") && said.contains("--scale 0.001"), "{said}");
    let check = scenes(&["check", text(&out.path().join("room"))]);
    let said = String::from_utf8(check.stderr).unwrap();
    assert!(check.status.success() && said.contains("--scale 0.001"), "{said}");
}

#[test]
fn chosen_pictures_are_cameras_with_their_reference_images() {
    let model = model(0.001);
    let images = tempfile::tempdir().unwrap();
    std::fs::create_dir(images.path().join("hall")).unwrap();
    image::RgbImage::from_pixel(64, 48, image::Rgb([9, 8, 7]))
        .save(images.path().join("hall/b.jpg"))
        .unwrap();
    let given = [text(model.path()), "--up=-y", "--images", text(images.path())];
    let (room, said, out) = import(&[&given[..], &["--cameras", "door=b.jpg"]].concat());
    assert!(said.is_empty(), "{said}");
    let [door] = &room.cameras[..] else { panic!("one camera") };
    assert_eq!(
        (door.name.as_str(), door.reference.clone()),
        ("door", Some(PathBuf::from("reference/door.jpg")))
    );
    let copied = std::fs::read(out.path().join("room/reference/door.jpg")).unwrap();
    assert_eq!(copied, std::fs::read(images.path().join("hall/b.jpg")).unwrap());
    // A picture that is not there is worth a warning, none at all is a mistake.
    let (room, said, _out) = import(&given);
    assert!(said.contains("camera `hall_a`: there is no picture `hall/a.jpg`"), "{said}");
    assert_eq!(room.cameras.iter().filter(|c| c.reference.is_some()).count(), 1);
    let said = refusal(&[&given[..], &["--cameras", "a.jpg"]].concat());
    assert!(said.contains("it holds no picture of the cameras"), "{said}");
    assert!(
        refusal(&[text(model.path()), "--cameras", "lobby"])
            .contains("no picture of the model has this name")
    );
}

#[test]
fn known_points_align_a_model_and_their_residuals_are_told() {
    let model = model(1.0);
    let picks = model.path().join("picks.csv");
    // Millimetres, y down, to metres, with x north (the model's z), y west, z up, 100 m east.
    let row = |[x, y, z]: [f64; 3], off: f64, name: &str| {
        format!("{x},{y},{z},{},{},{},{name}\n", z / 1000.0 + off, 100.0 - x / 1000.0, -y / 1000.0)
    };
    let corners = [
        [0.0, 0.0, 3000.0],
        [1900.0, 0.0, 3000.0],
        [1900.0, 0.0, 4900.0],
        [0.0, 0.0, 4900.0],
        [0.0, -2500.0, 4900.0],
    ];
    let table = |off: f64| {
        let rows = corners
            .iter()
            .zip(0..)
            .map(|(c, i)| row(*c, if i == 2 { off } else { 0.0 }, &format!("corner {i}")));
        "x,y,z,room_x,room_y,room_z,name\n".to_owned() + &rows.collect::<String>()
    };
    std::fs::write(&picks, table(0.0)).unwrap();
    let given = [text(model.path()), "--points", text(&picks)];
    let (room, said, _out) = import(&given);
    assert!(said.contains("points    5, rms 0.000 m, 0.00") || said.contains("1e-3 metres a unit"), "{said}");
    assert!(said.contains("point     corner 4: 0.000 m off"), "{said}");
    assert!(
        (center(&room, "hall_b") - Point3::new(0.0, 99.0, 2.0)).norm() < 1e-6,
        "{}",
        center(&room, "hall_b")
    );
    std::fs::write(&picks, table(0.5)).unwrap();
    let (_, said, _out) = import(&given);
    assert!(said.contains("point `corner 2` is 0.5") && said.contains("leave it out"), "{said}");
    std::fs::write(&picks, "x,y,z,room_x,room_y,room_z\n0,0,0,1,1,1\n").unwrap();
    assert!(refusal(&given).contains("at least 3"));
    assert!(refusal(&[&given[..], &["--up", "y"]].concat()).contains("--up"));
}

#[test]
fn a_far_frame_is_shifted_and_the_room_keeps_the_shift() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, content: &str| std::fs::write(folder.path().join(name), content).unwrap();
    put("cameras.txt", "1 PINHOLE 64 48 60 60 32 24\n");
    // Cameras of UTM that look down: x east, y north, z up; half a turn about x.
    put(
        "images.txt",
        "1 0 1 0 0 -500003 5400010.25 102 1 a.jpg\n\n2 0 1 0 0 -500004 5400010.25 102 1 b.jpg\n\n",
    );
    put(
        "points3D.txt",
        "1 500003.125 5400010.5 100 1 2 3 0\n2 500003.5 5400011 100 1 2 3 0\n3 500004 5400010 100 1 2 3 0\n",
    );
    let (room, said, out) = import(&[text(folder.path())]);
    assert!(said.contains("moved by -500000,-5400000,0 m"), "{said}");
    assert!((center(&room, "a") - Point3::new(3.0, 10.25, 102.0)).norm() < 1e-6);
    assert_eq!(room.source, Some(Source { shift: [-500_000.0, -5_400_000.0, 0.0] }));
    let Some(Geometry::Discs(discs)) = &room.geometry else { panic!("points") };
    assert_eq!(discs[0].center.to_array(), [3.125, 10.5, 100.0]);
    let check = scenes(&["check", text(&out.path().join("room"))]);
    let told = String::from_utf8(check.stdout).unwrap();
    assert!(told.contains("moved by -500000, -5400000, 0 m"), "{told}");
    let (room, said, _out) = import(&[text(folder.path()), "--shift=-500003,-5400010,-100"]);
    assert!(said.is_empty() && (center(&room, "a") - Point3::new(0.0, 0.25, 2.0)).norm() < 1e-6, "{said}");
}

#[test]
fn geometry_of_every_format_lies_where_the_cameras_see_it() {
    let model = model(0.001);
    let put = |name: &str, bytes: &[u8]| {
        let path = model.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    // A wall of 2 × 1 m, 4 m before the cameras, in the model's world: Y down.
    let corners = [[0.0, 0.0, 4.0], [2.0, 0.0, 4.0], [2.0, -1.0, 4.0], [0.0, -1.0, 4.0_f32]];
    let obj: String = corners.iter().map(|[x, y, z]| format!("v {x} {y} {z} 1 0 0\n")).collect();
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n"
        .to_owned()
        + &corners.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect::<String>()
        + "4 0 1 2 3\n";
    let binary: Vec<u8> = corners.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    put("wall.bin", &binary);
    let gltf = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":6}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}],
        "bufferViews":[{"buffer":0,"byteLength":48}],"buffers":[{"byteLength":48,"uri":"wall.bin"}]}"#;
    let obj = put("wall.obj", (obj + "f 1 2 3 4\n").as_bytes());
    for file in [put("wall.ply", ply.as_bytes()), obj, put("wall.gltf", gltf.as_bytes())] {
        let given = [text(model.path()), "--up=-y", "--geometry", text(&file), "--cameras", "a.jpg"];
        let (room, said, _out) = import(&given);
        assert!(said.is_empty(), "{said}");
        let Some(Geometry::Mesh(mesh)) = &room.geometry else { panic!("{}: a mesh", file.display()) };
        assert_eq!(mesh.triangles.len(), 2, "{}", file.display());
        for (vertex, [x, y, z]) in mesh.vertices.iter().zip(corners) {
            assert!(vertex.distance(glam::Vec3::new(x, z, -y)) < 1e-6, "{}: {vertex}", file.display());
        }
    }
    // Without --up a glTF file is turned by its standard, and the model's cameras are not.
    let (room, _, _out) = import(&[text(model.path()), "--geometry", text(&model.path().join("wall.gltf"))]);
    let Some(Geometry::Mesh(mesh)) = &room.geometry else { panic!("a mesh") };
    assert!(mesh.vertices[2].distance(glam::Vec3::new(2.0, -4.0, -1.0)) < 1e-6, "{}", mesh.vertices[2]);
}

#[test]
fn a_room_goes_out_as_a_mesh_with_its_colours() {
    let model = model(0.001);
    let (room, _, out) = import(&[text(model.path()), "--up=-y"]);
    let dir = out.path().join("room");
    let Some(Geometry::Discs(discs)) = &room.geometry else { panic!("points") };
    for (format, name) in [("ply", "mesh.ply"), ("glb", "mesh.glb")] {
        let file = out.path().join(name);
        let output = scenes(&["export", text(&dir), "--format", format, "--out", text(&file)]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        // The cameras are in the room's world already.
        let cameras = out.path().join("transforms.json");
        assert!(
            scenes(&["export", text(&dir), "--format", "nerfstudio", "--out", text(&cameras)])
                .status
                .success()
        );
        let (back, said, _back) = import(&[text(&cameras), "--geometry", text(&file)]);
        assert!(said.is_empty(), "{said}");
        let Some(Geometry::Mesh(mesh)) = &back.geometry else { panic!("a mesh") };
        assert_eq!(mesh.triangles.len(), 4 * discs.len());
        for (corners, disc) in mesh.vertices.chunks(6).zip(discs) {
            let middle = corners.iter().sum::<glam::Vec3>() / 6.0;
            assert!(middle.distance(disc.center) < 1e-5, "{format}: {middle} {}", disc.center);
        }
        assert!(mesh.colors.iter().all(|color| *color == [10, 20, 30]), "{format}");
    }
    let cameras_only = out.path().join("empty");
    std::fs::create_dir(&cameras_only).unwrap();
    let scene = std::fs::read_to_string(dir.join("scene.toml")).unwrap();
    std::fs::write(cameras_only.join("scene.toml"), scene.replace("geometry =", "# geometry =")).unwrap();
    let output = scenes(&[
        "export",
        text(&cameras_only),
        "--format",
        "glb",
        "--out",
        text(&out.path().join("no.glb")),
    ]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && said.contains("no geometry"), "{said}");
}

/// The corners and faces of a box from the origin to `size`, seen from inside, as OBJ.
fn box_obj(size: [f64; 3], place: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let corner = |i: usize| place([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { size[axis] } else { 0.0 }));
    let vertices: String = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    vertices + "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n"
}

#[test]
fn the_floor_of_a_tilted_model_is_found_and_brought_to_zero() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, content: &str| std::fs::write(folder.path().join(name), content).unwrap();
    // A room of 6 × 5 × 2.6 m, tilted by a few degrees and lifted; z up or, as in COLMAP's worlds, y down.
    let tilt = nalgebra::UnitQuaternion::from_euler_angles(0.06, -0.04, 0.0);
    for up in ["z", "-y"] {
        let turn = if up == "z" {
            nalgebra::UnitQuaternion::identity()
        } else {
            nalgebra::UnitQuaternion::from_axis_angle(
                &nalgebra::Vector3::x_axis(),
                -std::f64::consts::FRAC_PI_2,
            )
        };
        let tilted = |p: [f64; 3]| -> [f64; 3] {
            (turn * (tilt * nalgebra::Vector3::from(p)) + nalgebra::Vector3::new(0.3, 0.2, 1.7)).into()
        };
        put("room.obj", &box_obj([6.0, 5.0, 2.6], tilted));
        put("cameras.txt", "1 PINHOLE 640 480 400 400 320 240\n");
        // Two cameras in opposite corners, 2.2 m above the floor, which look at the middle of it.
        let image = |id: i32, eye: [f64; 3]| {
            let ahead = nalgebra::Vector3::new(3.0, 2.5, 0.3) - nalgebra::Vector3::from(eye);
            let world_from_camera =
                turn * tilt * nalgebra::UnitQuaternion::face_towards(&ahead, &-nalgebra::Vector3::z());
            let q = world_from_camera.inverse();
            let t = -(q * nalgebra::Vector3::from(tilted(eye)));
            format!("{id} {} {} {} {} {} {} {} 1 {id}.jpg\n\n", q.w, q.i, q.j, q.k, t.x, t.y, t.z)
        };
        put("images.txt", &(image(1, [0.5, 0.5, 2.2]) + &image(2, [5.5, 4.5, 2.2])));
        let obj = folder.path().join("room.obj");
        let (room, said, _out) = import(&[text(folder.path()), "--geometry", text(&obj), "--floor", "auto"]);
        assert!(said.contains("floor     ") && !said.contains("WARN"), "{said}");
        for name in ["1", "2"] {
            assert!((center(&room, name).z - 2.2).abs() < 0.01, "{up}: {}", center(&room, name));
        }
        assert!(((center(&room, "1") - center(&room, "2")).norm() - 5.0_f64.hypot(4.0)).abs() < 1e-6);
        let Some(Geometry::Mesh(mesh)) = &room.geometry else { panic!("a mesh") };
        let heights: Vec<f32> = mesh.vertices.iter().map(|v| v.z).collect();
        assert!(
            heights[..4].iter().all(|z| z.abs() < 0.01)
                && heights[4..].iter().all(|z| (z - 2.6).abs() < 0.01),
            "{up}: {heights:?}"
        );
    }
    let said = refusal(&[text(folder.path()), "--floor", "auto"]);
    assert!(said.contains("--floor auto: there is no geometry"), "{said}");
}
