//! Other zones in a `scene.toml`, everything else in it as it was, byte for byte.
//!
//! People write in that file, too. So it is not written anew from what was read: the parser only tells where each zone
//! stands, and the text between is left alone, comments, layout and line ends included. A zone keeps its table, with the
//! comments in it, as long as it keeps its name or its outline; tables of new zones follow the last one.

use std::fmt::Write;
use std::ops::Range;
use std::path::Path;

use calib::files::write_atomic;
use serde::{Deserialize, Serialize};
use toml::Spanned;
use toml::de::DeTable;

use super::read::scene_file_in;
use super::validate::drawn_zones_defect;
use super::{Zone, ZoneKind};
use crate::polygon::Polygon;
use crate::{Error, Result};

/// Corners closer than this, in metres, are the same: a number may have gone to a page and back.
const SAME_M: f64 = 1e-9;

/// Which state of a `scene.toml` something was made from: a hash of its bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SceneVersion(String);

impl SceneVersion {
    /// The state that the file of a room directory is in now.
    ///
    /// # Errors
    /// [`Error::Content`] when there is no such file, [`Error::Io`] when it cannot be read.
    pub fn of(dir: &Path) -> Result<Self> {
        let path = scene_file_in(dir)?;
        let bytes = std::fs::read(&path).map_err(|source| Error::Io { path, source })?;
        Ok(Self::of_bytes(&bytes))
    }

    fn of_bytes(bytes: &[u8]) -> Self {
        Self(blake3::hash(bytes).to_hex().to_string())
    }
}

/// Gives a room directory other zones, in place of those it has, and returns the file's new version. Nothing but the
/// `[[zone]]` tables changes; the file is written whole or not at all.
///
/// # Errors
/// [`Error::Room`] for zones nobody should draw: without a name, with the name of another, not simple, without area.
/// [`Error::Changed`] when the file is not of that version any more. [`Error::Content`] when it cannot be parsed, must
/// not be written, or is a link; [`Error::Io`] or [`Error::Calib`] when it cannot be read or written.
pub fn replace_zones(dir: &Path, zones: &[Zone], version: &SceneVersion) -> Result<SceneVersion> {
    if let Some((place, problem)) = drawn_zones_defect(zones) {
        return Err(Error::Room { place, problem });
    }
    let path = scene_file_in(dir)?;
    refuse_what_is_not_ours_to_write(&path)?;
    let text = calib::files::read_text(&path)?;
    if SceneVersion::of_bytes(text.as_bytes()) != *version {
        return Err(Error::Changed { path });
    }
    let rewritten = rewritten(&text, zones)
        .map_err(|e| Error::content(&path, "[[zone]]", e.message().replace('\n', " ")))?;
    write_atomic(&path, rewritten.as_bytes())?;
    Ok(SceneVersion::of_bytes(rewritten.as_bytes()))
}

/// A file takes the place of another by its name: a link would become a file, and a protection against writing be lost.
fn refuse_what_is_not_ours_to_write(path: &Path) -> Result<()> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let problem = if path.symlink_metadata().map_err(io)?.is_symlink() {
        "it is a symbolic link; edit the room it leads to, or put a copy here"
    } else if path.metadata().map_err(io)?.permissions().readonly() {
        "it is protected against writing; allow it (chmod u+w), or edit a copy of the room"
    } else {
        return Ok(());
    };
    Err(Error::content(path, "whole file", problem))
}

/// What is looked at of a `scene.toml`.
#[derive(Deserialize)]
struct Tables {
    #[serde(default)]
    zone: Vec<Spanned<Table>>,
}

/// A zone, and where its values stand.
#[derive(Deserialize)]
struct Table {
    name: Spanned<String>,
    polygon: Spanned<Polygon>,
    kind: Option<Spanned<ZoneKind>>,
}

impl Table {
    /// The end of the value that stands last.
    fn end(&self) -> usize {
        let kind = self.kind.as_ref().map_or(0, |kind| kind.span().end);
        self.name.span().end.max(self.polygon.span().end).max(kind)
    }
}

/// A piece of the text and what takes its place.
type Cut = (Range<usize>, String);

