//! Reading PLY: every defect of the file is named before anything is built from it.

#[cfg(test)]
mod tests;

use std::path::Path;

use glam::{DVec3, Vec3};
use ply_rs::parser::{Parser, Reader};
use ply_rs::ply::{ElementDef, Encoding, Header, PropertyAccess, PropertyType, ScalarType};

use super::header::{self, FACES, STRIPS, VERTICES};
use super::row::{CORNERS, FaceRow, SkippedRow, StripRow, VertexRow};
use super::strips::{self, END_OF_STRIP};
use crate::geometry::{Disc, Geometry, Mesh, normals, spacing, triangulate};
use crate::{Error, Result};

/// Reads a room's geometry from a PLY file, ASCII or binary.
///
/// # Errors
/// [`Error::Io`], or [`Error::Content`] naming the element and its problem.
pub fn read(path: &Path) -> Result<Geometry> {
    read_with(path, None, DVec3::ZERO)
}

/// [`read`] for clouds that may lack normals: they are estimated, each towards the nearest of the viewpoints. All
/// positions are moved by `shift_m` before they are rounded to single precision.
///
/// # Errors
/// As [`read`].
pub fn read_seen_from(path: &Path, viewpoints: &[Vec3], shift_m: DVec3) -> Result<Geometry> {
    read_with(path, Some(viewpoints), shift_m)
}

fn read_with(path: &Path, viewpoints: Option<&[Vec3]>, shift_m: DVec3) -> Result<Geometry> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    decode(&bytes, viewpoints, shift_m).map_err(|(place, problem)| Error::Content {
        path: path.to_owned(),
        place,
        problem,
    })
}

/// Defect of a file: the place and the problem.
type Defect = (String, String);
type Decoded<T> = std::result::Result<T, Defect>;

/// Greatest coordinate, metres: beyond it neighbouring numbers of single precision are more than a millimetre apart.
const FARTHEST_M: f64 = 10_000.0;

fn decode(bytes: &[u8], viewpoints: Option<&[Vec3]>, shift_m: DVec3) -> Decoded<Geometry> {
    if bytes.is_empty() {
        return Err(("whole file".into(), "the file is empty; write it again".into()));
    }
    let mut reader = Reader::new(bytes);
    let header = Parser::<SkippedRow>::new().read_header(&mut reader).map_err(|e| {
        match header::unreadable_line(bytes) {
            Some((line, problem)) => (format!("header, line {line}"), problem),
            None => ("header".to_owned(), format!("this is no PLY file: {}", cause_of(&e.to_string()))),
        }
    })?;
    check_sizes(&header, reader.get_ref().len())?;
    header::check_skipped(&header)?;

    let (mut vertices, mut faces, mut strips) = (Vec::new(), Vec::new(), Vec::new());
    for element in header.elements.values() {
        match element.name.as_str() {
            VERTICES => vertices = rows::<VertexRow>(&mut reader, element, &header)?,
            FACES => faces = rows::<FaceRow>(&mut reader, element, &header)?,
            STRIPS => strips = rows::<StripRow>(&mut reader, element, &header)?,
            _ => drop(rows::<SkippedRow>(&mut reader, element, &header)?),
        }
    }
    require(&header, "vertex", &["x", "y", "z"], "a room's geometry needs positions")?;
    shift(&mut vertices, shift_m)?;
    let geometry = if faces.is_empty() && strips.is_empty() {
        if let Some(viewpoints) = viewpoints.filter(|_| !has(&header, "vertex", "nx")) {
            face(&mut vertices, viewpoints)?;
        } else {
            let why =
                "a cloud without faces needs normals; `scenes import` estimates them, with the cameras given";
            require(&header, "vertex", &["nx", "ny", "nz"], why)?;
        }
        Geometry::Discs(discs(&vertices, has(&header, "vertex", "radius"))?)
    } else {
        Geometry::Mesh(mesh(&vertices, &faces, &strips)?)
    };
    if geometry.is_empty() {
        let problem = "there are no points; leave `geometry` out of scene.toml if the room is empty";
        return Err(("element vertex".into(), problem.into()));
    }
    geometry.defect().map_or(Ok(geometry), Err)
}

