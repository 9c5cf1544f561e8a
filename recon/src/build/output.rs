//! The room directory: made beside its target, then put in its place.

use std::path::{Path, PathBuf};

use image::RgbImage;
use scenes::room::{Room, SCENE_FILE};

use crate::{Error, Result};

/// Quality of the reference images.
const JPEG_QUALITY: u8 = 95;

/// The room that will be replaced, if there is one. A target must be new, empty, or a room: anything else is not ours
/// to replace. Nothing is left behind by asking.
///
/// # Errors
/// [`Error::Content`] when the target cannot be written or replaced without loss: hours of work must not end there.
pub(super) fn check_target(out: &Path) -> Result<Option<Room>> {
    let refuse = |problem: &str| Err(Error::content(out, "--out", problem));
    if !out.exists() {
        return check_creatable(out).map(|()| None);
    }
    if !out.is_dir() {
        return refuse("is a file; name a directory for the room");
    }
    check_creatable(out)?;
    let mut entries = std::fs::read_dir(out).map_err(|source| Error::Io { path: out.to_owned(), source })?;
    if entries.next().is_none() {
        return Ok(None);
    }
    if !out.join(SCENE_FILE).is_file() {
        return refuse("exists, holds other things and is no room; name a new directory");
    }
    // Its zones are kept; a room that does not tell them must not be lost with them.
    Room::read(out).map(Some).or_else(|e| {
        refuse(&format!("the room that is there cannot be replaced, since it cannot be read ({e}); mend it or name a new directory"))
    })
}

/// Whether a directory can be made beside the target.
fn check_creatable(out: &Path) -> Result<()> {
    let absolute = std::path::absolute(out).map_err(|source| Error::Io { path: out.to_owned(), source })?;
    let above = absolute.ancestors().skip(1).find(|folder| folder.exists()).unwrap_or(Path::new("/"));
    tempfile::tempdir_in(above).map(drop).map_err(|source| {
        let problem = format!("no directory can be made in {} ({source})", above.display());
        Error::content(out, "--out", problem)
    })
}

/// Writes the room whole: references, geometry, then whatever `more` adds.
pub(super) fn write(
    out: &Path,
    room: &mut Room,
    references: &[(&str, &RgbImage)],
    more: &mut dyn FnMut(&Path, &Room) -> Result<()>,
) -> Result<()> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::Io { path, source }
    };
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(parent).map_err(io(parent))?;
    let beside = tempfile::Builder::new().prefix(".recon-").tempdir_in(parent).map_err(io(parent))?;
    let fresh = beside.path().join("room");
    std::fs::create_dir(&fresh).map_err(io(&fresh))?;
    for (camera, (name, image)) in room.cameras.iter_mut().zip(references) {
        let relative = PathBuf::from("reference").join(format!("{name}.jpg"));
        write_jpeg(&fresh.join(&relative), image)?;
        camera.reference = Some(relative);
    }
    room.write(&fresh)?;
    more(&fresh, room)?;
    let replaced = beside.path().join("before");
    if out.exists() {
        std::fs::rename(out, &replaced).map_err(io(out))?;
    }
    if let Err(source) = std::fs::rename(&fresh, out) {
        // Best effort: the old room comes back under its name.
        let _ = std::fs::rename(&replaced, out);
        return Err(Error::Io { path: out.to_owned(), source });
    }
    Ok(())
}

fn write_jpeg(path: &Path, image: &RgbImage) -> Result<()> {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .encode_image(image)
        .map_err(|e| Error::content(path, "image", e.to_string()))?;
    Ok(calib::files::write_atomic(path, &bytes)?)
}

/// A picture as PNG.
pub(super) fn write_png(path: &Path, image: &RgbImage) -> Result<()> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|e| Error::content(path, "image", e.to_string()))?;
    Ok(calib::files::write_atomic(path, bytes.get_ref())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::{Camera, Intrinsics};
    use nalgebra::Isometry3;
    use scenes::room::RoomCamera;

    fn room() -> Room {
        let camera = Camera {
            intrinsics: Intrinsics::from_horizontal_fov(32, 24, 60.0),
            camera_from_world: Isometry3::translation(0.0, 0.0, 2.0),
        };
        let camera = RoomCamera { name: "a".into(), camera, reference: None };
        Room { cameras: vec![camera], ..Room::default() }
    }

    #[test]
    fn a_room_replaces_a_room_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("deep/room");
        let image = RgbImage::new(32, 24);
        let references = [("a", &image)];
        check_target(&out).unwrap();
        write(&out, &mut room(), &references, &mut |_, _| Ok(())).unwrap();
        assert!(out.join("reference/a.jpg").is_file());
        assert_eq!(Room::read(&out).unwrap().cameras[0].reference, Some("reference/a.jpg".into()));
        std::fs::write(out.join("old.txt"), "from before").unwrap();

        check_target(&out).unwrap();
        let failed = write(&out, &mut room(), &references, &mut |_, _| Err(Error::Room("no".into())));
        assert!(failed.is_err() && out.join("old.txt").is_file(), "a failed build must leave the room alone");
        write(&out, &mut room(), &references, &mut |_, _| Ok(())).unwrap();
        assert!(!out.join("old.txt").exists());
        let left: Vec<_> = std::fs::read_dir(out.parent().unwrap()).unwrap().collect();
        assert_eq!(left.len(), 1, "{left:?}");
    }

    #[test]
    fn other_peoples_directories_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        check_target(folder.path()).unwrap();
        let file = folder.path().join("thesis.txt");
        std::fs::write(&file, "years of work").unwrap();
        assert!(check_target(folder.path()).unwrap_err().to_string().contains("no room"));
        assert!(check_target(&file).unwrap_err().to_string().contains("is a file"));
    }
}
