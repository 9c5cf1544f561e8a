//! Preserved and changed bytes of a `scene.toml`.

mod merging;
mod moving;

use super::*;
use crate::room::{Room, SCENE_FILE, ZoneKind};
use nalgebra::Point2;
use proptest::prelude::*;
use tempfile::TempDir;

/// A hand-written file: comments everywhere, cameras between zones, odd spaces, no line end at the end.
const SCENE: &str = r#"# my room
format = 1   # of the file

# The doors.

# north
[[zone]]  # 1
name = 'door "A"'   # painted
# measured twice
polygon = [
  [0, 0],   # hinge
  [1.0, 0], [1, 1],
]
kind="exit"

[[camera]]
name = "cam"
width = 640
height = 480
matrix = [[430.0, 0.0, 319.5], [0.0, 430.0, 239.5], [0.0, 0.0, 1.0]]
rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
translation = [0, 0, 0]

  [[zone]]
  polygon = [[3.0, 0.0], [4.0, 0.0], [4.0, 1.0]]
  name = "gate"
# after the gate
[[region]]
name = "counter" # the red one
polygon = [[0, 5], [1, 5], [1, 6]]
dwell_s = 60.0

[[line]]
name = "till"
points = [[2, 0], [2, 1]]

[floor]
walkable = [[[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0]]] # all of it"#;

fn room(text: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(SCENE_FILE), text).unwrap();
    folder
}

fn text(dir: &Path) -> String {
    std::fs::read_to_string(dir.join(SCENE_FILE)).unwrap()
}

fn zones(dir: &Path) -> Vec<Zone> {
    Room::read(dir).unwrap().zones
}

fn drawing(dir: &Path) -> Drawing {
    Drawing::take(&mut Room::read(dir).unwrap())
}

/// The drawing, edited in nothing.
fn edited(drawing: &Drawing) -> EditedDrawing {
    fn each<T: Clone>(items: &[T]) -> Vec<Edited<T>> {
        items.iter().enumerate().map(|(i, item)| Edited { item: item.clone(), origin: Some(i) }).collect()
    }
    let Drawing { zones, regions, lines, floor } = drawing;
    EditedDrawing { zones: each(zones), regions: each(regions), lines: each(lines), floor: floor.clone() }
}

/// Saves what is drawn, with all else as it is, as something new.
fn save(dir: &Path, change: impl FnOnce(&mut Drawing)) -> Result<SavedDrawing> {
    let base = drawing(dir);
    let mut all = base.clone();
    change(&mut all);
    let mut all = edited(&all);
    all.zones.iter_mut().for_each(|zone| zone.origin = None);
    all.regions.iter_mut().for_each(|region| region.origin = None);
    all.lines.iter_mut().for_each(|line| line.origin = None);
    save_drawing(dir, &base, &all, OnConflict::Overwrite)
}

fn replace(dir: &Path, zones: &[Zone]) -> Result<SavedDrawing> {
    save(dir, |drawing| drawing.zones = zones.to_vec())
}

/// Text with other zones.
fn with_zones(text: &str, zones: &[Zone]) -> String {
    let present = Drawing::of_text(text).unwrap();
    let drawing = Drawing { zones: zones.to_vec(), ..present.clone() };
    rewritten(text, &present, &drawing).unwrap()
}

fn zone(name: &str, x: f64, kind: ZoneKind) -> Zone {
    let polygon = Polygon::rectangle(Point2::new(x, 0.1), Point2::new(x + 1.0, 1.0 / 3.0));
    Zone { name: name.into(), polygon, kind }
}

#[test]
fn zones_that_stay_leave_every_byte() {
    for layout in [SCENE.to_owned(), SCENE.replace('\n', "\r\n"), format!("{SCENE}\n\n# end\n")] {
        let folder = room(&layout);
        replace(folder.path(), &zones(folder.path())).unwrap();
        assert_eq!(text(folder.path()), layout);
    }
}

