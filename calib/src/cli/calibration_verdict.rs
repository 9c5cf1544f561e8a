//! Verdict on a calibration: whether the lens model fits the boards, has a ray for every pixel, and is borne out by boards
//! all over the picture.

use std::path::Path;

use anyhow::bail;
use image::{Rgb, RgbImage};
use nalgebra::Point2;

use crate::LensModel;
use crate::ray_uncertainty::RayUncertainty;
use crate::vision::chessboard::{CORNER_SIGMA_PX, Calibration};

/// Residual that is many times what corners are found to, pixels rms.
const BAD_RMS_PX: f64 = 10.0 * CORNER_SIGMA_PX;
/// Uncertainty of a ray from which on the boards do not bear out the lens there, pixels.
const UNCERTAIN_PX: f64 = 5.0;
/// Points of the picture at which rays are looked at, across and down; odd, so that there is a middle.
const GRID: (u32, u32) = (33, 25);

/// Advice to try the other models of wide lenses.
fn other_models(model: LensModel) -> String {
    let wide = LensModel::ALL.into_iter().filter(|other| !other.is_default() && *other != model);
    format!("try {}", wide.map(|other| format!("--model {other}")).collect::<Vec<_>>().join(" or "))
}

/// Judgement of a calibration by its views: the uncertainty of rays over the picture.
pub(super) struct CalibrationVerdict {
    /// Pixels of the grid, and the standard deviations of their rays in pixels.
    rays: Vec<(Point2<f64>, Option<f64>)>,
    /// Whether the uncertainty could be computed.
    is_known: bool,
}

impl CalibrationVerdict {
    pub(super) fn of(found: &Calibration) -> Self {
        let k = &found.intrinsics;
        let (columns, rows) = GRID;
        if let Some(uncertainty) = RayUncertainty::of(k, &found.views, CORNER_SIGMA_PX) {
            return Self { rays: uncertainty.over_picture(columns, rows), is_known: true };
        }
        let pixel = |i: u32| {
            let part =
                |i: u32, count: u32, side: u32| f64::from(i) / f64::from(count - 1) * (f64::from(side) - 1.0);
            Point2::new(part(i % columns, columns, k.width), part(i / columns, rows, k.height))
        };
        let sigma = |pixel: &Point2<f64>| k.unproject(pixel).map(|_| f64::NAN);
        let rays = (0..columns * rows).map(pixel).map(|pixel| (pixel, sigma(&pixel)));
        Self { rays: rays.collect(), is_known: false }
    }

    /// Share of the picture that has no ray, because the lens model folds back on itself, percent.
    fn folded_percent(&self) -> f64 {
        let folded = self.rays.iter().filter(|(_, sigma)| sigma.is_none()).count();
        100.0 * folded as f64 / self.rays.len() as f64
    }

    /// Refuses a lens that the model does not describe: a residual far above the corners' errors, and an image that folds.
    pub(super) fn refuse_wrong_model(&self, found: &Calibration, out: &Path) -> anyhow::Result<()> {
        let folded_percent = self.folded_percent();
        if found.rms_px >= BAD_RMS_PX && folded_percent > 0.0 {
            bail!(
                "{}: the boards do not fit the lens model: the residual is {:.2} px ({:.0} times what corners are found to), and \
                 {folded_percent:.0} % of the picture has no ray, since the model folds; {}, or check --pattern",
                out.display(),
                found.rms_px,
                found.rms_px / CORNER_SIGMA_PX,
                other_models(found.intrinsics.distortion.model())
            );
        }
        Ok(())
    }

    fn at(&self, column: u32, row: u32) -> Option<f64> {
        self.rays.get((row * GRID.0 + column) as usize)?.1
    }

