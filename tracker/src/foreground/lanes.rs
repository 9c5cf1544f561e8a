//! Vectorised comparison of a frame with the background in the frame's exposure, in integers.

use wide::u8x16;

use super::exposure::Exposure;

/// Number of pixels handled together, so that the comparison is vectorised.
pub(super) const LANES: usize = 32;

/// Exposure in integers, repeated over a chunk of pixels: a gain and a bias for each byte.
pub(super) struct ExposureLanes {
    /// Gains, in 1/16384.
    gain: [u16; 3 * LANES],
    /// Biases in 1/64 levels: the one to add, then the one to subtract.
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

    /// Computes the background (1/256 levels) in this exposure into `looks`, and returns each pixel's squared distance
    /// from it, at most 65535, which scores 255 at a tolerance up to 128 levels.
    pub(super) fn compare(
        &self,
        background: &[u16; 3 * LANES],
        frame: &[u8; 3 * LANES],
        looks: &mut [u8; 3 * LANES],
    ) -> [u16; LANES] {
        let mut off = [0; 3 * LANES];
        for i in 0..3 * LANES {
            // 8 and 14 binary places less 16 leave 6.
            let scaled = ((u32::from(background[i]) * u32::from(self.gain[i])) >> 16) as u16;
            let level = scaled.saturating_add(self.bias[0][i]).saturating_sub(self.bias[1][i]);
            looks[i] = (level.saturating_add(32) >> 6).min(255) as u8;
            off[i] = frame[i].abs_diff(looks[i]);
        }
        let [red, green, blue] = planes(&off);
        let square = |off: u8| u16::from(off) * u16::from(off);
        let mut sums = [0; LANES];
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum = square(red[i]).saturating_add(square(green[i])).saturating_add(square(blue[i]));
        }
        sums
    }
}

/// Bytes in a vector register.
const REGISTER: usize = 16;

/// For each channel and each of three registers of pixels: the index of the channel's values in the register.
const PLACES: [[[u8; REGISTER]; 3]; 3] = {
    /// An index that yields 0.
    const ELSEWHERE: u8 = 0x80;
    let mut places = [[[ELSEWHERE; REGISTER]; 3]; 3];
    let mut byte = 0;
    while byte < 3 * REGISTER {
        places[byte % 3][byte / REGISTER][byte / 3] = (byte % REGISTER) as u8;
        byte += 1;
    }
    places
};

/// Splits pixels into one plane for each channel.
fn planes(pixels: &[u8; 3 * LANES]) -> [[u8; LANES]; 3] {
    let mut planes = [[0; LANES]; 3];
    for (group, registers) in pixels.as_chunks::<REGISTER>().0.as_chunks::<3>().0.iter().enumerate() {
        let registers = registers.map(u8x16::new);
        for (plane, places) in planes.iter_mut().zip(&PLACES) {
            let [a, b, c] = std::array::from_fn(|i| registers[i].shuffle(u8x16::new(places[i])));
            plane[group * REGISTER..][..REGISTER].copy_from_slice((a | b | c).as_array());
        }
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_hold_every_third_value() {
        let pixels: [u8; 3 * LANES] = std::array::from_fn(|i| (i * 7 % 251) as u8);
        for (c, plane) in planes(&pixels).iter().enumerate() {
            for (i, value) in plane.iter().enumerate() {
                assert_eq!(*value, pixels[3 * i + c]);
            }
        }
    }
}
