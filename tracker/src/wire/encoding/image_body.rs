//! The part of a message that holds a mask and its colours, and the filmed picture.

use std::io::Cursor;

use image::codecs::jpeg::JpegEncoder;
use image::{ImageFormat, ImageReader, RgbImage};

use super::bytes::{Decoded, Malformed, Reader, put_block, put_varint};
use super::outline::OutlineModel;
use super::range_coder::{Coder, Decoder, Encoder};
use super::samples::SampleModel;
use super::{LARGEST_SIDE, Limits};
use crate::observation::{Colours, Mask};

/// Quality of the filmed pictures' JPEG, 1 to 100.
const JPEG_QUALITY: u8 = 85;
/// The largest width and height of a filmed picture.
const LARGEST_PICTURE_SIDE: u32 = 4096;

/// Codes of the forms of the mask and its colours.
const PACKED: u8 = 0;
const CODED: u8 = 1;

/// Number of bytes of a mask with `samples` samples in the packed form.
pub(super) fn packed_bytes(width: u32, height: u32, samples: usize) -> usize {
    width.div_ceil(8) as usize * height as usize + 2 * samples
}

/// Appends a mask and its colours in the shorter form.
pub(super) fn put_mask(out: &mut Vec<u8>, mask: &Mask, colours: Option<&Colours>) -> Decoded<()> {
    let (width, height) = mask.dimensions();
    if width.max(height) > LARGEST_SIDE {
        return Err(Malformed("a mask is wider or higher than 16,384 pixels"));
    }
    put_varint(out, width.into());
    put_varint(out, height.into());
    let cells = colours.map(|colours| Colours::sampled_cells(mask, colours.step()));
    let samples = colours.map_or(&[][..], Colours::samples);
    if cells.as_ref().map_or(0, Mask::count) != samples.len() as u64 {
        return Err(Malformed("an observation's colours belong to another mask"));
    }
    if let Some(colours) = colours {
        out.push(colours.step());
    }
    let mut encoder = Encoder::new();
    code(&mut encoder, mask, |_| cells, samples)?;
    let coded = encoder.finish();
    if coded.len() < packed_bytes(width, height, samples.len()) {
        out.push(CODED);
        put_block(out, &coded);
    } else {
        out.push(PACKED);
        put_block(out, &packed(mask, samples));
    }
    Ok(())
}

/// Reads a mask and its colours.
pub(super) fn mask(
    reader: &mut Reader<'_>,
    limits: Limits,
    has_colours: bool,
) -> Decoded<(Mask, Option<Colours>)> {
    let (width, height) = (reader.size(LARGEST_SIDE)?, reader.size(LARGEST_SIDE)?);
    if (width, height) != (limits.width, limits.height) {
        return Err(Malformed("a mask does not have the working size"));
    }
    let step = if has_colours { Some(reader.byte()?) } else { None };
    if step == Some(0) {
        return Err(Malformed("the colours' step is 0"));
    }
    let cells_of = |mask: &Mask| step.map(|step| Colours::sampled_cells(mask, step));
    let form = reader.byte()?;
    let most_samples = if has_colours { width as usize * height as usize } else { 0 };
    let body = reader.block(packed_bytes(width, height, most_samples))?;
    let (mask, samples) = match form {
        PACKED => {
            let (rows, rest) = body
                .split_at_checked(packed_bytes(width, height, 0))
                .ok_or(Malformed("the packed picture is cut off"))?;
            let mask = unpacked(width, height, rows)?;
            if rest.len() as u64 != 2 * cells_of(&mask).map_or(0, |cells| cells.count()) {
                return Err(Malformed("the colours' number is not the mask's"));
            }
            (mask, rest.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect())
        }
        CODED => {
            let mut decoder = Decoder::new(body)?;
            let empty = Mask::new(width, height);
            let coded = code(&mut decoder, &empty, cells_of, &[])?;
            decoder.finish()?;
            coded
        }
        _ => return Err(Malformed("the mask's form is unknown")),
    };
    let colours = match step {
        None => None,
        Some(step) => Some(
            Colours::from_samples(&mask, step, samples)
                .ok_or(Malformed("the colours' number is not the mask's"))?,
        ),
    };
    Ok((mask, colours))
}

/// Codes a mask and, if it has cells with colours, their samples.
fn code(
    coder: &mut impl Coder,
    mask: &Mask,
    cells_of: impl FnOnce(&Mask) -> Option<Mask>,
    samples: &[u16],
) -> Decoded<(Mask, Vec<u16>)> {
    let mask = OutlineModel::default().code(coder, mask)?;
    let samples = match cells_of(&mask) {
        Some(cells) => SampleModel::default().code(coder, &cells, samples)?,
        None => Vec::new(),
    };
    Ok((mask, samples))
}

fn packed(mask: &Mask, samples: &[u16]) -> Vec<u8> {
    let row_bytes = mask.width().div_ceil(8) as usize;
    let row = |y| mask.row(y).iter().flat_map(|word| word.to_le_bytes()).take(row_bytes);
    let rows = (0..mask.height()).flat_map(row);
    rows.chain(samples.iter().flat_map(|sample| sample.to_le_bytes())).collect()
}

fn unpacked(width: u32, height: u32, rows: &[u8]) -> Decoded<Mask> {
    let row_bytes = width.div_ceil(8) as usize;
    let beyond = if width.is_multiple_of(8) { 0 } else { u8::MAX << (width % 8) };
    if row_bytes > 0 && rows.chunks_exact(row_bytes).any(|row| row[row_bytes - 1] & beyond != 0) {
        return Err(Malformed("the packed mask has foreground beyond its width"));
    }
    Ok(Mask::from_fn(width, height, |x, y| rows[y as usize * row_bytes + x as usize / 8] >> (x % 8) & 1 == 1))
}

/// A filmed picture as a JPEG file.
pub(super) fn jpeg(picture: &RgbImage) -> Decoded<Vec<u8>> {
    if picture.width().max(picture.height()) > LARGEST_PICTURE_SIDE {
        return Err(Malformed("a picture is wider or higher than 4096 pixels"));
    }
    let mut jpeg = Vec::new();
    let written = picture.write_with_encoder(JpegEncoder::new_with_quality(&mut jpeg, JPEG_QUALITY));
    written.map_err(|_| Malformed("a picture cannot be written as JPEG"))?;
    Ok(jpeg)
}

/// The picture of a JPEG file.
pub(super) fn picture(jpeg: &[u8]) -> Decoded<RgbImage> {
    let mut reader = ImageReader::with_format(Cursor::new(jpeg), ImageFormat::Jpeg);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(LARGEST_PICTURE_SIDE);
    limits.max_image_height = Some(LARGEST_PICTURE_SIDE);
    limits.max_alloc = Some(8 * u64::from(LARGEST_PICTURE_SIDE).pow(2));
    reader.limits(limits);
    let picture = reader.decode().map_err(|_| Malformed("a picture is not a JPEG within its limits"))?;
    Ok(picture.into_rgb8())
}
