//! Elements of a COLMAP model: lenses, and pictures taken through them.

use calib::{Distortion, Fisheye, Intrinsics, LensModel};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::exchange::CORNER_PX;

/// A lens as the model has it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ModelCamera {
    pub(super) id: u32,
    pub(super) model: &'static CameraModel,
    pub(super) width: u64,
    pub(super) height: u64,
    pub(super) parameters: Vec<f64>,
}

/// A picture and its pose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ModelImage {
    pub(super) id: u64,
    pub(super) name: String,
    pub(super) camera: u32,
    /// Camera from world.
    pub(super) pose: ModelPose,
}

/// A rigid transform as the model has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ModelPose {
    /// w, x, y, z.
    pub(super) rotation: [f64; 4],
    pub(super) translation: [f64; 3],
}

/// A point of the model, without its observations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ModelPoint {
    pub(super) place: [f64; 3],
    pub(super) color: [u8; 3],
}

/// One of COLMAP's camera models.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct CameraModel {
    pub(super) id: i32,
    pub(super) name: &'static str,
    pub(super) parameters: usize,
}

/// All numbered camera models, those of COLMAP 4 included; some are listed only so that an error can name them.
pub(super) static MODELS: [CameraModel; 18] = [
    CameraModel { id: 0, name: "SIMPLE_PINHOLE", parameters: 3 },
    CameraModel { id: 1, name: "PINHOLE", parameters: 4 },
    CameraModel { id: 2, name: "SIMPLE_RADIAL", parameters: 4 },
    CameraModel { id: 3, name: "RADIAL", parameters: 5 },
    CameraModel { id: 4, name: "OPENCV", parameters: 8 },
    CameraModel { id: 5, name: "OPENCV_FISHEYE", parameters: 8 },
    CameraModel { id: 6, name: "FULL_OPENCV", parameters: 12 },
    CameraModel { id: 7, name: "FOV", parameters: 5 },
    CameraModel { id: 8, name: "SIMPLE_RADIAL_FISHEYE", parameters: 4 },
    CameraModel { id: 9, name: "RADIAL_FISHEYE", parameters: 5 },
    CameraModel { id: 10, name: "THIN_PRISM_FISHEYE", parameters: 12 },
    CameraModel { id: 11, name: "RAD_TAN_THIN_PRISM_FISHEYE", parameters: 16 },
    CameraModel { id: 12, name: "SIMPLE_DIVISION", parameters: 4 },
    CameraModel { id: 13, name: "DIVISION", parameters: 5 },
    CameraModel { id: 14, name: "SIMPLE_FISHEYE", parameters: 3 },
    CameraModel { id: 15, name: "FISHEYE", parameters: 4 },
    CameraModel { id: 16, name: "EUCM", parameters: 6 },
    CameraModel { id: 17, name: EQUIRECTANGULAR, parameters: 2 },
];

/// Model of pictures all around, which no pinhole picture holds.
const EQUIRECTANGULAR: &str = "EQUIRECTANGULAR";

/// Defect of a file: the place and the problem.
pub(super) type Defect = (String, String);

/// Fisheye with the first two radial coefficients.
fn fisheye(k1: f64, k2: f64) -> Distortion {
    Fisheye::from([k1, k2, 0.0, 0.0]).into()
}

/// Name of the model of a lens, and the numbers after `fx fy cx cy`: COLMAP has OpenCV's models, in their order.
pub(super) fn written(distortion: &Distortion) -> (&'static str, Vec<f64>) {
    let mut numbers = distortion.coefficients();
    let name = match distortion.model() {
        _ if distortion.is_none() => {
            numbers.clear();
            "PINHOLE"
        }
        LensModel::BrownConrady if numbers[4] == 0.0 => {
            numbers.truncate(4);
            "OPENCV"
        }
        LensModel::BrownConrady => {
            numbers.extend([0.0; 3]);
            "FULL_OPENCV"
        }
        LensModel::Rational => "FULL_OPENCV",
        LensModel::Fisheye => "OPENCV_FISHEYE",
    };
    (name, numbers)
}

