//! Fuzz target that gives each input to one reader of files or packets, whose name is in `FUZZ_READER`.
//!
//! Without a name the program prints the names of all readers. Good content is written to the folder `FUZZ_SEEDS`, so that the fuzzer
//! starts from it. `tests/fuzz/run.sh` runs all readers.
#![no_main]
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use tempfile::TempDir;
use tests::readers::{Reader, readers};

/// A reader, the folder of its files, and the path of the one that changes.
struct Chosen {
    reader: Reader,
    path: PathBuf,
    _folder: TempDir,
}

static CHOSEN: OnceLock<Chosen> = OnceLock::new();

fn choose() -> Chosen {
    let name = std::env::var("FUZZ_READER").unwrap_or_default();
    let mut readers = readers().expect("good files can be written");
    let Some(chosen) = readers.iter().position(|reader| reader.name == name) else {
        for reader in &readers {
            println!("{}", reader.name);
        }
        std::process::exit(if name.is_empty() { 0 } else { 2 });
    };
    let reader = readers.swap_remove(chosen);
    let folder = tempfile::tempdir().expect("the folder for temporary files can be written to");
    let path = reader.prepare(folder.path()).expect("the folder for temporary files can be written to");
    if let Some(seeds) = std::env::var_os("FUZZ_SEEDS") {
        std::fs::write(Path::new(&seeds).join("good"), &reader.content).expect("FUZZ_SEEDS is a folder");
    }
    Chosen { reader, path, _folder: folder }
}

fuzz_target!(
    init: {
        CHOSEN.get_or_init(choose);
    },
    |content: &[u8]| {
        let Chosen { reader, path, .. } = CHOSEN.get_or_init(choose);
        std::fs::write(path, content).expect("the folder for temporary files can be written to");
        let _ = reader.read(path);
    }
);
