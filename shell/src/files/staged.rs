//! Replacement of a file in one step.

use std::ffi::OsString;
use std::fs::{File, Metadata, Permissions};
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

/// End of the names of files that are being written.
const ENDING: &str = ".writing";
/// Permissions of a new result, of which the process's mask takes some away.
const MODE: u32 = 0o644;
/// Longest name, bytes, to which an ending is added.
const LONGEST_NAME: usize = 200;

/// A file that is written beside its place, and takes its name in one step once all of it is on the disk.
///
/// A reader, a full disk, a killed program and a loss of power see the old content or the new one, never a part. The
/// name of a link stays a link: the file that it leads to is replaced. The new file has the old one's permissions and,
/// where the system allows it, its owner. A device or a pipe is written to directly, since it cannot be replaced.
///
/// Dropped without [`finish`](Self::finish), it leaves nothing behind. What a killed program leaves, `.NAME.writing`, is
/// replaced by the next one that writes the file.
#[derive(Debug)]
pub struct StagedFile {
    /// Path with all links resolved.
    target: PathBuf,
    /// Place of the file until it takes its name; `None` for a device. It is removed before the file is unlocked.
    beside: Option<Beside>,
    file: File,
}

#[derive(Debug)]
struct Beside {
    path: PathBuf,
    /// The file that is replaced.
    before: Option<Metadata>,
    /// Whether the file has taken its name: the path may then be another program's.
    is_named: bool,
}

impl Drop for Beside {
    fn drop(&mut self) {
        if !self.is_named {
            // A file that cannot be removed is replaced by the next program.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

impl StagedFile {
    /// Begins a file. Folders above it are made.
    ///
    /// # Errors
    /// An error of the operating system; [`ErrorKind::IsADirectory`] where a folder stands in the file's place.
    pub fn create(path: &Path) -> io::Result<Self> {
        let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let before = target.metadata().ok();
        match before {
            Some(folder) if folder.is_dir() => Err(ErrorKind::IsADirectory.into()),
            Some(other) if !other.is_file() => {
                let file = File::options().write(true).open(&target)?;
                Ok(Self { target, file, beside: None })
            }
            before => {
                std::fs::create_dir_all(folder_of(&target))?;
                let (path, file) = open_beside(&target)?;
                Ok(Self { target, file, beside: Some(Beside { path, before, is_named: false }) })
            }
        }
    }

    /// Brings the content to the disk, which is where a full one may show, without taking the name yet.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn settle(&mut self) -> io::Result<()> {
        let Some(Beside { before, .. }) = &self.beside else { return Ok(()) };
        if let Some(before) = before {
            let now = self.file.metadata()?;
            if (now.uid(), now.gid()) != (before.uid(), before.gid()) {
                // Only an administrator may give files away; other people's replacements belong to them.
                let _ = fchown(&self.file, Some(before.uid()), Some(before.gid()));
            }
            // After the change of the owner, which takes some permissions away.
            self.file.set_permissions(before.permissions())?;
        }
        self.file.sync_all()
    }

    /// Brings the content to the disk and gives the file its name.
    ///
    /// # Errors
    /// An error of the operating system; the file that stood there before is then untouched.
    pub fn finish(self) -> io::Result<()> {
        self.finish_open().map(drop)
    }

    /// [`finish`](Self::finish), with the file still open for more content at its end.
    ///
    /// # Errors
    /// As [`finish`](Self::finish).
    pub fn finish_open(mut self) -> io::Result<File> {
        self.settle()?;
        self.take_name()
    }

    /// Gives a file that was [settled](Self::settle) its name.
    fn take_name(self) -> io::Result<File> {
        let Self { target, file, beside } = self;
        if let Some(mut beside) = beside {
            std::fs::rename(&beside.path, &target)?;
            beside.is_named = true;
            sync_folder(folder_of(&target))?;
            file.unlock()?;
        }
        Ok(file)
    }

    /// Gives files that belong together their names, in this order, once all of them are on the disk.
    ///
    /// # Errors
    /// The number of the file that failed, with the error. While a file's content fails, none of them has its name.
    pub fn finish_all(mut files: Vec<Self>) -> Result<(), (usize, io::Error)> {
        for (i, file) in files.iter_mut().enumerate() {
            file.settle().map_err(|e| (i, e))?;
        }
        files.into_iter().enumerate().try_for_each(|(i, file)| file.take_name().map(drop).map_err(|e| (i, e)))
    }
}

/// Opens a file beside its place: the one that a killed program has left, if there is one. The lock of a file tells that
/// the program is alive, which then keeps the name for itself.
fn open_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    let name = target.file_name().unwrap_or_default();
    let named = |more: &str| {
        let mut hidden = OsString::from(".");
        if name.len() <= LONGEST_NAME {
            hidden.push(name);
        }
        hidden.push(more);
        hidden.push(ENDING);
        folder_of(target).join(hidden)
    };
    let own = format!(".{}", std::process::id());
    for more in ["", own.as_str()] {
        let path = named(more);
        let file =
            File::options().read(true).write(true).create(true).truncate(false).mode(MODE).open(&path)?;
        let is_named = |file: &File| {
            let (open, named) = (file.metadata()?, path.symlink_metadata()?);
            Ok::<_, io::Error>((open.dev(), open.ino()) == (named.dev(), named.ino()))
        };
        // A program that had it may have given it its name in between.
        if file.try_lock().is_ok() && is_named(&file).unwrap_or(false) {
            file.set_len(0)?;
            return Ok((path, file));
        }
    }
    Err(io::Error::new(ErrorKind::ResourceBusy, "another program is writing it"))
}

impl Write for StagedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for StagedFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Permissions of a result, readable by all: temporary files are private by default.
pub fn readable_by_all() -> Permissions {
    Permissions::from_mode(MODE)
}

/// Brings the names in a folder to the disk, so that a loss of power does not undo a new one.
///
/// # Errors
/// An error of the operating system.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    match File::open(folder)?.sync_all() {
        // Some file systems keep no names to be synchronised.
        Err(e) if matches!(e.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => Ok(()),
        done => done,
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn write(path: &Path, content: &[u8]) -> io::Result<()> {
        let mut file = StagedFile::create(path)?;
        file.write_all(content)?;
        file.finish()
    }

    #[test]
    fn a_replaced_file_keeps_its_permissions_and_its_links() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a.txt"), folder.path().join("link.txt"));
        write(&file, b"old").unwrap();
        assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777 & !0o644, 0);
        fs::set_permissions(&file, Permissions::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink("a.txt", &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o640);
    }

