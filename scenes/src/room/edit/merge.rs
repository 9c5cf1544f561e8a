//! Three-way merge of drawings: as loaded, as edited, and as the file has it now.
//!
//! Name, outline and property of each zone, region and line are merged by themselves: a part that changed on one side
//! alone is taken from there. `[floor]`, whose polygons have no names, is one part.

use serde::Deserialize;

use super::Drawing;
use super::drawn_table::{DrawnTable, Part, are_same_polygons, counterparts, is_same};
use crate::polygon::Polygon;
use crate::room::{Line, Region, Zone};

/// A zone, region or line after editing.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Edited<T> {
    /// Its present state.
    pub item: T,
    /// Its index in the loaded drawing; `None` for a new one.
    pub origin: Option<usize>,
}

/// A drawing after editing.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditedDrawing {
    /// The zones.
    pub zones: Vec<Edited<Zone>>,
    /// The regions.
    pub regions: Vec<Edited<Region>>,
    /// The lines.
    pub lines: Vec<Edited<Line>>,
    /// The polygons of `[floor]`.
    pub floor: Vec<Polygon>,
}

/// Treatment of parts that were changed on both sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OnConflict {
    /// Nothing is saved.
    #[default]
    Refuse,
    /// The edited drawing's part is saved.
    Overwrite,
}

/// Merged drawing, or a line for each conflict.
pub(super) fn merged(
    base: &Drawing,
    edited: &EditedDrawing,
    present: &Drawing,
    on_conflict: OnConflict,
) -> Result<Drawing, Vec<String>> {
    let mut conflicts = Vec::new();
    let merged = Drawing {
        zones: merged_tables(&base.zones, &edited.zones, &present.zones, &mut conflicts),
        regions: merged_tables(&base.regions, &edited.regions, &present.regions, &mut conflicts),
        lines: merged_tables(&base.lines, &edited.lines, &present.lines, &mut conflicts),
        floor: merged_floor(&base.floor, &edited.floor, &present.floor, &mut conflicts),
    };
    if conflicts.is_empty() || on_conflict == OnConflict::Overwrite { Ok(merged) } else { Err(conflicts) }
}

/// Tells whether a merged drawing has nothing but what was edited.
pub(super) fn is_as_edited(merged: &Drawing, edited: &EditedDrawing) -> bool {
    are_as_edited(&merged.zones, &edited.zones)
        && are_as_edited(&merged.regions, &edited.regions)
        && are_as_edited(&merged.lines, &edited.lines)
        && are_same_polygons(&merged.floor, &edited.floor)
}

fn are_as_edited<T: DrawnTable>(merged: &[T], edited: &[Edited<T>]) -> bool {
    merged.len() == edited.len() && edited.iter().all(|e| merged.iter().any(|m| is_same(m, &e.item)))
}

/// Tables in the file's order, new ones last. In a conflict the edited side is taken.
fn merged_tables<T: DrawnTable>(
    base: &[T],
    edited: &[Edited<T>],
    present: &[T],
    conflicts: &mut Vec<String>,
) -> Vec<T> {
    let edited_of_base = |i: usize| edited.iter().find(|e| e.origin == Some(i)).map(|e| &e.item);
    let is_new = |i: usize, e: &Edited<T>| {
        let is_first = edited[..i].iter().all(|other| other.origin != e.origin);
        e.origin.is_none_or(|origin| origin >= base.len() || !is_first)
    };
    let new: Vec<&T> =
        edited.iter().enumerate().filter(|(i, e)| is_new(*i, e)).map(|(_, e)| &e.item).collect();
    let present_of_base = counterparts(base, present);
    let mut told = |name: &str, problem: &str| conflicts.push(format!("{} `{name}`: {problem}", T::TABLE));
    let mut merged = Vec::with_capacity(present.len() + new.len());
    let mut added_on_both_sides = Vec::new();
    for (j, there) in present.iter().enumerate() {
        let Some(i) = present_of_base.iter().position(|of_base| *of_base == Some(j)) else {
            // Added in the file; perhaps here, too.
            match new.iter().find(|here| here.name() == there.name()) {
                Some(here) => {
                    if !is_same(*here, there) {
                        told(there.name(), "added both here and in the file");
                    }
                    added_on_both_sides.push(there.name());
                    merged.push((*here).clone());
                }
                None => merged.push(there.clone()),
            }
            continue;
        };
        match edited_of_base(i) {
            Some(here) => {
                let (both, parts) = merged_table(&base[i], here, there);
                for part in parts {
                    told(base[i].name(), part);
                }
                merged.push(both);
            }
            None if is_same(&base[i], there) => {}
            None => told(base[i].name(), "removed here, changed in the file"),
        }
    }
    // Removed in the file.
    for (i, _) in present_of_base.iter().enumerate().filter(|(_, of_base)| of_base.is_none()) {
        if let Some(here) = edited_of_base(i).filter(|here| !is_same(*here, &base[i])) {
            told(base[i].name(), "changed here, removed in the file");
            merged.push(here.clone());
        }
    }
    merged.extend(new.into_iter().filter(|here| !added_on_both_sides.contains(&here.name())).cloned());
    merged
}

/// Merged table, and what was changed on both sides.
fn merged_table<T: DrawnTable>(base: &T, here: &T, there: &T) -> (T, Vec<&'static str>) {
    let mut merged = here.clone();
    let mut conflicts = Vec::new();
    for (part, _) in T::PARTS {
        if here.has_same(base, *part) {
            merged.take(there, *part);
        } else if !there.has_same(base, *part) && !there.has_same(here, *part) {
            conflicts.push(match part {
                Part::Name => "renamed both here and in the file",
                Part::Outline => "moved both here and in the file",
                Part::Property => "its kind or duration was changed both here and in the file",
            });
        }
    }
    (merged, conflicts)
}

fn merged_floor(
    base: &[Polygon],
    here: &[Polygon],
    there: &[Polygon],
    conflicts: &mut Vec<String>,
) -> Vec<Polygon> {
    if are_same_polygons(here, base) {
        return there.to_vec();
    }
    if !are_same_polygons(there, base) && !are_same_polygons(there, here) {
        conflicts.push("[floor]: changed both here and in the file".into());
    }
    here.to_vec()
}
