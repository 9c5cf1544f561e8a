//! `scenes import`: a room from the output of reconstruction, scanning or calibration programs.

use std::path::PathBuf;

use crate::exchange::{self, calib_files};
use crate::geometry::{ply, vec3_from_point};
use crate::room::{GEOMETRY_FILE, Room, SCENE_FILE};
use clap::Args;
use glam::DVec3;
use shell::files::Outputs;

/// Make a room directory from cameras and a mesh or cloud.
///
/// Cameras come from a COLMAP model (text or binary), from nerfstudio's transforms.json, or one by one from the files
/// of `calib intrinsics` and `calib pose`. Their world has to be the room's: metres, Z up, the floor at z = 0, and that
/// of the geometry, too; `colmap model_aligner` brings a model there. Images become cameras of their names. Normals are
/// estimated for a laser scanner's cloud without normals, and for a COLMAP model's own points, which are used where no
/// geometry is given.
#[derive(Args)]
#[command(after_help = "Examples:
  scenes import sparse/0 --geometry meshed-poisson.ply --out myroom
  scenes import transforms.json --out myroom
  scenes import sparse/0 --geometry utm.ply --shift=-500000,-5400000,0 --out myroom
  scenes import --camera door=lens1.toml,pose1.toml --camera desk=lens2.toml,pose2.toml --geometry scan.ply --out myroom")]
pub(crate) struct Import {
    /// A COLMAP model's folder, or a transforms.json.
    #[arg(value_name = "MODEL", required_unless_present = "camera")]
    model: Option<PathBuf>,
    /// A camera of its own: its lens (`calib intrinsics`) and its pose (`calib pose`); once a camera.
    #[arg(long, value_name = "NAME=LENS,POSE", value_parser = camera)]
    camera: Vec<(String, PathBuf, PathBuf)>,
    /// Geometry of the room as PLY; without it a COLMAP model's points, or nothing.
    #[arg(long, value_name = "FILE")]
    geometry: Option<PathBuf>,
    /// Metres by which cameras and geometry are moved, for frames far from their origin, such as UTM.
    #[arg(long, value_name = "X,Y,Z", value_parser = shift, allow_hyphen_values = true, default_value = "0,0,0")]
    shift: DVec3,
    /// The room directory to make.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

fn camera(text: &str) -> Result<(String, PathBuf, PathBuf), String> {
    text.split_once('=')
        .and_then(|(name, files)| Some((name, files.split_once(',')?)))
        .filter(|(name, (lens, pose))| ![name, lens, pose].iter().any(|part| part.is_empty()))
        .map(|(name, (lens, pose))| (name.to_owned(), lens.into(), pose.into()))
        .ok_or_else(|| "it is not of the form NAME=LENS,POSE, as in door=lens.toml,pose.toml".to_owned())
}

fn shift(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if DVec3::new(x, y, z).is_finite() => Ok(DVec3::new(x, y, z)),
        _ => Err("it is not of the form X,Y,Z in metres, as in -500000,-5400000,0".to_owned()),
    }
}

impl Import {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        let mut cameras = self.model.as_deref().map(exchange::cameras).transpose()?.unwrap_or_default();
        for (name, lens, pose) in &self.camera {
            cameras.push(calib_files::camera(name, lens, pose)?);
        }
        let shift = nalgebra::Translation3::new(self.shift.x, self.shift.y, self.shift.z);
        for camera in &mut cameras {
            camera.camera.camera_from_world *= shift.inverse();
        }
        let eyes: Vec<_> = cameras.iter().map(|c| vec3_from_point(&c.camera.center())).collect();
        let geometry = match (&self.geometry, &self.model) {
            (Some(file), _) => Some(ply::read_seen_from(file, &eyes, self.shift)?),
            (None, Some(model)) => exchange::points(model, &eyes, self.shift)?,
            (None, None) => None,
        };
        anyhow::ensure!(
            !self.out.join(SCENE_FILE).exists(),
            "{}: --out: there is a room already; name a new directory",
            self.out.display()
        );
        anyhow::ensure!(
            geometry.is_none() || !self.out.join(GEOMETRY_FILE).exists(),
            "{}: --out: a {GEOMETRY_FILE} of no room stands there and would be lost; name a new directory",
            self.out.display()
        );
        let of_cameras = self.camera.iter().flat_map(|(_, lens, pose)| [lens, pose]);
        let inputs = self.model.iter().chain(&self.geometry).chain(of_cameras);
        Outputs::new([self.out.as_path()]).refuse(inputs)?;
        Ok(Room { cameras, geometry, ..Room::default() }.write(&self.out)?)
    }
}
