//! The room directory: written beside its target, then moved in its place.
//!
//! The exchange is one step where the file system can exchange two names: a reader of the room meanwhile has the old
//! one or the new one. Files of other programs and people in the old one (tracks, notes) are kept.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use image::RgbImage;
use scenes::room::{Room, SCENE_FILE};
use shell::files::sync_folder;

use super::workplace::{self, Workplace};
use crate::{Error, Result};

const REFERENCES: &str = "reference";

/// Quality of the reference images.
const JPEG_QUALITY: u8 = 95;

/// Checks that the target is new, empty, or a room, and returns the room that will be replaced: other directories must
/// not be replaced. The check leaves no files behind.
///
/// # Errors
/// [`Error::File`] when the target cannot be written or replaced without loss: hours of work must not end there.
pub(super) fn check_target(out: &Path) -> Result<Option<Room>> {
    let refuse = |problem: &str| Err(Error::content(out, "--out", problem));
    workplace::clear_up(out);
    if !out.exists() {
        return check_creatable(out).map(|()| None);
    }
    if !out.is_dir() {
        return refuse("is a file; name a directory for the room");
    }
    check_creatable(out)?;
    let whole = out.canonicalize().map_err(Error::io(out))?;
    if std::env::current_dir().is_ok_and(|here| here.starts_with(&whole)) {
        return refuse(
            "is where this program was started, and would be replaced under it; start it from elsewhere or name a new directory",
        );
    }
    if is_mount_point(&whole) {
        return refuse("is a mount point, which cannot be replaced; name a directory in it");
    }
    let mut entries = fs::read_dir(out).map_err(Error::io(out))?;
    if entries.next().is_none() {
        return Ok(None);
    }
    if !out.join(SCENE_FILE).is_file() {
        return refuse("exists, holds other things and is no room; name a new directory");
    }
    // The room's zones are kept; a room whose zones cannot be read must not be lost with them.
    Room::read(out).map(Some).or_else(|e| {
        refuse(&format!("the room that is there cannot be replaced, since it cannot be read ({e}); mend it or name a new directory"))
    })
}

/// Directory of a room that is not to be believed: a sibling of the target, which stays as it is. One that an earlier build
/// made is replaced.
pub(super) fn aside(out: &Path) -> PathBuf {
    let named = |number: usize| {
        let mut name = out.file_name().unwrap_or_default().to_owned();
        name.push(if number == 1 { ".red".to_owned() } else { format!(".red{number}") });
        out.with_file_name(name)
    };
    let is_ours = |dir: &PathBuf| !dir.exists() || check_target(dir).is_ok();
    (1..=999).map(named).find(is_ours).unwrap_or_else(|| named(1))
}

/// Checks that a directory can be made beside the target.
fn check_creatable(out: &Path) -> Result<()> {
    let absolute = std::path::absolute(out).map_err(Error::io(out))?;
    let above = absolute.ancestors().skip(1).find(|folder| folder.exists()).unwrap_or(Path::new("/"));
    tempfile::tempdir_in(above).map(drop).map_err(|source| {
        let problem = format!("no directory can be made in {} ({source})", above.display());
        Error::content(out, "--out", problem)
    })
}

/// Writes the whole room: references, geometry, then the files that `more` adds.
pub(super) fn write(
    out: &Path,
    room: &mut Room,
    references: &[(&str, &RgbImage)],
    more: &mut dyn FnMut(&Path, &Room) -> Result<()>,
) -> Result<()> {
    let out = &std::path::absolute(out).map_err(Error::io(out))?;
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(parent).map_err(Error::io(parent))?;
    let beside = Workplace::new(parent, out)?;
    let fresh = beside.fresh();
    for (camera, (name, image)) in room.cameras.iter_mut().zip(references) {
        let relative = PathBuf::from(REFERENCES).join(format!("{name}.jpg"));
        write_jpeg(&fresh.join(&relative), image)?;
        camera.reference = Some(relative);
    }
    room.write(&fresh)?;
    more(&fresh, room)?;
    if !out.exists() {
        return fs::rename(&fresh, out).and_then(|()| sync_folder(parent)).map_err(Error::io(out));
    }
    let before = exchange(&fresh, out, &beside.before()).map_err(Error::io(out))?;
    sync_folder(parent).map_err(Error::io(parent))?;
    if let Err(source) = workplace::take_over_foreign(&before, out) {
        // The old room stays in place, so that no foreign file is lost.
        let cache = beside.keep();
        let problem = format!("the room is finished, but {source}; the old one is in {}", cache.display());
        return Err(Error::content(out, "files of others", problem));
    }
    Ok(())
}

