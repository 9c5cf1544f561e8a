//! Common form of the tables that are drawn on the floor: a name, an outline and at most one property.

use nalgebra::Point2;
use serde::de::DeserializeOwned;
use toml_edit::{Array, Value};

use crate::polygon::Polygon;
use crate::room::{Line, Region, Zone, ZoneKind};

/// Difference below which numbers are the same, in metres or seconds: one may have gone to a page and back.
const SAME: f64 = 1e-9;

/// Part of a table that is compared, merged and written by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Name,
    Outline,
    /// A zone's kind, a region's `dwell_s`.
    Property,
}

/// A kind of table that is drawn.
pub(super) trait DrawnTable: Clone + DeserializeOwned {
    /// Name of the tables.
    const TABLE: &'static str;
    /// The parts, and the keys under which they stand, in the order in which new tables have them.
    const PARTS: &'static [(Part, &'static str)];

    fn name(&self) -> &str;
    fn name_mut(&mut self) -> &mut String;
    fn outline(&self) -> &[Point2<f64>];
    fn outline_mut(&mut self) -> &mut Vec<Point2<f64>>;
    /// Tells whether the property is the same in both.
    fn has_same_property(&self, other: &Self) -> bool;
    /// Takes the property over from another.
    fn take_property(&mut self, other: &Self);
    /// Value of the property in a file; `None` where its key is left out.
    fn property(&self) -> Option<Value>;
    /// Tells whether a new table leaves the property out.
    fn has_default_property(&self) -> bool {
        self.property().is_none()
    }

    /// Tells whether a part is the same in both.
    fn has_same(&self, other: &Self, part: Part) -> bool {
        match part {
            Part::Name => self.name() == other.name(),
            Part::Outline => is_same_outline(self.outline(), other.outline()),
            Part::Property => self.has_same_property(other),
        }
    }

    /// Takes a part over from another.
    fn take(&mut self, other: &Self, part: Part) {
        match part {
            Part::Name => other.name().clone_into(self.name_mut()),
            Part::Outline => other.outline().clone_into(self.outline_mut()),
            Part::Property => self.take_property(other),
        }
    }

    /// Value of a part in a file; `None` where its key is left out.
    fn value(&self, part: Part) -> Option<Value> {
        match part {
            Part::Name => Some(self.name().into()),
            Part::Outline => Some(outline_value(self.outline())),
            Part::Property => self.property(),
        }
    }

    /// Tells whether a new table leaves the part out.
    fn is_default(&self, part: Part) -> bool {
        part == Part::Property && self.has_default_property()
    }
}

/// Access to a table's field `name`, and to its corners in the field that is named.
macro_rules! name_and_outline {
    ($($corners:tt).+) => {
        fn name(&self) -> &str {
            &self.name
        }

        fn name_mut(&mut self) -> &mut String {
            &mut self.name
        }

        fn outline(&self) -> &[Point2<f64>] {
            &self.$($corners).+
        }

        fn outline_mut(&mut self) -> &mut Vec<Point2<f64>> {
            &mut self.$($corners).+
        }
    };
}

impl DrawnTable for Zone {
    const TABLE: &'static str = "zone";
    const PARTS: &'static [(Part, &'static str)] =
        &[(Part::Name, "name"), (Part::Outline, "polygon"), (Part::Property, "kind")];

    name_and_outline!(polygon.0);

    fn has_same_property(&self, other: &Self) -> bool {
        self.kind == other.kind
    }

    fn take_property(&mut self, other: &Self) {
        self.kind = other.kind;
    }

    fn property(&self) -> Option<Value> {
        Some(match self.kind {
            ZoneKind::Entry => "entry".into(),
            ZoneKind::Exit => "exit".into(),
            ZoneKind::Both => "both".into(),
        })
    }

    fn has_default_property(&self) -> bool {
        self.kind == ZoneKind::default()
    }
}

impl DrawnTable for Region {
    const TABLE: &'static str = "region";
    const PARTS: &'static [(Part, &'static str)] =
        &[(Part::Name, "name"), (Part::Outline, "polygon"), (Part::Property, "dwell_s")];

    name_and_outline!(polygon.0);

    fn has_same_property(&self, other: &Self) -> bool {
        match (self.dwell_s, other.dwell_s) {
            (Some(a), Some(b)) => (a - b).abs() <= SAME,
            (a, b) => a.is_none() && b.is_none(),
        }
    }

    fn take_property(&mut self, other: &Self) {
        self.dwell_s = other.dwell_s;
    }

    fn property(&self) -> Option<Value> {
        self.dwell_s.map(Value::from)
    }
}

impl DrawnTable for Line {
    const TABLE: &'static str = "line";
    const PARTS: &'static [(Part, &'static str)] = &[(Part::Name, "name"), (Part::Outline, "points")];

    name_and_outline!(points);

    fn has_same_property(&self, _: &Self) -> bool {
        true
    }

    fn take_property(&mut self, _: &Self) {}

    fn property(&self) -> Option<Value> {
        None
    }
}

/// Tables of one kind that a file states. Keys that are unknown here are passed over.
pub(super) fn stated<T: DrawnTable>(file: &toml::Table) -> Result<Vec<T>, String> {
    let Some(tables) = file.get(T::TABLE) else { return Ok(Vec::new()) };
    let tables = tables.as_array().ok_or_else(|| format!("`{}` is no list of tables", T::TABLE))?;
    let parsed = |(i, table): (usize, &toml::Value)| {
        let entries = table.as_table().into_iter().flatten();
        let known = entries.filter(|(key, _)| T::PARTS.iter().any(|(_, known)| known == key));
        let known: toml::Table = known.map(|(key, value)| (key.clone(), value.clone())).collect();
        known.try_into().map_err(|e: toml::de::Error| format!("{} {}: {}", T::TABLE, i + 1, e.message()))
    };
    tables.iter().enumerate().map(parsed).collect()
}

/// Tells whether all parts of two tables are the same.
pub(super) fn is_same<T: DrawnTable>(a: &T, b: &T) -> bool {
    T::PARTS.iter().all(|(part, _)| a.has_same(b, *part))
}

/// Tells whether two outlines have the same corners, in the same order.
pub(super) fn is_same_outline(a: &[Point2<f64>], b: &[Point2<f64>]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).amax() <= SAME)
}

/// Tells whether two lists of polygons are the same.
pub(super) fn are_same_polygons(a: &[Polygon], b: &[Polygon]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same_outline(&a.0, &b.0))
}

/// Index of the counterpart among `others` of each table: the one of its name, else the one of its outline. No two have
/// the same.
pub(super) fn counterparts<T: DrawnTable>(tables: &[T], others: &[T]) -> Vec<Option<usize>> {
    let mut of_table = vec![None; tables.len()];
    let mut taken = vec![false; others.len()];
    let belongs: [fn(&T, &T) -> bool; 2] =
        [|a, b| a.name() == b.name(), |a, b| is_same_outline(a.outline(), b.outline())];
    for belongs in belongs {
        for (table, of_table) in tables.iter().zip(&mut of_table).filter(|(_, other)| other.is_none()) {
            *of_table = (0..others.len()).find(|i| !taken[*i] && belongs(table, &others[*i]));
            if let Some(i) = *of_table {
                taken[i] = true;
            }
        }
    }
    of_table
}

/// Corners as a file states them.
pub(super) fn outline_value(corners: &[Point2<f64>]) -> Value {
    corners.iter().map(|corner| Array::from_iter([corner.x, corner.y])).collect()
}