#[test]
fn only_what_a_zone_says_differently_is_written() {
    let folder = room(SCENE);
    let mut changed = zones(folder.path());
    changed[0].kind = ZoneKind::Both;
    changed[0].polygon.0[2].y = 2.5;
    changed[1].name = "gate\t\"B\"".replace('\t', " ");
    changed[1].kind = ZoneKind::Entry;
    replace(folder.path(), &changed).unwrap();
    let expected = SCENE
        .replace("kind=\"exit\"", "kind=\"both\"")
        .replace("[\n  [0, 0],   # hinge\n  [1.0, 0], [1, 1],\n]", "[[0.0, 0.0], [1.0, 0.0], [1.0, 2.5]]")
        .replace("name = \"gate\"\n", "name = 'gate \"B\"'\nkind = \"entry\"\n");
    assert_eq!(text(folder.path()), expected);
    assert_eq!(zones(folder.path()), changed);
}

#[test]
fn zones_come_after_the_last_and_go_with_their_lines() {
    let folder = room(SCENE);
    let mut all = zones(folder.path());
    let gate = all.remove(1);
    all.push(zone("new", 5.0, ZoneKind::Entry));
    replace(folder.path(), &all).unwrap();
    let table = "\n  [[zone]]\n  polygon = [[3.0, 0.0], [4.0, 0.0], [4.0, 1.0]]\n  name = \"gate\"\n";
    let new = "\n[[zone]]\nname = \"new\"\n\
               polygon = [[5.0, 0.1], [6.0, 0.1], [6.0, 0.3333333333333333], [5.0, 0.3333333333333333]]\n\
               kind = \"entry\"\n";
    assert_eq!(text(folder.path()), SCENE.replace(table, new));
    assert_eq!(zones(folder.path()), all);
    // In reverse order, and down to no zone: everything outside the zones is preserved.
    replace(folder.path(), &[gate]).unwrap();
    replace(folder.path(), &[]).unwrap();
    let first = &SCENE[SCENE.find("[[zone]]").unwrap()..SCENE.find("\n[[camera]]").unwrap()];
    assert_eq!(text(folder.path()), SCENE.replace(table, "").replace(first, ""));
    assert!(zones(folder.path()).is_empty());
}

#[test]
fn zones_in_one_line_become_tables() {
    for list in ["[{ name = \"a\", polygon = [[0, 0], [1, 0], [1, 1]] }]", "[]"] {
        let layout = format!("zone = {list} # all\n{}", without_zones());
        let folder = room(&layout);
        let mut all = zones(folder.path());
        all.push(zone("b", 2.0, ZoneKind::Both));
        replace(folder.path(), &all).unwrap();
        assert_eq!(zones(folder.path()), all);
        assert!(text(folder.path()).starts_with(&without_zones()));
    }
}

fn without_zones() -> String {
    let (first, gate) = (SCENE.find("[[zone]]").unwrap(), SCENE.find("  [[zone]]").unwrap());
    let (camera, after) = (SCENE.find("[[camera]]").unwrap(), SCENE.find("# after").unwrap());
    [&SCENE[..first], &SCENE[camera..gate], &SCENE[after..]].concat()
}

/// The zones of a file, and all else.
#[derive(Debug, PartialEq, Deserialize)]
struct Tables {
    #[serde(default)]
    zone: Vec<toml::Table>,
    #[serde(flatten)]
    others: toml::Table,
}

/// Tables and keys of a later version, and comments at places where an edit could lose them.
#[test]
fn unknown_tables_and_all_comments_outlive_every_zone() {
    let later = SCENE
        .replace(
            "kind=\"exit\"\n",
            "kind=\"exit\"\ncolor = 'red'\n\n[[sofa]]\n# of the sofa\nname = \"sofa\"\n",
        )
        .replace("# after the gate", "# after the gate\n[[table]]\nends = [[0, 0], [1, 1]]");
    let document = |text: &str| -> Tables { Tables { zone: Vec::new(), ..toml::from_str(text).unwrap() } };
    let door = Drawing::of_text(&later).unwrap().zones.remove(0);
    let mut text = with_zones(&later, &[Zone { kind: ZoneKind::Both, ..door }]);
    assert!(text.contains("kind=\"both\"\ncolor = 'red'\n"), "{text}");
    for zones in [vec![], vec![zone("new", 1.0, ZoneKind::Exit)], vec![]] {
        text = with_zones(&text, &zones);
        assert_eq!(document(&text), document(&later));
        for comment in
            ["# my room", "# of the file", "# The doors.", "# north", "# of the sofa", "# after the gate"]
        {
            assert_eq!(text.matches(comment).count(), 1, "{comment} in\n{text}");
        }
    }
    let line = "format = 1\n# doors\nzone = []\n[floor]\n# the end\n";
    let text = with_zones(line, &[zone("new", 1.0, ZoneKind::Both)]);
    assert_eq!(
        text.lines().filter(|line| line.starts_with('#')).collect::<Vec<_>>(),
        ["# doors", "# the end"]
    );
    assert!(text.find("# the end") < text.find("[[zone]]"), "{text}");
}

