//! Complete and truncated files.

use std::path::{Path, PathBuf};

use ffmpeg::Rational;
use ffmpeg::codec::Id;

use super::films::{EncodedTrack, mux, noise, noisy_film};
use crate::video::FrameSource;

/// Number of frames that can be read from a file, and the error at its end if it is not complete.
fn frames(path: &Path) -> (usize, Option<String>) {
    let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
    let said = source.read_all().err().map(|error| error.to_string());
    (source.delivered(), said)
}

/// Writes films of 60 frames, of which six are lost in the middle, one in each container.
fn lossy_films(folder: &Path) -> Vec<PathBuf> {
    let shown: Vec<_> =
        (0..60).filter(|k| !(30..36).contains(k)).map(|k| (k, noise(64, 48, k as u32))).collect();
    [
        ("film.mp4", Id::H264, "faststart"),
        ("fragments.mp4", Id::H264, "frag_keyframe+empty_moov+default_base_moof"),
        ("film.mkv", Id::H264, ""),
        ("film.flv", Id::H264, ""),
        ("film.avi", Id::MJPEG, ""),
    ]
    .map(|(name, codec, flags)| {
        let path = folder.join(name);
        let options = [("movflags", flags)];
        let options = if flags.is_empty() { &options[..0] } else { &options };
        mux(&path, &[EncodedTrack::new(codec, &[], Rational(1, 10), &shown)], options);
        path
    })
    .into()
}

#[test]
fn a_cut_is_told_at_the_frame_where_it_is_and_lost_frames_are_not() {
    let folder = tempfile::tempdir().unwrap();
    for path in lossy_films(folder.path()) {
        assert_eq!(frames(&path), (54, None), "{}", path.display());
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() * 6 / 10]).unwrap();
        let (delivered, said) = frames(&path);
        let said = said.unwrap_or_else(|| panic!("{}: {delivered} frames", path.display()));
        assert!((20..40).contains(&delivered), "{said}");
        let place = format!("{}: frame {}: the file ends here", path.display(), delivered + 1);
        assert!(said.starts_with(&place) && said.ends_with("copy it again"), "{said}");
    }
}

#[test]
fn a_transport_stream_may_end_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.ts");
    let shown: Vec<_> = (0..60).filter(|k| k % 7 != 3).map(|k| (k, noise(64, 48, k as u32))).collect();
    mux(&path, &[EncodedTrack::new(Id::H264, &[], Rational(1, 10), &shown)], &[]);
    assert_eq!(frames(&path), (shown.len(), None));
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() * 6 / 10]).unwrap();
    let (delivered, said) = frames(&path);
    assert!((25..45).contains(&delivered) && said.is_none(), "{delivered} {said:?}");
}

#[test]
fn an_end_without_pictures_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    noisy_film(&path, 64, 48, 60);
    // State of a file after an interrupted download for which the space had been reserved.
    let mut film = std::fs::read(&path).unwrap();
    let kept = film.len() / 2;
    film[kept..].fill(0);
    std::fs::write(&path, film).unwrap();
    let (delivered, said) = frames(&path);
    let said = said.unwrap();
    assert!((20..40).contains(&delivered), "{delivered}");
    let place = format!("frame {}: the rest of the file cannot be decoded", delivered + 1);
    assert!(said.contains(&place), "{said}");
}

#[test]
fn frames_behind_the_end_of_an_edit_list_are_not_missed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    let shown: Vec<_> = (0..60).map(|k| (k, noise(64, 48, k as u32))).collect();
    mux(&path, &[EncodedTrack::new(Id::H264, &[], Rational(1, 10), &shown)], &[("movflags", "faststart")]);
    // Trim as by telephones: the edit list (ISO 14496-12, `elst`) shows half of the film.
    let mut film = std::fs::read(&path).unwrap();
    let list = film.windows(4).position(|name| name == b"elst").unwrap();
    let lasts = film[list + 12..list + 16].as_chunks::<4>().0[0];
    film[list + 12..list + 16].copy_from_slice(&(u32::from_be_bytes(lasts) / 2).to_be_bytes());
    std::fs::write(&path, film).unwrap();
    let (delivered, said) = frames(&path);
    assert!((29..=31).contains(&delivered) && said.is_none(), "{delivered} {said:?}");
}
