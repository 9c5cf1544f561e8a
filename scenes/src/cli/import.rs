//! `scenes import`: a room from the output of reconstruction, scanning or calibration programs.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::{DVec3, Vec3};
use nalgebra::{Isometry3, Point3, Similarity3, Translation3, UnitQuaternion, Vector3};
use shell::files::Outputs;
use shell::ranges::Range;

use crate::exchange::alignment::{self, KnownPoint};
use crate::exchange::{self, Model, ModelGeometry, ModelOptions, PicturedCamera, Pictures, Selection};
use crate::exchange::{calib_files, placement, references};
use crate::floor::{self, FloorOptions};
use crate::geometry::scan::{MOST_POINTS, Placing};
use crate::geometry::{Geometry, files, vec3_from_point};
use crate::room::{GEOMETRY_FILE, Room, SCENE_FILE, Source};

/// Make a room directory from cameras and a mesh or cloud.
///
/// Cameras come from a COLMAP model (text or binary, with or without rigs), from nerfstudio's transforms.json, or one by
/// one from the files of `calib intrinsics` and `calib pose`. Geometry comes from the model (COLMAP's points, nerfstudio's
/// `ply_file_path`) or from --geometry: PLY, OBJ, glTF or GLB, LAS or LAZ; normals are estimated where it has none.
///
/// The room's world is in metres, with Z up and the floor at z = 0. --scale, --up and --shift bring cameras and geometry
/// there together, in this order, or --points does, by points that are known in both; --floor auto finds the floor. Frames more than 10 km from their
/// origin, as UTM's, are shifted by whole kilometres; scene.toml keeps the shift. Images become cameras of their names.
#[derive(Args)]
#[command(after_help = "Examples:
  scenes import sparse/0 --geometry meshed-poisson.ply --images images --out myroom
  scenes import sparse/0 --cameras door=hall/IMG_0012.jpg desk=IMG_0500.jpg --points picks.csv --out myroom
  scenes import transforms.json --up y --scale 0.001 --floor auto --out myroom
  scenes import sparse/0 --geometry utm.laz --shift=-500000,-5400000,0 --out myroom
  scenes import --camera door=lens1.toml,pose1.toml --camera desk=lens2.toml,pose2.toml --geometry scan.glb --out myroom

picks.csv, the model's coordinates and the room's of the same points (at least 3, not on a line):
  x,y,z,room_x,room_y,room_z,name
  -0.21,1.70,3.05,0,0,0,corner by the door")]
pub(crate) struct Import {
    /// A COLMAP model's folder, or a transforms.json
    #[arg(value_name = "MODEL", required_unless_present = "camera")]
    model: Option<PathBuf>,
    /// Pictures of the model that become the room's cameras, by path, file name or camera name; CAMERA=PICTURE names the
    /// camera [default: all]
    #[arg(long, value_name = "PICTURE", num_args = 1.., requires = "model")]
    cameras: Vec<String>,
    /// A camera of its own: its lens (`calib intrinsics`) and its pose (`calib pose`); once a camera
    #[arg(long, value_name = "NAME=LENS,POSE", value_parser = camera)]
    camera: Vec<(String, PathBuf, PathBuf)>,
    /// Folder of the model's pictures; those of the room's cameras are copied into the room as reference images
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// Geometry of the room: PLY, OBJ, glTF, GLB, LAS or LAZ; without it the model's own, or nothing
    #[arg(long, value_name = "FILE")]
    geometry: Option<PathBuf>,
    /// Metres a unit of the model: 0.001 for millimetres
    #[arg(long, value_name = "NUMBER", value_parser = SCALE.number())]
    scale: Option<f64>,
    /// Direction of up in the model's world: x, y, z, -x, -y, -z, or a vector X,Y,Z [default: z; in glTF files y]
    #[arg(long, value_name = "AXIS", value_parser = up, allow_hyphen_values = true)]
    up: Option<UpAxis>,
    /// Metres by which cameras and geometry are moved
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    shift: Option<DVec3>,
    /// Points known in the model and in the room, by which they are aligned; with --scale only by rotation and translation
    #[arg(long, value_name = "CSV", conflicts_with_all = ["up", "shift"])]
    points: Option<PathBuf>,
    /// Bring the floor to z = 0, by the shortest turn and move: `auto` finds it among the planes of the geometry
    #[arg(long, value_enum, value_name = "HOW", conflicts_with = "points")]
    floor: Option<FloorSearch>,
    /// Undo what nerfstudio did to the world of transforms.json (`applied_transform`, `applied_scale`)
    #[arg(long)]
    undo_applied: bool,
    /// Number of points above which a cloud is thinned, one point a voxel
    #[arg(long, value_name = "NUMBER", default_value_t = MOST_POINTS, value_parser = POINTS.whole::<usize>())]
    most_points: usize,
    /// The room directory to make
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Way in which the floor is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FloorSearch {
    /// Among the planes of the geometry
    Auto,
}

/// Metres a unit.
const SCALE: Range = Range::new(1e-9, 1e9, "metres a unit");
/// Points of a cloud.
const POINTS: Range = Range::new(1.0, 1e9, "points");
/// Residual of known points from which on they are worth a warning, metres.
const LARGE_RESIDUAL_M: f64 = 0.1;

/// A direction in the model's world.
#[derive(Debug, Clone, Copy, PartialEq)]
struct UpAxis(UnitQuaternion<f64>);

fn camera(text: &str) -> Result<(String, PathBuf, PathBuf), String> {
    text.split_once('=')
        .and_then(|(name, files)| Some((name, files.split_once(',')?)))
        .filter(|(name, (lens, pose))| ![name, lens, pose].iter().any(|part| part.is_empty()))
        .map(|(name, (lens, pose))| (name.to_owned(), lens.into(), pose.into()))
        .ok_or_else(|| "it is not of the form NAME=LENS,POSE, as in door=lens.toml,pose.toml".to_owned())
}

fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if DVec3::new(x, y, z).is_finite() => Ok(DVec3::new(x, y, z)),
        _ => Err("it is not of the form X,Y,Z in metres, as in -500000,-5400000,0".to_owned()),
    }
}

