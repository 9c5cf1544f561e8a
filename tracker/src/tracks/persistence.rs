//! Persistence of files that grow: for one run, or lasting over the ends of programs and losses of power.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::Duration;

/// Interval at which lasting files are synchronised to the disk.
const EVERY: Duration = Duration::from_millis(900);

/// Manner in which the files of a run are kept.
#[derive(Debug, Clone, Default)]
pub struct Persistence {
    syncer: Option<Arc<Syncer>>,
}

impl Persistence {
    /// Files that go on where an earlier run ended, and are synchronised to the disk every second by a thread of their
    /// own: a loss of power loses at most the last second. The default is files that replace older ones, which the
    /// operating system writes to the disk when it likes.
    pub fn lasting() -> Self {
        let syncer = Arc::new(Syncer::default());
        let own = Arc::downgrade(&syncer);
        // It ends with the last file that uses it.
        thread::spawn(move || synchronise(&own));
        Self { syncer: Some(syncer) }
    }

    /// Whether files go on.
    pub(crate) fn continues(&self) -> bool {
        self.syncer.is_some()
    }

    /// Adds a file that has been opened.
    pub(super) fn register(&self, path: &Path, file: &Arc<File>) {
        if let Some(syncer) = &self.syncer {
            syncer.files().push((path.to_owned(), Arc::clone(file)));
        }
    }
}

/// Open files, which are synchronised together.
#[derive(Debug, Default)]
struct Syncer(Mutex<Vec<(PathBuf, Arc<File>)>>);

impl Syncer {
    fn files(&self) -> std::sync::MutexGuard<'_, Vec<(PathBuf, Arc<File>)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Syncer {
    /// Synchronises what was written since the last turn of the thread.
    fn drop(&mut self) {
        for (_, file) in self.files().drain(..) {
            // The program ends: there is nothing that could be done about it.
            let _ = file.sync_data();
        }
    }
}

fn synchronise(syncer: &Weak<Syncer>) {
    let mut has_warned = false;
    loop {
        thread::sleep(EVERY);
        let Some(syncer) = syncer.upgrade() else { return };
        // Writers never wait for the disk: the list is not locked meanwhile.
        let files = syncer.files().clone();
        for (path, file) in &files {
            if let Err(e) = file.sync_data()
                && !has_warned
            {
                has_warned = true;
                tracing::warn!("{}: cannot be synchronised to the disk ({e})", path.display());
            }
        }
        drop(files);
        // A file that its writer has closed was synchronised for the last time.
        syncer.files().retain(|(_, file)| Arc::strong_count(file) > 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_files_are_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let persistence = Persistence::lasting();
        let open = ["a", "b"].map(|name| Arc::new(File::create(folder.path().join(name)).unwrap()));
        for file in &open {
            persistence.register(Path::new("a"), file);
        }
        let [kept, closed] = open;
        drop(closed);
        let syncer = persistence.syncer.clone().unwrap();
        let until = std::time::Instant::now() + 20 * EVERY;
        while syncer.files().len() > 1 && std::time::Instant::now() < until {
            thread::sleep(EVERY / 10);
        }
        assert_eq!(syncer.files().len(), 1);
        assert!(Arc::strong_count(&kept) > 1);
    }
}
