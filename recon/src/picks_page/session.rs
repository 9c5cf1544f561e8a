//! The project that is picked: its pictures and picks, questions about them, saving.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use shell::loopback::{Answer, Protection};

use super::geometry::{self, EpipolarLine};
use super::state::{Built, Progress, ProposedPoint, ReferencePicture, State, Views};
use crate::pipeline::BuildOptions;
use crate::project::{
    LEAST_SHARED_POINTS, Picked, PickedTable, Project, ProjectCamera, ProjectVersion, read_picked,
    save_picked,
};
use crate::verdict::Verdict;
use crate::{Error, Result};

/// A capture project while its points are picked.
pub struct Session {
    project: PathBuf,
    room: PathBuf,
    options: BuildOptions,
    /// Host and protection of the zone editor that the page leads on to.
    host: String,
    protection: Protection,
    cameras: Vec<ProjectCamera>,
    state: Mutex<State>,
}

/// The project for the page.
#[derive(Serialize)]
pub(super) struct ProjectReply {
    name: String,
    version: ProjectVersion,
    cameras: Vec<String>,
    picked: Picked,
}

/// Progress of the captures, proposals and build, as the page asks for it.
#[derive(Serialize)]
pub(super) struct StateReply {
    captures: Progress,
    /// Width and height of each camera's reference picture, as soon as it is there.
    pictures: BTreeMap<String, (u32, u32)>,
    /// Whether surfaces are known, and with them residuals and epipolar lines.
    has_surfaces: bool,
    proposals: Vec<ProposedPoint>,
    build: Progress,
    built: Option<BuiltReply>,
}

#[derive(Serialize)]
struct BuiltReply {
    number: usize,
    room: PathBuf,
    verdict: Verdict,
    cameras: Vec<String>,
}

/// A pixel, and the camera in which its epipolar line is asked for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EpipolarRequest {
    camera: String,
    pixel: Point2<f64>,
    other: String,
}

/// Points whose residuals are asked for; those picked in one camera only count for nothing.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ResidualsRequest {
    points: Vec<BTreeMap<String, [f64; 2]>>,
}

/// Residuals of the picks of each pair of cameras that share points.
#[derive(Serialize)]
pub(super) struct ResidualsReply {
    pairs: Vec<PairReply>,
}

#[derive(Serialize)]
struct PairReply {
    cameras: [String; 2],
    /// Number of points in common.
    points: usize,
    /// Problem, where they do not join the cameras.
    problem: Option<String>,
    misfits: Vec<MisfitReply>,
}

#[derive(Serialize)]
struct MisfitReply {
    /// Index of the point in the request.
    point: usize,
    camera: String,
    /// Distance from where the others put it.
    px: f64,
    left_out: bool,
}

/// Picks to save, and the version of the file that they were made from.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SaveRequest {
    version: ProjectVersion,
    picked: Picked,
}

#[derive(Serialize)]
pub(super) struct SaveReply {
    version: ProjectVersion,
    picked: Picked,
}

#[derive(Serialize)]
pub(super) struct ZonesReply {
    link: String,
}

impl Session {
    /// Reads the cameras of a project. `room`: directory that builds make. `host`, `protection`: those of the page.
    ///
    /// # Errors
    /// As [`Project::read_unpicked`]; [`Error::File`] for a project of one camera, which has no points to pick.
    pub fn open(
        project: &Path,
        room: &Path,
        options: BuildOptions,
        host: &str,
        protection: &Protection,
    ) -> Result<Arc<Self>> {
        let (cameras, _) = Project::read_unpicked(project)?;
        let state = State { pictures: vec![None; cameras.len()], ..State::default() };
        Ok(Arc::new(Self {
            project: project.to_owned(),
            room: room.to_owned(),
            options,
            host: host.to_owned(),
            protection: protection.clone(),
            cameras,
            state: Mutex::new(state),
        }))
    }

    pub(super) fn project(&self) -> &Path {
        &self.project
    }

    pub(super) fn room(&self) -> &Path {
        &self.room
    }

    pub(super) fn options(&self) -> &BuildOptions {
        &self.options
    }

    pub(super) fn cameras(&self) -> &[ProjectCamera] {
        &self.cameras
    }

