//! Defects for which a mesh or a cloud cannot be intersected: the element and its problem.

use glam::Vec3;
use shell::ranges::{ROOM_M, SIZE_M};

use super::{Disc, Mesh};

/// Largest deviation of a normal's length from 1.
const UNIT_TOLERANCE: f32 = 1e-3;

type Defect = (String, String);

/// Defect of a vertex that is in no room.
fn place_defect(i: usize, place: Vec3) -> Option<Defect> {
    if !place.is_finite() {
        return Some(not_finite(format!("vertex {i}")));
    }
    let problem = place.to_array().into_iter().find_map(|metres| ROOM_M.defect(f64::from(metres)))?;
    Some((format!("vertex {i}"), format!("a coordinate {problem}")))
}

fn not_finite(place: String) -> Defect {
    (place, "a number is not finite; remove the element or write it again".into())
}

/// The first defect of a mesh, if there is one.
pub(super) fn of_mesh(mesh: &Mesh) -> Option<Defect> {
    if mesh.colors.len() != mesh.vertices.len() {
        return Some((
            "colours".into(),
            format!("{} colours for {} vertices", mesh.colors.len(), mesh.vertices.len()),
        ));
    }
    if let Some(defect) = mesh.vertices.iter().enumerate().find_map(|(i, v)| place_defect(i, *v)) {
        return Some(defect);
    }
    let count = mesh.vertices.len();
    mesh.triangles.iter().enumerate().find_map(|(i, triangle)| {
        let index = triangle.iter().find(|&&index| index as usize >= count)?;
        Some((format!("face {i}"), format!("names vertex {index}, but there are {count} (counted from 0)")))
    })
}

/// The first defect of a cloud of discs, if there is one.
pub(super) fn of_discs(discs: &[Disc]) -> Option<Defect> {
    discs.iter().enumerate().find_map(|(i, d)| {
        let place = || format!("vertex {i}");
        let defect = place_defect(i, d.center);
        if defect.is_some() {
            defect
        } else if !(d.normal.is_finite() && d.radius.is_finite()) {
            Some(not_finite(place()))
        } else if d.radius <= 0.0 {
            Some((place(), format!("the radius {} is not positive", d.radius)))
        } else if let Some(problem) = SIZE_M.defect(f64::from(d.radius)).filter(|_| d.radius > 1.0) {
            Some((place(), format!("the radius {problem}")))
        } else if d.normal == Vec3::ZERO {
            Some((place(), "the normal is zero; estimate normals or remove the point".into()))
        } else if (d.normal.length() - 1.0).abs() > UNIT_TOLERANCE {
            Some((place(), format!("the normal's length is {}, not 1", d.normal.length())))
        } else {
            None
        }
    })
}
