//! `calib pose`: a camera's pose from known points and their pixels.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use image::Rgb;
use nalgebra::Point2;
use serde::Deserialize;
use shell::files::Outputs;
use shell::ranges::{PIXELS, ROOM_M, SIDE_PX};

use crate::files::{read_intrinsics, write_together};
use crate::picture;
use crate::resection::{
    Consensus, Pick, mirrored_world, refuse_mirrored_world, resect_by_consensus, resect_with_lens,
    wrong_from_px,
};

/// Estimate a camera's pose from known points and their pixels.
#[derive(Args)]
#[command(after_help = "\
picks.csv has a header and a line a point: metres in the world, then the pixel (0 0 is the top-left pixel's centre).

  x,y,z,u,v
  0.00,0.00,0.00,312.5,407.0
  1.20,0.00,0.00,455.1,398.2

4 points suffice; more are better, and not all on one plane. Of two poses that fit, the better is taken, and the other is
told of, and picks that do not agree with most others are left out and named. Without --intrinsics 6 points in space and the image's size tell the lens, too, but not its distortion; the file
then holds both, and serves as either.

Examples:
  calib pose --intrinsics cam1.toml --picks picks.csv --out pose.toml --image reference.jpg --picture check.png
  calib pose --size 640x480 --picks picks.csv --out camera.toml")]
pub(crate) struct Pose {
    /// The camera, as `calib intrinsics` writes it; without it the lens is estimated from the picks, too
    #[arg(long, value_name = "FILE")]
    intrinsics: Option<PathBuf>,
    /// Known points and their pixels
    #[arg(long, value_name = "FILE")]
    picks: PathBuf,
    /// File to write the pose to: `rotation` and `translation` (world to camera) as `scene.toml` has them
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// The image that the pixels were picked in: its size is checked, or taken, and --picture draws on it
    #[arg(long, value_name = "FILE")]
    image: Option<PathBuf>,
    /// The size of the image that the pixels were picked in, without --intrinsics and --image
    #[arg(long, value_name = "WxH", value_parser = size, conflicts_with_all = ["intrinsics", "image"])]
    size: Option<(u32, u32)>,
    /// File to draw the picks (green) and the projections of their points (red) to
    #[arg(long, value_name = "FILE", requires = "image")]
    picture: Option<PathBuf>,
}

fn size(text: &str) -> Result<(u32, u32), &'static str> {
    let sides = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let is_side = |side: u32| SIDE_PX.contains(f64::from(side));
    sides
        .filter(|(w, h)| is_side(*w) && is_side(*h))
        .ok_or("a size is width and height, 1 to 20000 pixels each, such as 640x480")
}

#[derive(Deserialize)]
struct PickRow {
    x: f64,
    y: f64,
    z: f64,
    u: f64,
    v: f64,
}

/// The estimated camera, and the uncertainty of its lens where the lens was estimated from the picks, too.
struct PoseEstimate {
    consensus: Consensus,
    lens_sigma_px: Option<[f64; 4]>,
}

impl Pose {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        self.refuse_lost_inputs()?;
        let picks = read_picks(&self.picks)?;
        let found = self.resect(&picks)?;
        let Consensus { resection, wrong } = &found.consensus;
        let camera = &resection.camera;
        let rms_px = found.consensus.rms_px();
        let text = crate::files::pose_text(camera, rms_px, found.lens_sigma_px.is_some())?;
        let picture = match (&self.image, &self.picture) {
            (Some(image), Some(picture)) => Some((picture, draw(image, picture, &picks, camera)?)),
            _ => None,
        };
        let mut files = vec![(self.out.as_path(), text.as_bytes())];
        files.extend(picture.iter().map(|(path, bytes)| (path.as_path(), bytes.as_slice())));
        write_together(&files)?;

