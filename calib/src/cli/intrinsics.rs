//! `calib intrinsics`: focal lengths, principal point and distortion from pictures of a chessboard.

use std::collections::HashSet;
use std::io::Write;
use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use shell::files::Outputs;
use shell::ranges::SIZE_M;

use super::calibration_verdict::CalibrationVerdict;
use crate::vision::chessboard::Chessboard;
use crate::{Distortion, LensModel, picture};

/// Estimate a camera's intrinsics from pictures of a chessboard.
#[derive(Args)]
#[command(after_help = "\
Film a printed chessboard that fills a good part of the picture, tilted this way and that, ten times or more, in every
corner of the view. The pattern is counted in inner corners.

Examples:
  calib intrinsics board/*.jpg --pattern 9x6 --square 0.025 --out cam1.toml
  calib intrinsics board/*.jpg --pattern 9x6 --square 0.025 --model fisheye --out cam2.toml")]
pub(crate) struct Intrinsics {
    /// Pictures of the board, all of one size
    #[arg(required = true)]
    images: Vec<PathBuf>,
    /// Inner corners of the board, columns x rows
    #[arg(long)]
    pattern: Chessboard,
    /// Side of a square, metres
    #[arg(long, value_name = "METRES", value_parser = SIZE_M.number())]
    square: f64,
    /// Model of the lens: `rational` for wide angles that brown-conrady does not fit, `fisheye` from about 120° on
    #[arg(long, value_name = "NAME", default_value_t)]
    model: LensModel,
    /// File to write the intrinsics to (TOML, as `room.toml` names it)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Folder to write the found corners to, drawn on each picture: the second of a name gets a number
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// File to draw the uncertainty of each ray to, with the corners that were found
    #[arg(long, value_name = "FILE")]
    uncertainty: Option<PathBuf>,
}

/// Factor over the median residual from which on a view is warned of: a blurred or mistaken board.
const OUTLIER_FACTOR: f64 = 3.0;

/// The coefficients by name; those of the tangential part, which are smaller, with one digit more.
fn distortion_line(distortion: &Distortion) -> String {
    let names = distortion.model().coefficient_names();
    let named = names.iter().zip(distortion.coefficients()).map(|(name, value)| {
        let digits = if name.starts_with('p') { 5 } else { 4 };
        format!("{name} {value:.digits$}")
    });
    format!("distortion       {}", named.collect::<Vec<_>>().join("  "))
}

impl Intrinsics {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        let drawings = self.drawings();
        let outputs = drawings.iter().chain([&self.out]).chain(&self.uncertainty).map(PathBuf::as_path);
        Outputs::new(outputs).refuse(&self.images)?;
        let mut out = shell::console::stdout();
        let (mut views, mut names, mut size) = (Vec::new(), Vec::new(), None);
        for (index, path) in self.images.iter().enumerate() {
            let mut picture = picture::read(path)?.into_rgb8();
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
                    if let Some(drawing) = drawings.get(index) {
                        self.pattern.draw(&mut picture, &corners)?;
                        picture::write(drawing, &picture)?;
                    }
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
        let found = self.pattern.calibrate(&views, size.unwrap_or((0, 0)), self.square, self.model)?;
        let verdict = CalibrationVerdict::of(&found);
        verdict.refuse_wrong_model(&found, &self.out)?;
        if let Some(path) = &self.uncertainty {
            picture::write(path, &verdict.picture(&found)?)?;
        }
        crate::files::write_intrinsics(&self.out, &found.intrinsics)?;

        let k = &found.intrinsics;
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
        super::print_lens(&mut out, k, found.sigma_px)?;
        writeln!(out, "{}", distortion_line(&k.distortion))?;
        writeln!(out, "residual         {:.3} px rms over {} views", found.rms_px, views.len())?;
        if let Some(line) = verdict.rays_line() {
            writeln!(out, "rays             {line}")?;
        }
        writeln!(out, "written          {}", self.out.display())?;
        for warning in verdict.warnings(&found) {
            tracing::warn!("{}: {warning}", self.out.display());
        }
        Ok(())
    }

    /// Path of each picture's drawing, named after it, with a number where several have one name; empty without
    /// `--pictures`.
    fn drawings(&self) -> Vec<PathBuf> {
        let Some(folder) = &self.pictures else { return Vec::new() };
        let mut taken = HashSet::new();
        let named = |path: &PathBuf| {
            let stem = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy();
            let mut name = format!("{stem}.png");
            for number in 2.. {
                if taken.insert(name.clone()) {
                    break;
                }
                name = format!("{stem}_{number}.png");
            }
            folder.join(name)
        };
        self.images.iter().map(named).collect()
    }
}
