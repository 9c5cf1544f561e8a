//! Check for truncated files: shorter than the sizes in their own container say, as after an interrupted copy.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// Element ids of Matroska's header and segment, RFC 9559 and RFC 8794.
const EBML_HEADER: [u8; 4] = [0x1a, 0x45, 0xdf, 0xa3];
const EBML_SEGMENT: [u8; 4] = [0x18, 0x53, 0x80, 0x67];
/// Boxes of ISO 14496-12 that a film needs; anything else at the end of a file was appended by another program.
const FILM_BOXES: [&[u8; 4]; 3] = [b"moov", b"moof", b"mdat"];

/// Tag types of FLV: audio, video and script.
const FLV_TAGS: [u8; 3] = [8, 9, 18];

/// Whether the sizes in a container say that the file should be longer than it is; `format` is FFmpeg's name. `false`
/// for formats that do not state their length.
pub(super) fn is_cut_off(path: &Path, format: &str) -> io::Result<bool> {
    let walk = match format.split(',').next() {
        Some("mov") => boxes_end,
        Some("matroska") => segment_end,
        Some("avi") => riff_end,
        Some("flv") => tags_end,
        _ => return Ok(false),
    };
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let end = match walk(&mut file, length) {
        // A size field that is itself truncated states no length.
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(false),
        end => end?,
    };
    Ok(end > length)
}

/// End of an MP4 or MOV file by its boxes, bytes: they stand side by side, each with its size and name in front.
fn boxes_end(file: &mut File, length: u64) -> io::Result<u64> {
    let mut at = 0;
    while at + 8 <= length {
        let [header @ .., n, a, m, e] = bytes_at::<8>(file, at)?;
        let size = match u32::from_be_bytes(header) {
            // A size of 0: the box reaches to the end of the file.
            0 => return Ok(length),
            1 => u64::from_be_bytes(bytes_at(file, at + 8)?),
            size => u64::from(size),
        };
        let end = at.saturating_add(size);
        if size < 8 || end > length {
            return Ok(if FILM_BOXES.contains(&&[n, a, m, e]) { end } else { length });
        }
        at = end;
    }
    Ok(at)
}

/// End of an AVI file by its RIFF chunks, bytes; a long film has more than one.
fn riff_end(file: &mut File, length: u64) -> io::Result<u64> {
    let mut at = 0;
    while at + 8 <= length {
        let [name @ .., a, b, c, d] = bytes_at::<8>(file, at)?;
        let size = u32::from_le_bytes([a, b, c, d]);
        // A recorder that was switched off has not written the size.
        if &name != b"RIFF" || size == 0 || size == u32::MAX {
            return Ok(length);
        }
        let end = at + 8 + u64::from(size);
        if end > length {
            return Ok(end);
        }
        // Chunks begin at even places.
        at = end.next_multiple_of(2);
    }
    Ok(at.min(length))
}

/// End of an FLV file by its tags, bytes: a header that states its own length, then tags, each with its size before
/// and after it.
fn tags_end(file: &mut File, length: u64) -> io::Result<u64> {
    let mut file = BufReader::new(file);
    let mut at = u64::from(u32::from_be_bytes(bytes_at(&mut file, 5)?)) + 4;
    while at < length {
        let Ok([kind, size @ ..]) = bytes_at::<4>(&mut file, at) else { return Ok(length + 1) };
        if !FLV_TAGS.contains(&(kind & 0x1f)) {
            return Ok(length);
        }
        let end = at + 11 + u64::from(u32::from_be_bytes([0, size[0], size[1], size[2]]));
        if end > length {
            return Ok(end);
        }
        at = end + 4;
    }
    Ok(length)
}

/// End of a Matroska or `WebM` file, bytes: a header, then one segment with everything else.
fn segment_end(file: &mut File, length: u64) -> io::Result<u64> {
    let mut at = 0;
    for name in [EBML_HEADER, EBML_SEGMENT] {
        if bytes_at::<4>(file, at)? != name {
            return Ok(length);
        }
        let (bytes, size) = element_size(file, at + 4)?;
        let Some(size) = size else { return Ok(length) };
        at = (at + 4 + bytes).saturating_add(size);
    }
    Ok(at)
}

