//! Names of a model's pictures as cameras, and the choice of those that become the room's cameras.

use std::collections::HashMap;
use std::path::Path;

use crate::{Error, Result};

/// Pictures of a model that become cameras, in this order; all of them where none is named.
///
/// Each entry is a picture's path in the model, its file name, either without extension, or the camera's name; before an
/// `=` it may have another name for the camera.
#[derive(Debug, Clone, Default)]
pub struct Selection {
    /// The entries, as the user wrote them.
    pub entries: Vec<String>,
}

/// A picture that becomes a camera: its number in the model, and the camera's name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Chosen {
    pub(super) index: usize,
    pub(super) name: String,
}

/// Number of names listed in an error.
const LISTED: usize = 5;

impl Selection {
    /// The chosen ones of a model's `pictures`, whose cameras are called `names` by default.
    ///
    /// # Errors
    /// [`Error::File`] for an entry that fits none of the pictures, or several of them, and for a picture that is
    /// chosen twice.
    pub(super) fn choose(&self, file: &Path, pictures: &[String], names: Vec<String>) -> Result<Vec<Chosen>> {
        if self.entries.is_empty() {
            return Ok(names.into_iter().enumerate().map(|(index, name)| Chosen { index, name }).collect());
        }
        let index = Index::of(pictures, &names);
        let mut chosen: Vec<Chosen> = Vec::with_capacity(self.entries.len());
        for entry in &self.entries {
            let wrong = |problem| Error::content(file, format!("--cameras {entry}"), problem);
            // A picture's own name may hold an `=`.
            let (name, found) = match entry.split_once('=') {
                Some((name, picture)) if index.find(entry).is_empty() => (Some(name), index.find(picture)),
                _ => (None, index.find(entry)),
            };
            let &[number] = found else { return Err(wrong(mismatch(found, pictures))) };
            if chosen.iter().any(|earlier| earlier.index == number) {
                return Err(wrong(format!(
                    "the picture `{}` is named twice; leave one out",
                    pictures[number]
                )));
            }
            let name = name.map_or_else(|| names[number].clone(), str::to_owned);
            chosen.push(Chosen { index: number, name });
        }
        Ok(chosen)
    }
}

/// Problem of an entry that fits no picture, or several.
fn mismatch(found: &[usize], pictures: &[String]) -> String {
    let listed = |indices: &mut dyn Iterator<Item = usize>| {
        indices.take(LISTED).map(|i| format!("`{}`", pictures[i])).collect::<Vec<_>>().join(", ")
    };
    let more = |count: usize| if count > LISTED { ", …" } else { "" };
    if found.is_empty() {
        let names = listed(&mut (0..pictures.len()));
        let count = pictures.len();
        format!("no picture of the model has this name; its {count} are called {names}{}", more(count))
    } else {
        let names = listed(&mut found.iter().copied());
        let count = found.len();
        format!("{count} pictures have this name; name one by its whole path: {names}{}", more(count))
    }
}

/// Pictures by the ways in which they may be named, the most exact way first.
struct Index {
    by_way: [HashMap<String, Vec<usize>>; 5],
}

impl Index {
    fn of(pictures: &[String], names: &[String]) -> Self {
        let mut by_way: [HashMap<String, Vec<usize>>; 5] = Default::default();
        for (number, (picture, name)) in pictures.iter().zip(names).enumerate() {
            let path = plain(picture);
            let file = path.rsplit('/').next().unwrap_or(&path).to_owned();
            let ways = [without_extension(&path), name.clone(), without_extension(&file)];
            let [path_stem, name, file_stem] = ways;
            for (way, key) in by_way.iter_mut().zip([path, path_stem, name, file, file_stem]) {
                way.entry(key).or_default().push(number);
            }
        }
        Self { by_way }
    }

    fn find(&self, entry: &str) -> &[usize] {
        let key = plain(entry);
        self.by_way.iter().find_map(|way| way.get(&key)).map_or(&[], Vec::as_slice)
    }
}

/// A picture's path with `/` between folders and without a leading `./`.
fn plain(picture: &str) -> String {
    picture.replace('\\', "/").trim_start_matches("./").to_owned()
}

fn without_extension(path: &str) -> String {
    Path::new(path).with_extension("").to_string_lossy().into_owned()
}

/// Parts of a picture's path that its camera is named after.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NamedAfter {
    /// The whole path, as in COLMAP's models, where it is relative to the folder of all pictures.
    Path,
    /// The file's name, and as many folders as tell equal ones apart.
    File,
}

