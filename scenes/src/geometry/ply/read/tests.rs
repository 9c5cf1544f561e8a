//! Files that are read, and each kind of defect that is named.

use super::*;
use glam::Vec3;

const TRIANGLE: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1e0 0\n3 0 1 2\n";

const POINT: &str = "ply\r\nformat ascii 1.0\r\nelement vertex 1\r\nproperty float x\r\nproperty float y\r\n\
    property float z\r\nproperty float nx\r\nproperty float ny\r\nproperty float nz\r\nproperty float radius\r\n\
    end_header\r\n1 2 3 0 0 2 0.1\r\n";

/// A room's own file, or one that is imported, with the cameras' places.
fn decode_here(bytes: &[u8], viewpoints: Option<&[Vec3]>) -> Decoded<Geometry> {
    match viewpoints {
        Some(viewpoints) => scan(bytes)?.into_geometry(&Placing { viewpoints, ..Placing::default() }),
        None => decode(bytes),
    }
}

fn problem(text: &str) -> String {
    let (place, problem) = decode_here(text.as_bytes(), None).unwrap_err();
    let line = format!("{place}: {problem}");
    assert!(!line.contains('\n'), "{line}");
    line
}

#[test]
fn ascii_faces_and_points_are_read() {
    let Geometry::Mesh(mesh) = decode_here(TRIANGLE.as_bytes(), None).unwrap() else {
        panic!("faces make a mesh")
    };
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.vertices[2], Vec3::Y);

    let Geometry::Discs(discs) = decode_here(POINT.as_bytes(), None).unwrap() else {
        panic!("points make discs")
    };
    assert_eq!((discs[0].normal, discs[0].radius), (Vec3::Z, 0.1));
    assert_eq!((discs[0].filled, discs[0].confidence), (false, 1.0));
}

#[test]
fn other_elements_and_properties_are_skipped_and_quads_split() {
    let text = "ply\nformat ascii 1.0\ncomment by hand\nelement sensor 2\nproperty list uchar float row\n\
        element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float quality\n\
        property float red\nproperty float green\nproperty float blue\n\
        element face 1\nproperty int flags\nproperty list uchar uint vertex_index\nend_header\n\
        2 5 6\n0\n0 0 0 9 1 0 0.5\n1 0 0 9 1 0 0.5\n1 1 0 9 1 0 0.5\n0 1 0 9 1 0 0.5\n7 4 0 1 2 3";
    let Geometry::Mesh(mesh) = decode_here(text.as_bytes(), None).unwrap() else {
        panic!("faces make a mesh")
    };
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(mesh.colors[0], [255, 0, 127]);
}

#[test]
fn big_endian_is_read() {
    let mut bytes =
        b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
            .to_vec();
    for value in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0] {
        bytes.extend(value.to_be_bytes());
    }
    bytes.push(3);
    for index in [0_i32, 1, 2] {
        bytes.extend(index.to_be_bytes());
    }
    let Geometry::Mesh(mesh) = decode_here(&bytes, None).unwrap() else { panic!("faces make a mesh") };
    assert_eq!(mesh.vertices[2], Vec3::Y * 2.0);
}

#[test]
fn files_that_are_no_ply_or_cut_off_are_named() {
    assert!(problem("").contains("empty"));
    assert!(problem("solid cube\n").contains("no PLY"));
    assert!(problem(&TRIANGLE[..60]).contains("header"));
    let cut = problem(&TRIANGLE[..TRIANGLE.len() - 20]);
    assert!(cut.contains("cut off") || cut.contains("end of file"), "{cut}");
    assert!(problem("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n").contains("property x"));
    // Every truncation of a binary file, too, ends in a message.
    let whole = {
        let Geometry::Mesh(mesh) = decode_here(TRIANGLE.as_bytes(), None).unwrap() else { panic!("a mesh") };
        super::super::encode(&Geometry::Mesh(mesh)).unwrap()
    };
    assert!(decode_here(&whole, None).is_ok());
    for length in 0..whole.len() {
        assert!(decode_here(&whole[..length], None).is_err(), "{length} of {} bytes", whole.len());
    }
}

#[test]
fn absurd_counts_take_no_memory() {
    let binary = |elements: &str| format!("ply\nformat binary_little_endian 1.0\n{elements}end_header\n");
    assert!(problem(&binary("element nothing 1000000000000\n")).contains("no properties"));
    let many = binary("element vertex 1000000000000\nproperty float x\nproperty float y\nproperty float z\n");
    assert!(problem(&many).contains("cut off"));
    let most = format!("element vertex {}\nproperty double x\n", u64::MAX);
    assert!(problem(&binary(&most)).contains("cut off"));
}

#[test]
fn a_bare_cloud_faces_who_saw_it() {
    let bare = |points: &str| {
        let count = points.lines().count();
        format!(
            "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
            property float z\nend_header\n{points}"
        )
    };
    let corners: Vec<String> = (0..100).map(|i| format!("{} {} 0", i % 10, i / 10)).collect();
    let floor = corners.join("\n") + "\n";
    let below = [Vec3::new(0.5, 0.5, -2.0)];
    let Geometry::Discs(discs) = decode_here(bare(&floor).as_bytes(), Some(&below)).unwrap() else {
        panic!("points make discs")
    };
    assert!(discs.iter().all(|d| d.normal.distance(-Vec3::Z) < 1e-4 && d.radius > 0.5 && d.radius < 1.5));
    // Without cameras the seen side is unknown; existing normals are kept.
    assert!(problem(&bare(&floor)).contains("scenes import"));
    let Geometry::Discs(discs) = decode_here(POINT.as_bytes(), Some(&below)).unwrap() else {
        panic!("discs")
    };
    assert_eq!(discs[0].normal, Vec3::Z);
    let (place, said) = decode_here(bare("0 0 0\n1 1e99 0\n").as_bytes(), Some(&below)).unwrap_err();
    assert!(place == "vertex 1" && said.contains("not finite"), "{place}: {said}");
}

