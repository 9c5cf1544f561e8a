//! Other picks and another scale in a `room.toml`, with everything else preserved: comments, layout, tables of cameras.
//!
//! The file is changed as a document (`toml_edit`), not serialised anew, and replaced in one step. A save names the version
//! of the file that it was made from, so that it does not undo what another program changed meanwhile.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, Value};

use super::metres::ScaleTable;
use super::tables::ProjectFile;
use crate::{Error, Result};

/// Difference below which pixels are the same: one may have gone to a page and back.
const SAME_PX: f64 = 1e-6;

/// The part of a project that a person picks in pictures.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picked {
    /// The `[[point]]` tables.
    pub points: Vec<PickedTable>,
    /// The `[scale]` table, or the `[[scale]]` tables; without any they stay as they are.
    pub scale: Vec<ScaleTable>,
}

/// One `[[point]]` table.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PickedTable {
    /// Number of the table in the file, from 1; `None` for a new one.
    #[serde(default)]
    pub number: Option<usize>,
    /// Pixel in each camera, by name.
    pub picks: BTreeMap<String, [f64; 2]>,
}

/// Version of a project file: a hash of its bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ProjectVersion(String);

impl ProjectVersion {
    fn of(text: &str) -> Self {
        Self(blake3::hash(text.as_bytes()).to_hex().to_string())
    }
}

/// Reads what is picked in a project file.
///
/// # Errors
/// [`Error::Calib`] for a file that cannot be read or parsed.
pub fn read_picked(path: &Path) -> Result<(Picked, ProjectVersion)> {
    let text = calib::files::read_text(path)?;
    Ok((picked_of(path, &text)?, ProjectVersion::of(&text)))
}

fn picked_of(path: &Path, text: &str) -> Result<Picked> {
    let ProjectFile { point, scale, .. } = calib::files::parse_toml(path, text)?;
    let numbered = (1..).zip(point);
    let points = numbered.map(|(number, picks)| PickedTable { number: Some(number), picks }).collect();
    Ok(Picked { points, scale })
}

/// Writes what is picked into the project file that was read at `version`; returns what it has from now on.
///
/// # Errors
/// [`Error::Changed`] when the file has been changed since; [`Error::File`] for picks that no project may have;
/// [`Error::Calib`] for a file that cannot be read or written.
pub fn save_picked(
    path: &Path,
    version: &ProjectVersion,
    picked: &Picked,
) -> Result<(Picked, ProjectVersion)> {
    let text = calib::files::read_text(path)?;
    if ProjectVersion::of(&text) != *version {
        return Err(Error::Changed(path.to_owned()));
    }
    let rewritten = rewritten(&text, picked).map_err(|problem| Error::content(path, "picks", problem))?;
    let file: ProjectFile = calib::files::parse_toml(path, &rewritten)?;
    let cameras = file.cameras(path)?;
    file.points(path, &cameras)?;
    if !file.scale.is_empty() {
        file.lengths(path, &cameras)?;
    }
    if rewritten != text {
        calib::files::write_atomic(path, rewritten.as_bytes())?;
    }
    Ok((picked_of(path, &rewritten)?, ProjectVersion::of(&rewritten)))
}

/// Text of a project file with other picks.
fn rewritten(text: &str, picked: &Picked) -> std::result::Result<String, String> {
    let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| e.message().to_owned())?;
    let before = match document.remove("point") {
        None => ArrayOfTables::new(),
        Some(Item::ArrayOfTables(tables)) => tables,
        Some(_) => return Err("the points are no [[point]] tables; write each as a table of its own".into()),
    };
    let mut after = ArrayOfTables::new();
    for point in &picked.points {
        let old = point.number.map(|number| {
            before.get(number.wrapping_sub(1)).cloned().ok_or(format!("there is no [[point]] {number}"))
        });
        after.push(with_picks(old.transpose()?, &point.picks));
    }
    if !after.is_empty() {
        document.insert("point", Item::ArrayOfTables(after));
    }
    if !toml::from_str::<ProjectFile>(text).is_ok_and(|file| file.scale == picked.scale) {
        set_scales(&mut document, &picked.scale)?;
    }
    let mut rewritten = document.to_string();
    if !text.ends_with('\n') && rewritten.ends_with('\n') {
        rewritten.pop();
    }
    // The document is written with line feeds alone.
    Ok(if text.contains("\r\n") { rewritten.replace('\n', "\r\n") } else { rewritten })
}

