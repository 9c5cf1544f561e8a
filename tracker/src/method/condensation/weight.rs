//! Two-dimensional weight of a hypothesis in each camera (equation 9): the mean of N·E over its contour.

use glam::Vec3A;
use nalgebra::Vector3;

use super::contour::{HeadCamera, HeadShape, POINTS};
use super::edges::EdgeImage;
use super::integration::{CameraWeight, CameraWeights, Integration, RayTest};
use super::options::EdgeOptions;
use crate::prepared_room::PreparedCamera;

/// Distance in front of a head at which a static surface hides it, metres: half of a head and the room's own errors.
const HIDES_M: f64 = 0.2;

/// Least share of change inside a head's contour; below it the camera sees the empty scene.
const DENIED_BELOW: f32 = 0.3;

/// Distance of two contours' centres, in half heights of a head, below which they are the same.
const SAME_CONTOUR: f32 = 0.75;

/// Cameras and head model: everything that weights depend on besides pictures.
#[derive(Debug, Clone)]
pub struct HeadWeights {
    cameras: Vec<HeadCamera>,
    dark_heads_only: bool,
    integration: Integration,
    rays: RayTest,
    beta: f32,
    seen_at: f32,
}

/// Input of the weighing of hypotheses.
#[derive(Debug, Clone, Copy)]
pub struct WeighingInput<'a> {
    /// Cameras and head model.
    pub head_weights: &'a HeadWeights,
    /// The same cameras with the static room.
    pub cameras: &'a [PreparedCamera],
    /// Edges of the moment; `None` for cameras without a usable picture.
    pub edges: &'a [Option<EdgeImage>],
    /// Expected heads of all tracks.
    pub everybody: &'a [ExpectedHead],
    /// Power of the integrated weight.
    pub sharpness: f64,
}

/// Expected head of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpectedHead {
    /// Its centre, metres.
    pub head: Vector3<f64>,
    /// Agreement of the cameras on it lately, 0 to 1.
    pub trust: f32,
}

/// Agreement of the cameras on a head.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HeadSupport {
    /// √(π₁ π₂) of the two cameras with the largest product, among pairs whose rays are not collinear.
    pub pair: f32,
    /// Root of the mean of π₁ π₂ over all such pairs of cameras that see it, or see the empty scene instead.
    pub all: f32,
    /// Number of cameras that see the head.
    pub seeing: u32,
    /// Number of cameras that should see it past the room, and see the empty scene there.
    pub denying: u32,
}

impl HeadSupport {
    /// Whether the head is seen: two cameras agree on it, and no more see the empty scene than see it.
    pub fn is_seen(&self, seen_at: f64) -> bool {
        f64::from(self.pair) >= seen_at && self.denying <= self.seeing
    }

    /// Whether the contours of two heads may meet here by chance: only two cameras see a head, and another one sees the
    /// empty scene. Three rays hardly meet by chance.
    pub fn is_doubtful(&self) -> bool {
        self.seeing < 3 && self.denying > 0
    }
}

impl HeadWeights {
    /// Weights for these cameras.
    pub fn new(
        cameras: &[PreparedCamera],
        shape: &HeadShape,
        edges: &EdgeOptions,
        integration: Integration,
        (rays, beta): (RayTest, f64),
        seen_at: f64,
    ) -> Self {
        Self {
            cameras: cameras.iter().map(|c| HeadCamera::new(c, shape)).collect(),
            dark_heads_only: edges.dark_heads_only,
            integration,
            rays,
            beta: beta as f32,
            seen_at: seen_at as f32,
        }
    }

    /// Computes every camera's weight of a head at each place into `weights_by_camera`: for cameras with a picture and the place in
    /// their image and, for [`Integration::Room`], only if the static room does not hide it.
    pub fn weigh_in_cameras(
        &self,
        heads: &[Vector3<f64>],
        prepared: &[PreparedCamera],
        edges: &[Option<EdgeImage>],
        weights_by_camera: &mut [CameraWeights],
    ) {
        weights_by_camera.iter_mut().for_each(CameraWeights::clear);
        // Camera by camera, so that its data stay in the cache.
        for ((camera, edges), prepared) in self.cameras.iter().zip(edges).zip(prepared) {
            let Some(edges) = edges else { continue };
            for (head, weights_by_camera) in heads.iter().zip(&mut *weights_by_camera) {
                if self.integration == Integration::Room && is_hidden(prepared, head) {
                    continue;
                }
                let Some(weight) = self.weight(camera, edges, head) else { continue };
                weights_by_camera.push(CameraWeight { weight, ray: ray(camera, head) });
            }
        }
    }