/// A room of 4 × 3 × 2.5 m, all its sides but the one at x = 4 and the ceiling, as five strips.
const STRIPS_OF_A_ROOM: &str = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n\
    property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n0 0 2.5\n0 3 0\n\
    0 3 2.5\n4 0 0\n4 0 2.5\n4 3 0\n4 3 2.5\n\
    25 0 1 2 3 -1 4 6 5 7 -1 0 4 1 5 -1 2 3 6 7 -1 0 2 4 6 -1\n";

#[test]
fn strips_are_the_surface() {
    let Geometry::Mesh(mesh) = decode_here(STRIPS_OF_A_ROOM.as_bytes(), None).unwrap() else {
        panic!("strips make a mesh")
    };
    assert_eq!(mesh.triangles.len(), 10);
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = mesh.corners(*triangle);
        0.5 * (b - a).cross(c - a).length()
    };
    let all: f32 = mesh.triangles.iter().map(area).sum();
    assert!((all - (12.0 + 2.0 * 10.0 + 2.0 * 7.5)).abs() < 1e-4, "{all}");
    assert!(problem(&STRIPS_OF_A_ROOM.replace("4 6 5 7", "4 6 5 8")).contains("strip 0: names vertex 8"));
}

#[test]
fn surfaces_in_forms_that_are_not_read_are_refused() {
    let other = problem(&STRIPS_OF_A_ROOM.replace("tristrips", "trifans"));
    assert!(other.contains("element trifans") && other.contains("triangles"), "{other}");
    let name = STRIPS_OF_A_ROOM.replace("property float z", "property float scalar_C2C[<0.1]");
    assert!(problem(&name).contains("header, line 6: the name"), "{}", problem(&name));
    let of = STRIPS_OF_A_ROOM.replace("list int int", "list int int64");
    assert!(problem(&of).contains("header, line 8: the type `int64`"), "{}", problem(&of));
    assert!(!problem("ply\nnonsense\n").contains("ExpectedSet"), "{}", problem("ply\nnonsense\n"));
}

#[test]
fn a_frame_far_away_needs_a_shift_and_keeps_its_digits() {
    let far = TRIANGLE.replace("float y", "double y").replace(
        "\n0 0 0\n1 0 0\n0 1e0 0\n",
        "\n500000 5400000.25 0\n500001 5400000.25 0\n500000 5400001.375 0\n",
    );
    let refused = problem(&far);
    assert!(refused.contains("vertex 0") && refused.contains("--shift=-500000,-5400000,0"), "{refused}");
    let shift = nalgebra::Translation3::new(-500_000.0, -5_400_000.0, 0.0);
    let placing = Placing { room_from_scan: nalgebra::convert(shift), ..Placing::default() };
    let geometry = scan(far.as_bytes()).unwrap().into_geometry(&placing).unwrap();
    let Geometry::Mesh(mesh) = geometry else { panic!("a mesh") };
    assert_eq!(mesh.vertices[2], Vec3::new(0.0, 1.375, 0.0));
}

#[test]
fn colours_of_sixteen_bits_and_bytes_as_floats_are_read() {
    let colored = |of: &str, values: &str| {
        let properties = ["red", "green", "blue"].map(|name| format!("property {of} {name}\n")).concat();
        let text = TRIANGLE
            .replace("element face", &format!("{properties}element face"))
            .replace("\n0 0 0\n", &format!("\n0 0 0 {values}\n"))
            .replace("\n1 0 0\n", "\n1 0 0 0 0 0\n")
            .replace("\n0 1e0 0\n", "\n0 1e0 0 0 0 0\n");
        let Geometry::Mesh(mesh) = decode(text.as_bytes()).unwrap() else { panic!("a mesh") };
        mesh.colors[0]
    };
    assert_eq!(colored("ushort", "65535 25700 257"), [255, 100, 1]);
    assert_eq!(colored("ushort", "255 100 1"), [255, 100, 1]);
    assert_eq!(colored("float", "1.0 0.5 0"), [255, 127, 0]);
    assert_eq!(colored("float", "255.0 100.0 1"), [255, 100, 1]);
}

#[test]
fn wrong_elements_are_named() {
    assert!(problem(&TRIANGLE.replace("3 0 1 2", "3 0 1 3")).contains("face 0: names vertex 3"));
    assert!(problem(&TRIANGLE.replace("3 0 1 2", "3 0 1 -1")).contains("negative"));
    assert!(problem(&TRIANGLE.replace("3 0 1 2", "2 0 1 0")).contains("2 corners"));
    assert!(problem(&TRIANGLE.replace("1e0", "nan")).contains("vertex"));
    assert!(problem(&TRIANGLE.replace("1e0", "1e99")).contains("vertex 2"));
    assert!(problem(&TRIANGLE.replace("int vertex_indices", "float vertex_indices")).contains("face"));
    assert!(problem(&POINT.replace("0 0 2 0.1", "0 0 0 0.1")).contains("vertex 0: the normal is zero"));
    assert!(problem(&POINT.replace("0 0 2 0.1", "0 0 2 -0.1")).contains("radius"));
    assert!(problem(&POINT.replace("float nx", "float a")).contains("needs normals"));
}