/// Length of an element's size field, bytes, and the size that the field states; `None` where the size is unknown.
fn element_size(file: &mut File, at: u64) -> io::Result<(u64, Option<u64>)> {
    let [first] = bytes_at(file, at)?;
    let more = first.leading_zeros();
    if more > 7 {
        return Ok((1, None));
    }
    let mut size = u64::from(first) & (0x7f >> more);
    let mut unknown = 0x7f >> more;
    for place in 1..=u64::from(more) {
        let [byte] = bytes_at(file, at + place)?;
        size = (size << 8) | u64::from(byte);
        unknown = (unknown << 8) | 0xff;
    }
    Ok((u64::from(more) + 1, Some(size).filter(|size| *size != unknown)))
}

fn bytes_at<const N: usize>(file: &mut (impl Read + Seek), at: u64) -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a file of these bytes, and the same file without its last byte, is cut off.
    fn is_cut_off(format: &str, bytes: &[u8]) -> [bool; 2] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film");
        [bytes, &bytes[..bytes.len() - 1]].map(|bytes| {
            std::fs::write(&path, bytes).unwrap();
            super::is_cut_off(&path, format).unwrap()
        })
    }

    #[test]
    fn boxes_end_where_the_file_does() {
        let film = [b"\0\0\0\x0cftypisom".as_slice(), b"\0\0\0\x0amdat\x01\x02"].concat();
        assert_eq!(is_cut_off("mov,mp4", &film), [false, true]);
        let long = [b"\0\0\0\x08moov".as_slice(), b"\0\0\0\x01mdat\0\0\0\0\0\0\0\x12ab"].concat();
        assert_eq!(is_cut_off("mov,mp4", &long), [false, true]);
        // A box of size 0 reaches to the end of the file, wherever that is.
        assert_eq!(is_cut_off("mov,mp4", b"\0\0\0\x08moov\0\0\0\0mdatabc"), [false, false]);
        // Bytes appended after the film by another program.
        assert_eq!(is_cut_off("mov,mp4", &[&film, b"a note of many words".as_slice()].concat()), [false; 2]);
        assert_eq!(is_cut_off("mpegts", &film), [false, false]);
    }

    #[test]
    fn riff_chunks_end_where_the_file_does() {
        let film = b"RIFF\x05\0\0\0AVI x\0RIFF\x04\0\0\0AVIX";
        assert_eq!(is_cut_off("avi", film), [false, true]);
        assert_eq!(is_cut_off("avi", b"RIFF\0\0\0\0AVI LIST"), [false, false]);
    }

    #[test]
    fn tags_end_where_the_file_does() {
        let tag = |kind: u8| [kind, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 0, 0, 0, 14];
        let film = [b"FLV\x01\x01\0\0\0\x09\0\0\0\0".as_slice(), &tag(18), &tag(9)].concat();
        // The repeated size after the last tag is not needed.
        assert_eq!(is_cut_off("flv", &film), [false, false]);
        let film = &film[..film.len() - 4];
        assert_eq!(is_cut_off("flv", film), [false, true]);
        assert_eq!(is_cut_off("flv", &film[..film.len() - 12]), [true, true]);
        assert_eq!(is_cut_off("flv", &[film, &[0; 40]].concat()), [false, false]);
    }

    #[test]
    fn segments_end_where_the_file_does() {
        let film =
            |size: &[u8]| [EBML_HEADER.as_slice(), b"\x82ab", &EBML_SEGMENT, size, b"cluster"].concat();
        assert_eq!(is_cut_off("matroska,webm", &film(b"\x87")), [false, true]);
        assert_eq!(is_cut_off("matroska,webm", &film(b"\x01\0\0\0\0\0\0\x07")), [false, true]);
        // The length of a stream is not known in advance.
        assert_eq!(is_cut_off("matroska,webm", &film(b"\xff")), [false, false]);
        assert_eq!(is_cut_off("matroska,webm", &film(b"\x01\xff\xff\xff\xff\xff\xff\xff")), [false, false]);
    }
}