/// Refuses a file that is too short for the sizes in its header, before memory is allocated for it.
fn check_sizes(header: &Header, available: usize) -> Decoded<()> {
    let mut needed: u128 = 0;
    for element in header.elements.values() {
        let place = || format!("element {}", element.name);
        if element.properties.is_empty() && element.count > 0 {
            return Err((place(), "has rows but no properties; write the file again".into()));
        }
        let row: u128 =
            element.properties.values().map(|p| smallest_size(&p.data_type, header.encoding)).sum();
        needed += row * element.count as u128;
        // The last number of an ASCII file needs no line break after it.
        if needed > available as u128 + u128::from(header.encoding == Encoding::Ascii) {
            let problem = format!(
                "the header announces {} rows, {needed} bytes or more up to here, but {available} bytes follow it: \
                 the file is cut off; copy or write it again",
                element.count
            );
            return Err((place(), problem));
        }
    }
    Ok(())
}

/// Fewest bytes of a property in a row: a digit and a separator a number in ASCII, an empty list.
fn smallest_size(data_type: &PropertyType, encoding: Encoding) -> u128 {
    let (PropertyType::Scalar(scalar) | PropertyType::List(scalar, _)) = data_type;
    match (encoding, scalar) {
        (Encoding::Ascii, _) | (_, ScalarType::Short | ScalarType::UShort) => 2,
        (_, ScalarType::Char | ScalarType::UChar) => 1,
        (_, ScalarType::Int | ScalarType::UInt | ScalarType::Float) => 4,
        (_, ScalarType::Double) => 8,
    }
}

fn rows<R: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &Header,
) -> Decoded<Vec<R>> {
    Parser::<R>::new()
        .read_payload_for_element(reader, element, header)
        .map_err(|e| bad_row(element, &one_line(&e.to_string())))
}

/// Defect of a row, from the parser's message: the line of an ASCII file and then, at length, its own grammar.
fn bad_row(element: &ElementDef, said: &str) -> Defect {
    let place = format!("element {}", element.name);
    let line = said.strip_prefix("Line ").and_then(|rest| rest.split_once(':'));
    let Some((line, _)) = line else { return (place, said.to_owned()) };
    let problem = format!(
        "the line does not hold what the header announces (properties: {}) as finite numbers; write the file again",
        element.properties.len()
    );
    (format!("{place}, line {line}"), problem)
}

fn has(header: &Header, element: &str, property: &str) -> bool {
    header.elements.get(element).is_some_and(|e| e.properties.contains_key(property))
}

fn require(header: &Header, element: &str, properties: &[&str], why: &str) -> Decoded<()> {
    match properties.iter().find(|p| !has(header, element, p)) {
        Some(missing) => Err((format!("element {element}"), format!("property {missing} is missing: {why}"))),
        None => Ok(()),
    }
}

/// Moves the vertices, and checks that they lie near enough to the origin.
fn shift(rows: &mut [VertexRow], shift_m: DVec3) -> Decoded<()> {
    for (i, row) in rows.iter_mut().enumerate() {
        let moved = DVec3::from(row.position) + shift_m;
        // A number too large for single precision is none; the checks of the geometry name it.
        if moved.as_vec3().is_finite() && moved.abs().max_element() > FARTHEST_M {
            let nearby = (moved / 1000.0).floor() * 1000.0;
            let problem = format!(
                "lies at ({:.0}, {:.0}, {:.0}), more than 10 km from the origin, where a millimetre is lost: move geometry \
                 and cameras to the origin, as with `scenes import … --shift={},{},0`",
                moved.x, moved.y, moved.z, -nearby.x, -nearby.y
            );
            return Err((format!("vertex {i}"), problem));
        }
        row.position = moved.to_array();
    }
    Ok(())
}

fn position(row: &VertexRow) -> Vec3 {
    DVec3::from(row.position).as_vec3()
}

