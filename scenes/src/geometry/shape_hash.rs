//! Hash of the shape that rays can hit, as a key of caches that depend on the geometry.

use super::Geometry;

/// Approximate size of the blocks that are hashed, bytes.
const BLOCK_BYTES: usize = 1 << 16;

impl Geometry {
    /// Hash that is the same for geometry of the same shape; colours do not count.
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
