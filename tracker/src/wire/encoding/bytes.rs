//! Integers, numbers, texts and byte strings within a message. Reading beyond the bytes, or an invalid value, is an
//! error.

/// Reason why a message is refused, or cannot be encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Malformed(pub(crate) &'static str);

/// `Result` of the encoding.
pub(in crate::wire) type Decoded<T> = Result<T, Malformed>;

/// Appends a variable-length integer: 7 bits a byte, lowest first, the top bit set in all bytes but the last (LEB128).
pub(in crate::wire) fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Appends a number: 8 bytes, IEEE 754, lowest byte first.
pub(in crate::wire) fn put_f64(out: &mut Vec<u8>, value: f64) {
    out.extend_from_slice(&value.to_le_bytes());
}

/// Appends a byte string after its length.
pub(in crate::wire) fn put_block(out: &mut Vec<u8>, bytes: &[u8]) {
    put_varint(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

/// Appends a text after its length, cut at a character boundary so that it has at most `longest` bytes.
pub(in crate::wire) fn put_text(out: &mut Vec<u8>, text: &str, longest: usize) {
    let end = text.char_indices().map(|(at, c)| at + c.len_utf8()).take_while(|end| *end <= longest).last();
    put_block(out, &text.as_bytes()[..end.unwrap_or(0)]);
}

/// Reads a message from its start.
pub(in crate::wire) struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A reader of these bytes.
    pub(in crate::wire) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// The next `count` bytes.
    pub(in crate::wire) fn take(&mut self, count: usize) -> Decoded<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or(Malformed("the message is cut off"))?;
        self.rest = rest;
        Ok(taken)
    }

    /// The next `N` bytes.
    pub(in crate::wire) fn array<const N: usize>(&mut self) -> Decoded<[u8; N]> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        Ok(bytes)
    }

    /// The next byte.
    pub(in crate::wire) fn byte(&mut self) -> Decoded<u8> {
        Ok(self.take(1)?[0])
    }

    /// The next variable-length integer.
    pub(in crate::wire) fn varint(&mut self) -> Decoded<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let bits = u64::from(byte & 0x7f);
            if bits << shift >> shift != bits {
                break;
            }
            value |= bits << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(Malformed("an integer is too large"))
    }

    /// The next variable-length integer, which must not be above `most`.
    pub(in crate::wire) fn size(&mut self, most: u32) -> Decoded<u32> {
        let value = self.varint()?;
        u32::try_from(value).ok().filter(|v| *v <= most).ok_or(Malformed("a size is above its limit"))
    }

    /// The next number, which must be finite.
    pub(in crate::wire) fn finite(&mut self) -> Decoded<f64> {
        Some(f64::from_le_bytes(self.array()?))
            .filter(|v| v.is_finite())
            .ok_or(Malformed("a number is not finite"))
    }

    /// The next byte string, of at most `longest` bytes.
    pub(in crate::wire) fn block(&mut self, longest: usize) -> Decoded<&'a [u8]> {
        let length = self.size(u32::try_from(longest).unwrap_or(u32::MAX))?;
        self.take(length as usize)
    }

    /// The next text, of at most `longest` bytes; control characters become spaces, so that the text stays one line of
    /// a log.
    pub(in crate::wire) fn text(&mut self, longest: usize) -> Decoded<String> {
        let text = std::str::from_utf8(self.block(longest)?).map_err(|_| Malformed("a text is not UTF-8"))?;
        Ok(text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect())
    }

    /// Checks that no bytes are left.
    pub(in crate::wire) fn finish(self) -> Decoded<()> {
        if self.rest.is_empty() { Ok(()) } else { Err(Malformed("bytes follow the message's end")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn integers_texts_and_numbers_return(value in any::<u64>(), shift in 0_u32..64, number in -1e300..1e300, text in ".{0,40}") {
            let mut bytes = Vec::new();
            put_varint(&mut bytes, value >> shift);
            put_f64(&mut bytes, number);
            put_text(&mut bytes, &text, 20);
            let mut reader = Reader::new(&bytes);
            prop_assert_eq!(reader.varint()?, value >> shift);
            prop_assert_eq!(reader.finite()?.to_bits(), number.to_bits());
            let read = reader.text(20)?;
            let printable: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            prop_assert!(read.len() <= 20 && printable.starts_with(&read) && (text.len() > 20 || read == printable));
            prop_assert_eq!(reader.finish(), Ok(()));
        }
    }

    #[test]
    fn integers_above_64_bits_and_numbers_without_value_are_refused() {
        let too_large: [&[u8]; 3] =
            [&[0xff; 11], &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 2], &[0x80]];
        for bytes in too_large {
            assert!(Reader::new(bytes).varint().is_err(), "{bytes:?}");
        }
        assert!(Reader::new(&f64::NAN.to_le_bytes()).finite().is_err());
        assert!(Reader::new(&[200, 1, 0]).block(100).is_err());
        assert!(Reader::new(&[2, 0xc3, 0x28]).text(100).is_err());
        assert!(Reader::new(&[0]).finish().is_err());
    }
}
