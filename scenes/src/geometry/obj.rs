//! Wavefront OBJ: vertices (with colours after the coordinates, as scanning programs write them), polygons, and materials'
//! colours and textures from the `mtllib` beside it.
//!
//! Own code and no crate: coordinates need the digits of a double, and a defect its line's number.

use std::collections::HashMap;
use std::path::Path;

use super::scan::{Defect, Scan};
use super::scan_vertex::ScanVertex;
use super::texture::Texture;

/// Colour and picture of a material.
#[derive(Debug, Default)]
struct Material {
    /// Levels, 0 to 255.
    color: Option<[f32; 3]>,
    texture: Option<Texture>,
}

/// Reads the file's text; materials are looked for beside `path`.
///
/// # Errors
/// The line, and the problem with it.
pub(super) fn scan(path: &Path, bytes: &[u8]) -> Result<Scan, Defect> {
    let text = String::from_utf8_lossy(bytes);
    let mut file = Obj::new(path);
    for (line, number) in text.lines().zip(1..) {
        file.line(line).map_err(|problem| (format!("line {number}"), problem))?;
    }
    file.finish()
}

struct Obj<'a> {
    path: &'a Path,
    scan: Scan,
    /// Whether a vertex states its colour.
    is_colored: Vec<bool>,
    normals: Vec<[f32; 3]>,
    /// Places in the texture: to the right, upwards.
    texture_places: Vec<[f32; 2]>,
    materials: HashMap<String, Material>,
    material: Option<String>,
    brightest: f32,
}

impl<'a> Obj<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            scan: Scan::default(),
            is_colored: Vec::new(),
            normals: Vec::new(),
            texture_places: Vec::new(),
            materials: HashMap::new(),
            material: None,
            brightest: 0.0,
        }
    }

    fn line(&mut self, line: &str) -> Result<(), String> {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => self.vertex(&numbers(words)?),
            Some("vn") => match numbers(words)?[..] {
                [x, y, z, ..] => {
                    self.normals.push([x as f32, y as f32, z as f32]);
                    Ok(())
                }
                _ => Err("a normal (`vn`) has three numbers".into()),
            },
            Some("vt") => match numbers(words)?[..] {
                [u, v, ..] => {
                    self.texture_places.push([u as f32, v as f32]);
                    Ok(())
                }
                [u] => {
                    self.texture_places.push([u as f32, 0.0]);
                    Ok(())
                }
                [] => Err("a texture's place (`vt`) has one to three numbers".into()),
            },
            Some("f") => self.face(words),
            Some("usemtl") => {
                self.material = words.next().map(str::to_owned);
                Ok(())
            }
            Some("mtllib") => {
                // A name may hold spaces.
                let name = line.trim().strip_prefix("mtllib").unwrap_or_default().trim();
                read_materials(&self.path.with_file_name(name), &mut self.materials);
                Ok(())
            }
            // Groups, names, smoothing, lines, curves: no surface that is needed.
            _ => Ok(()),
        }
    }

    fn vertex(&mut self, numbers: &[f64]) -> Result<(), String> {
        let &[x, y, z, ref more @ ..] = numbers else {
            return Err("a vertex (`v`) has at least three numbers".into());
        };
        let mut vertex = ScanVertex { position: [x, y, z], ..ScanVertex::default() };
        // Three further numbers are a colour, with a weight before them or not.
        let color = match *more {
            [r, g, b] | [_, r, g, b] => Some([r as f32, g as f32, b as f32]),
            _ => None,
        };
        if let Some(color) = color {
            vertex.color = color;
            self.brightest = color.into_iter().fold(self.brightest, f32::max);
        }
        self.is_colored.push(color.is_some());
        self.scan.vertices.push(vertex);
        Ok(())
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w str>) -> Result<(), String> {
        let mut corners = Vec::new();
        for word in words {
            let mut parts = word.split('/');
            let mut index = |count: usize| index_of(parts.next().unwrap_or_default(), count);
            let vertex = index(self.scan.vertices.len())?;
            let vertex = vertex.ok_or_else(|| format!("the corner `{word}` names no vertex"))?;
            let place = index(self.texture_places.len())?.and_then(|i| self.texture_places.get(i).copied());
            let normal = index(self.normals.len())?.and_then(|i| self.normals.get(i).copied());
            let count = self.scan.vertices.len();
            let Some(there) = self.scan.vertices.get_mut(vertex) else {
                return Err(format!(
                    "the corner `{word}` names vertex {}, but {count} stand before it",
                    vertex + 1
                ));
            };
            if let Some(normal) = normal {
                there.normal = normal;
            }
            if !self.is_colored[vertex]
                && let Some(color) =
                    self.material.as_ref().and_then(|m| self.materials.get(m)).and_then(|m| m.at(place))
            {
                there.color = color;
                self.is_colored[vertex] = true;
                self.brightest = self.brightest.max(255.0);
            }
            corners.push(vertex as u32);
        }
        if corners.len() < 3 {
            return Err(format!("the face has {} corners; it needs 3", corners.len()));
        }
        self.scan.polygons.push(corners);
        Ok(())
    }

    fn finish(mut self) -> Result<Scan, Defect> {
        if self.scan.vertices.is_empty() {
            return Err((
                "whole file".into(),
                "it holds no vertex (`v`), so it is no OBJ file with geometry".into(),
            ));
        }
        if self.scan.vertices.len() > u32::MAX as usize {
            return Err(("whole file".into(), "it has more than 4 billion vertices; thin it".into()));
        }
        // Colours are 0 to 1, or 0 to 255 in the files of some scanners; materials have been brought to 255.
        let is_fraction = self.brightest <= 1.0;
        for (vertex, is_colored) in self.scan.vertices.iter_mut().zip(&self.is_colored) {
            if is_fraction && *is_colored {
                vertex.color = vertex.color.map(|level| 255.0 * level);
            }
        }
        // A cloud lists normals beside its vertices, one each, since no face names them.
        if self.scan.is_cloud() && self.normals.len() == self.scan.vertices.len() {
            for (vertex, normal) in self.scan.vertices.iter_mut().zip(&self.normals) {
                vertex.normal = *normal;
            }
            self.scan.has_normals = true;
        }
        Ok(self.scan)
    }
}

