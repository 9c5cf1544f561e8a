//! Reading of glTF: the scene's primitives one after the other, each in the place of its node.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use base64::Engine;
use nalgebra::{Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3, Vector4};

use super::document::{Document, Node, Primitive};
use super::{BINARY_CHUNK, JSON_CHUNK, MAGIC};
use crate::geometry::scan::{Defect, Scan};
use crate::geometry::scan_vertex::ScanVertex;
use crate::geometry::texture::{Texture, level_of_light, light_of_level};

pub(super) type Parsed<T> = Result<T, Defect>;

/// Reads a file, glTF or GLB; its buffers and pictures are looked for beside `path`.
///
/// # Errors
/// The place in the file and the problem.
pub(in crate::geometry) fn scan(path: &Path, bytes: &[u8]) -> Parsed<Scan> {
    let (json, binary) = if bytes.starts_with(MAGIC) { chunks(bytes)? } else { (bytes, None) };
    let document: Document = serde_json::from_slice(json).map_err(|e| {
        let place = format!("JSON, line {}, column {}", e.line(), e.column());
        let said = e.to_string();
        (place, format!("this is no glTF 2.0: {}", said.split(" at line ").next().unwrap_or_default()))
    })?;
    let mut file = File { path, document: &document, buffers: Vec::new(), textures: HashMap::new() };
    for (i, buffer) in document.buffers.iter().enumerate() {
        let place = || format!("buffer {i}");
        let content: Cow<'_, [u8]> = match (&buffer.uri, binary) {
            (Some(uri), _) => file.resource(uri, buffer.byte_length).map_err(|p| (place(), p))?.into(),
            (None, Some(binary)) if i == 0 => binary.into(),
            (None, _) => {
                return Err((place(), "it has no content; export the file again, as one .glb".into()));
            }
        };
        if content.len() < buffer.byte_length {
            let problem = format!(
                "{} bytes are announced, but {} are there: the file is cut off; copy it again",
                buffer.byte_length,
                content.len()
            );
            return Err((place(), problem));
        }
        file.buffers.push(content);
    }
    file.scene()
}

/// The JSON and the binary chunk of a GLB file.
fn chunks(bytes: &[u8]) -> Parsed<(&[u8], Option<&[u8]>)> {
    let cut_off = || ("GLB".to_owned(), "the file ends within a chunk; copy it again".to_owned());
    let number = |at: usize| bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    match number(4) {
        Some(2) => {}
        Some(version) => {
            return Err(("GLB".into(), format!("its version is {version}; export it as glTF 2.0")));
        }
        None => return Err(cut_off()),
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < bytes.len() {
        let (Some(length), Some(kind)) = (number(at), number(at + 4)) else { return Err(cut_off()) };
        let from = at + 8;
        let chunk = bytes.get(from..).and_then(|rest| rest.get(..length as usize)).ok_or_else(cut_off)?;
        match kind {
            JSON_CHUNK if json.is_none() => json = Some(chunk),
            BINARY_CHUNK if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = from + length as usize;
    }
    Ok((json.ok_or_else(cut_off)?, binary))
}

pub(super) struct File<'a> {
    path: &'a Path,
    pub(super) document: &'a Document,
    pub(super) buffers: Vec<Cow<'a, [u8]>>,
    /// Decoded pictures by their number; `None` for those that cannot be read.
    textures: HashMap<usize, Option<Texture>>,
}

/// A part of the list that an index names.
pub(super) fn named<'d, T>(list: &'d [T], index: usize, what: &str) -> Parsed<&'d T> {
    list.get(index).ok_or_else(|| {
        (
            format!("{what} {index}"),
            format!("it is named, but there are {}; export the file again", list.len()),
        )
    })
}