impl ModelCamera {
    pub(super) fn intrinsics(&self) -> Result<Intrinsics, String> {
        let p = &self.parameters;
        let (fx, fy, cx, cy, distortion) = match self.model.name {
            "SIMPLE_PINHOLE" => (p[0], p[0], p[1], p[2], Distortion::NONE),
            "PINHOLE" => (p[0], p[1], p[2], p[3], Distortion::NONE),
            "SIMPLE_RADIAL" => (p[0], p[0], p[1], p[2], [p[3], 0.0, 0.0, 0.0, 0.0].into()),
            "RADIAL" => (p[0], p[0], p[1], p[2], [p[3], p[4], 0.0, 0.0, 0.0].into()),
            "OPENCV" => (p[0], p[1], p[2], p[3], [p[4], p[5], p[6], p[7], 0.0].into()),
            "FULL_OPENCV" if p[9..] == [0.0; 3] => {
                (p[0], p[1], p[2], p[3], [p[4], p[5], p[6], p[7], p[8]].into())
            }
            "FULL_OPENCV" => (p[0], p[1], p[2], p[3], Distortion::new(LensModel::Rational, &p[4..])?),
            "OPENCV_FISHEYE" => (p[0], p[1], p[2], p[3], Distortion::new(LensModel::Fisheye, &p[4..])?),
            "SIMPLE_FISHEYE" => (p[0], p[0], p[1], p[2], fisheye(0.0, 0.0)),
            "FISHEYE" => (p[0], p[1], p[2], p[3], fisheye(0.0, 0.0)),
            "SIMPLE_RADIAL_FISHEYE" => (p[0], p[0], p[1], p[2], fisheye(p[3], 0.0)),
            "RADIAL_FISHEYE" => (p[0], p[0], p[1], p[2], fisheye(p[3], p[4])),
            // Without their bend these are pinholes, too.
            "SIMPLE_DIVISION" if p[3] == 0.0 => (p[0], p[0], p[1], p[2], Distortion::NONE),
            "DIVISION" | "FOV" | "EUCM" if p[4] == 0.0 => (p[0], p[1], p[2], p[3], Distortion::NONE),
            EQUIRECTANGULAR => {
                return Err(format!(
                    "the model {EQUIRECTANGULAR} is not known here; cut the pictures into perspective ones before"
                ));
            }
            name => {
                return Err(format!(
                    "the model {name} is not known here; make pinhole pictures with `colmap image_undistorter`"
                ));
            }
        };
        let side =
            |pixels: u64| u32::try_from(pixels).map_err(|_| format!("{pixels} pixels are no image's side"));
        let (width, height) = (side(self.width)?, side(self.height)?);
        let (cx, cy) = (cx - CORNER_PX, cy - CORNER_PX);
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy, distortion };
        intrinsics.validate().map_err(|e| e.to_string())?;
        Ok(intrinsics)
    }
}

impl ModelPose {
    pub(super) const IDENTITY: Self = Self { rotation: [1.0, 0.0, 0.0, 0.0], translation: [0.0; 3] };

    pub(super) fn of_numbers([w, x, y, z, tx, ty, tz]: [f64; 7]) -> Self {
        Self { rotation: [w, x, y, z], translation: [tx, ty, tz] }
    }

    pub(super) fn isometry(&self) -> Result<Isometry3<f64>, String> {
        let [w, x, y, z] = self.rotation;
        let quaternion = Quaternion::new(w, x, y, z);
        if !((quaternion.norm() - 1.0).abs() < 1e-3 && self.translation.iter().all(|t| t.is_finite())) {
            return Err("its pose is no rotation (a quaternion of length 1) and finite translation".into());
        }
        Ok(Isometry3::from_parts(
            Translation3::from(self.translation),
            UnitQuaternion::from_quaternion(quaternion),
        ))
    }
}