fn up(text: &str) -> Result<UpAxis, String> {
    let (sign, axis) =
        text.strip_prefix('-').map_or((1.0, text.trim_start_matches('+')), |axis| (-1.0, axis));
    let direction = match axis {
        "x" | "X" => sign * Vector3::x(),
        "y" | "Y" => sign * Vector3::y(),
        "z" | "Z" => sign * Vector3::z(),
        _ => vector(text).map(|v| Vector3::new(v.x, v.y, v.z)).unwrap_or_default(),
    };
    placement::upright(direction)
        .map(UpAxis)
        .ok_or_else(|| "it is none of x, y, z, -x, -y, -z and no vector X,Y,Z longer than 0".to_owned())
}

impl Import {
    pub(crate) fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        self.refuse_output()?;
        let Model { mut cameras, geometry } = self.read_model()?;
        let (room_from_model, shift) = self.room_from_model(out, &cameras)?;
        for camera in &mut cameras {
            camera.entry.camera = placement::placed(&camera.entry.camera, &room_from_model);
        }
        let mut geometry = self.read_geometry(&geometry, &room_from_model, &cameras)?;
        if self.floor == Some(FloorSearch::Auto) {
            self.level(out, geometry.as_mut(), &mut cameras)?;
        }
        let references = match &self.images {
            Some(folder) => references::find(folder, &mut cameras)?,
            None => Vec::new(),
        };
        let source = (shift != DVec3::ZERO).then(|| Source { shift: shift.to_array() });
        let cameras = cameras.into_iter().map(|camera| camera.entry).collect();
        let room = Room { cameras, source, geometry, ..Room::default() };
        for warning in room.odd_sizes() {
            tracing::warn!("{}: {warning}", self.out.display());
        }
        room.validate()?;
        references::copy(&references, &self.out)?;
        Ok(room.write(&self.out)?)
    }

    fn refuse_output(&self) -> anyhow::Result<()> {
        anyhow::ensure!(
            !self.out.join(SCENE_FILE).exists(),
            "{}: --out: there is a room already; name a new directory",
            self.out.display()
        );
        anyhow::ensure!(
            !self.out.join(GEOMETRY_FILE).exists(),
            "{}: --out: a {GEOMETRY_FILE} of no room stands there and would be lost; name a new directory",
            self.out.display()
        );
        let of_cameras = self.camera.iter().flat_map(|(_, lens, pose)| [lens, pose]);
        let inputs = self.model.iter().chain(&self.geometry).chain(&self.points).chain(&self.images);
        Ok(Outputs::new([self.out.as_path()]).refuse(inputs.chain(of_cameras))?)
    }

    fn read_model(&self) -> anyhow::Result<Model> {
        let options = ModelOptions {
            selection: Selection { entries: self.cameras.clone() },
            pictures: Pictures { folders: self.images.iter().cloned().collect() },
            undo_applied: self.undo_applied,
        };
        let none = Model { cameras: Vec::new(), geometry: ModelGeometry::None };
        let mut model = self.model.as_deref().map_or(Ok(none), |path| exchange::model(path, &options))?;
        for (name, lens, pose) in &self.camera {
            let entry = calib_files::camera(name, lens, pose)?;
            model.cameras.push(PicturedCamera { picture: name.clone(), entry });
        }
        Ok(model)
    }

    /// Way from the model's world to the room's, and the shift in it, metres, which the room keeps.
    fn room_from_model(
        &self,
        out: &mut impl Write,
        cameras: &[PicturedCamera],
    ) -> anyhow::Result<(Similarity3<f64>, DVec3)> {
        let near = if let Some(path) = &self.points {
            self.aligned(out, path)?
        } else {
            let turn = self.up.map_or_else(UnitQuaternion::identity, |up| up.0);
            placement::similarity(self.scale.unwrap_or(1.0), turn, DVec3::ZERO)
        };
        let eyes: Vec<Point3<f64>> = cameras.iter().map(|c| near * c.entry.camera.center()).collect();
        let shift = match self.shift {
            Some(shift) => shift,
            None => match placement::shift_of_far_frame(&eyes) {
                Some(shift) => {
                    tracing::warn!(
                        "the cameras stand far from their origin: the room is moved by {},{},{} m, which scene.toml keeps \
                         (--shift: another one)",
                        shift.x,
                        shift.y,
                        shift.z
                    );
                    shift
                }
                None => DVec3::ZERO,
            },
        };
        let shifted = Translation3::new(shift.x, shift.y, shift.z) * near;
        Ok((shifted, shift))
    }

    /// Finds the floor, and brings it to z = 0.
    fn level(
        &self,
        out: &mut impl Write,
        geometry: Option<&mut Geometry>,
        cameras: &mut [PicturedCamera],
    ) -> anyhow::Result<()> {
        let place = || {
            format!(
                "{}: --floor auto",
                self.geometry.as_ref().or(self.model.as_ref()).unwrap_or(&self.out).display()
            )
        };
        let Some(geometry) = geometry else {
            anyhow::bail!("{}: there is no geometry to find the floor in; name one with --geometry", place());
        };
        let poses: Vec<Isometry3<f64>> = cameras.iter().map(|c| c.entry.camera.camera_from_world).collect();
        let eyes: Vec<Point3<f64>> = cameras.iter().map(|c| c.entry.camera.center()).collect();
        let points = floor::surface_points(geometry, &eyes);
        let (plane, report) = floor::find(&points, &poses, &[], &FloorOptions::default())
            .map_err(|problem| anyhow::anyhow!("{}: {problem}; or use --up, --shift or --points", place()))?;
        writeln!(
            out,
            "floor     {:.0} % of the surfaces, {:.3} m rms, was {:.1}° from level",
            100.0 * report.area_share,
            report.rms,
            plane.normal.angle(&Vector3::z()).to_degrees()
        )?;
        let level = floor::levelled(&plane, &eyes);
        geometry.transform(&level);
        for camera in cameras {
            camera.entry.camera = camera.entry.camera.moved(&level);
        }
        Ok(())
    }

    /// Similarity of the known points of a file, and how well they agree with it.
    fn aligned(&self, out: &mut impl Write, path: &Path) -> anyhow::Result<Similarity3<f64>> {
        let points: Vec<KnownPoint> = alignment::read_points(path)?;
        let found = alignment::align(&points, self.scale)
            .map_err(|problem| anyhow::anyhow!("{}: {problem}", path.display()))?;
        writeln!(
            out,
            "points    {}, rms {:.3} m, {} metres a unit of the model",
            points.len(),
            found.rms_m(),
            shell::ranges::shown(found.room_from_model.scaling())
        )?;
        for (point, residual_m) in points.iter().zip(&found.residuals_m) {
            writeln!(out, "point     {}: {residual_m:.3} m off", point.name)?;
        }
        if let Some(outlier) = found.outlier {
            tracing::warn!(
                "{}: point `{}` is {:.3} m from where the others put it, which agree within {:.3} m; correct it or leave it out",
                path.display(),
                points[outlier.index].name,
                outlier.distance_m,
                outlier.others_rms_m
            );
        } else if found.rms_m() > LARGE_RESIDUAL_M {
            tracing::warn!(
                "{}: the points agree within {:.2} m only; compare their coordinates, pick more, or measure again",
                path.display(),
                found.rms_m()
            );
        }
        Ok(found.room_from_model)
    }

    fn read_geometry(
        &self,
        of_model: &ModelGeometry,
        room_from_model: &Similarity3<f64>,
        cameras: &[PicturedCamera],
    ) -> anyhow::Result<Option<Geometry>> {
        let viewpoints: Vec<Vec3> =
            cameras.iter().map(|c| vec3_from_point(&c.entry.camera.center())).collect();
        let placing = |room_from_scan: Similarity3<f64>| Placing {
            room_from_scan,
            viewpoints: &viewpoints,
            most_points: self.most_points,
        };
        let says_up = self.up.is_some() || self.points.is_some();
        let read = |path: &Path, way: Similarity3<f64>| {
            // The standard of glTF has Y up; where the user says what is up, it is that of all files.
            let way = if says_up { way } else { way * files::z_up_from_file(path) };
            files::read(path, &placing(way)).map(Some)
        };
        Ok(match (&self.geometry, of_model) {
            (Some(file), _) => read(file, *room_from_model)?,
            (None, ModelGeometry::File { path, model_from_file }) => {
                read(path, room_from_model * model_from_file)?
            }
            (None, ModelGeometry::Points(dir)) => {
                exchange::colmap::geometry(dir, &placing(*room_from_model))?
            }
            (None, ModelGeometry::None) => None,
        })
    }
}