#[test]
fn invalid_zones_are_refused_by_name_and_nothing_is_written() {
    let folder = room(SCENE);
    let bow_tie =
        Polygon([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)].map(|(x, y)| Point2::new(x, y)).to_vec());
    let door = zone("door", 0.0, ZoneKind::Both);
    let round = Polygon((0..1001).map(|i| Point2::new(f64::from(i).cos(), f64::from(i).sin())).collect());
    for (bad, words) in [
        (
            vec![door.clone(), Zone { polygon: bow_tie, ..zone("knot", 0.0, ZoneKind::Both) }],
            "zone 2 (`knot`): its outline meets itself: the edge from corner 1 to 2 and the one from 3 to 4",
        ),
        (vec![Zone { name: " ".into(), ..door.clone() }], "zone 1 (` `): it has no name"),
        (vec![door.clone(), door.clone()], "zone 2 (`door`): another zone has the same name"),
        (vec![Zone { name: "a\nb".into(), ..door.clone() }], "line break"),
        (vec![Zone { polygon: Polygon(door.polygon.0[..2].to_vec()), ..door.clone() }], "3 corners"),
        (vec![Zone { polygon: round, ..door.clone() }], "1001 corners"),
    ] {
        let said = replace(folder.path(), &bad).unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
        assert_eq!(text(folder.path()), SCENE);
    }
}

#[cfg(unix)]
#[test]
fn links_and_protected_files_are_named_and_left_alone() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let (folder, linked) = (room(SCENE), tempfile::tempdir().unwrap());
    let link = linked.path().join(SCENE_FILE);
    symlink(folder.path().join(SCENE_FILE), &link).unwrap();
    let said = replace(linked.path(), &[]).unwrap_err().to_string();
    assert!(said.contains("symbolic link") && said.contains(&*link.to_string_lossy()), "{said}");
    assert!(link.is_symlink());
    let protected = std::fs::Permissions::from_mode(0o444);
    std::fs::set_permissions(folder.path().join(SCENE_FILE), protected).unwrap();
    let said = replace(folder.path(), &[]).unwrap_err().to_string();
    assert!(said.contains("chmod u+w"), "{said}");
    assert_eq!(text(folder.path()), SCENE);
}

fn some_zones() -> impl Strategy<Value = Vec<Zone>> {
    let kind = prop_oneof![Just(ZoneKind::Entry), Just(ZoneKind::Exit), Just(ZoneKind::Both)];
    let names = prop::sample::subsequence(vec!["door \"A\"", "gate", "b'", "ü\\", "[[zone]]"], 0..5);
    (names, prop::collection::vec((-9.0..9.0, kind), 5)).prop_map(|(names, rest)| {
        names.iter().zip(rest).map(|(name, (x, kind))| zone(name, x, kind)).collect()
    })
}

proptest! {
    /// For any sequence of zones, they are read back, and the rest of the file is preserved.
    #[test]
    fn zones_read_back_as_they_were_saved(steps in prop::collection::vec(some_zones(), 1..4), crlf: bool) {
        let newline = if crlf { "\r\n" } else { "\n" };
        let folder = room(&SCENE.replace('\n', newline));
        for step in &steps {
            replace(folder.path(), step).unwrap();
            let mut back = zones(folder.path());
            let mut asked = step.clone();
            back.sort_by(|a, b| a.name.cmp(&b.name));
            asked.sort_by(|a, b| a.name.cmp(&b.name));
            prop_assert_eq!(back, asked);
            let saved = text(folder.path());
            let of_two = if crlf { saved.matches('\n').count() } else { 0 };
            prop_assert_eq!(saved.matches("\r\n").count(), of_two, "line ends are mixed");
        }
        replace(folder.path(), &[]).unwrap();
        let squeezed = |text: &str| text.lines().filter(|l| !l.trim().is_empty()).map(String::from).collect::<Vec<_>>();
        prop_assert_eq!(squeezed(&text(folder.path())), squeezed(&without_zones()));
    }
}
