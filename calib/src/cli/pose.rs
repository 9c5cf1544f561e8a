//! `calib pose`: where a camera stands, from known points and their pixels.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use calib::files::{read_intrinsics, rows_of_matrix, write_atomic};
use calib::resection::{Pick, resect};
use clap::Args;
use image::Rgb;
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// Estimate a camera's pose from known points and their pixels.
#[derive(Args)]
#[command(after_help = "\
picks.csv has a header and a line a point: metres in the world, then the pixel (0 0 is the top-left pixel's centre).

  x,y,z,u,v
  0.00,0.00,0.00,312.5,407.0
  1.20,0.00,0.00,455.1,398.2

6 points in space or 4 on a plane suffice; more are better.

Example:
  calib pose --intrinsics cam1.toml --picks picks.csv --out pose.toml --image reference.jpg --picture check.png")]
pub(crate) struct Pose {
    /// The camera, as `calib intrinsics` writes it
    #[arg(long, value_name = "FILE")]
    intrinsics: PathBuf,
    /// Known points and their pixels
    #[arg(long, value_name = "FILE")]
    picks: PathBuf,
    /// Where to write the pose: `rotation` and `translation` (world to camera) as `scene.toml` has them
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// The image that the pixels were picked in, for --picture
    #[arg(long, value_name = "FILE", requires = "picture")]
    image: Option<PathBuf>,
    /// Where to draw the picks (green) and the projections of their points (red)
    #[arg(long, value_name = "FILE", requires = "image")]
    picture: Option<PathBuf>,
}

#[derive(Deserialize)]
struct Row {
    x: f64,
    y: f64,
    z: f64,
    u: f64,
    v: f64,
}

#[derive(Serialize)]
struct PoseFile {
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    rms_px: f64,
}

impl Pose {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        let intrinsics = read_intrinsics(&self.intrinsics)?;
        let picks = read_picks(&self.picks)?;
        let found = resect(&intrinsics, &picks).with_context(|| self.picks.display().to_string())?;
        let pose = &found.camera.camera_from_world;
        let file = PoseFile {
            rotation: rows_of_matrix(pose.rotation.to_rotation_matrix().matrix()),
            translation: pose.translation.vector.into(),
            rms_px: found.rms_px(),
        };
        if let (Some(image), Some(picture)) = (&self.image, &self.picture) {
            draw(image, picture, &picks, &found.camera)?;
        }
        write_atomic(&self.out, toml::to_string(&file)?.as_bytes())?;

        let mut out = std::io::stdout().lock();
        for (index, residual) in found.residuals_px.iter().enumerate() {
            writeln!(out, "pick {:2}  {residual:6.2} px", index + 1)?;
        }
        let c = found.camera.center();
        writeln!(
            out,
            "camera   at {:.3} {:.3} {:.3} m; residual {:.2} px rms",
            c.x,
            c.y,
            c.z,
            found.rms_px()
        )?;
        writeln!(out, "written  {}", self.out.display())?;
        Ok(())
    }
}

fn read_picks(path: &Path) -> anyhow::Result<Vec<Pick>> {
    let name = path.display();
    let file = std::fs::File::open(path).with_context(|| name.to_string())?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(file);
    let mut picks = Vec::new();
    for (index, row) in reader.deserialize().enumerate() {
        let row: Row = row.with_context(|| format!("{name}: point {}: expected x,y,z,u,v", index + 1))?;
        picks.push(Pick { world: [row.x, row.y, row.z].into(), pixel: Point2::new(row.u, row.v) });
    }
    if picks.is_empty() {
        bail!("{name}: holds no points; write a header x,y,z,u,v and a line a point");
    }
    Ok(picks)
}

fn draw(image: &Path, picture: &Path, picks: &[Pick], camera: &calib::Camera) -> anyhow::Result<()> {
    let mut canvas = image::open(image)
        .with_context(|| format!("{}: cannot be read as an image", image.display()))?
        .into_rgb8();
    let mut cross = |at: Point2<f64>, color: Rgb<u8>, arm: i64| {
        for step in -arm..=arm {
            for (dx, dy) in [(step, step), (step, -step)] {
                let (x, y) = (at.x.round() as i64 + dx, at.y.round() as i64 + dy);
                if (0..canvas.width() as i64).contains(&x) && (0..canvas.height() as i64).contains(&y) {
                    canvas.put_pixel(x as u32, y as u32, color);
                }
            }
        }
    };
    for pick in picks {
        cross(pick.pixel, Rgb([0, 220, 0]), 6);
        if let Some(projected) = camera.project(&pick.world) {
            cross(projected, Rgb([240, 0, 0]), 3);
        }
    }
    canvas.save(picture).with_context(|| picture.display().to_string())
}