impl File<'_> {
    /// Bytes of a URI: in itself, or a file beside this one. At most `most` bytes of a file are read.
    fn resource(&self, uri: &str, most: usize) -> Result<Vec<u8>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            let encoded = data.split_once(";base64,").map(|(_, encoded)| encoded);
            let encoded =
                encoded.ok_or("its data: URI is not in base64; export the file again, as one .glb")?;
            return base64::engine::general_purpose::STANDARD.decode(encoded).map_err(|e| {
                format!("its data: URI is no base64 ({e}); export the file again, as one .glb")
            });
        }
        if uri.contains("://") {
            return Err(format!("it lies at {uri}; load it down and export the file as one .glb"));
        }
        let file = self.path.with_file_name("").join(PathBuf::from(decoded_percents(uri)));
        let read = || {
            let opened = std::fs::File::open(&file)?;
            if !opened.metadata()?.is_file() {
                return Err(std::io::Error::other("is no file"));
            }
            let mut bytes = Vec::new();
            opened.take(most as u64).read_to_end(&mut bytes)?;
            Ok(bytes)
        };
        read().map_err(|e| format!("{}: {e}", file.display()))
    }

    fn scene(&mut self) -> Parsed<Scan> {
        let document = self.document;
        let roots: Vec<usize> = if document.scenes.is_empty() {
            let mut is_child = vec![false; document.nodes.len()];
            for child in document.nodes.iter().flat_map(|node| &node.children) {
                if let Some(flag) = is_child.get_mut(*child) {
                    *flag = true;
                }
            }
            (0..document.nodes.len()).filter(|i| !is_child[*i]).collect()
        } else {
            named(&document.scenes, document.scene.unwrap_or(0), "scene")?.nodes.clone()
        };
        let mut scan = Scan::default();
        let mut points = Scan::default();
        let mut is_visited = vec![false; document.nodes.len()];
        let mut left: Vec<(usize, Matrix4<f64>)> =
            roots.into_iter().rev().map(|i| (i, Matrix4::identity())).collect();
        while let Some((index, world_from_parent)) = left.pop() {
            let node = named(&document.nodes, index, "node")?;
            if std::mem::replace(&mut is_visited[index], true) {
                let problem = "it has two parents, which glTF does not allow; export the file again";
                return Err((format!("node {index}"), problem.into()));
            }
            let world_from_node = world_from_parent * matrix_of(node);
            if let Some(mesh) = node.mesh {
                for (number, primitive) in
                    named(&document.meshes, mesh, "mesh")?.primitives.iter().enumerate()
                {
                    let at = |(place, problem): Defect| {
                        (format!("mesh {mesh}, primitive {number}, {place}"), problem)
                    };
                    self.primitive(primitive, &world_from_node, &mut scan, &mut points).map_err(at)?;
                }
            }
            left.extend(node.children.iter().rev().map(|child| (*child, world_from_node)));
        }
        if scan.is_cloud() {
            points.full_level = 255.0;
            return Ok(points);
        }
        if !points.vertices.is_empty() {
            tracing::warn!(
                "{}: {} points beside the triangles are not read",
                self.path.display(),
                points.vertices.len()
            );
        }
        Ok(scan)
    }

    /// Adds a primitive's triangles or points.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        world_from_node: &Matrix4<f64>,
        scan: &mut Scan,
        points: &mut Scan,
    ) -> Parsed<()> {
        const POINTS: u32 = 0;
        let mode = primitive.mode.unwrap_or(4);
        if !matches!(mode, POINTS | 4..=6) {
            return Ok(());
        }
        for compression in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
            if primitive.extensions.contains_key(compression) {
                return Err((
                    "attributes".into(),
                    format!("they are compressed by {compression}, which is not read; export them without"),
                ));
            }
        }
        let Some(&positions) = primitive.attributes.get("POSITION") else { return Ok(()) };
        let positions = self.numbers::<3>(positions, "VEC3")?;
        let colors = self.colors(primitive, positions.len())?;
        let normals = match primitive.attributes.get("NORMAL") {
            Some(normals) if mode == POINTS => Some(self.numbers::<3>(*normals, "VEC3")?),
            _ => None,
        };
        let into = if mode == POINTS { points } else { scan };
        let first = into.vertices.len();
        if first + positions.len() > u32::MAX as usize {
            return Err(("POSITION".into(), "the file has more than 4 billion vertices; thin it".into()));
        }
        into.has_normals = normals.is_some() && (first == 0 || into.has_normals);
        for (i, position) in positions.iter().enumerate() {
            let placed = world_from_node.transform_point(&Point3::from(*position));
            let normal = normals.as_ref().and_then(|normals| normals.get(i)).map_or([0.0; 3], |normal| {
                let turned = world_from_node * Vector4::new(normal[0], normal[1], normal[2], 0.0);
                [turned.x as f32, turned.y as f32, turned.z as f32]
            });
            let color = colors.as_ref().and_then(|colors| colors.get(i)).copied();
            let usual = ScanVertex::default();
            into.vertices.push(ScanVertex {
                position: placed.into(),
                normal,
                color: color.unwrap_or(usual.color),
                ..usual
            });
        }
        if mode == POINTS {
            return Ok(());
        }
        let corners: Vec<usize> = match primitive.indices {
            Some(indices) => self.indices(indices)?,
            None => (0..positions.len()).collect(),
        };
        if let Some(index) = corners.iter().find(|index| **index >= positions.len()) {
            let problem =
                format!("vertex {index} is named, but there are {} (counted from 0)", positions.len());
            return Err(("indices".into(), problem));
        }
        let mut push = |a: usize, b: usize, c: usize| {
            into.triangles.push([a, b, c].map(|corner| (first + corner) as u32));
        };
        match mode {
            4 => corners.chunks_exact(3).for_each(|t| push(t[0], t[1], t[2])),
            5 => corners.windows(3).enumerate().for_each(|(i, t)| {
                if i.is_multiple_of(2) { push(t[0], t[1], t[2]) } else { push(t[1], t[0], t[2]) }
            }),
            _ => corners.windows(2).skip(1).for_each(|t| push(corners[0], t[0], t[1])),
        }
        Ok(())
    }

    /// Colours of a primitive's vertices, levels from 0 to 255; `None` where nothing states one.
    fn colors(&mut self, primitive: &Primitive, count: usize) -> Parsed<Option<Vec<[f32; 3]>>> {
        let document = self.document;
        let surface = match primitive.material {
            Some(index) => Some(&named(&document.materials, index, "material")?.pbr_metallic_roughness),
            None => None,
        };
        // Colours of vertices and materials are amounts of light.
        let mut light: Option<Vec<[f32; 3]>> = match primitive.attributes.get("COLOR_0") {
            Some(&index) => {
                let alpha = named(&document.accessors, index, "accessor")?.shape == "VEC4";
                let as_light = |c: &[f64]| [c[0] as f32, c[1] as f32, c[2] as f32];
                Some(if alpha {
                    self.numbers::<4>(index, "VEC4")?.iter().map(|c| as_light(c)).collect()
                } else {
                    self.numbers::<3>(index, "VEC3")?.iter().map(|c| as_light(c)).collect()
                })
            }
            None => None,
        };
        let mut multiply = |by: &dyn Fn(usize) -> [f32; 3]| {
            let light = light.get_or_insert_with(|| vec![[1.0; 3]; count]);
            for (i, light) in light.iter_mut().enumerate() {
                *light = std::array::from_fn(|c| light[c] * by(i)[c]);
            }
        };
        if let Some([r, g, b, _]) = surface.and_then(|surface| surface.base_color_factor) {
            multiply(&|_| [r, g, b]);
        }
        if let Some(texture) = surface.and_then(|surface| surface.base_color_texture.as_ref())
            && let Some(&places) = primitive.attributes.get(&format!("TEXCOORD_{}", texture.tex_coord))
        {
            let places = self.numbers::<2>(places, "VEC2")?;
            if let Some(picture) = self.texture(texture.index)? {
                multiply(&|i| {
                    let [u, v] = places.get(i).copied().unwrap_or_default();
                    picture.at(u as f32, v as f32).map(|level| light_of_level(f32::from(level) / 255.0))
                });
            }
        }
        Ok(light
            .map(|light| light.into_iter().map(|c| c.map(|l| (255.0 * level_of_light(l)).round())).collect()))
    }

    fn texture(&mut self, index: usize) -> Parsed<Option<&Texture>> {
        /// Most bytes of a picture's file.
        const MOST_BYTES: usize = 1 << 30;
        let document = self.document;
        let Some(image) = named(&document.textures, index, "texture")?.source else { return Ok(None) };
        if !self.textures.contains_key(&image) {
            let source = named(&document.images, image, "image")?;
            let bytes: Cow<'_, [u8]> = match (&source.uri, source.buffer_view) {
                (Some(uri), _) => match self.resource(uri, MOST_BYTES) {
                    Ok(bytes) => bytes.into(),
                    Err(problem) => {
                        tracing::warn!(
                            "{}: image {image}: {problem}; the surface has no texture",
                            self.path.display()
                        );
                        Vec::new().into()
                    }
                },
                (None, Some(view)) => self.view(view)?.0.into(),
                (None, None) => Vec::new().into(),
            };
            let texture = if bytes.is_empty() { None } else { Texture::decode(self.path, &bytes) };
            self.textures.insert(image, texture);
        }
        Ok(self.textures.get(&image).and_then(Option::as_ref))
    }
}

fn matrix_of(node: &Node) -> Matrix4<f64> {
    if let Some(columns) = &node.matrix {
        return Matrix4::from_column_slice(columns);
    }
    let translation = Translation3::from(node.translation.unwrap_or_default()).to_homogeneous();
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)).to_homogeneous();
    let scale = Matrix4::new_nonuniform_scaling(&Vector3::from(node.scale.unwrap_or([1.0; 3])));
    translation * rotation * scale
}

/// A URI's text with `%20` and the like as the characters they stand for.
fn decoded_percents(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let hex = bytes.get(at + 1..at + 3).and_then(|pair| std::str::from_utf8(pair).ok());
        if let Some(byte) =
            hex.filter(|_| bytes[at] == b'%').and_then(|pair| u8::from_str_radix(pair, 16).ok())
        {
            decoded.push(byte);
            at += 3;
        } else {
            decoded.push(bytes[at]);
            at += 1;
        }
    }
    String::from_utf8_lossy(&decoded).into_owned()
}
