//! Replacement of the zones in a `scene.toml`, with everything else preserved: tables, unknown keys, comments, layout
//! and line ends.
//!
//! People edit that file, too, so it is changed as a document (`toml_edit`), not serialised anew. A zone keeps its
//! table, with the comments in it, as long as it keeps its name or its outline; tables of new zones follow the last
//! one.

#[cfg(test)]
mod tests;

use std::path::Path;

use calib::files::write_atomic;
use serde::{Deserialize, Serialize};
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, Value};

use super::read::scene_file_in;
use super::validate::drawn_zones_defect;
use super::{Zone, ZoneKind};
use crate::polygon::Polygon;
use crate::{Error, Result};

/// Distance below which corners are the same, metres: a number may have gone to a page and back.
const SAME_M: f64 = 1e-9;

/// Version of a `scene.toml`: a hash of its bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SceneVersion(String);

impl SceneVersion {
    /// Present version of the file of a room directory.
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

/// Replaces the zones of a room directory, and returns the file's new version. Only the `[[zone]]` tables change; the
/// file is replaced in one step.
///
/// # Errors
/// [`Error::Room`] for zones that must not be drawn: without a name, with the name of another, not simple, without
/// area. [`Error::Changed`] when the file is not of that version any more. [`Error::Content`] when it cannot be parsed,
/// must not be written, or is a link; [`Error::Io`] or [`Error::Calib`] when it cannot be read or written.
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
    let rewritten =
        rewritten(&text, zones).map_err(|e| Error::content(&path, "[[zone]]", e.replace('\n', " ")))?;
    write_atomic(&path, rewritten.as_bytes())?;
    Ok(SceneVersion::of_bytes(rewritten.as_bytes()))
}

/// Refuses links and write-protected files: replacing a link by name would make it a file, and lose the protection.
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

/// Zones as a file states them.
#[derive(Deserialize)]
struct StatedZones {
    #[serde(default)]
    zone: Vec<StatedZone>,
}

/// A zone as a file states it. Keys that are unknown here are left to the reader of the room.
#[derive(Deserialize)]
struct StatedZone {
    name: String,
    polygon: Polygon,
    kind: Option<ZoneKind>,
}

/// Text of a scene file with other zones.
fn rewritten(text: &str, zones: &[Zone]) -> std::result::Result<String, String> {
    let stated: StatedZones = toml::from_str(text).map_err(|e| e.message().to_owned())?;
    let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| e.message().to_owned())?;
    let zone_of_table = zone_of_each_table(&stated.zone, zones);
    // Comments that stood above the header of a table that goes, with the table's position.
    let mut orphans = Vec::new();
    // Zones written as one value, `zone = [{ … }]`, become tables: not every form of the value takes comments.
    let is_value = document.get("zone").is_some_and(Item::is_value);
    if let Some(key) = document.key("zone").filter(|_| is_value) {
        let above = key.leaf_decor().prefix().and_then(|prefix| prefix.as_str());
        orphans.push((None, above.unwrap_or_default().to_owned()));
    }
    let old = document.remove("zone").and_then(|item| match item {
        Item::ArrayOfTables(tables) => Some(tables),
        _ => None,
    });
    let old = old.unwrap_or_default();
    let last_position = old.iter().filter_map(Table::position).max();
    let mut tables = ArrayOfTables::new();
    for ((mut table, stated), zone) in old.into_iter().zip(&stated.zone).zip(&zone_of_table) {
        if let Some(i) = *zone {
            update(&mut table, stated, &zones[i]);
            tables.push(table);
        } else {
            orphans.push((table.position(), comments_above(&table)));
        }
    }
    let is_new = |i: &usize| is_value || !zone_of_table.contains(&Some(*i));
    for i in (0..zones.len()).filter(is_new) {
        let mut table = new_table(&zones[i]);
        // Of tables with equal positions the first in the list is written first.
        table.set_position(last_position.or(Some(isize::MAX)));
        tables.push(table);
    }
    if last_position.is_none()
        && let Some(first) = tables.get_mut(0)
    {
        // New tables come last, after the comments at the file's end.
        let ending = document.trailing().as_str().unwrap_or_default().to_owned();
        document.set_trailing("");
        put_above(first, &ending);
    }
    document.insert("zone", Item::ArrayOfTables(tables));
    for (position, comments) in orphans.into_iter().rev() {
        if let Some(table) = next_table(document.as_table_mut(), position) {
            put_above(table, &comments);
        } else {
            let ending = document.trailing().as_str().unwrap_or_default();
            document.set_trailing(comments + ending);
        }
    }
    let mut rewritten = document.to_string();
    if !text.ends_with('\n') && rewritten.ends_with('\n') {
        rewritten.pop();
    }
    // The document is written with line feeds alone.
    Ok(if text.contains("\r\n") { rewritten.replace('\n', "\r\n") } else { rewritten })
}

