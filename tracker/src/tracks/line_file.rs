//! A text file that grows by whole lines and can be read during that time.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use shell::files::StagedFile;

use super::Persistence;
use crate::{Error, Result};

/// Writer that creates its file with the first lines, so that a run that fails before leaves older results alone.
#[derive(Debug)]
pub(crate) struct LineFile {
    path: PathBuf,
    persistence: Persistence,
    /// First line of the file; empty for none.
    header: &'static str,
    file: Option<Arc<File>>,
    /// Number of bytes of whole lines.
    length: u64,
}

impl LineFile {
    /// File that replaces an older one.
    pub(crate) fn new(path: PathBuf) -> Self {
        Self { path, persistence: Persistence::default(), header: "", file: None, length: 0 }
    }

    /// The same file, with this first line.
    pub(crate) fn with_header(self, header: &'static str) -> Self {
        Self { header, ..self }
    }

    /// The same file, kept in this way.
    pub(crate) fn kept(self, persistence: &Persistence) -> Self {
        Self { persistence: persistence.clone(), ..self }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Closes the file; the next lines go to another one.
    pub(crate) fn move_to(&mut self, path: PathBuf) {
        (self.path, self.file, self.length) = (path, None, 0);
    }

    /// Appends whole lines (or nothing) and passes them to the operating system at once. After a failure, such as a
    /// full disk, the file ends with the last line before, and later lines continue there.
    pub(crate) fn append(&mut self, lines: &str) -> Result<()> {
        let file = match self.file.take() {
            Some(file) => file,
            None if self.persistence.continues() => self.open()?,
            None => return self.begin(lines),
        };
        let written = (&*file).write_all(lines.as_bytes());
        if written.is_ok() {
            self.length += lines.len() as u64;
        } else {
            // Cutting may fail, too; the first failure is the one to report.
            let _ = cut(&file, self.length);
        }
        self.file = Some(file);
        written.map_err(Error::io(&self.path))
    }

    /// Begins the file with its header and first lines, in place of an older one, which a full disk leaves alone.
    fn begin(&mut self, lines: &str) -> Result<()> {
        let text = format!("{}{lines}", self.header);
        let begun = || {
            let mut file = StagedFile::create(&self.path)?;
            file.write_all(text.as_bytes())?;
            file.finish_open()
        };
        self.file = Some(Arc::new(begun().map_err(Error::io(&self.path))?));
        self.length = text.len() as u64;
        Ok(())
    }

    /// Opens a file that goes on; with the header, if it has no line yet.
    fn open(&mut self) -> Result<Arc<File>> {
        if let Some(folder) = self.path.parent() {
            std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        }
        let io = || Error::io(&self.path);
        let mut file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&self.path)
            .map_err(io())?;
        self.length = cut_torn_line(&mut file).map_err(io())?;
        if self.length == 0 {
            file.write_all(self.header.as_bytes()).map_err(io())?;
            self.length = self.header.len() as u64;
        }
        let file = Arc::new(file);
        self.persistence.register(&self.path, &file);
        Ok(file)
    }
}

/// Cuts a file to a length, bytes, and continues writing there.
fn cut(mut file: &File, length: u64) -> std::io::Result<()> {
    file.set_len(length)?;
    file.seek(SeekFrom::Start(length)).map(drop)
}

/// Cuts off a last line that has no end, as a loss of power leaves it, and continues writing there. Returns the length,
/// bytes.
fn cut_torn_line(file: &mut File) -> std::io::Result<u64> {
    let end_of_line = |text: &[u8]| text.iter().rposition(|byte| *byte == b'\n').map_or(0, |i| i + 1);
    let (mut length, mut text) = tail(file, BLOCK)?;
    if end_of_line(&text) == 0 {
        // The torn line is longer than a block.
        (length, text) = tail(file, u64::MAX)?;
    }
    length -= (text.len() - end_of_line(&text)) as u64;
    cut(file, length)?;
    Ok(length)
}

/// Part of a file in which its last line is sought, bytes.
const BLOCK: u64 = 1 << 20;