    /// Uncertainty of the rays in the middle, and the largest at the edges and in the corners.
    pub(super) fn rays_line(&self) -> Option<String> {
        if !self.is_known {
            return None;
        }
        let (right, bottom) = (GRID.0 - 1, GRID.1 - 1);
        let largest = |places: [(u32, u32); 4]| {
            let sigmas = places.map(|(column, row)| self.at(column, row));
            let told: Option<Vec<f64>> = sigmas.into_iter().collect();
            told.map_or("none".to_owned(), |told| format!("± {:.2}", told.into_iter().fold(0.0, f64::max)))
        };
        let middle = [(right / 2, bottom / 2); 4];
        let edges = [(0, bottom / 2), (right, bottom / 2), (right / 2, 0), (right / 2, bottom)];
        let corners = [(0, 0), (right, 0), (0, bottom), (right, bottom)];
        Some(format!(
            "{} px in the middle, {} px at the edges, {} px in the corners",
            largest(middle),
            largest(edges),
            largest(corners)
        ))
    }

    /// Warnings about the calibration for the person who is going to use it.
    pub(super) fn warnings(&self, found: &Calibration) -> Vec<String> {
        let mut warnings = Vec::new();
        if found.rms_px >= BAD_RMS_PX {
            warnings.push(format!(
                "the residual of {:.2} px is {:.0} times what corners are found to: the lens does not fit the model ({}; \
                 a zoom that moved?), or the board is bent or blurred",
                found.rms_px,
                found.rms_px / CORNER_SIGMA_PX,
                other_models(found.intrinsics.distortion.model())
            ));
        }
        let folded_percent = self.folded_percent();
        if folded_percent > 0.0 {
            warnings.push(format!(
                "{folded_percent:.1} % of the picture has no ray, since the lens model folds there; film the board there as well"
            ));
        }
        let uncertain =
            self.rays.iter().filter(|(_, sigma)| sigma.is_some_and(|s| s >= UNCERTAIN_PX)).count();
        let worst = self.rays.iter().filter_map(|(pixel, sigma)| Some((pixel, (*sigma)?)));
        if let Some((pixel, sigma)) =
            worst.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, s)| *s >= UNCERTAIN_PX)
        {
            warnings.push(format!(
                "the boards cover a part of the picture only: over {:.0} % of it rays are uncertain by {UNCERTAIN_PX:.0} px or \
                 more, by {sigma:.0} px at ({:.0}, {:.0}); film the board there as well",
                100.0 * uncertain as f64 / self.rays.len() as f64,
                pixel.x,
                pixel.y
            ));
        }
        warnings
    }

    /// The picture's area in colours of the rays' uncertainty (dark: below 0.1 px; yellow: 10 px and more; red: no ray),
    /// with the corners that were found in white.
    pub(super) fn picture(&self, found: &Calibration) -> anyhow::Result<RgbImage> {
        let k = &found.intrinsics;
        if !self.is_known {
            bail!("--uncertainty: the views do not tell it; film the board in more places");
        }
        let (columns, rows) = GRID;
        let mut picture = RgbImage::from_fn(k.width, k.height, |x, y| {
            let near = |at: u32, side: u32, count: u32| {
                let steps = f64::from(count - 1) * f64::from(at) / f64::from(side.max(2) - 1);
                (steps.round() as u32).min(count - 1)
            };
            match self.at(near(x, k.width, columns), near(y, k.height, rows)) {
                None => Rgb([200, 30, 30]),
                Some(sigma) => {
                    let part = sigma.max(1e-3).log10().midpoint(1.0).clamp(0.0, 1.0);
                    let mix = |from: f64, to: f64| (from + part * (to - from)).round() as u8;
                    Rgb([mix(20.0, 250.0), mix(30.0, 220.0), mix(80.0, 60.0)])
                }
            }
        });
        for (_, pixel) in found.views.iter().flat_map(|view| &view.corners) {
            let (x, y) = (pixel.x.round() as i64, pixel.y.round() as i64);
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                if let (Ok(x), Ok(y)) = (u32::try_from(x + dx), u32::try_from(y + dy))
                    && x < k.width
                    && y < k.height
                {
                    picture.put_pixel(x, y, Rgb([255; 3]));
                }
            }
        }
        Ok(picture)
    }
}
