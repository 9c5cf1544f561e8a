//! A detector's boxes within a seen message.

use std::sync::Arc;

use super::bytes::{Decoded, Malformed, Reader, put_f64, put_varint};
use crate::observation::PersonBox;

/// Largest number of boxes of one frame.
const MOST_BOXES: u32 = 1024;
/// Largest length of an appearance vector.
const LONGEST_VECTOR: u32 = 4096;
/// Largest number of bytes of all boxes of one frame.
pub(super) const LONGEST_BOXES: usize = 4 << 20;
/// Bit of the byte of flags that says that an appearance vector follows; the lower four are the cut edges.
const WITH_VECTOR: u8 = 16;

/// Appends the boxes of a frame.
pub(super) fn put_boxes(out: &mut Vec<u8>, boxes: &[PersonBox]) -> Decoded<()> {
    if boxes.len() > MOST_BOXES as usize {
        return Err(Malformed("an observation has more than 1024 boxes"));
    }
    let start = out.len();
    put_varint(out, boxes.len() as u64);
    for PersonBox { left, top, right, bottom, cut, appearance } in boxes {
        let edges = [left, top, right, bottom];
        if edges.iter().any(|edge| !edge.is_finite()) {
            return Err(Malformed("a box's edge is not finite"));
        }
        for edge in edges {
            put_f64(out, *edge);
        }
        let cuts = cut.iter().enumerate().fold(0, |bits, (edge, is_cut)| bits | u8::from(*is_cut) << edge);
        out.push(cuts | if appearance.is_some() { WITH_VECTOR } else { 0 });
        if let Some(vector) = appearance {
            if vector.len() > LONGEST_VECTOR as usize || vector.iter().any(|value| !value.is_finite()) {
                return Err(Malformed("an appearance vector is not finite, or has more than 4096 values"));
            }
            put_varint(out, vector.len() as u64);
            vector.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
        }
    }
    if out.len() - start > LONGEST_BOXES {
        return Err(Malformed("an observation's boxes have more than 4 MiB"));
    }
    Ok(())
}

/// Reads the boxes of a frame.
pub(super) fn boxes(reader: &mut Reader<'_>) -> Decoded<Vec<PersonBox>> {
    let count = reader.size(MOST_BOXES)?;
    (0..count).map(|_| person_box(reader)).collect()
}

fn person_box(reader: &mut Reader<'_>) -> Decoded<PersonBox> {
    let [left, top, right, bottom] = [reader.finite()?, reader.finite()?, reader.finite()?, reader.finite()?];
    let flags = reader.byte()?;
    if flags >= 2 * WITH_VECTOR {
        return Err(Malformed("a box has an unknown flag"));
    }
    let appearance = if flags & WITH_VECTOR == 0 { None } else { Some(vector(reader)?) };
    Ok(PersonBox {
        left,
        top,
        right,
        bottom,
        cut: [0, 1, 2, 3].map(|edge| flags >> edge & 1 == 1),
        appearance,
    })
}

fn vector(reader: &mut Reader<'_>) -> Decoded<Arc<[f32]>> {
    let length = reader.size(LONGEST_VECTOR)?;
    let mut value = || -> Decoded<f32> {
        let value = f32::from_le_bytes(reader.array()?);
        if value.is_finite() { Ok(value) } else { Err(Malformed("an appearance value is not finite")) }
    };
    (0..length).map(|_| value()).collect()
}
