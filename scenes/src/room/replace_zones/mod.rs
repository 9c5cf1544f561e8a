//! Replacement of the zones in a `scene.toml`, with everything else preserved byte for byte.
//!
//! People edit that file, too. So it is not serialised anew: the parser only locates each zone, and the text between is
//! left alone, comments, layout and line ends included. A zone keeps its table, with the comments in it, as long as it
//! keeps its name or its outline; tables of new zones follow the last one.

#[cfg(test)]
mod tests;

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
    let rewritten = rewritten(&text, zones)
        .map_err(|e| Error::content(&path, "[[zone]]", e.message().replace('\n', " ")))?;
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

/// The part of a `scene.toml` that is parsed here.
#[derive(Deserialize)]
struct Tables {
    #[serde(default)]
    zone: Vec<Spanned<ZoneTable>>,
}

/// A zone's table, with the spans of its values.
#[derive(Deserialize)]
struct ZoneTable {
    name: Spanned<String>,
    polygon: Spanned<Polygon>,
    kind: Option<Spanned<ZoneKind>>,
}

impl ZoneTable {
    /// End of the last value.
    fn end(&self) -> usize {
        let kind = self.kind.as_ref().map_or(0, |kind| kind.span().end);
        self.name.span().end.max(self.polygon.span().end).max(kind)
    }
}

/// A range of the text and its replacement.
type Cut = (Range<usize>, String);

/// Text of a scene file with other zones.
fn rewritten(text: &str, zones: &[Zone]) -> std::result::Result<String, toml::de::Error> {
    let Tables { zone: tables } = toml::from_str(text)?;
    let newline = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let mut cuts: Vec<Cut> = Vec::new();
    let mut is_new = vec![true; zones.len()];
    // Position at which new tables are inserted.
    let mut end = text.len();
    if let Some(assignment) = assigned(text)? {
        // `zone = [{ … }]` is one value; tables are written instead, since lines cannot be inserted into every form of
        // it.
        cuts.push((lines(text, assignment), String::new()));
    } else {
        let zone_of_table = zone_of_each_table(&tables, zones);
        for (table, zone) in tables.iter().zip(zone_of_table) {
            let place = table.span().start..table.get_ref().end();
            end = end_of_line(text, place.end);
            if let Some(i) = zone {
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
    // At equal positions insertions come after deletions that end there.
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

/// Span of `zone = …`, if the zones are written as a value and not as tables.
fn assigned(text: &str) -> std::result::Result<Option<Range<usize>>, toml::de::Error> {
    let document = DeTable::parse(text)?;
    let Some((key, value)) = document.get_ref().get_key_value("zone") else { return Ok(None) };
    // The span of tables is that of the first header; a list of lists is no list of zones.
    let is_value = !text[value.span()].starts_with("[[");
    Ok(is_value.then(|| key.span().start..value.span().end))
}

/// Index of the zone that each table belongs to from now on: the one of its name, else the one of its outline.
fn zone_of_each_table(tables: &[Spanned<ZoneTable>], zones: &[Zone]) -> Vec<Option<usize>> {
    let mut of_table = vec![None; tables.len()];
    let mut taken = vec![false; zones.len()];
    let belongs: [fn(&ZoneTable, &Zone) -> bool; 2] = [
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

/// Edits for the values of a table that differ from a zone's.
fn changes(text: &str, table: &ZoneTable, zone: &Zone, newline: &str) -> Vec<Cut> {
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

/// Text of a zone's table, with an empty line before it.
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

/// Whole lines that a range of the text stands on, with the empty line before them, if there is one.
fn lines(text: &str, place: Range<usize>) -> Range<usize> {
    let start_of_line = |at: usize| text[..at].rfind('\n').map_or(0, |i| i + 1);
    let start = start_of_line(place.start);
    let before = start_of_line(start.saturating_sub(1));
    let start = if text[before..start].trim().is_empty() { before } else { start };
    start..end_of_line(text, place.end)
}

/// Position after the line break that ends the line of `at`, or the text's end.
fn end_of_line(text: &str, at: usize) -> usize {
    text[at..].find('\n').map_or(text.len(), |i| at + i + 1)
}
