//! `calib intrinsics`: focal lengths, principal point and distortion from pictures of a chessboard.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, bail};
use calib::vision::chessboard::Chessboard;
use clap::Args;
use image::RgbImage;

/// Estimate a camera's intrinsics from pictures of a chessboard.
#[derive(Args)]
#[command(after_help = "\
Film a printed chessboard that fills a good part of the picture, tilted this way and that, ten times or more, in every
corner of the view. The pattern is counted in inner corners.

Example:
  calib intrinsics board/*.jpg --pattern 9x6 --square 0.025 --out cam1.toml")]
pub(crate) struct Intrinsics {
    /// Pictures of the board, all of one size
    #[arg(required = true)]
    images: Vec<PathBuf>,
    /// Inner corners of the board, columns x rows
    #[arg(long)]
    pattern: Chessboard,
    /// Side of a square, metres
    #[arg(long, value_name = "METRES")]
    square: f64,
    /// Where to write the intrinsics (TOML, as `room.toml` names it)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Where to write the found corners, drawn on each picture
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
}

/// A view whose residual is this many times the median is worth a warning: a blurred or mistaken board.
const OUTLIER_FACTOR: f64 = 3.0;

impl Intrinsics {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        if !(self.square > 0.0 && self.square.is_finite()) {
            bail!("--square {}: a square's side is a positive number of metres", self.square);
        }
        let mut out = std::io::stdout().lock();
        let (mut views, mut names, mut size) = (Vec::new(), Vec::new(), None);
        for path in &self.images {
            let picture = image::open(path)
                .with_context(|| format!("{}: cannot be read as an image", path.display()))?;
            let picture = picture.into_rgb8();
            let expected = *size.get_or_insert(picture.dimensions());
            if picture.dimensions() != expected {
                let (w, h) = picture.dimensions();
                bail!(
                    "{}: is {w} × {h}, the pictures before it are {} × {}",
                    path.display(),
                    expected.0,
                    expected.1
                );
            }
            match self.pattern.find(&image::imageops::grayscale(&picture))? {
                Some(corners) => {
                    self.draw(path, picture, &corners)?;
                    views.push(corners);
                    names.push(path);
                }
                None => writeln!(
                    out,
                    "{}: the {} board is not seen whole; left out",
                    path.display(),
                    self.pattern
                )?,
            }
        }
        let found = self.pattern.calibrate(&views, size.unwrap_or((0, 0)), self.square)?;
        calib::files::write_intrinsics(&self.out, &found.intrinsics)?;

        let (k, s) = (&found.intrinsics, found.sigma_px);
        let mut sorted = found.view_rms_px.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2];
        for (path, rms) in names.iter().zip(&found.view_rms_px) {
            let note = if *rms > OUTLIER_FACTOR * median {
                "   ← far above the others: blurred or bent? leave it out"
            } else {
                ""
            };
            writeln!(out, "{}: {rms:.3} px{note}", path.display())?;
        }
        writeln!(out, "focal length     {:.2} ± {:.2}, {:.2} ± {:.2} px", k.fx, s[0], k.fy, s[1])?;
        writeln!(out, "principal point  {:.2} ± {:.2}, {:.2} ± {:.2} px", k.cx, s[2], k.cy, s[3])?;
        let [k1, k2, p1, p2, k3] = k.distortion.into();
        writeln!(out, "distortion       k1 {k1:.4}  k2 {k2:.4}  p1 {p1:.5}  p2 {p2:.5}  k3 {k3:.4}")?;
        writeln!(out, "residual         {:.3} px rms over {} views", found.rms_px, views.len())?;
        writeln!(out, "written          {}", self.out.display())?;
        Ok(())
    }

    fn draw(
        &self,
        path: &std::path::Path,
        mut picture: RgbImage,
        corners: &[nalgebra::Point2<f64>],
    ) -> anyhow::Result<()> {
        let Some(folder) = &self.pictures else { return Ok(()) };
        self.pattern.draw(&mut picture, corners)?;
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let target = folder.join(path.file_name().unwrap_or(path.as_os_str())).with_extension("png");
        picture.save(&target).with_context(|| target.display().to_string())
    }
}
