//! Lenses of `transforms.json`: of a frame, or once for all.

use calib::{Distortion, Intrinsics, LensModel};
use serde::Deserialize;

use crate::exchange::{CORNER_PX, Pictures};

/// Camera models that ours covers; distortion that a model does not have is zero in the file.
const MODELS: [&str; 6] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", FISHEYE];
/// OpenCV's fisheye, of which `k1` to `k4` are the numbers.
pub(super) const FISHEYE: &str = "OPENCV_FISHEYE";

#[derive(Deserialize, Clone)]
pub(super) struct LensInput {
    camera_model: Option<String>,
    /// k1, k2, k3, k4, p1 and p2, which nerfstudio prefers to the single numbers.
    distortion_params: Option<Vec<f64>>,
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    /// Angle of view across the picture, radians, in place of `fl_x`…
    camera_angle_x: Option<f64>,
    /// …and down it.
    camera_angle_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
}

impl LensInput {
    /// Fills missing numbers with those given for all frames.
    pub(super) fn or(self, all: Self) -> Self {
        // A frame's own coefficients outweigh the parameters for all frames.
        let states_distortion =
            self.distortion_params.is_some() || self.distortion().iter().any(Option::is_some);
        // So does a frame's own focal length the angle for all frames, and the other way round.
        let states_focal = [self.fl_x, self.camera_angle_x].iter().any(Option::is_some);
        let shared = |value: Option<f64>| value.filter(|_| !states_focal);
        Self {
            camera_model: self.camera_model.or(all.camera_model),
            distortion_params: if states_distortion { self.distortion_params } else { all.distortion_params },
            w: self.w.or(all.w),
            h: self.h.or(all.h),
            fl_x: self.fl_x.or(shared(all.fl_x)),
            fl_y: self.fl_y.or(shared(all.fl_y)),
            camera_angle_x: self.camera_angle_x.or(shared(all.camera_angle_x)),
            camera_angle_y: self.camera_angle_y.or(shared(all.camera_angle_y)),
            cx: self.cx.or(all.cx),
            cy: self.cy.or(all.cy),
            k1: self.k1.or(all.k1),
            k2: self.k2.or(all.k2),
            p1: self.p1.or(all.p1),
            p2: self.p2.or(all.p2),
            k3: self.k3.or(all.k3),
            k4: self.k4.or(all.k4),
        }
    }

    /// k1, k2, k3, k4, p1 and p2, where they stand on their own.
    fn distortion(&self) -> [Option<f64>; 6] {
        [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2]
    }

    /// Width and height, from the file or else from the picture itself.
    fn size(&self, picture: &str, pictures: &Pictures) -> Result<(u32, u32), String> {
        let side = |pixels: f64, key: &str| {
            let is_whole = pixels >= 1.0 && pixels <= f64::from(u32::MAX) && pixels.fract() == 0.0;
            if is_whole { Ok(pixels as u32) } else { Err(format!("`{key}` is {pixels}, no image's side")) }
        };
        match (self.w, self.h) {
            (Some(w), Some(h)) => Ok((side(w, "w")?, side(h, "h")?)),
            (w, _) => {
                let missing = if w.is_none() { "w" } else { "h" };
                let file = pictures.find(picture).ok_or_else(|| {
                    format!(
                        "`{missing}` is missing, and there is no picture to measure; name the pictures' folder with --images"
                    )
                })?;
                calib::picture::size(&file).map_err(|e| format!("`{missing}` is missing, and {e}"))
            }
        }
    }

    /// Focal lengths, pixels, as such or as angles of view.
    fn focal_lengths(&self, width: u32, height: u32) -> Result<(f64, f64), String> {
        let of_angle = |angle: Option<f64>, side: u32, key: &str| match angle {
            Some(rad) if rad > 0.0 && rad < std::f64::consts::PI => {
                Ok(Some(0.5 * f64::from(side) / (0.5 * rad).tan()))
            }
            Some(rad) => Err(format!("`{key}` is {rad}; it is an angle of view in radians, from 0 to 3.14")),
            None => Ok(None),
        };
        if let Some(fx) = self.fl_x {
            return Ok((fx, self.fl_y.unwrap_or(fx)));
        }
        let across = of_angle(self.camera_angle_x, width, "camera_angle_x")?;
        let down = of_angle(self.camera_angle_y, height, "camera_angle_y")?;
        match (across, self.fl_y.or(down)) {
            (Some(fx), fy) => Ok((fx, fy.unwrap_or(fx))),
            (None, _) => Err("`fl_x` is missing, and so is `camera_angle_x`".into()),
        }
    }

    pub(super) fn intrinsics(self, picture: &str, pictures: &Pictures) -> Result<Intrinsics, String> {
        if let Some(model) = self.camera_model.as_deref().filter(|m| !MODELS.contains(m)) {
            return Err(format!("the `camera_model` {model} is not known here; undistort the pictures"));
        }
        let [k1, k2, k3, k4, p1, p2] = match self.distortion_params.as_deref() {
            Some(params) => <[f64; 6]>::try_from(params).map_err(|_| {
                format!(
                    "`distortion_params` holds {} numbers; they are k1, k2, k3, k4, p1 and p2",
                    params.len()
                )
            })?,
            None => self.distortion().map(|k| k.unwrap_or(0.0)),
        };
        let is_fisheye = self.camera_model.as_deref() == Some(FISHEYE);
        let distortion = if is_fisheye {
            if let Some((key, _)) = [("p1", p1), ("p2", p2)].into_iter().find(|(_, value)| *value != 0.0) {
                return Err(format!("`{key}` is not known here for a fisheye; undistort the pictures"));
            }
            Distortion::new(LensModel::Fisheye, &[k1, k2, k3, k4])?
        } else if k4 != 0.0 {
            return Err("`k4` is not known here; undistort the pictures".into());
        } else {
            [k1, k2, p1, p2, k3].into()
        };
        if is_fisheye && self.fl_x.is_none() {
            return Err("`fl_x` is missing; an angle of view does not tell it of a fisheye".into());
        }
        let (width, height) = self.size(picture, pictures)?;
        let (fx, fy) = self.focal_lengths(width, height)?;
        // Files with an angle of view need no principal point: it is the middle.
        let center = |value: Option<f64>, side: u32, key: &str| match value {
            Some(pixels) => Ok(pixels),
            None if self.fl_x.is_none() => Ok(0.5 * f64::from(side)),
            None => Err(format!("`{key}` is missing")),
        };
        let (cx, cy) = (center(self.cx, width, "cx")?, center(self.cy, height, "cy")?);
        let intrinsics =
            Intrinsics { width, height, fx, fy, cx: cx - CORNER_PX, cy: cy - CORNER_PX, distortion };
        intrinsics.validate().map_err(|e| e.to_string())?;
        Ok(intrinsics)
    }
}
