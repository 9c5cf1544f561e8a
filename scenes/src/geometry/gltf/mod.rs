//! glTF 2.0 and its binary form GLB in and out (<https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>): triangles and
//! points with colours of vertices, materials and textures. Its world has Y up, in metres.
//!
//! Own code on `serde_json`: of the crates that know the format, none reads accessors of a hostile file without a panic.

mod accessor;
mod document;
mod read;
#[cfg(test)]
#[allow(clippy::float_cmp)] // numbers that are only copied stay as they are
mod tests;
mod write;

pub(super) use read::scan;
pub use write::encode;

/// First bytes of a GLB file.
const MAGIC: &[u8; 4] = b"glTF";
/// Types of its chunks.
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BINARY_CHUNK: u32 = 0x004e_4942;
