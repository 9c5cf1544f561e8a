//! Drawings merged with what changed in the file meanwhile.

use super::*;
use crate::room::{Line, Region};

fn region(name: &str, x: f64) -> Region {
    Region { name: name.into(), polygon: zone("", x, ZoneKind::Both).polygon, dwell_s: None }
}

/// A room, its drawing, and the same with origins, to be edited.
fn loaded() -> (TempDir, Drawing, EditedDrawing) {
    let folder = room(SCENE);
    let base = drawing(folder.path());
    let edits = edited(&base);
    (folder, base, edits)
}

/// Replaces a text in the scene file, as another program would.
fn outside(dir: &Path, from: &str, to: &str) {
    let before = text(dir);
    assert!(before.contains(from), "no {from}");
    std::fs::write(dir.join(SCENE_FILE), before.replace(from, to)).unwrap();
}

#[test]
fn regions_lines_and_floor_are_written_like_zones() {
    let folder = room(SCENE);
    let saved = save(folder.path(), |all| {
        all.regions[0].dwell_s = None;
        all.regions.push(region("shelf", 2.0));
        all.lines[0].points[1] = Point2::new(2.0, 1.5);
        all.floor[0].0[2] = Point2::new(9.0, 8.0);
    })
    .unwrap();
    let shelf = "\n[[region]]\nname = \"shelf\"\n\
                 polygon = [[2.0, 0.1], [3.0, 0.1], [3.0, 0.3333333333333333], [2.0, 0.3333333333333333]]\n";
    let expected = SCENE
        .replace("dwell_s = 60.0\n", shelf)
        .replace("points = [[2, 0], [2, 1]]", "points = [[2.0, 0.0], [2.0, 1.5]]")
        .replace("[9.0, 9.0]]] # all", "[9.0, 8.0]]] # all");
    assert_eq!(text(folder.path()), expected);
    assert_eq!((drawing(folder.path()), saved.is_merged), (saved.drawing, false));
    // Without lines and floor their tables are gone, and the room is derived from its geometry again.
    save(folder.path(), |all| (all.lines, all.floor) = (vec![], vec![])).unwrap();
    let left = text(folder.path());
    assert!(
        !left.contains("[[line]]") && !left.contains("[floor]") && left.contains("# the red one"),
        "{left}"
    );
    // And come back at the end.
    save(folder.path(), |all| {
        all.lines.push(Line { name: "l".into(), points: vec![Point2::origin(), Point2::new(1.0, 2.0)] });
        all.floor.push(region("", 0.0).polygon);
    })
    .unwrap();
    let added = text(folder.path());
    assert!(added.starts_with(left.trim_end()), "{added}");
    let (line, floor) = (added.find("\n[[line]]\n").unwrap(), added.find("\n[floor]\n").unwrap());
    assert!(left.len() <= line + 1 && line < floor, "{added}");
}

#[test]
fn what_changed_on_one_side_alone_is_kept_from_there() {
    let (folder, base, mut edits) = loaded();
    outside(folder.path(), "kind=\"exit\"", "kind=\"entry\" # by hand");
    outside(folder.path(), "dwell_s = 60.0", "dwell_s = 30.0");
    outside(folder.path(), "points = [[2, 0], [2, 1]]", "points = [[2, 0], [2, 2]]");
    outside(folder.path(), "format = 1", "# measured again\nformat = 1");
    edits.zones[0].item.name = "front door".into();
    edits.zones[1].item.polygon.0[1].x = 4.5;
    edits.regions[0].item.name = "till".into();
    edits.lines[0].item.name = "way out".into();
    edits.zones.push(Edited { item: zone("new", 7.0, ZoneKind::Both), origin: None });
    let saved = save_drawing(folder.path(), &base, &edits, OnConflict::Refuse).unwrap();
    assert!(saved.is_merged);
    assert_eq!(saved.version, SceneVersion::of(folder.path()).unwrap());
    let after = drawing(folder.path());
    assert_eq!(after, saved.drawing);
    let names: Vec<&str> = after.zones.iter().map(|zone| zone.name.as_str()).collect();
    assert_eq!(names, ["front door", "gate", "new"]);
    assert_eq!((after.zones[0].kind, after.zones[1].polygon.0[1].x), (ZoneKind::Entry, 4.5));
    assert_eq!((after.regions[0].name.as_str(), after.regions[0].dwell_s), ("till", Some(30.0)));
    assert_eq!((after.lines[0].name.as_str(), after.lines[0].points[1].y), ("way out", 2.0));
    for comment in ["# by hand", "# measured again", "# hinge", "# the red one", "# all of it"] {
        assert!(text(folder.path()).contains(comment), "{comment}");
    }
}

