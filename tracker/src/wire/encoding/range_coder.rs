//! Adaptive binary range coder: probable bits need little space, and the probabilities are learnt from the preceding
//! bits.
//!
//! The coder of LZMA (I. Pavlov, "LZMA specification", 2015; after G. N. N. Martin, "Range encoding", 1979): 11-bit
//! probabilities, 32-bit range, a carry that runs back over bytes of 255. Integers only, so it is the same everywhere.
//!
//! [`Coder`] is both directions behind one trait, so that a model cannot differ between the two.

use super::bytes::{Decoded, Malformed};

/// Bits of a probability.
const PROBABILITY_BITS: u32 = 11;
/// Adaptation rate of the probabilities, by 2⁻⁴ of the difference for each bit: fast, because a message has few
/// symbols.
const ADAPTATION: u32 = 4;
/// Range below which it is extended by a byte.
const LEAST_RANGE: u32 = 1 << 24;

/// The probability that a bit is 0, in parts of 2¹¹.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bit(u16);

impl Default for Bit {
    fn default() -> Self {
        Self(1 << (PROBABILITY_BITS - 1))
    }
}

impl Bit {
    /// Part of the range that represents 0.
    fn bound(self, range: u32) -> u32 {
        (range >> PROBABILITY_BITS) * u32::from(self.0)
    }

    fn learn(&mut self, bit: bool) {
        if bit {
            self.0 -= self.0 >> ADAPTATION;
        } else {
            self.0 += ((1 << PROBABILITY_BITS) - self.0) >> ADAPTATION;
        }
    }
}

/// One direction of the coder. An encoder takes the value that it is given and returns it; a decoder ignores its
/// argument and returns the value that was given to the encoder.
pub(super) trait Coder {
    /// Codes one bit.
    fn bit(&mut self, model: &mut Bit, bit: bool) -> Decoded<bool>;
}

/// Coder that writes.
pub(super) struct Encoder {
    low: u64,
    range: u32,
    /// Last byte that a carry may still change, and the number of bytes of 255 after it.
    cache: u8,
    pending: usize,
    out: Vec<u8>,
}

impl Encoder {
    /// An encoder that has written nothing.
    pub(super) fn new() -> Self {
        Self { low: 0, range: u32::MAX, cache: 0, pending: 1, out: Vec::new() }
    }

    /// The bytes of everything that was written.
    pub(super) fn finish(mut self) -> Vec<u8> {
        for _ in 0..5 {
            self.shift();
        }
        self.out
    }

    fn shift(&mut self) {
        if self.low < 0xff00_0000 || self.low > u64::from(u32::MAX) {
            let carry = (self.low >> 32) as u8;
            let mut byte = self.cache;
            for _ in 0..std::mem::take(&mut self.pending) {
                self.out.push(byte.wrapping_add(carry));
                byte = 0xff;
            }
            self.cache = (self.low >> 24) as u8;
        }
        self.pending += 1;
        self.low = (self.low & 0x00ff_ffff) << 8;
    }
}

impl Coder for Encoder {
    fn bit(&mut self, model: &mut Bit, bit: bool) -> Decoded<bool> {
        let bound = model.bound(self.range);
        if bit {
            self.low += u64::from(bound);
            self.range -= bound;
        } else {
            self.range = bound;
        }
        model.learn(bit);
        while self.range < LEAST_RANGE {
            self.range <<= 8;
            self.shift();
        }
        Ok(bit)
    }
}

/// Coder that reads the output of an [`Encoder`].
pub(super) struct Decoder<'a> {
    code: u32,
    range: u32,
    rest: &'a [u8],
}

impl<'a> Decoder<'a> {
    /// Decoder at the start of these bytes.
    pub(super) fn new(bytes: &'a [u8]) -> Decoded<Self> {
        let mut decoder = Self { code: 0, range: u32::MAX, rest: bytes };
        // The first byte is the encoder's empty cache.
        for _ in 0..5 {
            decoder.shift()?;
        }
        Ok(decoder)
    }