/// The text of a scene file with other zones.
fn rewritten(text: &str, zones: &[Zone]) -> std::result::Result<String, toml::de::Error> {
    let Tables { zone: tables } = toml::from_str(text)?;
    let newline = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let mut cuts: Vec<Cut> = Vec::new();
    let mut is_new = vec![true; zones.len()];
    // Where new tables go.
    let mut end = text.len();
    if let Some(assignment) = assigned(text)? {
        // `zone = [{ … }]`: one value, for which tables are written instead, since lines cannot be put into all of those.
        cuts.push((lines(text, assignment), String::new()));
    } else {
        let kept = kept(&tables, zones);
        for (table, kept) in tables.iter().zip(kept) {
            let place = table.span().start..table.get_ref().end();
            end = end_of_line(text, place.end);
            if let Some(i) = kept {
                is_new[i] = false;
                cuts.extend(changes(text, table.get_ref(), &zones[i], newline));
            } else {
                cuts.push((lines(text, place), String::new()));
            }
        }
    }
    let mut added = String::new();
    for (zone, _) in zones.iter().zip(is_new).filter(|(_, is_new)| *is_new) {
        added += &written(zone, newline);
    }
    if !added.is_empty() && !text[..end].is_empty() && !text[..end].ends_with('\n') {
        added.insert_str(0, newline);
    }
    cuts.push((end..end, added));
    // What is put in at a place comes after what is cut away before it.
    cuts.sort_by_key(|(range, _)| (range.start, range.end));
    let mut result = String::with_capacity(text.len());
    let mut at = 0;
    for (range, instead) in cuts {
        result += &text[at..range.start];
        result += &instead;
        at = range.end;
    }
    result += &text[at..];
    Ok(result)
}

/// Where `zone = …` stands, if the zones are written as a value and not as tables.
fn assigned(text: &str) -> std::result::Result<Option<Range<usize>>, toml::de::Error> {
    let document = DeTable::parse(text)?;
    let Some((key, value)) = document.get_ref().get_key_value("zone") else { return Ok(None) };
    // The span of tables is that of the first header; a list of lists is no list of zones.
    let is_value = !text[value.span()].starts_with("[[");
    Ok(is_value.then(|| key.span().start..value.span().end))
}

/// For each table the zone that it belongs to from now on: the one of its name, else the one of its outline.
fn kept(tables: &[Spanned<Table>], zones: &[Zone]) -> Vec<Option<usize>> {
    let mut of_table = vec![None; tables.len()];
    let mut taken = vec![false; zones.len()];
    let belongs: [fn(&Table, &Zone) -> bool; 2] = [
        |table, zone| *table.name.get_ref() == zone.name,
        |table, zone| is_same(table.polygon.get_ref(), &zone.polygon),
    ];
    for belongs in belongs {
        for (table, of_table) in tables.iter().zip(&mut of_table).filter(|(_, zone)| zone.is_none()) {
            *of_table = (0..zones.len()).find(|i| !taken[*i] && belongs(table.get_ref(), &zones[*i]));
            if let Some(i) = *of_table {
                taken[i] = true;
            }
        }
    }
    of_table
}

fn is_same(a: &Polygon, b: &Polygon) -> bool {
    a.0.len() == b.0.len() && a.0.iter().zip(&b.0).all(|(a, b)| (a - b).amax() <= SAME_M)
}

/// The values of a table that differ from a zone's.
fn changes(text: &str, table: &Table, zone: &Zone, newline: &str) -> Vec<Cut> {
    let mut cuts = Vec::new();
    if *table.name.get_ref() != zone.name {
        cuts.push((table.name.span(), name_text(&zone.name)));
    }
    if !is_same(table.polygon.get_ref(), &zone.polygon) {
        cuts.push((table.polygon.span(), polygon_text(&zone.polygon)));
    }
    match &table.kind {
        Some(kind) if *kind.get_ref() != zone.kind => cuts.push((kind.span(), kind_text(zone.kind).into())),
        None if zone.kind != ZoneKind::default() => {
            let end = end_of_line(text, table.end());
            let line = format!("kind = {}", kind_text(zone.kind));
            let is_ended = text[..end].ends_with('\n');
            let line = if is_ended { line + newline } else { newline.to_owned() + &line };
            cuts.push((end..end, line));
        }
        _ => {}
    }
    cuts
}

