//! Rows of vertices and faces of a PLY file, as `ply-rs` fills and reads them.

use ply_rs::ply::{BeginList, Property, PropertyAccess, PropertyAccessResult};

use super::strips::END_OF_STRIP;
use crate::geometry::scan_vertex::ScanVertex;

/// Properties that its file lacks keep the values of [`ScanVertex::default`].
impl PropertyAccess for ScanVertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) {
            let Some(value) = double(&property) else { return PropertyAccessResult::UnsupportedType };
            self.position[axis] = value;
            return PropertyAccessResult::Set;
        }
        let number = match name {
            "nx" => &mut self.normal[0],
            "ny" => &mut self.normal[1],
            "nz" => &mut self.normal[2],
            "radius" => &mut self.radius,
            "confidence" => &mut self.confidence,
            "red" | "green" | "blue" => {
                let Some(value) = property.to_f32_lossy() else {
                    return PropertyAccessResult::UnsupportedType;
                };
                self.color[usize::from(name == "green") + 2 * usize::from(name == "blue")] = value;
                return PropertyAccessResult::Set;
            }
            "filled" => {
                let Some(value) = property.to_f32_lossy() else {
                    return PropertyAccessResult::UnsupportedType;
                };
                self.filled = value != 0.0;
                return PropertyAccessResult::Set;
            }
            _ => return PropertyAccessResult::Ignored,
        };
        match property.to_f32_lossy() {
            Some(value) => {
                *number = value;
                PropertyAccessResult::Set
            }
            None => PropertyAccessResult::UnsupportedType,
        }
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        Some(match name {
            "x" => self.position[0] as f32,
            "y" => self.position[1] as f32,
            "z" => self.position[2] as f32,
            "nx" => self.normal[0],
            "ny" => self.normal[1],
            "nz" => self.normal[2],
            "radius" => self.radius,
            "confidence" => self.confidence,
            _ => return None,
        })
    }

    fn get_uchar(&self, name: &str) -> Option<u8> {
        Some(match name {
            "red" => self.color[0] as u8,
            "green" => self.color[1] as u8,
            "blue" => self.color[2] as u8,
            "filled" => u8::from(self.filled),
            _ => return None,
        })
    }
}

/// A number of any type, with all its digits.
fn double(property: &Property) -> Option<f64> {
    match property {
        Property::Double(value) => Some(*value),
        Property::Int(value) => Some(f64::from(*value)),
        Property::UInt(value) => Some(f64::from(*value)),
        other => other.to_f32_lossy().map(f64::from),
    }
}

/// Triangle strips: their corners one after the other, [`END_OF_STRIP`] for every negative index.
#[derive(Debug, Clone)]
pub(super) struct StripRow {
    pub(super) corners: Vec<u32>,
}

impl PropertyAccess for StripRow {
    fn new() -> Self {
        Self { corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        let index = |value: i32| u32::try_from(value).unwrap_or(END_OF_STRIP);
        self.corners = match &property {
            Property::ListChar(corners) => corners.iter().map(|value| index(i32::from(*value))).collect(),
            Property::ListShort(corners) => corners.iter().map(|value| index(i32::from(*value))).collect(),
            Property::ListInt(corners) => corners.iter().copied().map(index).collect(),
            other => match other.to_u32_list() {
                Some(corners) => corners,
                None => return PropertyAccessResult::UnsupportedType,
            },
        };
        PropertyAccessResult::Set
    }
}

/// A face: its corners, as indices of vertices.
#[derive(Debug, Clone)]
pub(super) struct FaceRow {
    pub(super) corners: Vec<u32>,
    /// The same indices for the writer, which writes the common type `int`.
    pub(super) signed: Vec<i32>,
}

/// The two names in use for the list of a face's corners.
pub(super) const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

impl PropertyAccess for FaceRow {
    fn new() -> Self {
        Self { corners: Vec::new(), signed: Vec::new() }
    }

    fn begin_list_uint(&mut self, name: &str, _len: usize) -> BeginList<'_, u32> {
        if CORNERS.contains(&name) { BeginList::Fill(&mut self.corners) } else { BeginList::UseSetter }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = match (property.to_u32_list(), &property) {
            (Some(corners), _) => corners,
            // A negative index is out of range like one that is too large: let the same check name it.
            (None, Property::ListChar(_) | Property::ListShort(_) | Property::ListInt(_)) => {
                vec![u32::MAX; 3]
            }
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }

    fn get_list_int(&self, name: &str) -> Option<&[i32]> {
        (name == CORNERS[0]).then_some(&self.signed)
    }
}

/// A row of an element that is skipped.
#[derive(Debug, Clone)]
pub(super) struct SkippedRow;

impl PropertyAccess for SkippedRow {
    fn new() -> Self {
        Self
    }
}