    fn shift(&mut self) -> Decoded<()> {
        let (byte, rest) = self.rest.split_first().ok_or(Malformed("the coded picture is cut off"))?;
        self.code = self.code << 8 | u32::from(*byte);
        self.rest = rest;
        Ok(())
    }

    /// Checks that no bytes are left.
    pub(super) fn finish(self) -> Decoded<()> {
        if self.rest.is_empty() { Ok(()) } else { Err(Malformed("bytes follow the coded picture")) }
    }
}

impl Coder for Decoder<'_> {
    fn bit(&mut self, model: &mut Bit, _: bool) -> Decoded<bool> {
        let bound = model.bound(self.range);
        let bit = self.code >= bound;
        if bit {
            self.code -= bound;
            self.range -= bound;
        } else {
            self.range = bound;
        }
        model.learn(bit);
        while self.range < LEAST_RANGE {
            self.range <<= 8;
            self.shift()?;
        }
        Ok(bit)
    }
}

/// Symbol of up to `SIZE` values, a power of two: its bits from the highest, each with a model for all bits above it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Symbol<const SIZE: usize>([Bit; SIZE]);

impl<const SIZE: usize> Default for Symbol<SIZE> {
    fn default() -> Self {
        Self([Bit::default(); SIZE])
    }
}

impl<const SIZE: usize> Symbol<SIZE> {
    /// Codes one symbol; only the bits of `value` below `SIZE` count.
    pub(super) fn code(&mut self, coder: &mut impl Coder, value: usize) -> Decoded<usize> {
        let mut node = 1;
        for shift in (0..SIZE.ilog2()).rev() {
            let bit = coder.bit(&mut self.0[node], value >> shift & 1 == 1)?;
            node = node << 1 | usize::from(bit);
        }
        Ok(node - SIZE)
    }
}

/// Integer of up to 15 bits: the number of its bits, then those below the highest.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Length {
    bits: Symbol<16>,
    below: [[Bit; 2]; 16],
}

impl Length {
    /// Codes one integer below 2¹⁵.
    pub(super) fn code(&mut self, coder: &mut impl Coder, value: u32) -> Decoded<u32> {
        let bits = self.bits.code(coder, (u32::BITS - value.leading_zeros()) as usize)?;
        let mut read = u32::from(bits > 0);
        for shift in (0..bits.saturating_sub(1)).rev() {
            // The bit below the highest has a model of its own, the others share one.
            let model = &mut self.below[bits][usize::from(shift + 2 < bits)];
            let bit = coder.bit(model, value >> shift & 1 == 1)?;
            read = read << 1 | u32::from(bit);
        }
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(coder: &mut impl Coder, values: &[(usize, u32)]) -> Decoded<Vec<(usize, u32)>> {
        let (mut symbol, mut length) = (Symbol::<16>::default(), Length::default());
        values.iter().map(|(s, l)| Ok((symbol.code(coder, *s)?, length.code(coder, *l)?))).collect()
    }

    proptest! {
        #[test]
        fn decoder_returns_what_was_encoded_and_reads_every_byte(
            values in prop::collection::vec((0_usize..16, 0_u32..1 << 15), 0..400),
        ) {
            let mut encoder = Encoder::new();
            prop_assert_eq!(&all(&mut encoder, &values)?, &values);
            let bytes = encoder.finish();
            let mut decoder = Decoder::new(&bytes)?;
            prop_assert_eq!(&all(&mut decoder, &vec![(0, 0); values.len()])?, &values);
            prop_assert_eq!(decoder.finish(), Ok(()));
        }

        #[test]
        fn random_bytes_end_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            if let Ok(mut decoder) = Decoder::new(&bytes) {
                let _ = all(&mut decoder, &vec![(0, 0); 1000]);
            }
        }
    }

    #[test]
    fn likely_symbols_cost_little() {
        let mut encoder = Encoder::new();
        all(&mut encoder, &vec![(7, 3); 1000]).unwrap();
        let length = encoder.finish().len();
        assert!(length < 100, "{length}");
    }
}
