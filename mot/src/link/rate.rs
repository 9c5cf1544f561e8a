//! Frame rate of a recording, from the file beside it.

use std::path::Path;

use shell::ranges::RATE_HZ;

use crate::{Error, Result};

/// File name of MOTChallenge's description of a sequence.
const INFO: &str = "seqinfo.ini";

/// `frameRate` of the `seqinfo.ini` in a file's folder or the one above (`SEQUENCE/det/det.txt`), if there is one.
///
/// # Errors
/// A rate that is no positive number.
pub fn beside(file: &Path) -> Result<Option<f64>> {
    let folders = file.ancestors().skip(1).take(2);
    let Some(path) = folders.map(|folder| folder.join(INFO)).find(|path| path.is_file()) else {
        return Ok(None);
    };
    for (index, line) in calib::files::read_text(&path)?.lines().enumerate() {
        let Some((key, value)) = line.split_once('=').filter(|(key, _)| key.trim() == "frameRate") else {
            continue;
        };
        let rate = value.trim().parse().ok().filter(|rate| RATE_HZ.contains(*rate));
        return rate.map(Some).ok_or_else(|| {
            let problem = format!("{} is `{}`; write {RATE_HZ}", key.trim(), value.trim());
            Error::content(&path, format!("line {}", index + 1), problem)
        });
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_lies_beside_the_file_or_above_it() {
        let folder = tempfile::tempdir().unwrap();
        let (own, below) = (folder.path().join("detections.txt"), folder.path().join("det/det.txt"));
        assert_eq!(beside(&own).unwrap(), None);
        let write = |text: &str| std::fs::write(folder.path().join(INFO), text).unwrap();
        write("[Sequence]\nname=here\nframeRate=12.5\nseqLength=3\n");
        assert_eq!((beside(&own).unwrap(), beside(&below).unwrap()), (Some(12.5), Some(12.5)));
        write("[Sequence]\n");
        assert_eq!(beside(&own).unwrap(), None);
        for bad in ["0", "-3", "fast", "inf"] {
            write(&format!("\nframeRate={bad}\n"));
            let error = beside(&own).unwrap_err().to_string();
            assert!(error.contains(INFO) && error.contains("line 2"), "{error}");
        }
    }
}