    /// Looks at the state, or changes it.
    pub(super) fn update<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        // A thread that panicked has left no half-changed state: each change is one assignment or two.
        change(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The project as it is on disk.
    pub(super) fn described(&self) -> Result<ProjectReply> {
        let (picked, version) = read_picked(&self.project)?;
        let absolute = std::path::absolute(&self.project).unwrap_or_else(|_| self.project.clone());
        let folder = absolute.parent().and_then(Path::file_name).unwrap_or(absolute.as_os_str());
        Ok(ProjectReply {
            name: folder.to_string_lossy().into_owned(),
            version,
            cameras: self.cameras.iter().map(|camera| camera.name.clone()).collect(),
            picked,
        })
    }

    pub(super) fn progress(&self) -> StateReply {
        self.update(|state| StateReply {
            captures: state.captures.clone(),
            pictures: self
                .cameras
                .iter()
                .zip(&state.pictures)
                .filter_map(|(camera, picture)| Some((camera.name.clone(), picture.as_ref()?.size)))
                .collect(),
            has_surfaces: state.views.is_some(),
            proposals: state.proposals.clone(),
            build: state.build.clone(),
            built: state.built.clone().map(|Built { room, verdict, cameras }| BuiltReply {
                number: state.builds,
                room,
                verdict,
                cameras,
            }),
        })
    }

    fn index(&self, name: &str) -> std::result::Result<usize, Answer> {
        let known = || self.cameras.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", ");
        let found = self.cameras.iter().position(|camera| camera.name == name);
        found.ok_or_else(|| {
            Answer::error(404, &format!("no camera is called `{name}`; there are {}", known()))
        })
    }

    /// Reference picture of a camera.
    pub(super) fn picture(&self, name: &str) -> std::result::Result<Answer, Answer> {
        let index = self.index(name)?;
        let picture = self.update(|state| state.pictures[index].clone());
        let picture = picture.ok_or_else(|| Answer::error(404, "its capture is not read yet; ask again"))?;
        Ok(Answer::ok("image/png", picture.png.clone()))
    }

    fn views(&self) -> std::result::Result<Arc<Views>, Answer> {
        let views = self.update(|state| state.views.clone());
        views.ok_or_else(|| Answer::error(409, "the captures are not worked through yet"))
    }

    /// Epipolar line of a pixel; empty while nothing joins the two cameras.
    pub(super) fn epipolar(&self, asked: &EpipolarRequest) -> std::result::Result<EpipolarLine, Answer> {
        let [from, onto] = [self.index(&asked.camera)?, self.index(&asked.other)?];
        let views = self.views()?;
        let pair = [from.min(onto), from.max(onto)];
        let proposed = || {
            let found = views.pairs.iter().find(|other| other.cameras == pair);
            Some(found?.found.as_ref()?.first_from_second)
        };
        let Some(first_from_second) = self.update(|state| state.joined.get(&pair).copied()).or_else(proposed)
        else {
            return Ok(EpipolarLine::default());
        };
        let onto_from = if from < onto { first_from_second.inverse() } else { first_from_second };
        let line = geometry::epipolar(&views.views[from], &views.views[onto], &onto_from, &asked.pixel);
        Ok(line.unwrap_or_default())
    }

