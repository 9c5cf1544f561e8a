//! Valid projects, and every kind of invalid one.

use std::path::Path;

use calib::Intrinsics;
use nalgebra::Point2;

use super::*;

const CAMERAS: &str = r#"
[[camera]]
name = "a"
capture = "frames"
intrinsics = "lens.toml"
[[camera]]
name = "b"
capture = "frames"
reference = 3
intrinsics = "lens.toml"
"#;
const POINTS: &str = "
[[point]]\na = [10, 20]\nb = [30.5, 40]
[[point]]\na = [100, 20]\nb = [30, 140]
[[point]]\na = [110, 200]\nb = [130, 40]
";
const SCALE: &str = "[scale]\ncamera = \"b\"\nfrom = [1, 2]\nto = [30, 4]\nmetres = 1.5\n";

fn read(text: &str) -> std::result::Result<Project, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("frames")).unwrap();
    let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
    calib::files::write_intrinsics(&folder.path().join("lens.toml"), &lens).unwrap();
    let path = folder.path().join("room.toml");
    std::fs::write(&path, text).unwrap();
    let result = Project::read(&path).map_err(|e| e.to_string());
    if let Err(line) = &result {
        assert!(line.contains("room.toml") || line.contains("lens.toml"), "names no file: {line}");
        assert_eq!(line.lines().count(), 1, "{line}");
    }
    result
}

/// Error of a project that is valid but for the change `from` → `to`.
fn refusal(from: &str, to: &str) -> String {
    let text = format!("{CAMERAS}{POINTS}{SCALE}");
    assert!(text.contains(from), "{from}");
    read(&text.replacen(from, to, 1)).unwrap_err()
}

#[test]
fn a_whole_project_is_read() {
    let project = read(&format!("{CAMERAS}{POINTS}{SCALE}")).unwrap();
    assert_eq!(project.cameras.len(), 2);
    assert_eq!(project.cameras[0].reference, ReferenceFrame::Last);
    assert_eq!(project.cameras[1].reference, ReferenceFrame::Number(3));
    assert_eq!(project.shared(0, 1)[1], (Point2::new(100.0, 20.0), Point2::new(30.0, 140.0)));
    let [KnownLength::Distance { camera: 1, metres: 1.5, .. }] = project.lengths[..] else {
        panic!("{:?}", project.lengths)
    };
    let height = read(&format!("{CAMERAS}{POINTS}[scale]\ncamera = \"a\"\nheight = 2.4\n")).unwrap();
    assert_eq!(height.lengths, [KnownLength::Height { camera: 0, height_m: 2.4 }]);
    let board = "[scale]\ncamera = \"a\"\nboard = \"9x6\"\nsquare = 0.03\n";
    let project = read(&format!("{CAMERAS}{POINTS}{board}")).unwrap();
    let [KnownLength::Board { camera: 0, board, square_m: 0.03 }] = project.lengths[..] else {
        panic!("{:?}", project.lengths)
    };
    assert_eq!(board.to_string(), "9x6");
}

#[test]
fn one_camera_needs_no_points() {
    let one = CAMERAS.split("[[camera]]\nname = \"b\"").next().unwrap();
    assert!(read(&format!("{one}[scale]\ncamera = \"a\"\nheight = 2\n")).is_ok());
}

#[test]
fn a_missing_or_empty_file_is_named() {
    let gone = Project::read(Path::new("/nowhere/room.toml")).unwrap_err().to_string();
    assert!(gone.contains("/nowhere/room.toml"), "{gone}");
    assert!(read("").unwrap_err().contains("[[camera]]"));
    assert!(read("[[camera]\n").unwrap_err().contains("line 1"));
}

#[test]
fn unknown_keys_and_cameras_are_named() {
    assert!(refusal("capture =", "captrue =").contains("captrue"));
    let line = refusal("a = [10, 20]", "c = [10, 20]");
    assert!(line.contains("[[point]] 1, c") && line.contains("`a`, `b`"), "{line}");
    assert!(refusal("camera = \"b\"", "camera = \"x\"").contains("[scale], camera"));
}

#[test]
fn a_missing_capture_or_lens_is_named() {
    assert!(refusal("capture = \"frames\"", "capture = \"film.mp4\"").contains("[[camera]] 1, capture"));
    assert!(refusal("\"lens.toml\"", "\"other/lens.toml\"").contains("other/lens.toml"));
}

#[test]
fn names_must_differ_and_make_file_names() {
    assert!(refusal("name = \"b\"", "name = \"a\"").contains("already taken"));
    for bad in ["", "../a", "a/b", ".", " "] {
        assert!(
            refusal("name = \"a\"", &format!("name = \"{bad}\"")).contains("[[camera]] 1, name"),
            "{bad}"
        );
    }
}

#[test]
fn references_are_first_last_or_a_frame() {
    for bad in ["\"middle\"", "0", "-2"] {
        assert!(refusal("reference = 3", &format!("reference = {bad}")).contains("[[camera]] 2, reference"));
    }
}

#[test]
fn pixels_must_be_numbers_inside_the_image() {
    for bad in ["[nan, 20]", "[10, inf]"] {
        assert!(refusal("a = [10, 20]", &format!("a = {bad}")).contains("[[point]] 1, a"), "{bad}");
    }
    let line = refusal("b = [30, 140]", "b = [30, 240]");
    assert!(line.contains("[[point]] 2, b") && line.contains("320 × 240"), "{line}");
    assert!(refusal("to = [30, 4]", "to = [330, 4]").contains("[scale], to"));
}

