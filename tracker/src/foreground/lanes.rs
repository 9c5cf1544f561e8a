//! A frame against the background in the frame's exposure, many pixels at once, in whole numbers.

use super::exposure::Exposure;

/// Pixels handled together, so that the comparison runs in vector registers.
pub(super) const LANES: usize = 32;

/// An exposure as whole numbers, for many pixels at once: a gain and a bias for each of a chunk's bytes.
pub(super) struct ExposureLanes {
    /// In 1/16384.
    gain: [u16; 3 * LANES],
    /// In 1/64 levels; what is added, then what is taken away.
    bias: [[u16; 3 * LANES]; 2],
}

impl ExposureLanes {
    pub(super) fn new(exposure: &Exposure) -> Self {
        let bias = |sign: f32| {
            std::array::from_fn(|i| (64.0 * sign * exposure.bias[i % 3]).clamp(0.0, 65535.0).round() as u16)
        };
        let gain =
            std::array::from_fn(|i| (16384.0 * exposure.gain[i % 3]).clamp(0.0, 65535.0).round() as u16);
        Self { gain, bias: [bias(1.0), bias(-1.0)] }
    }

    /// What the background (1/256 levels) looks like in this exposure, and each byte's squared distance from it.
    pub(super) fn compare(
        &self,
        background: &[u16],
        frame: &[u8; 3 * LANES],
        looks: &mut [u8; 3 * LANES],
        squares: &mut [u16; 3 * LANES],
    ) {
        let Some(background) = background.first_chunk::<{ 3 * LANES }>() else { return };
        for i in 0..3 * LANES {
            // 8 and 14 binary places less 16 are 6.
            let scaled = ((u32::from(background[i]) * u32::from(self.gain[i])) >> 16) as u16;
            let level = scaled.saturating_add(self.bias[0][i]).saturating_sub(self.bias[1][i]);
            looks[i] = (level.saturating_add(32) >> 6).min(255) as u8;
            let off = u16::from(frame[i].abs_diff(looks[i]));
            squares[i] = off * off;
        }
    }
}
