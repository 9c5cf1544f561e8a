//! Writing PLY, binary little endian.

use std::path::Path;

use ply_rs::ply::{Addable, ElementDef, Encoding, Header, PropertyDef, PropertyType, ScalarType};
use ply_rs::writer::Writer;

use super::row::{CORNERS, FaceRow};
use crate::geometry::scan_vertex::ScanVertex;
use crate::geometry::{Disc, Geometry, Mesh};
use crate::{Error, Result};

/// Writes geometry as a binary PLY file, replaced in one step. [`super::read()`] gives back the same numbers.
///
/// # Errors
/// [`Error::Geometry`] when it has a defect, [`Error::Calib`] when the file cannot be written.
pub fn write(path: &Path, geometry: &Geometry) -> Result<()> {
    Ok(calib::files::write_atomic(path, &encode(geometry)?)?)
}

/// Encodes geometry as the bytes of the file.
pub(crate) fn encode(geometry: &Geometry) -> Result<Vec<u8>> {
    if let Some((place, problem)) = geometry.defect() {
        return Err(Error::Geometry(format!("{place}: {problem}")));
    }
    let written = match geometry {
        Geometry::Mesh(mesh) => encode_mesh(mesh),
        Geometry::Discs(discs) => encode_discs(discs),
    };
    written.map_err(|e| Error::Geometry(e.to_string()))
}

fn encode_mesh(mesh: &Mesh) -> std::io::Result<Vec<u8>> {
    let vertices: Vec<ScanVertex> = std::iter::zip(&mesh.vertices, &mesh.colors)
        .map(|(v, color)| ScanVertex {
            position: v.as_dvec3().to_array(),
            color: color.map(f32::from),
            ..ScanVertex::default()
        })
        .collect();
    let faces: Vec<FaceRow> = mesh
        .triangles
        .iter()
        .map(|t| FaceRow { corners: Vec::new(), signed: t.iter().map(|&i| i as i32).collect() })
        .collect();
    let vertex = element("vertex", vertices.len(), &["x", "y", "z"], &["red", "green", "blue"]);
    let mut face = ElementDef::new("face".into());
    face.count = faces.len();
    face.properties
        .add(PropertyDef::new(CORNERS[0].into(), PropertyType::List(ScalarType::UChar, ScalarType::Int)));
    let mut header = Header { encoding: Encoding::BinaryLittleEndian, ..Header::new() };
    header.elements.add(vertex.clone());
    header.elements.add(face.clone());

    let mut bytes = Vec::with_capacity(300 + 15 * vertices.len() + 13 * faces.len());
    let writer = Writer::<ScanVertex>::new();
    writer.write_header(&mut bytes, &header)?;
    writer.write_payload_of_element(&mut bytes, &vertices, &vertex, &header)?;
    Writer::<FaceRow>::new().write_payload_of_element(&mut bytes, &faces, &face, &header)?;
    Ok(bytes)
}

fn encode_discs(discs: &[Disc]) -> std::io::Result<Vec<u8>> {
    let rows: Vec<ScanVertex> = discs
        .iter()
        .map(|d| ScanVertex {
            position: d.center.as_dvec3().to_array(),
            normal: d.normal.to_array(),
            color: d.color.map(f32::from),
            radius: d.radius,
            filled: d.filled,
            confidence: d.confidence,
        })
        .collect();
    let vertex = element(
        "vertex",
        rows.len(),
        &["x", "y", "z", "nx", "ny", "nz", "radius", "confidence"],
        &["red", "green", "blue", "filled"],
    );
    let mut header = Header { encoding: Encoding::BinaryLittleEndian, ..Header::new() };
    header.elements.add(vertex.clone());
    let mut bytes = Vec::with_capacity(400 + 36 * rows.len());
    let writer = Writer::<ScanVertex>::new();
    writer.write_header(&mut bytes, &header)?;
    writer.write_payload_of_element(&mut bytes, &rows, &vertex, &header)?;
    Ok(bytes)
}

fn element(name: &str, count: usize, floats: &[&str], bytes: &[&str]) -> ElementDef {
    let mut element = ElementDef::new(name.into());
    element.count = count;
    let floats = floats.iter().map(|f| (f, ScalarType::Float));
    for (property, scalar) in floats.chain(bytes.iter().map(|b| (b, ScalarType::UChar))) {
        element.properties.add(PropertyDef::new((*property).into(), PropertyType::Scalar(scalar)));
    }
    element
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    fn number() -> impl Strategy<Value = f32> {
        -1e4_f32..1e4
    }

    fn disc() -> impl Strategy<Value = Disc> {
        let center = (number(), number(), number());
        let seen = (any::<bool>(), 0.0_f32..9.0);
        (center, -3.0_f32..3.0, 1e-3_f32..1.0, any::<[u8; 3]>(), seen).prop_map(
            |(c, angle, radius, color, (filled, confidence))| Disc {
                center: c.into(),
                normal: Vec3::new(angle.sin(), 0.0, angle.cos()).normalize(),
                radius,
                color,
                filled,
                confidence,
            },
        )
    }

    proptest! {
        #[test]
        fn written_discs_read_back_equal(discs in prop::collection::vec(disc(), 1..40)) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("room.ply");
            write(&path, &Geometry::Discs(discs.clone())).unwrap();
            let Geometry::Discs(back) = super::super::read(&path).unwrap() else { panic!("no discs") };
            prop_assert_eq!(back.len(), discs.len());
            for (a, b) in back.iter().zip(&discs) {
                // Normals are normalised again when read.
                prop_assert!((a.normal - b.normal).length() < 1e-6);
                prop_assert_eq!(&Disc { normal: b.normal, ..*a }, b);
            }

            let mesh = Geometry::Mesh(Mesh {
                vertices: discs.iter().map(|d| d.center).collect(),
                triangles: (0..discs.len() as u32).map(|i| [i, 0, i / 2]).collect(),
                colors: discs.iter().map(|d| d.color).collect(),
            });
            write(&path, &mesh).unwrap();
            prop_assert_eq!(super::super::read(&path).unwrap(), mesh);
        }
    }

    #[test]
    fn defects_are_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.ply");
        let good = Disc {
            center: Vec3::ZERO,
            normal: Vec3::Z,
            radius: 0.1,
            color: [0; 3],
            filled: false,
            confidence: 1.0,
        };
        for bad in [
            Disc { center: Vec3::NAN, ..good },
            Disc { normal: Vec3::ZERO, ..good },
            Disc { normal: Vec3::ONE, ..good },
            Disc { radius: 0.0, ..good },
            Disc { radius: f32::NAN, ..good },
        ] {
            let said = write(&path, &Geometry::Discs(vec![good, bad])).unwrap_err().to_string();
            assert!(said.contains("vertex 1"), "{said}");
        }
        let mesh = Mesh { vertices: vec![Vec3::ZERO], triangles: vec![[0, 0, 1]], colors: vec![[0; 3]] };
        assert!(write(&path, &Geometry::Mesh(mesh.clone())).is_err());
        assert!(write(&path, &Geometry::Mesh(Mesh { colors: vec![], ..mesh })).is_err());
        assert!(!path.exists());
    }
}
