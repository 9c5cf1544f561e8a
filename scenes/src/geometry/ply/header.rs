//! Checks of a PLY header: lines that the parser does not read, and elements whose loss would change the geometry.

use ply_rs::ply::{ElementDef, Header, PropertyType, ScalarType};

use super::row::CORNERS;

/// Elements that are read.
pub(super) const VERTICES: &str = "vertex";
pub(super) const FACES: &str = "face";
pub(super) const STRIPS: &str = "tristrips";

/// Names of the number types of PLY, old and new.
const TYPES: [&str; 16] = [
    "char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int8", "uint8", "int16", "uint16",
    "int32", "uint32", "float32", "float64",
];

/// Elements with lists of vertices that only repeat what the vertices are: edges, and the grid of a range scan.
const NOT_SURFACES: [&str; 2] = ["edge", "range_grid"];

/// The first line of a header that is not read, counted from 1, and the problem; `None` where each line is one that the
/// format knows.
pub(super) fn unreadable_line(bytes: &[u8]) -> Option<(usize, String)> {
    const LONGEST_HEADER: usize = 1 << 20;
    let bytes = &bytes[..bytes.len().min(LONGEST_HEADER)];
    if !bytes.starts_with(b"ply") {
        return None;
    }
    for (number, line) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        let problem = match words.as_slice() {
            ["end_header"] => return None,
            ["property", "list", length, of, name] => {
                [length, of].into_iter().find_map(|word| type_problem(word)).or_else(|| name_problem(name))
            }
            ["property", "list", ..] => Some("is no list: property list LENGTH_TYPE TYPE NAME".to_owned()),
            ["property", of, name] => type_problem(of).or_else(|| name_problem(name)),
            ["property", of, name, ..] => type_problem(of).or_else(|| {
                Some(format!("the property's name holds spaces (`{name} …`), which is not read; {MEND}"))
            }),
            ["element", name, _] => name_problem(name),
            _ => None,
        };
        if let Some(problem) = problem {
            return Some((number, problem));
        }
    }
    None
}

const MEND: &str = "export the geometry without this property, or rename it";

fn type_problem(word: &str) -> Option<String> {
    let problem =
        || format!("the type `{}` is not read; export it as one of {}", shown(word), TYPES[..8].join(", "));
    (!TYPES.contains(&word)).then(problem)
}

fn name_problem(name: &str) -> Option<String> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let problem = || format!("the name `{}` is not read (letters, digits, `_` and `-`); {MEND}", shown(name));
    (!name.chars().all(is_plain)).then(problem)
}

/// A word of the file for a message: without control characters, cut where it is long.
fn shown(word: &str) -> String {
    const LONGEST: usize = 60;
    word.chars().filter(|c| !c.is_control()).take(LONGEST).collect()
}

/// Checks the elements that are skipped.
///
/// # Errors
/// An element that lists vertices, and so may be the surface: its loss would turn a mesh into a cloud.
pub(super) fn check_skipped(header: &Header) -> Result<(), (String, String)> {
    for element in header.elements.values() {
        let name = element.name.as_str();
        if element.count == 0 || [VERTICES, FACES, STRIPS].contains(&name) {
            continue;
        }
        if lists_vertices(element) && !NOT_SURFACES.contains(&name) {
            let problem = format!(
                "lists vertices, so it may hold the surface, but only `{FACES}` and `{STRIPS}` are read; export the mesh as \
                 triangles"
            );
            return Err((format!("element {name}"), problem));
        }
        tracing::warn!("PLY: element `{name}` ({} rows) is not read", element.count);
    }
    Ok(())
}

fn lists_vertices(element: &ElementDef) -> bool {
    element.properties.values().any(|property| {
        let is_named = CORNERS.contains(&property.name.as_str());
        let is_list_of_indices = matches!(
            &property.data_type,
            PropertyType::List(_, of) if !matches!(of, ScalarType::Float | ScalarType::Double)
        );
        is_list_of_indices && (is_named || property.name.contains("vert"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(line: &str) -> Option<(usize, String)> {
        let text = format!("ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\n{line}\nend_header\n");
        unreadable_line(text.as_bytes())
    }

    #[test]
    fn lines_that_are_not_read_are_named() {
        for (line, word) in [
            ("property list uchar int64 vertex_indices", "`int64`"),
            ("property float scalar_distances[<0.1]", "`scalar_distances[<0.1]`"),
            ("property float scalar_Original cloud index", "spaces"),
            ("property half x", "`half`"),
            ("property list uchar int", "list"),
        ] {
            let (number, problem) = said(line).unwrap();
            assert_eq!(number, 5, "{line}");
            assert!(problem.contains(word), "{problem}");
        }
        for line in
            ["property uint8 red", "comment anything [goes] here", "property list uchar int32 vertex_indices"]
        {
            assert_eq!(said(line), None, "{line}");
        }
        // After the header anything may stand.
        assert_eq!(unreadable_line(b"ply\nend_header\nproperty int64 x\n"), None);
        assert_eq!(unreadable_line(b"solid cube\nproperty int64 x\n"), None);
    }
}