/// Estimates the normals of a bare cloud.
fn face(rows: &mut [VertexRow], viewpoints: &[Vec3]) -> Decoded<()> {
    let centers: Vec<Vec3> = rows.iter().map(position).collect();
    if let Some(i) = centers.iter().position(|center| !center.is_finite()) {
        return Err(not_finite(i));
    }
    for (row, normal) in rows.iter_mut().zip(normals::estimate(&centers, viewpoints)) {
        row.normal = normal.to_array();
    }
    Ok(())
}

fn not_finite(vertex: usize) -> Defect {
    (format!("vertex {vertex}"), "a number is not finite; remove the point".into())
}

fn discs(rows: &[VertexRow], radius_given: bool) -> Decoded<Vec<Disc>> {
    let mut discs = Vec::with_capacity(rows.len());
    for (i, row) in rows.iter().enumerate() {
        let (center, normal) = (position(row), Vec3::from(row.normal));
        if !(center.is_finite() && normal.is_finite()) {
            return Err(not_finite(i));
        }
        // `Geometry::defect` reports zero normals.
        let normal = normal.try_normalize().unwrap_or(Vec3::ZERO);
        // A confidence that is not finite counts as 0: no computation depends on it, so the file is not refused.
        let confidence = if row.confidence.is_finite() { row.confidence } else { 0.0 };
        let VertexRow { radius, color, filled, .. } = *row;
        discs.push(Disc { center, normal, radius, color, filled, confidence });
    }
    if !radius_given {
        let centers: Vec<Vec3> = discs.iter().map(|d| d.center).collect();
        for (disc, radius) in discs.iter_mut().zip(spacing::radii(&centers)) {
            disc.radius = radius;
        }
    }
    Ok(discs)
}

fn mesh(rows: &[VertexRow], faces: &[FaceRow], strips: &[StripRow]) -> Decoded<Mesh> {
    let mut mesh = Mesh {
        vertices: rows.iter().map(position).collect(),
        triangles: Vec::with_capacity(faces.len()),
        colors: rows.iter().map(|row| row.color).collect(),
    };
    for (i, face) in faces.iter().enumerate() {
        let place = || format!("face {i}");
        if face.corners.len() < 3 {
            let problem = format!("has {} corners in `{}`; a face needs 3", face.corners.len(), CORNERS[0]);
            return Err((place(), problem));
        }
        if let Some(&index) = face.corners.iter().find(|&&index| index as usize >= rows.len()) {
            let named = if index == u32::MAX { "a negative index".into() } else { format!("vertex {index}") };
            return Err((place(), format!("names {named}, but there are {} (counted from 0)", rows.len())));
        }
        triangulate::face(&face.corners, &mesh.vertices, &mut mesh.triangles);
    }
    for (i, strip) in strips.iter().enumerate() {
        let is_unknown = |index: &&u32| **index != END_OF_STRIP && **index as usize >= rows.len();
        if let Some(index) = strip.corners.iter().find(is_unknown) {
            let problem = format!("names vertex {index}, but there are {} (counted from 0)", rows.len());
            return Err((format!("strip {i}"), problem));
        }
        strips::triangles(&strip.corners, &mut mesh.triangles);
    }
    Ok(mesh)
}

/// The first sentence of the parser's message, without its grammar.
fn cause_of(message: &str) -> String {
    let line = one_line(message);
    let end = ["ParseError", "expected: ExpectedSet"].iter().filter_map(|word| line.find(word)).min();
    let cause = line[..end.unwrap_or(line.len())].trim_end_matches([' ', ':', ',']);
    if cause.is_empty() {
        "its header cannot be read; write the file again".to_owned()
    } else {
        cause.to_owned()
    }
}

/// Shortens a library's message to one line.
fn one_line(message: &str) -> String {
    const LONGEST: usize = 200;
    let mut line = message.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((cut, _)) = line.char_indices().nth(LONGEST) {
        line.truncate(cut);
        line.push('…');
    }
    line
}
