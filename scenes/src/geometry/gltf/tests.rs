//! Files of trimesh, files there and back, and files that are cut or made to harm.

use std::path::{Path, PathBuf};

use glam::Vec3;

use super::*;
use crate::geometry::scan::{Placing, Scan};
use crate::geometry::texture::light_of_level;
use crate::geometry::{Disc, Geometry, Mesh, files};

fn peer(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/scans").join(name)
}

fn read(bytes: &[u8]) -> Result<Scan, String> {
    scan(Path::new("/nowhere/room.glb"), bytes).map_err(|(place, problem)| format!("{place}: {problem}"))
}

fn mesh() -> Mesh {
    Mesh {
        vertices: vec![
            Vec3::new(0.1, 0.2, 0.3),
            Vec3::new(4.7, 0.0, 1e-3),
            Vec3::new(-3.0, 2.5, 2.4),
            Vec3::Z,
        ],
        triangles: vec![[0, 1, 2], [2, 1, 3]],
        colors: vec![[0, 1, 2], [255, 254, 253], [100, 20, 9], [180; 3]],
    }
}

#[test]
fn a_mesh_comes_back_in_its_place_with_its_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.glb");
    std::fs::write(&path, encode(&mesh()).unwrap()).unwrap();
    let placing = Placing { room_from_scan: files::z_up_from_file(&path), ..Placing::default() };
    let Geometry::Mesh(found) = files::read(&path, &placing).unwrap() else { panic!("a mesh") };
    assert_eq!((&found.triangles, &found.colors), (&mesh().triangles, &mesh().colors));
    for (a, b) in found.vertices.iter().zip(&mesh().vertices) {
        assert!(a.distance(*b) < 1e-6, "{a} {b}");
    }
    let discs = Geometry::Discs(vec![Disc {
        center: Vec3::ONE,
        normal: Vec3::X,
        radius: 0.1,
        color: [1, 2, 3],
        filled: false,
        confidence: 1.0,
    }]);
    assert_eq!(read(&encode(&discs.to_mesh()).unwrap()).unwrap().triangles.len(), 4);
}

/// The places of `tests/peers/scans.py`: a box of 4 × 3 × 2.5 with a corner at the origin, Y up, in a node that moves and
/// turns it.
#[test]
fn a_scene_of_trimesh_has_its_places_and_colours() {
    let name = "box.glb";
    let scan = scan(&peer(name), &std::fs::read(peer(name)).unwrap()).unwrap();
    let expected = std::fs::read_to_string(peer("box.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&expected).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let corners: Vec<Vec<f64>> = expected["corners"].as_array().unwrap().iter().map(numbers).collect();
    let colors: Vec<Vec<f64>> = expected["colors"].as_array().unwrap().iter().map(numbers).collect();
    assert_eq!((scan.vertices.len(), scan.triangles.len()), (corners.len(), 12));
    for ((vertex, corner), color) in scan.vertices.iter().zip(&corners).zip(&colors) {
        let off = vertex.position.iter().zip(corner).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-5, "{vertex:?} {corner:?}");
        // By the standard of glTF, vertex colours in bytes are linear light.
        for (level, light) in vertex.color.iter().zip(color) {
            assert!(
                (light_of_level(level / 255.0) - *light as f32 / 255.0).abs() < 5e-3,
                "{vertex:?} {color:?}"
            );
        }
    }
    // The outside of the box faces outwards: its volume is positive.
    let corner = |i: u32| nalgebra::Vector3::from(scan.vertices[i as usize].position);
    let volume: f64 =
        scan.triangles.iter().map(|[a, b, c]| corner(*a).dot(&corner(*b).cross(&corner(*c))) / 6.0).sum();
    assert!((volume - 30.0).abs() < 1e-3, "{volume}");
}

#[test]
fn textures_of_trimesh_colour_the_vertices() {
    for name in ["textured.glb", "textured.gltf"] {
        let scan = scan(&peer(name), &std::fs::read(peer(name)).unwrap()).unwrap();
        let expected = std::fs::read_to_string(peer("textured.json")).unwrap();
        let expected: Vec<[f32; 3]> = serde_json::from_str(&expected).unwrap();
        assert_eq!(scan.vertices.len(), expected.len(), "{name}");
        for (vertex, color) in scan.vertices.iter().zip(&expected) {
            let off = vertex.color.iter().zip(color).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off <= 1.0, "{name}: {vertex:?} {color:?}");
        }
    }
}