/// Names of the cameras of pictures: without extensions, folder separators and the `=` of command-line arguments. Equal
/// names get more of the pictures' folders, and their extensions at last.
pub(super) fn camera_names(pictures: &[String], after: NamedAfter) -> Vec<String> {
    let paths: Vec<String> = pictures.iter().map(|picture| plain(picture)).collect();
    let deepest = paths.iter().map(|path| path.matches('/').count()).max().unwrap_or(0);
    let shortest = if after == NamedAfter::Path { deepest } else { 0 };
    let joined = |path: &str, folders: usize| {
        let parts: Vec<&str> = path.split('/').filter(|part| !["", ".", ".."].contains(part)).collect();
        parts[parts.len().saturating_sub(folders + 1)..].join("_").replace('=', "_")
    };
    let mut names: Vec<String> =
        paths.iter().map(|path| joined(&without_extension(path), shortest)).collect();
    for folders in shortest + 1..=deepest + 1 {
        let doubled = doubled(&names);
        for (i, path) in paths.iter().enumerate().filter(|(i, _)| doubled[*i]) {
            // Past the deepest folder only the extension is left to tell them apart.
            let whole = if folders > deepest { path.clone() } else { without_extension(path) };
            names[i] = joined(&whole, folders);
        }
    }
    names
}

/// For each name whether another one is equal.
fn doubled(names: &[String]) -> Vec<bool> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    for name in names {
        *counts.entry(name).or_default() += 1;
    }
    names.iter().map(|name| counts[name.as_str()] > 1).collect()
}

#[cfg(test)]
mod tests {
    use super::NamedAfter::{File, Path as WholePath};
    use super::*;

    fn owned(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn equal_file_names_get_their_folders_and_then_their_extensions() {
        let names = |pictures: &[&str], after| camera_names(&owned(pictures), after);
        assert_eq!(names(&["images/a.jpg", "./images/b.c.png"], File), ["a", "b.c"]);
        assert_eq!(
            names(&["left/0001.jpg", "right/0001.jpg", "right/0002.jpg"], File),
            ["left_0001", "right_0001", "0002"]
        );
        assert_eq!(names(&["../a/x/1.jpg", "../b/x/1.jpg", "../b/y/1.jpg"], File), ["a_x_1", "b_x_1", "y_1"]);
        assert_eq!(names(&["a.jpg", "a.png"], File), ["a.jpg", "a.png"]);
        assert_eq!(
            names(&["hall/a b.jpg", "door=1.png", r"c\d.png"], WholePath),
            ["hall_a b", "door_1", "c_d"]
        );
        assert_eq!(names(&["x/a.jpg", "x/a.png", "y/a.png"], WholePath), ["x_a.jpg", "x_a.png", "y_a"]);
        assert!(names(&[], File).is_empty());
    }

    #[test]
    fn pictures_are_chosen_by_path_file_or_camera_and_may_be_renamed() {
        let pictures = owned(&["hall/1.jpg", "hall/2.jpg", "door/1.jpg", "x=y.png"]);
        let names = camera_names(&pictures, NamedAfter::Path);
        let choose = |entries: &[&str]| {
            let selection = Selection { entries: owned(entries) };
            let chosen = selection.choose(Path::new("images.bin"), &pictures, names.clone());
            chosen
                .map(|all| all.into_iter().map(|c| (c.index, c.name)).collect::<Vec<_>>())
                .map_err(|e| e.to_string())
        };
        let one = |index: usize, name: &str| Ok(vec![(index, name.to_owned())]);
        assert_eq!(choose(&[]).unwrap().len(), 4);
        for by in ["hall/2.jpg", "hall/2", "hall_2", "2.jpg", "2", "./hall/2.jpg", r"hall\2.jpg"] {
            assert_eq!(choose(&[by]), one(1, "hall_2"), "{by}");
        }
        assert_eq!(choose(&["x=y.png"]), one(3, "x_y"));
        assert_eq!(choose(&["entrance=door/1"]), one(2, "entrance"));
        assert_eq!(choose(&["2", "door_1"]).unwrap().iter().map(|c| c.0).collect::<Vec<_>>(), [1, 2]);
        let said = choose(&["1.jpg"]).unwrap_err();
        assert!(said.contains("2 pictures") && said.contains("`hall/1.jpg`, `door/1.jpg`"), "{said}");
        let said = choose(&["lobby"]).unwrap_err();
        assert!(
            said.starts_with("images.bin: --cameras lobby: no picture") && said.contains("its 4"),
            "{said}"
        );
        let said = choose(&["2", "hall/2"]).unwrap_err();
        assert!(said.contains("named twice"), "{said}");
    }
}