/// Gives the fresh room the name of the old one; returns the old one's new path.
fn exchange(fresh: &Path, out: &Path, elsewhere: &Path) -> io::Result<PathBuf> {
    #[cfg(target_os = "linux")]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        if renameat_with(CWD, fresh, CWD, out, RenameFlags::EXCHANGE).is_ok() {
            return Ok(fresh.to_owned());
        }
    }
    // Not every file system can exchange names; then there is a moment without a room.
    fs::rename(out, elsewhere)?;
    if let Err(error) = fs::rename(fresh, out) {
        // Best effort: the old room gets its name back.
        let _ = fs::rename(elsewhere, out);
        return Err(error);
    }
    Ok(elsewhere.to_owned())
}

/// Tells whether a directory is on another device than its parent.
#[cfg(unix)]
fn is_mount_point(dir: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let device = |path: &Path| path.metadata().map(|m| m.dev()).ok();
    dir.parent().is_none_or(|above| device(above) != device(dir))
}

#[cfg(not(unix))]
fn is_mount_point(dir: &Path) -> bool {
    dir.parent().is_none()
}

pub(super) fn write_jpeg(path: &Path, image: &RgbImage) -> Result<()> {
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .encode_image(image)
        .map_err(|e| Error::content(path, "image", e.to_string()))?;
    Ok(calib::files::write_atomic(path, &bytes)?)
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
        fs::create_dir(out.join("tracks")).unwrap();
        fs::write(out.join("tracks/tracks.txt"), "an afternoon").unwrap();
        fs::write(out.join("reference/gone.jpg"), "of a camera that is no more").unwrap();

        check_target(&out).unwrap();
        let failed = write(&out, &mut room(), &references, &mut |_, _| Err(Error::Room("no".into())));
        assert!(
            failed.is_err() && out.join("reference/gone.jpg").is_file(),
            "a failed build must leave the room alone"
        );
        write(&out, &mut room(), &references, &mut |_, _| Ok(())).unwrap();
        assert!(out.join("reference/a.jpg").is_file() && !out.join("reference/gone.jpg").exists());
        assert_eq!(fs::read(out.join("tracks/tracks.txt")).unwrap(), b"an afternoon", "not ours to lose");
        let left: Vec<_> = fs::read_dir(out.parent().unwrap()).unwrap().collect();
        assert_eq!(left.len(), 1, "{left:?}");
    }

    #[test]
    fn a_fresh_room_takes_the_name_of_the_old_one_or_leaves_it() {
        let folder = tempfile::tempdir().unwrap();
        let dir = |name: &str| {
            let dir = folder.path().join(name);
            fs::create_dir(&dir).unwrap();
            fs::write(dir.join("mark"), name).unwrap();
            dir
        };
        let (fresh, out) = (dir("fresh"), dir("out"));
        let before = exchange(&fresh, &out, &folder.path().join("elsewhere")).unwrap();
        assert_eq!(fs::read(out.join("mark")).unwrap(), b"fresh");
        assert_eq!(fs::read(before.join("mark")).unwrap(), b"out");
        // Without a fresh room the old one stays.
        let gone = exchange(&folder.path().join("nothing"), &out, &folder.path().join("elsewhere"));
        assert!(gone.is_err());
        assert_eq!(fs::read(out.join("mark")).unwrap(), b"fresh");
    }

    #[test]
    fn a_room_that_is_not_believed_gets_a_name_beside_the_target_and_replaces_nothing_but_its_like() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("room");
        let image = RgbImage::new(32, 24);
        let write_aside = || {
            let dir = aside(&out);
            write(&dir, &mut room(), &[("a", &image)], &mut |_, _| Ok(())).unwrap();
            dir.file_name().unwrap().to_owned()
        };
        assert_eq!(write_aside(), "room.red");
        assert_eq!(write_aside(), "room.red");
        fs::remove_file(folder.path().join("room.red/scene.toml")).unwrap();
        assert_eq!(write_aside(), "room.red2");
        assert!(folder.path().join("room.red/reference/a.jpg").is_file() && !out.exists());
    }

    #[test]
    fn targets_that_cannot_be_replaced_are_refused_beforehand() {
        // Tests run in their crate's folder.
        let said = check_target(Path::new(".")).unwrap_err().to_string();
        assert!(said.contains("started"), "{said}");
        if Path::new("/proc/self").is_dir() {
            assert!(is_mount_point(Path::new("/proc")) && !is_mount_point(Path::new("/proc/self")));
        }
    }

    #[test]
    fn other_peoples_directories_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        check_target(folder.path()).unwrap();
        let file = folder.path().join("thesis.txt");
        fs::write(&file, "years of work").unwrap();
        assert!(check_target(folder.path()).unwrap_err().to_string().contains("no room"));
        assert!(check_target(&file).unwrap_err().to_string().contains("is a file"));
    }
}