    #[test]
    fn an_unfinished_file_leaves_the_old_content_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/a.txt");
        write(&path, b"old").unwrap();
        let mut file = StagedFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        file.settle().unwrap();
        drop(file);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn files_take_their_names_together_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a", "b"].map(|name| folder.path().join(name));
        write(&paths[0], b"old").unwrap();
        let staged = || paths.iter().map(|path| StagedFile::create(path).unwrap()).collect::<Vec<_>>();
        StagedFile::finish_all(staged()).unwrap();
        assert_eq!(fs::read(&paths[0]).unwrap(), b"");
        let files = staged();
        // The second file's folder is taken away before it has its name: the content of the first was on the disk.
        let gone =
            StagedFile { target: folder.path().join("gone/c"), ..StagedFile::create(&paths[1]).unwrap() };
        let (number, _) = StagedFile::finish_all(files.into_iter().chain([gone]).collect()).unwrap_err();
        assert_eq!(number, 2);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn what_a_killed_program_left_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(folder.path().join(".a.txt.writing"), "half of a longer text").unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn two_programs_that_write_one_file_do_not_mix_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let [mut first, mut second] = [(); 2].map(|()| StagedFile::create(&path).unwrap());
        first.write_all(b"first").unwrap();
        second.write_all(b"second").unwrap();
        second.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        first.finish().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn folders_are_refused_and_devices_are_written_to() {
        let folder = tempfile::tempdir().unwrap();
        let refused = StagedFile::create(folder.path()).unwrap_err();
        assert_eq!(refused.kind(), ErrorKind::IsADirectory);
        let (null, link) = (Path::new("/dev/null"), folder.path().join("null"));
        std::os::unix::fs::symlink(null, &link).unwrap();
        write(&link, b"nothing").unwrap();
        assert!(!null.metadata().unwrap().is_file() && link.symlink_metadata().unwrap().is_symlink());
    }

    #[test]
    fn a_full_disk_is_told_and_takes_no_name() {
        let path = Path::new("/dev/full");
        if path.exists() {
            assert_eq!(write(path, b"more").unwrap_err().kind(), ErrorKind::StorageFull);
        }
    }
}