#[test]
fn points_of_trimesh_are_a_cloud() {
    let scan = scan(&peer("points.glb"), &std::fs::read(peer("points.glb")).unwrap()).unwrap();
    assert!(scan.is_cloud() && !scan.has_normals);
    assert_eq!(scan.vertices.len(), 5);
    assert_eq!(scan.vertices[3].position, [3.0, 0.5, -1.0]);
}

#[test]
fn every_cut_and_every_flipped_byte_ends_in_an_answer() {
    let whole = encode(&mesh()).unwrap();
    assert!(read(&whole).is_ok());
    for length in 0..whole.len() {
        assert!(read(&whole[..length]).is_err(), "{length} of {}", whole.len());
    }
    for at in 0..whole.len() {
        for value in [0, 0x7f, 0xff, b'9'] {
            let mut flipped = whole.clone();
            flipped[at] = value;
            // It may be another mesh, or none; it must not be the end of the program.
            let _ = read(&flipped);
        }
    }
}

/// A document of one triangle, with parts of it replaced.
fn changed(from: &str, to: &str) -> String {
    let text = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0,"children":[1]},{"translation":[0,0,1]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
        "bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,
        "uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    assert!(text.contains(from), "{from}");
    text.replace(from, to)
}

#[test]
fn documents_made_to_harm_are_refused_by_name() {
    assert_eq!(read(changed("nodes", "nodes").as_bytes()).unwrap().vertices[1].position, [1.0, 0.0, 0.0]);
    for (from, to, words) in [
        (r#""children":[1]}"#, r#""children":[1,1]}"#, "node 1: it has two parents"),
        (r#"{"translation":[0,0,1]}"#, r#"{"children":[0]}"#, ""),
        (r#""mesh":0"#, r#""mesh":7"#, "mesh 7: it is named"),
        (r#""count":3"#, r#""count":4"#, "accessor 0: it goes beyond"),
        (r#""count":3"#, r#""count":18446744073709551615"#, "accessor 0: it goes beyond"),
        (r#""count":3"#, r#""count":3,"byteOffset":18446744073709551615"#, "goes beyond"),
        (r#""count":3"#, r#""count":3,"sparse":{}"#, "sparse"),
        (r#""count":3"#, r#""count":-3"#, "no glTF"),
        (r#""byteLength":36}"#, r#""byteOffset":18446744073709551615,"byteLength":36}"#, "bufferView 0"),
        (r#""byteLength":36}"#, r#""byteLength":36,"byteStride":9223372036854775807}"#, "goes beyond"),
        (r#""bufferView":0,"#, "", "no bufferView"),
        ("5126", "5130", "componentType 5130"),
        ("VEC3", "VEC2", "type is VEC2"),
        (r#""byteLength":36,"#, r#""byteLength":4000000000,"#, "buffer 0: 4000000000 bytes are announced"),
        ("data:application/octet-stream;base64,AAAA", "data:text/plain,AAAA", "base64"),
        ("data:application/octet-stream;base64,", "https://example.org/", "example.org"),
        ("data:application/octet-stream;base64,", "/dev/zero?", "buffer 0"),
        (
            r#"{"attributes":{"POSITION":0}}"#,
            r#"{"attributes":{"POSITION":0},"extensions":{"KHR_draco_mesh_compression":{}}}"#,
            "draco",
        ),
        (r#"{"attributes":{"POSITION":0}}"#, r#"{"attributes":{"POSITION":0},"material":3}"#, "material 3"),
        (
            r#"{"attributes":{"POSITION":0}}"#,
            r#"{"attributes":{"POSITION":0},"indices":0}"#,
            "without a sign",
        ),
    ] {
        let found = read(changed(from, to).as_bytes());
        let said = found.err().unwrap_or_default();
        assert!(said.contains(words) && !said.contains('\n'), "{from} to {to}: {said}");
        // A circle of nodes has no root, and so no surface; everything else is an error.
        assert!(!said.is_empty() || words.is_empty(), "{from} to {to}");
    }
    let zero = changed(
        "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
        "/dev/zero",
    );
    assert!(read(zero.as_bytes()).unwrap_err().contains("is no file"));
}