#[test]
fn too_few_points_or_points_on_a_line_join_nothing() {
    let third = POINTS.rfind("[[point]]").unwrap();
    let line = read(&format!("{CAMERAS}{}{SCALE}", &POINTS[..third])).unwrap_err();
    assert!(line.contains("`a` and `b` share 2 points"), "{line}");
    let alone = refusal("a = [10, 20]\n", "");
    assert!(alone.contains("[[point]] 1") && alone.contains("two or more"), "{alone}");
    let line = "[[point]]\na = [10, 10]\nb = [5, 5]\n[[point]]\na = [20, 20]\nb = [5, 15]\n[[point]]\na = [90, 90]\nb = [5, 100]\n";
    assert!(read(&format!("{CAMERAS}{line}{SCALE}")).unwrap_err().contains("on a line"));
}

#[test]
fn several_lengths_are_read_and_told_apart_by_their_numbers() {
    let array = SCALE.replace("[scale]", "[[scale]]");
    let height = "[[scale]]\ncamera = \"a\"\nheight = 2.4\n";
    let project = read(&format!("{CAMERAS}{POINTS}{array}{height}")).unwrap();
    assert_eq!(project.lengths.iter().map(KnownLength::metres).collect::<Vec<_>>(), [1.5, 2.4]);
    assert_eq!(project.pixels_of(1).len(), 3 + 2);
    let refused = |height: &str| read(&format!("{CAMERAS}{POINTS}{array}{height}")).unwrap_err();
    let line = refused(&height.replace("2.4", "0"));
    assert!(line.contains("[[scale]] 2, height"), "{line}");
    let line = refused(&height.replace("height", "heigth"));
    assert!(line.contains("heigth"), "{line}");
    let outside = array.replace("[30, 4]", "[330, 4]");
    let line = read(&format!("{CAMERAS}{POINTS}{height}{outside}")).unwrap_err();
    assert!(line.contains("[[scale]] 2, to"), "{line}");
    let line = refused("[scale]\ncamera = \"a\"\nheight = 2.4\n");
    assert!(line.contains("line 26") && line.contains("duplicate key"), "{line}");
}

#[test]
fn control_points_need_coordinates_apart_and_pixels() {
    let control = |number: u32, at: &str, pixels: &str| {
        format!("[[control]] # {number}\nat = {at}\npixels = {{ {pixels} }}\n")
    };
    let first = control(1, "[1, 2]", "a = [10, 20], b = [30, 40]");
    let second = control(2, "[4.5, 2, 0.8]", "b = [50, 60]");
    let project = read(&format!("{CAMERAS}{POINTS}{first}{second}")).unwrap();
    let [one, other] = &project.control_points[..] else { panic!("{project:?}") };
    assert!(project.lengths.is_empty() && one.height_m.is_none() && other.height_m == Some(0.8));
    assert_eq!(one.picks, [(0, Point2::new(10.0, 20.0)), (1, Point2::new(30.0, 40.0))]);
    assert_eq!(project.pixels_of(1).len(), 3 + 2);
    let refused = |second: &str| read(&format!("{CAMERAS}{POINTS}{SCALE}{first}{second}")).unwrap_err();
    assert!(refused("").contains("[[control]]: control points give"));
    assert!(refused(&control(2, "[1.1, 2]", "b = [50, 60]")).contains("0.10 m apart"));
    for (at, pixels, place) in [
        ("[1]", "b = [50, 60]", "[[control]] 2, at"),
        ("[1, nan]", "b = [50, 60]", "[[control]] 2, at"),
        ("[500000, 2]", "b = [50, 60]", "[[control]] 2, at"),
        ("[4, 2]", "", "[[control]] 2, pixels"),
        ("[4, 2]", "c = [50, 60]", "[[control]] 2, c"),
        ("[4, 2]", "b = [50, 600]", "[[control]] 2, b"),
    ] {
        let line = refused(&control(2, at, pixels));
        assert!(line.contains(place), "{line}");
    }
}

#[test]
fn a_scale_needs_a_length() {
    assert!(refusal("to = [30, 4]", "to = [1, 2]").contains("no length"));
    for bad in ["0", "-1.0", "nan", "inf"] {
        assert!(refusal("metres = 1.5", &format!("metres = {bad}")).contains("[scale], metres"), "{bad}");
    }
    assert!(refusal("metres = 1.5", "").contains("either"));
    let scale = "from = [1, 2]\nto = [30, 4]\nmetres = 1.5";
    let board = |board: &str, square: &str| format!("board = \"{board}\"\nsquare = {square}");
    assert!(refusal(scale, &board("9x6", "0")).contains("[scale], square"));
    assert!(refusal(scale, &board("9", "0.03")).contains("inner corners"));
    assert!(refusal(scale, "board = \"9x6\"").contains("either"));
    assert!(refusal(scale, &format!("{scale}\n{}", board("9x6", "0.03"))).contains("either"));
    assert!(read(&format!("{CAMERAS}{POINTS}")).unwrap_err().contains("[scale]"));
}