/// A zone's table, with an empty line before it.
fn written(zone: &Zone, newline: &str) -> String {
    let (name, polygon) = (name_text(&zone.name), polygon_text(&zone.polygon));
    let mut table = format!("{newline}[[zone]]{newline}name = {name}{newline}polygon = {polygon}{newline}");
    if zone.kind != ZoneKind::default() {
        // Writing to a string cannot fail.
        let _ = write!(table, "kind = {}{newline}", kind_text(zone.kind));
    }
    table
}

fn name_text(name: &str) -> String {
    toml::Value::from(name).to_string()
}

fn polygon_text(polygon: &Polygon) -> String {
    let corners: Vec<String> = polygon.0.iter().map(|p| format!("[{:?}, {:?}]", p.x, p.y)).collect();
    format!("[{}]", corners.join(", "))
}

fn kind_text(kind: ZoneKind) -> &'static str {
    match kind {
        ZoneKind::Entry => "\"entry\"",
        ZoneKind::Exit => "\"exit\"",
        ZoneKind::Both => "\"both\"",
    }
}

/// The whole lines that a piece of the text stands on, with the empty line before them, if there is one.
fn lines(text: &str, place: Range<usize>) -> Range<usize> {
    let start_of_line = |at: usize| text[..at].rfind('\n').map_or(0, |i| i + 1);
    let start = start_of_line(place.start);
    let before = start_of_line(start.saturating_sub(1));
    let start = if text[before..start].trim().is_empty() { before } else { start };
    start..end_of_line(text, place.end)
}

/// The place after the line break that ends the line of a place, or the text's end.
fn end_of_line(text: &str, at: usize) -> usize {
    text[at..].find('\n').map_or(text.len(), |i| at + i + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room::{Room, SCENE_FILE};
    use nalgebra::Point2;
    use proptest::prelude::*;
    use tempfile::TempDir;

    /// As somebody may have written it: comments everywhere, cameras between zones, odd spaces, no line end at the end.
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

  [[ zone ]]
  polygon = [[3.0, 0.0], [4.0, 0.0], [4.0, 1.0]]
  name = "gate"
# after the gate
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

    fn replace(dir: &Path, zones: &[Zone]) -> Result<SceneVersion> {
        replace_zones(dir, zones, &SceneVersion::of(dir).unwrap())
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
        let table = "\n  [[ zone ]]\n  polygon = [[3.0, 0.0], [4.0, 0.0], [4.0, 1.0]]\n  name = \"gate\"\n";
        let new = "\n[[zone]]\nname = \"new\"\n\
                   polygon = [[5.0, 0.1], [6.0, 0.1], [6.0, 0.3333333333333333], [5.0, 0.3333333333333333]]\n\
                   kind = \"entry\"\n";
        assert_eq!(text(folder.path()), SCENE.replace(table, new));
        assert_eq!(zones(folder.path()), all);
        // The other way round, and down to none: everything that is no zone's stays.
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
        let (first, gate) = (SCENE.find("[[zone]]").unwrap(), SCENE.find("  [[ zone ]]").unwrap());
        let (camera, after) = (SCENE.find("[[camera]]").unwrap(), SCENE.find("# after").unwrap());
        [&SCENE[..first], &SCENE[camera..gate], &SCENE[after..]].concat()
    }

    #[test]
    fn what_nobody_should_draw_is_refused_by_name_and_nothing_is_written() {
        let folder = room(SCENE);
        let bow_tie = Polygon(
            [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)].map(|(x, y)| Point2::new(x, y)).to_vec(),
        );
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

    #[test]
    fn a_file_that_changed_meanwhile_is_left_alone() {
        let folder = room(SCENE);
        let version = SceneVersion::of(folder.path()).unwrap();
        let second = replace_zones(folder.path(), &[zone("a", 0.0, ZoneKind::Both)], &version).unwrap();
        assert_eq!(second, SceneVersion::of(folder.path()).unwrap());
        let before = text(folder.path());
        let said = replace_zones(folder.path(), &[], &version).unwrap_err();
        assert!(matches!(said, Error::Changed { .. }) && said.to_string().contains("scene.toml: "), "{said}");
        assert_eq!(text(folder.path()), before);
        replace_zones(folder.path(), &[], &second).unwrap();
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
        /// Whatever zones follow each other, they are read back, and what is no zone's stays.
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
}