/// A new table, an empty line above it.
fn spaced() -> Table {
    let mut table = Table::new();
    table.decor_mut().set_prefix("\n");
    table
}

/// A table with these picks: those that stay keep their layout.
fn with_picks(old: Option<Table>, picks: &BTreeMap<String, [f64; 2]>) -> Table {
    let mut table = old.unwrap_or_else(spaced);
    let gone: Vec<String> =
        table.iter().map(|(key, _)| key.to_owned()).filter(|key| !picks.contains_key(key)).collect();
    for key in gone {
        table.remove(&key);
    }
    for (camera, pixel) in picks {
        set(&mut table, camera, pair(pixel));
    }
    table
}

/// Writes the scales: one as a `[scale]` table, unless there are `[[scale]]` tables already, several as those. The table of a
/// scale keeps its layout and comments; one that is gone is the last that differs.
fn set_scales(document: &mut DocumentMut, scales: &[ScaleTable]) -> std::result::Result<(), String> {
    if scales.is_empty() {
        return Ok(());
    }
    let comment = document.key("scale").and_then(|key| key.leaf_decor().prefix().cloned());
    let item = document.entry("scale").or_insert_with(|| match scales {
        [_] => Item::Table(spaced()),
        _ => Item::ArrayOfTables(ArrayOfTables::new()),
    });
    if let ([scale], Some(table)) = (scales, item.as_table_like_mut()) {
        return set_scale(table, scale);
    }
    let problem =
        "`scale` is neither a table nor an array of tables; write it as [scale], or as [[scale]] tables";
    let is_inline = item.is_inline_table();
    let mut tables = match std::mem::take(item) {
        one @ (Item::Table(_) | Item::Value(Value::InlineTable(_))) => {
            let mut table = one.into_table().map_err(|_| problem)?;
            // Of `scale.camera = …`, too.
            table.set_dotted(false);
            if let Some(comment) = comment.filter(|_| is_inline) {
                table.decor_mut().set_prefix(comment);
            }
            ArrayOfTables::from_iter([table])
        }
        several => several.into_array_of_tables().map_err(|_| problem)?,
    };
    let stated = |table: &Table| toml::from_str::<ScaleTable>(&table.to_string()).ok();
    // Those that are no longer asked for go, from the end on, until as many are left.
    for index in (0..tables.len()).rev() {
        let is_asked = tables.get(index).and_then(stated).is_some_and(|table| scales.contains(&table));
        if tables.len() > scales.len() && !is_asked {
            tables.remove(index);
        }
    }
    while tables.len() > scales.len() {
        tables.remove(tables.len() - 1);
    }
    while tables.len() < scales.len() {
        tables.push(spaced());
    }
    for (table, scale) in tables.iter_mut().zip(scales) {
        set_scale(table, scale)?;
    }
    *item = Item::ArrayOfTables(tables);
    Ok(())
}

fn set_scale(table: &mut dyn toml_edit::TableLike, scale: &ScaleTable) -> std::result::Result<(), String> {
    let stated = toml::Table::try_from(scale).map_err(|e| e.to_string())?;
    let gone: Vec<String> =
        table.iter().map(|(key, _)| key.to_owned()).filter(|key| !stated.contains_key(key)).collect();
    for key in gone {
        table.remove(&key);
    }
    for (key, value) in stated {
        // The only arrays are pixels.
        let value = match value {
            toml::Value::String(text) => text.into(),
            toml::Value::Float(number) => number.into(),
            toml::Value::Array(pixel) => {
                pixel.iter().filter_map(toml::Value::as_float).collect::<Array>().into()
            }
            other => return Err(format!("[scale], {key}: {other} is not understood")),
        };
        set(table, &key, value);
    }
    Ok(())
}

