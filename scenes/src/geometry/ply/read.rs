//! Reading PLY: every defect of the file is named before anything is built from it.

#[cfg(test)]
mod tests;

use std::path::Path;

use ply_rs::parser::{Parser, Reader};
use ply_rs::ply::{ElementDef, Encoding, Header, PropertyAccess, PropertyType, ScalarType};

use super::header::{self, FACES, STRIPS, VERTICES};
use super::row::{FaceRow, SkippedRow, StripRow};
use super::strips::{self, END_OF_STRIP};
use crate::geometry::Geometry;
use crate::geometry::scan::{Defect, Placing, Scan};
use crate::geometry::scan_vertex::ScanVertex;
use crate::{Error, Result};

/// Reads a room's geometry from a PLY file, ASCII or binary.
///
/// # Errors
/// [`Error::File`] naming the element and its problem.
pub fn read(path: &Path) -> Result<Geometry> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    decode(&bytes).map_err(|(place, problem)| Error::content(path, place, problem))
}

type Decoded<T> = std::result::Result<T, Defect>;

/// Geometry of a room's file, which needs normals where it has no faces.
fn decode(bytes: &[u8]) -> Decoded<Geometry> {
    let (scan, header) = scan_and_header(bytes)?;
    if scan.is_cloud() {
        let why =
            "a cloud without faces needs normals; `scenes import` estimates them, with the cameras given";
        require(&header, "vertex", &["nx", "ny", "nz"], why)?;
    }
    scan.into_geometry(&Placing::default())
}

/// Vertices and faces of a file, ASCII or binary, in the file's world.
///
/// # Errors
/// The first defect of the file: its place, and the problem.
pub(crate) fn scan(bytes: &[u8]) -> Decoded<Scan> {
    let (scan, header) = scan_and_header(bytes)?;
    if scan.has_normals && scan.is_cloud() {
        require(&header, "vertex", &["nx", "ny", "nz"], "a normal has three numbers")?;
    }
    Ok(scan)
}

fn scan_and_header(bytes: &[u8]) -> Decoded<(Scan, Header)> {
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
            VERTICES => vertices = rows::<ScanVertex>(&mut reader, element, &header)?,
            FACES => faces = rows::<FaceRow>(&mut reader, element, &header)?,
            STRIPS => strips = rows::<StripRow>(&mut reader, element, &header)?,
            _ => drop(rows::<SkippedRow>(&mut reader, element, &header)?),
        }
    }
    require(&header, "vertex", &["x", "y", "z"], "a room's geometry needs positions")?;
    let scan = Scan {
        polygons: faces.into_iter().map(|face| face.corners).collect(),
        triangles: triangles_of(&strips, vertices.len())?,
        has_normals: has(&header, "vertex", "nx"),
        has_radii: has(&header, "vertex", "radius"),
        full_level: full_level(&header, &vertices),
        vertices,
    };
    Ok((scan, header))
}

/// Brightest level of a file's colours: 1 for numbers with fractions, 255 or 65535 for whole ones, unless the colours
/// themselves go beyond that.
fn full_level(header: &Header, vertices: &[ScanVertex]) -> f32 {
    let of_type = |element: &ElementDef| match element.properties.get("red").map(|p| &p.data_type) {
        Some(PropertyType::Scalar(ScalarType::Float | ScalarType::Double)) => 1.0,
        _ => 255.0,
    };
    let usual = header.elements.get(VERTICES).map_or(255.0, of_type);
    let brightest = vertices.iter().flat_map(|vertex| vertex.color).fold(0.0, f32::max);
    [1.0, 255.0, 65_535.0]
        .into_iter()
        .find(|level| *level >= usual && *level >= brightest)
        .unwrap_or(65_535.0)
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

/// Triangles of strips of so many vertices.
fn triangles_of(strips: &[StripRow], vertices: usize) -> Decoded<Vec<[u32; 3]>> {
    let mut triangles = Vec::new();
    for (i, strip) in strips.iter().enumerate() {
        let is_unknown = |index: &&u32| **index != END_OF_STRIP && **index as usize >= vertices;
        if let Some(index) = strip.corners.iter().find(is_unknown) {
            let problem = format!("names vertex {index}, but there are {vertices} (counted from 0)");
            return Err((format!("strip {i}"), problem));
        }
        strips::triangles(&strip.corners, &mut triangles);
    }
    Ok(triangles)
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