/// Length of a file, and its last bytes.
fn tail(file: &mut File, most: u64) -> std::io::Result<(u64, Vec<u8>)> {
    let length = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(length.saturating_sub(most)))?;
    let mut text = Vec::new();
    file.take(most).read_to_end(&mut text)?;
    Ok((length, text))
}

/// The last whole line of a file without its line break; `None` where there is no file or no such line.
///
/// # Errors
/// [`Error::File`] with the file.
pub(crate) fn last_line(path: &Path) -> Result<Option<String>> {
    let mut file = match File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(Error::io(path)(e)),
    };
    let (_, text) = tail(&mut file, BLOCK).map_err(Error::io(path))?;
    let Some(end) = text.iter().rposition(|byte| *byte == b'\n') else { return Ok(None) };
    let start = text[..end].iter().rposition(|byte| *byte == b'\n').map_or(0, |i| i + 1);
    Ok(Some(String::from_utf8_lossy(&text[start..end]).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_before_a_failure_stay_and_later_ones_follow_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines.txt");
        let mut lines = LineFile::new(path.clone());
        lines.append("first\n").unwrap();
        // A handle that cannot write stands for a full disk.
        let writable = lines.file.replace(Arc::new(File::open(&path).unwrap()));
        for _ in 0..2 {
            assert!(lines.append("lost\n").unwrap_err().to_string().contains("lines.txt"));
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "first\n");
        }
        // Part of a line was written before the disk was full.
        let file = writable.unwrap();
        (&*file).write_all(b"par").unwrap();
        cut(&file, lines.length).unwrap();
        lines.file = Some(file);
        lines.append("second\n").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "first\nsecond\n");
    }

    #[test]
    fn an_older_file_stays_until_the_first_lines_are_on_the_disk() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out/lines.txt");
        std::fs::create_dir(folder.path().join("out")).unwrap();
        std::fs::write(&path, "older\n").unwrap();
        let mut lines = LineFile::new(path.clone()).with_header("head\n");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "older\n");
        lines.append("first\n").unwrap();
        lines.append("second\n").unwrap();
        lines.append("").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "head\nfirst\nsecond\n");
        // A device that is always full, by a link of the file's name.
        if Path::new("/dev/full").exists() {
            std::os::unix::fs::symlink("/dev/full", folder.path().join("full.txt")).unwrap();
            let mut lines = LineFile::new(folder.path().join("full.txt"));
            assert!(lines.append("lost\n").unwrap_err().to_string().contains("full.txt"));
        }
    }

    #[test]
    fn a_lasting_file_goes_on_after_its_last_whole_line() {
        let folder = tempfile::tempdir().unwrap();
        let long = "x".repeat(3 * BLOCK as usize);
        for (name, left, whole) in [
            ("torn", "head\none\ntwo\nthr", "head\none\ntwo\n"),
            ("whole", "head\none\n", "head\none\n"),
            ("zeros", "head\none\n\0\0\0\0", "head\none\n"),
            ("no line", "he", ""),
            ("empty", "", ""),
            ("long", &format!("head\n{long}"), "head\n"),
            ("very long", &format!("head\n{long}\n{long}"), &format!("head\n{long}\n")),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, left).unwrap();
            let mut lines = LineFile::new(path.clone()).with_header("head\n").kept(&Persistence::lasting());
            lines.append("new\n").unwrap();
            let whole = if whole.is_empty() { "head\n" } else { whole };
            assert!(std::fs::read_to_string(&path).unwrap() == format!("{whole}new\n"), "{name}");
            assert_eq!(last_line(&path).unwrap().as_deref(), Some("new"), "{name}");
        }
        assert_eq!(last_line(&folder.path().join("missing")).unwrap(), None);
    }

    #[test]
    fn a_file_that_moves_begins_with_its_header() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a", "b"].map(|name| folder.path().join(name).join("rows.csv"));
        let mut lines = LineFile::new(paths[0].clone()).with_header("x,y\n").kept(&Persistence::lasting());
        lines.append("1,2\n").unwrap();
        lines.move_to(paths[1].clone());
        lines.append("").unwrap();
        lines.append("3,4\n").unwrap();
        let texts = paths.map(|path| std::fs::read_to_string(path).unwrap());
        assert_eq!(texts, ["x,y\n1,2\n", "x,y\n3,4\n"]);
    }
}