/// Sets a value unless it is the same; the comment behind it stays.
fn set(table: &mut dyn toml_edit::TableLike, key: &str, mut value: Value) {
    if let Some(old) = table.get(key).and_then(Item::as_value) {
        if is_same(old, &value) {
            return;
        }
        *value.decor_mut() = old.decor().clone();
    }
    table.insert(key, Item::Value(value));
}

fn is_same(old: &Value, new: &Value) -> bool {
    let number = |value: &Value| value.as_float().or_else(|| value.as_integer().map(|i| i as f64));
    match (old, new) {
        (Value::Array(old), Value::Array(new)) => {
            old.len() == new.len() && old.iter().zip(new).all(|(old, new)| is_same(old, new))
        }
        (Value::String(old), Value::String(new)) => old.value() == new.value(),
        _ => number(old).zip(number(new)).is_some_and(|(old, new)| (old - new).abs() < SAME_PX),
    }
}

/// A pixel, to a hundredth: finer than anybody picks.
fn pair(pixel: &[f64; 2]) -> Value {
    let rounded = pixel.map(|value| (100.0 * value).round() / 100.0);
    rounded.into_iter().collect::<Array>().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROJECT: &str = "# Kitchen, measured by hand.\n\n[[camera]]\nname = \"a\" # left\ncapture = \"a\"\n\n[[camera]]\n\
                           name = \"b\"\ncapture = \"b\"\n\n# the lamp\n[[point]]\na = [1.0, 2]  # its tip\nb = [3.0, 4.5]\n\n\
                           [[point]]\na = [10.0, 20.0]\nb = [30.0, 40.0]\n\n[scale]\ncamera = \"a\"\nheight = 2.4 # ladder\n";

    fn project() -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        for camera in ["a", "b"] {
            std::fs::create_dir(folder.path().join(camera)).unwrap();
        }
        let path = folder.path().join("room.toml");
        std::fs::write(&path, PROJECT).unwrap();
        (folder, path)
    }

    fn text(path: &Path) -> String {
        std::fs::read_to_string(path).unwrap()
    }

    #[test]
    fn what_is_not_changed_keeps_its_bytes() {
        let (_folder, path) = project();
        let (mut picked, version) = read_picked(&path).unwrap();
        assert_eq!(save_picked(&path, &version, &picked).unwrap().1, version);
        assert_eq!(text(&path), PROJECT);
        picked.points[0].picks.insert("b".into(), [7.254_9, 8.0]);
        let (saved, version) = save_picked(&path, &version, &picked).unwrap();
        assert_eq!(text(&path), PROJECT.replace("[3.0, 4.5]", "[7.25, 8.0]"));
        assert!((saved.points[0].picks["b"][0] - 7.25).abs() < 1e-9);
        picked.scale[0].height = Some(2.5);
        save_picked(&path, &version, &Picked { points: saved.points, ..picked }).unwrap();
        assert!(text(&path).contains("height = 2.5 # ladder"), "{}", text(&path));
    }

    #[test]
    fn points_come_and_go_and_the_scale_becomes_another() {
        let (_folder, path) = project();
        let (mut picked, version) = read_picked(&path).unwrap();
        picked.points.remove(0);
        let fresh = BTreeMap::from([("a".to_owned(), [5.0, 6.0]), ("b".to_owned(), [7.0, 8.0])]);
        picked.points.push(PickedTable { number: None, picks: fresh });
        picked.scale = vec![length_in_b()];
        let (saved, _) = save_picked(&path, &version, &picked).unwrap();
        let text = text(&path);
        assert_eq!(saved.points.iter().map(|p| p.number).collect::<Vec<_>>(), [Some(1), Some(2)]);
        assert!(
            text.starts_with("# Kitchen, measured by hand.\n\n[[camera]]\nname = \"a\" # left\n"),
            "{text}"
        );
        let places = ["b = [30.0, 40.0]", "\n[[point]]\na = [5.0, 6.0]\nb = [7.0, 8.0]\n", "\n[scale]\n"];
        let places = places.map(|part| text.find(part).unwrap_or_else(|| panic!("no {part} in {text}")));
        assert!(places.is_sorted() && !text.contains("lamp") && !text.contains("height"), "{text}");
        let lengths =
            ProjectFile::lengths(&calib::files::read_toml(&path).unwrap(), &path, &[named("a"), named("b")]);
        let [crate::project::KnownLength::Distance { camera: 1, metres, .. }] = lengths.unwrap()[..] else {
            panic!("no distance in {text}")
        };
        assert_eq!(metres.to_bits(), 1.2f64.to_bits());
    }

    #[test]
    fn a_second_length_makes_an_array_and_its_removal_leaves_the_other_as_it_was() {
        let (_folder, path) = project();
        let (mut picked, version) = read_picked(&path).unwrap();
        picked.scale.push(length_in_b());
        let (mut saved, version) = save_picked(&path, &version, &picked).unwrap();
        let several = text(&path);
        assert_eq!(saved.scale, picked.scale, "{several}");
        let kept = "\n[[scale]]\ncamera = \"a\"\nheight = 2.4 # ladder\n";
        assert!(several.contains(kept) && several.matches("[[scale]]").count() == 2, "{several}");
        saved.scale.pop();
        let (mut saved, version) = save_picked(&path, &version, &saved).unwrap();
        assert_eq!(text(&path), PROJECT.replace("[scale]", "[[scale]]"));
        saved.scale = vec![length_in_b()];
        let (saved, _) = save_picked(&path, &version, &saved).unwrap();
        assert_eq!(saved.scale, [length_in_b()]);
    }

    #[test]
    fn scales_in_other_notations_get_a_second_one() {
        for notation in [
            "# laser\nscale = { camera = \"a\", height = 2.4 }\n",
            "# laser\nscale.camera = \"a\"\nscale.height = 2.4\n",
            "# laser\nscale = [{ camera = \"a\", height = 2.4 }]\n",
        ] {
            let (_folder, path) = project();
            let tables = PROJECT.split("\n[scale]").next().unwrap();
            std::fs::write(&path, format!("{notation}{tables}")).unwrap();
            let before = text(&path);
            let (mut picked, version) = read_picked(&path).unwrap();
            assert_eq!(save_picked(&path, &version, &picked).unwrap().1, version, "{}", text(&path));
            assert_eq!(text(&path), before);
            picked.scale.push(length_in_b());
            let (saved, _) = save_picked(&path, &version, &picked).unwrap();
            assert_eq!(saved.scale, picked.scale, "{}", text(&path));
        }
    }

    fn length_in_b() -> ScaleTable {
        ScaleTable {
            camera: "b".into(),
            from: Some([1.0, 1.0]),
            to: Some([9.0, 9.0]),
            metres: Some(1.2),
            ..ScaleTable::default()
        }
    }

    fn named(name: &str) -> crate::project::ProjectCamera {
        crate::project::ProjectCamera {
            name: name.into(),
            capture: name.into(),
            reference: crate::capture::ReferenceFrame::Last,
            intrinsics: None,
        }
    }

    #[test]
    fn what_no_project_may_have_is_refused_and_nothing_is_written() {
        let (_folder, path) = project();
        let (picked, version) = read_picked(&path).unwrap();
        let refused = |change: &dyn Fn(&mut Picked)| {
            let mut picked = picked.clone();
            change(&mut picked);
            let said = save_picked(&path, &version, &picked).unwrap_err().to_string();
            assert_eq!(text(&path), PROJECT, "{said}");
            said
        };
        let said = refused(&|picked| {
            picked.points[1].picks.remove("b");
        });
        assert!(said.contains("[[point]] 2") && said.contains("two or more"), "{said}");
        let said = refused(&|picked| picked.points[0].number = Some(7));
        assert!(said.contains("no [[point]] 7"), "{said}");
        let said = refused(&|picked| {
            picked.points[0].picks.insert("c".into(), [1.0, 1.0]);
        });
        assert!(said.contains("no camera is called `c`"), "{said}");
        let said = refused(&|picked| picked.scale[0].height = Some(-1.0));
        assert!(said.contains("[scale], height"), "{said}");
        std::fs::write(&path, PROJECT.replace("2.4", "2.6")).unwrap();
        let said = save_picked(&path, &version, &picked).unwrap_err().to_string();
        assert!(said.contains("changed"), "{said}");
    }
}