        let mut out = shell::console::stdout();
        for (index, residual) in resection.residuals_px.iter().enumerate() {
            let note =
                if wrong.contains(&index) { "   ← does not agree with the others; left out" } else { "" };
            writeln!(out, "pick {:2}  {residual:6.2} px{note}", index + 1)?;
        }
        if let Some(sigma) = found.lens_sigma_px {
            super::print_lens(&mut out, &camera.intrinsics, sigma)?;
        }
        let c = camera.center();
        writeln!(out, "camera   at {:.3} {:.3} {:.3} m; residual {rms_px:.2} px rms", c.x, c.y, c.z)?;
        writeln!(out, "written  {}", self.out.display())?;
        self.warn(camera, rms_px, wrong);
        if let Some(alternative) = &resection.alternative {
            let c = alternative.camera.center();
            tracing::warn!(
                "{}: a camera at {:.3} {:.3} {:.3} m explains the picks almost as well ({:.2} px rms): pick more points, \
                 off the others' plane and nearer to the camera",
                self.picks.display(),
                c.x,
                c.y,
                c.z,
                alternative.rms_px
            );
        }
        Ok(())
    }

    /// Warns of a pose that the picks do not bear out.
    fn warn(&self, camera: &crate::Camera, rms_px: f64, wrong: &[usize]) {
        let (picks, k) = (self.picks.display(), &camera.intrinsics);
        if !wrong.is_empty() {
            let numbers: Vec<String> = wrong.iter().map(|index| (index + 1).to_string()).collect();
            tracing::warn!(
                "{picks}: pick {} does not agree with the others and has no part in the pose; correct it or leave it out",
                numbers.join(" and ")
            );
        }
        let many_px = wrong_from_px(k.width, k.height);
        if rms_px >= many_px {
            tracing::warn!(
                "{picks}: the residual of {rms_px:.1} px is many times what picks are made to (half a pixel): the pose is \
                 not to be trusted; check the points, their order, and the lens"
            );
        }
        if camera.center().z < 0.0 {
            tracing::warn!(
                "{picks}: the camera comes out {:.2} m below z = 0, which is the floor: is the sign of an axis wrong?",
                -camera.center().z
            );
        }
    }

    fn refuse_lost_inputs(&self) -> anyhow::Result<()> {
        let outputs = [Some(&self.out), self.picture.as_ref()].into_iter().flatten().map(PathBuf::as_path);
        let inputs = [Some(&self.picks), self.intrinsics.as_ref(), self.image.as_ref()];
        Ok(Outputs::new(outputs).refuse(inputs.into_iter().flatten())?)
    }

    fn resect(&self, picks: &[Pick]) -> anyhow::Result<PoseEstimate> {
        let shown = match &self.image {
            Some(image) => Some((image, picture::size(image)?)),
            None => None,
        };
        let of_picks = || self.picks.display().to_string();
        let Some(lens) = &self.intrinsics else {
            let size = shown.map(|(_, size)| size).or(self.size);
            let size = size.context(
                "without --intrinsics the image's size is needed: give --size, as in --size 640x480, or the --image itself",
            )?;
            let found = resect_with_lens(size, picks).with_context(of_picks)?;
            let of_mirrored = resect_with_lens(size, &mirrored_world(picks)).ok();
            refuse_mirrored_world(&found.resection, of_mirrored.as_ref().map(|found| &found.resection))
                .with_context(of_picks)?;
            let consensus = Consensus { resection: found.resection, wrong: Vec::new() };
            return Ok(PoseEstimate { consensus, lens_sigma_px: Some(found.sigma_px) });
        };
        let intrinsics = read_intrinsics(lens)?;
        let (width, height) = (intrinsics.width, intrinsics.height);
        if let Some((image, (w, h))) = shown.filter(|(_, size)| *size != (width, height)) {
            bail!(
                "{}: is {w} × {h}, {} is for {width} × {height}; calibrate at the image's size",
                image.display(),
                lens.display()
            );
        }
        let consensus = resect_by_consensus(&intrinsics, picks).with_context(of_picks)?;
        Ok(PoseEstimate { consensus, lens_sigma_px: None })
    }
}

fn read_picks(path: &Path) -> anyhow::Result<Vec<Pick>> {
    let name = path.display();
    let file = std::fs::File::open(path).with_context(|| name.to_string())?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(file);
    let mut picks = Vec::new();
    for (index, row) in reader.deserialize().enumerate() {
        let row: PickRow = row.with_context(|| format!("{name}: point {}: expected x,y,z,u,v", index + 1))?;
        let columns = [
            ("x", row.x, ROOM_M),
            ("y", row.y, ROOM_M),
            ("z", row.z, ROOM_M),
            ("u", row.u, PIXELS),
            ("v", row.v, PIXELS),
        ];
        for (column, value, range) in columns {
            if let Some(problem) = range.defect(value) {
                bail!("{name}: pick {}: {column} {problem}", index + 1);
            }
        }
        picks.push(Pick { world: [row.x, row.y, row.z].into(), pixel: Point2::new(row.u, row.v) });
    }
    if picks.is_empty() {
        bail!("{name}: holds no points; write a header x,y,z,u,v and a line a point");
    }
    Ok(picks)
}

/// The bytes of the drawing.
fn draw(image: &Path, drawing: &Path, picks: &[Pick], camera: &crate::Camera) -> crate::Result<Vec<u8>> {
    let mut canvas = picture::read(image)?.into_rgb8();
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
    picture::encode(drawing, &canvas)
}
