//! Replacement of the tables of one kind in a document.
//!
//! A zone, region or line keeps its table, with the comments in it, as long as it keeps its name or its outline; tables
//! of new ones follow the last one.

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

use super::drawn_table::{DrawnTable, counterparts, is_same};

/// Replaces the document's tables, which are the present ones, by others.
pub(super) fn replace<T: DrawnTable>(document: &mut DocumentMut, present: &[T], drawn: &[T]) {
    let is_kept = present.len() == drawn.len() && present.iter().zip(drawn).all(|(a, b)| is_same(a, b));
    if is_kept {
        return;
    }
    let drawn_of_table = counterparts(present, drawn);
    // Comments that stood above the header of a table that goes, with the table's position.
    let mut orphans = Vec::new();
    // Tables written as one value, `zone = [{ … }]`, become tables: not every form of the value takes comments.
    let is_value = document.get(T::TABLE).is_some_and(Item::is_value);
    if let Some(key) = document.key(T::TABLE).filter(|_| is_value) {
        let above = key.leaf_decor().prefix().and_then(|prefix| prefix.as_str());
        orphans.push((None, above.unwrap_or_default().to_owned()));
    }
    let old = document.remove(T::TABLE).and_then(|item| match item {
        Item::ArrayOfTables(tables) => Some(tables),
        _ => None,
    });
    let old = old.unwrap_or_default();
    let last_position = old.iter().filter_map(Table::position).max();
    let mut tables = ArrayOfTables::new();
    for ((mut table, stated), drawn_index) in old.into_iter().zip(present).zip(&drawn_of_table) {
        if let Some(i) = *drawn_index {
            update(&mut table, stated, &drawn[i]);
            tables.push(table);
        } else {
            orphans.push((table.position(), comments_above(&table)));
        }
    }
    let is_new = |i: &usize| is_value || !drawn_of_table.contains(&Some(*i));
    for i in (0..drawn.len()).filter(is_new) {
        let mut table = new_table(&drawn[i]);
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
    if !tables.is_empty() {
        document.insert(T::TABLE, Item::ArrayOfTables(tables));
    }
    for (position, comments) in orphans.into_iter().rev() {
        put_comments(document, position, &comments);
    }
}

/// Changes the values of a table that differ from what is drawn.
fn update<T: DrawnTable>(table: &mut Table, stated: &T, drawn: &T) {
    for (part, key) in T::PARTS {
        if stated.has_same(drawn, *part) {
            continue;
        }
        match drawn.value(*part) {
            Some(value) => set_value(table, key, value),
            None => {
                table.remove(key);
            }
        }
    }
}

/// Sets a value; comments around the old one stay.
pub(super) fn set_value(table: &mut dyn TableLike, key: &str, mut value: Value) {
    if let Some(old) = table.get_mut(key).and_then(Item::as_value_mut) {
        *value.decor_mut() = old.decor().clone();
        *old = value;
    } else {
        table.insert(key, Item::Value(value));
    }
}

/// A new table, with an empty line before it.
fn new_table<T: DrawnTable>(drawn: &T) -> Table {
    let mut table = Table::new();
    table.decor_mut().set_prefix("\n");
    for (part, key) in T::PARTS.iter().filter(|(part, _)| !drawn.is_default(*part)) {
        if let Some(value) = drawn.value(*part) {
            set_value(&mut table, key, value);
        }
    }
    table
}

/// Lines above a table's header, without the last one where that is empty.
pub(super) fn comments_above(table: &Table) -> String {
    let above = table.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default();
    // Text after the last line break is the header's indentation.
    let mut lines: Vec<&str> = above.split_inclusive('\n').filter(|line| line.ends_with('\n')).collect();
    if lines.last().is_some_and(|line| line.trim().is_empty()) {
        lines.pop();
    }
    lines.concat()
}

/// Puts comments where a table stood that is gone: above the next one, or at the file's end.
pub(super) fn put_comments(document: &mut DocumentMut, position: Option<isize>, comments: &str) {
    if let Some(table) = next_table(document.as_table_mut(), position) {
        put_above(table, comments);
    } else {
        let ending = document.trailing().as_str().unwrap_or_default();
        document.set_trailing(comments.to_owned() + ending);
    }
}

/// Puts lines above those that stand above a table's header.
pub(super) fn put_above(table: &mut Table, lines: &str) {
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
