//! Files of computed results beside the room, in a folder that may be deleted at any time.
//!
//! A file is `b"roomtrack cache 1\n"`, the key (a BLAKE3 hash of everything that the content was made from), the
//! content, and the BLAKE3 hash of all before. A file that is damaged, or of another key, counts as missing; a folder
//! that cannot be written costs the time of computing the results again, and a warning.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Name of the cache folder in the room directory.
const FOLDER: &str = "cache";
const MAGIC: &[u8] = b"roomtrack cache 1\n";
const HASH_BYTES: usize = blake3::OUT_LEN;

/// Path of the cache file of this name.
pub fn file_of(room_dir: &Path, name: &str) -> PathBuf {
    room_dir.join(FOLDER).join(format!("{name}.bin"))
}

/// Reads the content cached under a name; `None` if it is missing, damaged or of another key.
pub fn read(room_dir: &Path, name: &str, key: &blake3::Hash) -> Option<Vec<u8>> {
    let bytes = std::fs::read(file_of(room_dir, name)).ok()?;
    let (all, hash) = bytes.split_last_chunk::<HASH_BYTES>()?;
    let content = all.strip_prefix(MAGIC)?.strip_prefix(key.as_bytes().as_slice())?;
    (blake3::hash(all) == *hash).then(|| content.to_vec())
}

/// Caches a content under a name, in place of an earlier one; if that fails, a warning is logged.
pub fn write(room_dir: &Path, name: &str, key: &blake3::Hash, content: &[u8]) {
    let mut bytes = Vec::with_capacity(MAGIC.len() + 2 * HASH_BYTES + content.len());
    bytes.extend(MAGIC);
    bytes.extend(key.as_bytes());
    bytes.extend(content);
    let hash = blake3::hash(&bytes);
    bytes.extend(hash.as_bytes());
    if let Err(e) = calib::files::write_atomic(&file_of(room_dir, name), &bytes) {
        static WARNED: AtomicBool = AtomicBool::new(false);
        if let Some(warning) = first_warning(&WARNED, room_dir, &e) {
            tracing::warn!("{warning}");
        }
    }
}

/// The warning about a folder that cannot be written; `None` after the first, since the reason is the same for every
/// file.
fn first_warning(warned: &AtomicBool, room_dir: &Path, why: &calib::Error) -> Option<String> {
    let room = room_dir.display();
    (!warned.swap(true, Ordering::Relaxed)).then(|| {
        format!("{room}: nothing is kept for the next run, which works it out again and takes longer: {why}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_content_of_the_right_key_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let (dir, key) = (folder.path(), blake3::hash(b"made from this"));
        assert_eq!(read(dir, "map", &key), None);
        for content in [&b""[..], b"0123456789"] {
            write(dir, "map", &key, content);
            assert_eq!(read(dir, "map", &key).unwrap(), content);
        }
        assert_eq!(read(dir, "map", &blake3::hash(b"made from that")), None);
        assert_eq!(read(dir, "other", &key), None);

        let whole = std::fs::read(file_of(dir, "map")).unwrap();
        for length in 0..whole.len() {
            std::fs::write(file_of(dir, "map"), &whole[..length]).unwrap();
            assert_eq!(read(dir, "map", &key), None, "cut to {length}");
        }
        for place in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[place] ^= 4;
            std::fs::write(file_of(dir, "map"), &bytes).unwrap();
            assert_eq!(read(dir, "map", &key), None, "changed at {place}");
        }
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_no_failure() {
        let folder = tempfile::tempdir().unwrap();
        // A file takes the folder's place: it stops even root, who may write everywhere.
        std::fs::write(folder.path().join(FOLDER), "in the way").unwrap();
        let key = blake3::hash(b"");
        write(folder.path(), "map", &key, b"content");
        assert_eq!(read(folder.path(), "map", &key), None);
    }

    #[test]
    fn the_first_failure_is_told_with_its_reason() {
        let (warned, dir) = (AtomicBool::new(false), Path::new("myroom"));
        let why = calib::Error::Invalid("the disk is full".into());
        let said = first_warning(&warned, dir, &why).unwrap();
        assert!(said.contains("myroom") && said.contains("takes longer") && said.contains("disk is full"));
        assert_eq!(first_warning(&warned, dir, &why), None);
    }
}
