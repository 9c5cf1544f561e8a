//! A fingerprint of what rays can meet: caches that depend on the geometry are keyed by it.

use super::Geometry;

/// Numbers are hashed in blocks of about this many bytes.
const BLOCK_BYTES: usize = 1 << 16;

impl Geometry {
    /// The same for geometry of the same shape; colours do not count.
    pub(crate) fn shape_hash(&self) -> blake3::Hash {
        let mut hasher = blake3::Hasher::new();
        let mut block = Vec::with_capacity(BLOCK_BYTES);
        let mut add = |values: &[u32]| {
            block.extend(values.iter().flat_map(|v| v.to_le_bytes()));
            if block.len() > BLOCK_BYTES - 64 {
                hasher.update(&block);
                block.clear();
            }
        };
        match self {
            Self::Mesh(mesh) => {
                add(&[0, mesh.vertices.len() as u32]);
                mesh.vertices.iter().for_each(|v| add(&v.to_array().map(f32::to_bits)));
                mesh.triangles.iter().for_each(|t| add(t));
            }
            Self::Discs(discs) => {
                add(&[1, discs.len() as u32]);
                for d in discs {
                    add(&d.center.to_array().map(f32::to_bits));
                    add(&d.normal.to_array().map(f32::to_bits));
                    add(&[d.radius.to_bits()]);
                }
            }
        }
        hasher.update(&block);
        hasher.finalize()
    }
}