    /// π of one camera, 0 to 1; `None` where most of the contour is outside the image.
    fn weight(&self, camera: &HeadCamera, edges: &EdgeImage, head: &Vector3<f64>) -> Option<f32> {
        let c = camera.contour(head)?;
        let (sum, inside) = edges.along(c.half_height_px(), &c.outline);
        if 2 * inside < POINTS as u32 {
            return None;
        }
        let mean = sum / POINTS as f32;
        // If the changed side is unknown, a contour that is darker inside is as good as one that is brighter: the sign
        // of the sum is ignored. Otherwise a negative sum is no evidence.
        let is_signed = self.dark_heads_only || edges.is_of_change();
        Some(if is_signed { mean.max(0.0) } else { mean.abs() })
    }

    /// The same with another integration.
    #[must_use]
    pub fn with(&self, integration: Integration) -> Self {
        Self { integration, ..self.clone() }
    }

    /// Three-dimensional weight (equations 4 to 7).
    pub fn integrate(&self, weights_by_camera: &CameraWeights) -> f32 {
        weights_by_camera.integrate(self.integration, self.rays, self.beta)
    }

    /// Agreement of the cameras on a head with this trust, by contours that belong to no track with more trust.
    pub fn support(&self, head: &Vector3<f64>, trust: f32, input: &WeighingInput<'_>) -> HeadSupport {
        let mut weights_by_camera = CameraWeights::default();
        let mut support = HeadSupport::default();
        for ((camera, edges), prepared) in self.cameras.iter().zip(input.edges).zip(input.cameras) {
            let Some(edges) = edges else { continue };
            let Some(weight) = self.weight(camera, edges, head) else { continue };
            if weight >= self.seen_at {
                if input.everybody.iter().any(|o| o.trust > trust && is_same_contour(camera, head, &o.head)) {
                    continue;
                }
                support.seeing += 1;
            } else {
                // Unless the camera sees the empty scene, something else hides the head.
                let is_empty = changed(camera, edges, head).is_some_and(|changed| changed < DENIED_BELOW);
                if !is_empty || is_hidden(prepared, head) {
                    continue;
                }
                support.denying += 1;
            }
            weights_by_camera.push(CameraWeight { weight, ray: ray(camera, head) });
        }
        let (best, mean) = weights_by_camera.pairs(self.rays, self.beta);
        HeadSupport { pair: best.max(0.0).sqrt(), all: mean.max(0.0).sqrt(), ..support }
    }
}

/// Unit vector from a camera to a head.
fn ray(camera: &HeadCamera, head: &Vector3<f64>) -> [f32; 3] {
    let ray = head - camera.center.coords;
    Vec3A::new(ray.x as f32, ray.y as f32, ray.z as f32).normalize().to_array()
}

/// Whether two heads have about the same contour in a camera.
fn is_same_contour(camera: &HeadCamera, head: &Vector3<f64>, other: &Vector3<f64>) -> bool {
    let contours = (camera.contour(head), camera.contour(other));
    let (Some(own), Some(theirs)) = contours else { return false };
    let apart_px = (own.middle[0] - theirs.middle[0]).hypot(own.middle[1] - theirs.middle[1]);
    apart_px < SAME_CONTOUR * theirs.half_height_px()
}

/// Share of a head's inside that differs from the empty scene.
fn changed(camera: &HeadCamera, edges: &EdgeImage, head: &Vector3<f64>) -> Option<f32> {
    let c = camera.contour(head)?;
    let [mu, mv] = c.middle;
    let half_way = |i: usize| [0.5 * (c.outline.u[i] + mu), 0.5 * (c.outline.v[i] + mv)];
    edges.changed((0..POINTS).step_by(2).map(half_way))
}

/// Whether the static room hides a head from a camera; false outside the image.
pub fn is_hidden(camera: &PreparedCamera, head: &Vector3<f64>) -> bool {
    let seen = camera.pinhole.camera_from_world * nalgebra::Point3::from(*head);
    let Some(pixel) = camera.pinhole.intrinsics.project(&seen) else { return false };
    let (u, v) = (pixel.x.round(), pixel.y.round());
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    if !(u >= 0.0 && v >= 0.0 && u < width && v < height) {
        return false;
    }
    f64::from(camera.static_z_m[v as usize * camera.width() as usize + u as usize]) < seen.z - HIDES_M
}