impl Material {
    /// Colour at a place of the texture, levels from 0 to 255.
    fn at(&self, place: Option<[f32; 2]>) -> Option<[f32; 3]> {
        match (&self.texture, place) {
            (Some(texture), Some([u, v])) => Some(texture.at(u, 1.0 - v).map(f32::from)),
            _ => self.color,
        }
    }
}

/// Index from 0 of a word that counts from 1, or backwards from −1; `None` for an empty word.
fn index_of(word: &str, count: usize) -> Result<Option<usize>, String> {
    if word.is_empty() {
        return Ok(None);
    }
    match word.parse::<i64>() {
        Ok(number) if number > 0 => Ok(Some(number as usize - 1)),
        Ok(number) if number < 0 && number.unsigned_abs() <= count as u64 => {
            Ok(Some(count - number.unsigned_abs() as usize))
        }
        _ => Err(format!("`{word}` is no number of a vertex: they count from 1, or backwards from -1")),
    }
}

fn numbers<'w>(words: impl Iterator<Item = &'w str>) -> Result<Vec<f64>, String> {
    words.map(|word| word.parse().map_err(|_| format!("`{word}` is no number"))).collect()
}

/// Adds the materials of a file; one that is not there costs colours, which is told.
fn read_materials(path: &Path, materials: &mut HashMap<String, Material>) {
    let text = match std::fs::read(path) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(e) => {
            tracing::warn!("{}: {e}; the surfaces of its materials have no colour", path.display());
            return;
        }
    };
    let mut current: Option<&mut Material> = None;
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("newmtl") => {
                current = words.next().map(|name| materials.entry(name.to_owned()).or_default());
            }
            Some("Kd") => {
                if let (Some(material), Ok(&[r, g, b])) = (&mut current, numbers(words).as_deref()) {
                    material.color = Some([r, g, b].map(|level| 255.0 * level as f32));
                }
            }
            Some("map_Kd") => {
                // Options stand before the name, which may hold spaces; a name without options is the whole rest.
                let rest = line.trim().strip_prefix("map_Kd").unwrap_or_default().trim();
                let name =
                    if rest.starts_with('-') { rest.rsplit(' ').next().unwrap_or_default() } else { rest };
                let picture = path.with_file_name(name.replace('\\', "/"));
                let Some(material) = &mut current else { continue };
                match std::fs::read(&picture) {
                    Ok(bytes) => material.texture = Texture::decode(&picture, &bytes),
                    Err(e) => tracing::warn!("{}: {e}; the surface has no texture", picture.display()),
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // numbers that are only copied stay as they are
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Scan, String> {
        scan(Path::new("/nowhere/room.obj"), text.as_bytes())
            .map_err(|(place, problem)| format!("{place}: {problem}"))
    }

    #[test]
    fn faces_of_all_forms_and_colours_of_both_scales_are_read() {
        let corners = "v 500000.125 0 0\nv 1 0 0 # east\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
        for (face, expected) in [
            ("f 1 2 3 4", vec![0, 1, 2, 3]),
            ("f 1/1 2/1 3/1", vec![0, 1, 2]),
            ("f 1//1 2//1 3//1", vec![0, 1, 2]),
            ("f 1/1/1 2/1/1 4/1/1", vec![0, 1, 3]),
            ("f -4 -3 -1", vec![0, 1, 3]),
        ] {
            let scan = read(&format!("{corners}{face}\n")).unwrap();
            assert_eq!(scan.polygons, [expected], "{face}");
            assert_eq!(scan.vertices[0].position, [500_000.125, 0.0, 0.0]);
        }
        let color = |vertex: &str| read(&format!("{vertex}\nv 0 0 0 0 0 0\n")).unwrap().vertices[0].color;
        assert_eq!(color("v 0 0 0 1 0.5 0"), [255.0, 127.5, 0.0]);
        assert_eq!(color("v 0 0 0 255 100 0"), [255.0, 100.0, 0.0]);
        assert_eq!(color("v 0 0 0 1.0 0.2 0.2 0.2"), [51.0; 3]);
    }

    #[test]
    fn materials_and_textures_colour_the_vertices() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let image = image::RgbImage::from_fn(2, 2, |x, y| image::Rgb([100 * x as u8, 100 * y as u8, 7]));
        image.save(folder.path().join("the wall.png")).unwrap();
        put(
            "my room.mtl",
            "newmtl paint\nKd 1 0.5 0\nnewmtl wall\nKd 0 0 0\nmap_Kd the wall.png\nnewmtl lost\nmap_Kd no.png\n",
        );
        let text = "mtllib my room.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nv 3 0 0\nvt 0.1 0.9\nvt 0.9 0.1\nvt 0.9 0.9\n\
            usemtl paint\nf 4 5 6\nusemtl wall\nf 1/1 2/2 3/3\nusemtl lost\nf 1/1 2/2 3/3\n";
        let scan = scan(&folder.path().join("room.obj"), text.as_bytes()).unwrap();
        let colors: Vec<[f32; 3]> = scan.vertices.iter().map(|v| v.color).collect();
        // OBJ counts v from the bottom.
        assert_eq!(colors[..3], [[0.0, 0.0, 7.0], [100.0, 100.0, 7.0], [100.0, 0.0, 7.0]]);
        assert_eq!(colors[3], [255.0, 127.5, 0.0]);
    }

    #[test]
    fn a_cloud_keeps_its_normals() {
        let scan = read("v 0 0 0\nvn 0 0 1\nv 1 0 0\nvn 0 1 0\n").unwrap();
        assert!(scan.is_cloud() && scan.has_normals);
        assert_eq!(scan.vertices[1].normal, [0.0, 1.0, 0.0]);
        assert!(!read("v 0 0 0\nv 1 0 0\n").unwrap().has_normals);
    }

    #[test]
    fn defects_are_named_with_their_lines() {
        for (text, words) in [
            ("v 0 0 0\nv 1 zero 0\n", "line 2: `zero` is no number"),
            ("v 0 0\n", "line 1: a vertex"),
            ("v 0 0 0\nf 1 2 3\n", "line 2: the corner `2` names vertex 2, but 1 stand"),
            ("v 0 0 0\nf 1 1 0\n", "line 2: `0` is no number of a vertex"),
            ("v 0 0 0\nf 1 1 -2\n", "line 2: `-2` is no number of a vertex"),
            ("v 0 0 0\nf 1 1\n", "line 2: the face has 2 corners"),
            ("v 0 0 0\nf 1 / 1\n", "line 2: the corner `/` names no vertex"),
            ("v 0 0 0\nf 9223372036854775807 1 1\n", "line 2: the corner"),
            ("solid cube\n", "no vertex"),
            ("", "no vertex"),
        ] {
            let said = read(text).unwrap_err();
            assert!(said.contains(words), "{said}");
        }
    }
}