#[test]
fn additions_and_removals_of_both_sides_are_kept() {
    let (folder, base, mut edits) = loaded();
    let table = "\n[[zone]]\nname = \"theirs\"\npolygon = [[5, 5], [6, 5], [6, 6]]\n\n[[zone]]\nname = \"both\"\n\
                 polygon = [[7, 7], [8, 7], [8, 8]]\n\n[floor]";
    outside(folder.path(), "\n[floor]", table);
    outside(folder.path(), "[[line]]\nname = \"till\"\npoints = [[2, 0], [2, 1]]\n", "");
    edits.zones.remove(1);
    let both = Polygon(vec![Point2::new(7.0, 7.0), Point2::new(8.0, 7.0), Point2::new(8.0, 8.0)]);
    let both = Zone { name: "both".into(), polygon: both, kind: ZoneKind::Both };
    for item in [zone("mine", 1.0, ZoneKind::Exit), both] {
        edits.zones.push(Edited { item, origin: None });
    }
    let saved = save_drawing(folder.path(), &base, &edits, OnConflict::Refuse).unwrap();
    let names: Vec<&str> = saved.drawing.zones.iter().map(|zone| zone.name.as_str()).collect();
    assert_eq!(names, ["door \"A\"", "theirs", "both", "mine"]);
    assert!(saved.drawing.lines.is_empty() && saved.is_merged);
    assert_eq!(drawing(folder.path()), saved.drawing);
}

#[test]
fn what_changed_on_both_sides_is_told_and_saved_only_when_asked_to() {
    /// Edit, text that another program replaces, its replacement, and words of the refusal.
    type Case = (fn(&mut EditedDrawing), &'static str, &'static str, &'static str);
    let changes: [Case; 6] = [
        (
            |all| all.zones[0].item.polygon.0[2].y = 3.0,
            "[1, 1],\n]",
            "[1, 2],\n]",
            "zone `door \"A\"`: moved both here and in the file",
        ),
        (|all| all.lines[0].item.name = "a".into(), "\"till\"", "\"b\"", "line `till`: renamed both"),
        (|all| all.regions[0].item.dwell_s = None, "60.0", "61.0", "region `counter`: its kind or duration"),
        (
            |all| drop(all.regions.remove(0)),
            "60.0",
            "61.0",
            "region `counter`: removed here, changed in the file",
        ),
        (
            |all| all.lines[0].item.points[0].x = 1.0,
            "[[line]]\nname = \"till\"\npoints = [[2, 0], [2, 1]]\n",
            "",
            "line `till`: changed here, removed in the file",
        ),
        (|all| all.floor.clear(), "[9.0, 9.0]]]", "[9.0, 7.0]]]", "[floor]: changed both"),
    ];
    for (edit, from, to, words) in changes {
        let (folder, base, mut edits) = loaded();
        outside(folder.path(), from, to);
        let before = text(folder.path());
        edit(&mut edits);
        // A change elsewhere is not saved with it by halves.
        edits.zones[1].item.kind = ZoneKind::Entry;
        let said = save_drawing(folder.path(), &base, &edits, OnConflict::Refuse).unwrap_err();
        assert!(matches!(said, Error::Conflict { .. }), "{said}");
        let said = said.to_string();
        assert!(said.contains(words) && said.contains("scene.toml: ") && !said.contains("gate"), "{said}");
        assert_eq!(text(folder.path()), before);
        let saved = save_drawing(folder.path(), &base, &edits, OnConflict::Overwrite).unwrap();
        assert!(!saved.is_merged, "{words}");
        assert_eq!(drawing(folder.path()), saved.drawing);
    }
}

#[test]
fn the_same_change_on_both_sides_is_no_conflict() {
    let (folder, base, mut edits) = loaded();
    outside(folder.path(), "dwell_s = 60.0", "dwell_s = 5.0");
    edits.regions[0].item.dwell_s = Some(5.0);
    let before = text(folder.path());
    let saved = save_drawing(folder.path(), &base, &edits, OnConflict::Refuse).unwrap();
    assert_eq!((text(folder.path()), saved.is_merged), (before, false));
}

#[test]
fn a_drawing_that_no_room_may_have_is_refused_as_the_reader_refuses_it() {
    type Case = (fn(&mut Drawing), &'static str);
    let folder = room(SCENE);
    let bad: [Case; 5] = [
        (|all| all.regions[0].name = "gate".into(), "region 1 (`gate`): another zone has the same name"),
        (|all| all.lines[0].points.truncate(1), "line 1 (`till`): a line needs at least 2 points"),
        (|all| all.regions[0].dwell_s = Some(-1.0), "dwell_s is -1"),
        (|all| all.floor[0].0.truncate(2), "floor, walkable polygon 1: a polygon needs at least 3 corners"),
        (
            |all| {
                let corners = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)];
                all.floor.push(Polygon(corners.map(|(x, y)| Point2::new(x, y)).to_vec()));
            },
            "floor, walkable polygon 2: its outline meets itself",
        ),
    ];
    for (change, words) in bad {
        let said = save(folder.path(), change).unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
        assert_eq!(text(folder.path()), SCENE);
    }
}