    /// Residuals of picks.
    pub(super) fn residuals(&self, asked: &ResidualsRequest) -> std::result::Result<ResidualsReply, Answer> {
        let views = self.views()?;
        let count = self.cameras.len();
        let mut pairs = Vec::new();
        for pair in (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b])) {
            let names = pair.map(|camera| &self.cameras[camera].name);
            let pixel = |picks: &BTreeMap<String, [f64; 2]>, name: &str| {
                picks.get(name).map(|[x, y]| Point2::new(*x, *y))
            };
            let points: Vec<[Option<Point2<f64>>; 2]> =
                asked.points.iter().map(|picks| names.map(|name| pixel(picks, name))).collect();
            let shared = points.iter().filter(|[a, b]| a.is_some() && b.is_some()).count();
            let enough = shared >= LEAST_SHARED_POINTS;
            let joined = enough.then(|| geometry::join(pair.map(|camera| &views.views[camera]), &points));
            let joined = joined.transpose();
            let similarity = joined.as_ref().ok().and_then(|j| j.as_ref()).map(|j| j.first_from_second);
            self.update(|state| match similarity {
                Some(similarity) => state.joined.insert(pair, similarity),
                None => state.joined.remove(&pair),
            });
            if shared == 0 {
                continue;
            }
            let (misfits, problem) = match joined {
                Ok(joined) => (joined.map(|j| (j.misfits, j.left_out)).unwrap_or_default(), None),
                Err(problem) => (Default::default(), Some(problem)),
            };
            let (misfits, left_out) = misfits;
            let misfit = |(point, camera, px): (usize, usize, f64)| MisfitReply {
                point,
                camera: names[camera].clone(),
                px,
                left_out: left_out.contains(&point),
            };
            pairs.push(PairReply {
                cameras: names.map(Clone::clone),
                points: shared,
                problem,
                misfits: misfits.into_iter().map(misfit).collect(),
            });
        }
        Ok(ResidualsReply { pairs })
    }

    /// Writes picks and scale into `room.toml`.
    pub(super) fn save(&self, asked: &SaveRequest) -> Result<SaveReply> {
        // The lock is held until the file is written: pages save one after the other.
        self.update(|state| {
            if let Some((point, camera)) = outside(&asked.picked.points, &self.cameras, &state.pictures) {
                let place = format!("point {point}, {camera}");
                return Err(Error::content(&self.project, place, "lies outside its picture"));
            }
            let (picked, version) = save_picked(&self.project, &asked.version, &asked.picked)?;
            Ok(SaveReply { version, picked })
        })
    }

    /// Picture of the room that was built last: `plan`, or a camera's preview.
    pub(super) fn built_picture(&self, camera: Option<&str>) -> std::result::Result<Answer, Answer> {
        let none = || Answer::error(404, "no room has been built yet");
        let built = self.update(|state| state.built.clone()).ok_or_else(none)?;
        let file = match camera {
            None => built.room.join("plan.png"),
            Some(name) if built.cameras.iter().any(|camera| camera == name) => {
                built.room.join("preview").join(format!("{name}.png"))
            }
            Some(name) => return Err(Answer::error(404, &format!("the room has no camera `{name}`"))),
        };
        let bytes = std::fs::read(&file);
        bytes
            .map(|bytes| Answer::ok("image/png", bytes))
            .map_err(|e| Answer::error(404, &format!("{}: {e}", file.display())))
    }

    /// Starts the zone editor of the room that was built last, or finds the one that is running.
    pub(super) fn zones(&self) -> std::result::Result<ZonesReply, Answer> {
        let built = self.update(|state| state.built.clone());
        let room = built.ok_or_else(|| Answer::error(404, "no room has been built yet"))?.room;
        let running = self.update(|state| state.zones.clone());
        if let Some((_, link)) = running.filter(|(dir, _)| *dir == room) {
            return Ok(ZonesReply { link });
        }
        let failed = |e: scenes::Error| Answer::error(500, &e.to_string());
        let server = scenes::editor::Server::bind(&self.host, 0, &self.protection).map_err(failed)?;
        let editor = scenes::editor::Session::open(&room).map_err(failed)?;
        let link = server.link();
        // It ends with the program.
        std::thread::spawn(move || server.run(editor));
        self.update(|state| state.zones = Some((room, link.clone())));
        Ok(ZonesReply { link })
    }
}

/// The first pick outside its picture, where the picture is known: number of the point, name of the camera.
fn outside(
    points: &[PickedTable],
    cameras: &[ProjectCamera],
    pictures: &[Option<Arc<ReferencePicture>>],
) -> Option<(usize, String)> {
    let is_outside = |name: &str, [x, y]: [f64; 2]| {
        let index = cameras.iter().position(|camera| camera.name == name)?;
        let (width, height) = pictures[index].as_ref()?.size;
        let inside =
            (-0.5..=f64::from(width) - 0.5).contains(&x) && (-0.5..=f64::from(height) - 0.5).contains(&y);
        (!inside).then_some(())
    };
    let numbered =
        (1..).zip(points).flat_map(|(number, point)| point.picks.iter().map(move |pick| (number, pick)));
    let mut wrong = numbered.filter(|(_, (name, pixel))| is_outside(name, **pixel).is_some());
    wrong.next().map(|(number, (name, _))| (number, name.clone()))
}
