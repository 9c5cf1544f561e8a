//! Reading of a room directory as a [`Room`].

use std::path::{Path, PathBuf};

use calib::files::{parse_toml, read_text, read_toml};
use serde::Deserialize;

use super::scene_file::{FORMAT, SceneFile, Version};
use super::validate::{camera_place, zone_place};
use super::{Line, Region, Room, SCENE_FILE, Zone, marking};
use crate::geometry::ply;
use crate::{Error, Result};

impl Room {
    /// Reads a room directory with its geometry, and checks it.
    ///
    /// A missing reference image is only worth a warning: nothing but previews needs it.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::File`] or [`Error::Calib`], naming the file, the place in it and the problem.
    pub fn read(dir: &Path) -> Result<Self> {
        let path = scene_file_in(dir)?;
        let (mut room, geometry) = room_without_geometry(&path, &read_text(&path)?)?;
        if let Some(geometry) = geometry {
            let ply_path = dir.join(&geometry);
            if !ply_path.is_file() {
                let problem = format!(
                    "there is no file {}; put it there, or remove the line if the room is empty",
                    ply_path.display()
                );
                return Err(Error::content(&path, "geometry", problem));
            }
            room.geometry = Some(ply::read(&ply_path)?);
        }
        if let Some((place, problem)) = room.defect() {
            return Err(Error::content(&path, place, problem));
        }
        for (camera, image) in room.missing_references(dir) {
            tracing::warn!("{}: camera `{camera}`: no reference image {}", path.display(), image.display());
        }
        Ok(room)
    }

    /// Reference images that `scene.toml` names but that are missing: camera and file.
    pub fn missing_references(&self, dir: &Path) -> Vec<(&str, PathBuf)> {
        self.cameras
            .iter()
            .filter_map(|c| Some((c.name.as_str(), dir.join(c.reference.as_ref()?))))
            .filter(|(_, image)| !image.is_file())
            .collect()
    }
}

/// Files of a room directory, and the directory itself: what an output must not take the place of. Of a directory that
/// cannot be read, as many as are known.
pub fn files_of(dir: &Path) -> Vec<PathBuf> {
    #[derive(Deserialize)]
    struct Named {
        geometry: Option<PathBuf>,
        #[serde(default)]
        camera: Vec<NamedCamera>,
    }
    #[derive(Deserialize)]
    struct NamedCamera {
        reference: Option<PathBuf>,
    }
    let path = dir.join(SCENE_FILE);
    let named = read_toml::<Named>(&path).ok();
    let more = named.into_iter().flat_map(|named| {
        named.geometry.into_iter().chain(named.camera.into_iter().filter_map(|camera| camera.reference))
    });
    [dir.to_owned(), path].into_iter().chain(more.map(|file| dir.join(file))).collect()
}

/// Room of a scene file's text without its geometry, whose file is named beside it. The room is not checked yet.
///
/// # Errors
/// [`Error::File`] or [`Error::Calib`], naming the file, the place in it and the problem.
pub(super) fn room_without_geometry(path: &Path, text: &str) -> Result<(Room, Option<PathBuf>)> {
    if text.trim().is_empty() {
        return Err(Error::content(path, "whole file", "the file is empty; write the room again"));
    }
    let Version { format } = parse_toml(path, text)?;
    if format != FORMAT {
        let problem = format!("format {format} is not known; this program reads format {FORMAT}");
        return Err(Error::content(path, "format", problem));
    }
    let file: SceneFile = parse_toml(path, text)?;
    let mut room = Room {
        zones: file.zone,
        regions: file.region,
        lines: file.line,
        geo: file.geo,
        source: file.source,
        walkable: file.floor.and_then(|floor| floor.walkable),
        ..Room::default()
    };
    for (i, table) in file.camera.into_iter().enumerate() {
        let place = camera_place(i, &table.name);
        let camera = table
            .camera()
            .map_err(|(key, problem)| Error::content(path, format!("{place}: {key}"), problem))?;
        room.cameras.push(camera);
    }
    Ok((room, file.geometry))
}

pub(super) fn scene_file_in(dir: &Path) -> Result<PathBuf> {
    let path = dir.join(SCENE_FILE);
    let problem = if !dir.exists() {
        "there is no such room directory; make one with `recon build`"
    } else if !dir.is_dir() {
        "this is a file; name the room directory that holds scene.toml"
    } else if !path.is_file() {
        "it holds no scene.toml, so it is no room directory; make one with `recon build`"
    } else {
        return Ok(path);
    };
    Err(Error::content(dir, "room directory", problem))
}

/// Zones, regions and lines of a file.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct Markings {
    /// The `[[zone]]` tables; at least one.
    #[serde(default, rename = "zone")]
    pub zones: Vec<Zone>,
    /// The `[[region]]` tables.
    #[serde(default, rename = "region")]
    pub regions: Vec<Region>,
    /// The `[[line]]` tables.
    #[serde(default, rename = "line")]
    pub lines: Vec<Line>,
}

/// Markings of a file: its `[[zone]]`, `[[region]]` and `[[line]]` tables; other content is ignored. A room's
/// `scene.toml` will do.
///
/// # Errors
/// [`Error::Calib`] when it cannot be read or parsed, [`Error::File`] when it holds no zone, or one without area, or a
/// region or line that no room may have.
pub fn read_markings(file: &Path) -> Result<Markings> {
    let markings: Markings = read_toml(file)?;
    if markings.zones.is_empty() {
        return Err(Error::content(file, "whole file", "there is no [[zone]] table in it"));
    }
    for (i, zone) in markings.zones.iter().enumerate() {
        if let Some(problem) = zone.polygon.defect() {
            return Err(Error::content(file, zone_place(i, &zone.name), problem));
        }
    }
    match marking::defect(&markings.zones, &markings.regions, &markings.lines) {
        Some((place, problem)) => Err(Error::content(file, place, problem)),
        None => Ok(markings),
    }
}