/// Index of the zone that each table belongs to from now on: the one of its name, else the one of its outline.
fn zone_of_each_table(tables: &[StatedZone], zones: &[Zone]) -> Vec<Option<usize>> {
    let mut of_table = vec![None; tables.len()];
    let mut taken = vec![false; zones.len()];
    let belongs: [fn(&StatedZone, &Zone) -> bool; 2] =
        [|table, zone| table.name == zone.name, |table, zone| is_same(&table.polygon, &zone.polygon)];
    for belongs in belongs {
        for (table, of_table) in tables.iter().zip(&mut of_table).filter(|(_, zone)| zone.is_none()) {
            *of_table = (0..zones.len()).find(|i| !taken[*i] && belongs(table, &zones[*i]));
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

/// Changes the values of a table that differ from a zone's.
fn update(table: &mut Table, stated: &StatedZone, zone: &Zone) {
    if stated.name != zone.name {
        set(table, "name", zone.name.as_str().into());
    }
    if !is_same(&stated.polygon, &zone.polygon) {
        set(table, "polygon", polygon_value(&zone.polygon));
    }
    if stated.kind.unwrap_or_default() != zone.kind {
        set(table, "kind", kind_text(zone.kind).into());
    }
}

/// Sets a value; comments around the old one stay.
fn set(table: &mut Table, key: &str, mut value: Value) {
    if let Some(old) = table.get_mut(key).and_then(Item::as_value_mut) {
        *value.decor_mut() = old.decor().clone();
        *old = value;
    } else {
        table.insert(key, Item::Value(value));
    }
}

/// Table of a zone, with an empty line before it.
fn new_table(zone: &Zone) -> Table {
    let mut table = Table::new();
    table.decor_mut().set_prefix("\n");
    set(&mut table, "name", zone.name.as_str().into());
    set(&mut table, "polygon", polygon_value(&zone.polygon));
    if zone.kind != ZoneKind::default() {
        set(&mut table, "kind", kind_text(zone.kind).into());
    }
    table
}

fn polygon_value(polygon: &Polygon) -> Value {
    polygon.0.iter().map(|corner| Array::from_iter([corner.x, corner.y])).collect()
}

fn kind_text(kind: ZoneKind) -> &'static str {
    match kind {
        ZoneKind::Entry => "entry",
        ZoneKind::Exit => "exit",
        ZoneKind::Both => "both",
    }
}

/// Lines above a table's header, without the last one where that is empty.
fn comments_above(table: &Table) -> String {
    let above = table.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default();
    // Text after the last line break is the header's indentation.
    let mut lines: Vec<&str> = above.split_inclusive('\n').filter(|line| line.ends_with('\n')).collect();
    if lines.last().is_some_and(|line| line.trim().is_empty()) {
        lines.pop();
    }
    lines.concat()
}

/// Puts lines above those that stand above a table's header.
fn put_above(table: &mut Table, lines: &str) {
    let above = table.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default();
    let above = format!("{lines}{above}");
    table.decor_mut().set_prefix(above);
}

/// First table of the file's top level whose header is at this position or after it.
fn next_table(document: &mut Table, position: Option<isize>) -> Option<&mut Table> {
    let tables = document.iter_mut().flat_map(|(_, item)| match item {
        Item::Table(table) => vec![table],
        Item::ArrayOfTables(tables) => tables.iter_mut().collect(),
        _ => Vec::new(),
    });
    tables.filter(|table| table.position() >= position).min_by_key(|table| table.position())
}
