//! The `[floor]` table of a document: the polygons in which a person can stand.

use toml_edit::{DocumentMut, Item, Table, Value};

use super::drawn_table::{are_same_polygons, outline_value};
use super::tables::{comments_above, put_comments, set_value};
use crate::polygon::Polygon;

const TABLE: &str = "floor";
const KEY: &str = "walkable";

/// Polygons that a file states; none where it states no walkable floor.
pub(super) fn stated(file: &toml::Table) -> Result<Vec<Polygon>, String> {
    let Some(value) = file.get(TABLE).and_then(|floor| floor.get(KEY)) else { return Ok(Vec::new()) };
    value.clone().try_into().map_err(|e: toml::de::Error| format!("floor, walkable: {}", e.message()))
}

/// Replaces the polygons that differ from the present ones. A table that holds nothing else goes with the last polygon,
/// and with the first one a new table comes last.
pub(super) fn replace(document: &mut DocumentMut, present: &[Polygon], polygons: &[Polygon]) {
    if are_same_polygons(present, polygons) {
        return;
    }
    let value: Value = polygons.iter().map(|polygon| outline_value(&polygon.0)).collect();
    match document.get_mut(TABLE).and_then(Item::as_table_like_mut) {
        Some(floor) if polygons.is_empty() => {
            floor.remove(KEY);
            if floor.is_empty() {
                remove(document);
            }
        }
        Some(floor) => set_value(floor, KEY, value),
        None => {
            let mut table = Table::new();
            table.decor_mut().set_prefix("\n");
            table.set_position(Some(isize::MAX));
            table.insert(KEY, Item::Value(value));
            // The comments at the file's end stay where they are.
            let ending = document.trailing().as_str().unwrap_or_default().to_owned();
            document.set_trailing("");
            super::tables::put_above(&mut table, &ending);
            document.insert(TABLE, Item::Table(table));
        }
    }
}

/// Removes the table; the comments above it stay.
fn remove(document: &mut DocumentMut) {
    if let Some(Item::Table(table)) = document.remove(TABLE) {
        put_comments(document, table.position(), &comments_above(&table));
    }
}
