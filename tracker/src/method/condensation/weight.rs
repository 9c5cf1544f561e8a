//! The two-dimensional weight of a hypothesis in each camera (equation 9): the mean of N·E over its contour.

use glam::Vec3A;
use nalgebra::Vector3;

use super::contour::{HeadCamera, HeadShape, POINTS};
use super::edges::EdgeImage;
use super::integration::{Integration, Look, Looks, RayTest};
use super::options::EdgeOptions;
use crate::stage::StageCamera;

/// This much in front of a head, a static surface hides it, metres: half of a head and the room's own errors.
const HIDES_M: f64 = 0.2;

/// A camera sees nobody where less than this share of a head is not as in the empty scene.
const DENIED_BELOW: f32 = 0.3;

/// Contours whose middles are nearer than this share of a head's half height are one.
const SAME_CONTOUR: f32 = 0.75;

/// The cameras and the model: what weights depend on besides pictures.
#[derive(Debug, Clone)]
pub struct Lookout {
    cameras: Vec<HeadCamera>,
    dark_heads_only: bool,
    integration: Integration,
    rays: RayTest,
    beta: f32,
    seen_at: f32,
}

/// What hypotheses are weighed with.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    /// Cameras and model.
    pub lookout: &'a Lookout,
    /// The same cameras with the static room.
    pub stage: &'a [StageCamera],
    /// The moment's edges; `None` for cameras that say nothing.
    pub edges: &'a [Option<EdgeImage>],
    /// Where everybody's head is expected.
    pub everybody: &'a [Expected],
    /// The power of the integrated weight.
    pub sharpness: f64,
}

/// Where somebody's head is expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Its middle.
    pub head: Vector3<f64>,
    /// How well cameras have agreed on it lately, 0 to 1.
    pub trust: f32,
}

/// How well the cameras agree on a head.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Support {
    /// √(π₁ π₂) of the two cameras that see it best among those whose rays to it are no line.
    pub pair: f32,
    /// The root of the mean of π₁ π₂ over all such pairs of cameras that see it or see the empty scene instead.
    pub all: f32,
    /// Cameras that see the head.
    pub seeing: u32,
    /// Cameras that should see it past the room, and see the empty scene there.
    pub denying: u32,
}

impl Support {
    /// Whether the head is seen at all: two cameras agree on it, and no more deny it than see it.
    pub fn is_seen(&self, seen_at: f64) -> bool {
        f64::from(self.pair) >= seen_at && self.denying <= self.seeing
    }

    /// Whether this may be a place where the contours of two heads meet by chance: two cameras see a head, and another that
    /// should sees nobody. Three rays hardly meet by chance.
    pub fn is_doubtful(&self) -> bool {
        self.seeing < 3 && self.denying > 0
    }
}

impl Lookout {
    /// For these cameras.
    pub fn new(
        cameras: &[StageCamera],
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

    /// Every camera's weight of a head at each of some places, into `looks`: of the cameras that have a picture now and the
    /// place in their image, and for [`Integration::Room`] only of those that the static room leaves a view of it.
    pub fn look(
        &self,
        heads: &[Vector3<f64>],
        stage: &[StageCamera],
        edges: &[Option<EdgeImage>],
        looks: &mut [Looks],
    ) {
        looks.iter_mut().for_each(Looks::clear);
        // Camera by camera: what one of them sees of a person fits the cache.
        for ((camera, edges), stage) in self.cameras.iter().zip(edges).zip(stage) {
            let Some(edges) = edges else { continue };
            for (head, looks) in heads.iter().zip(&mut *looks) {
                if self.integration == Integration::Room && is_hidden(stage, head) {
                    continue;
                }
                let Some(weight) = self.weight(camera, edges, head) else { continue };
                looks.push(Look { weight, ray: ray(camera, head) });
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
        // Where it is not known which side has changed, a contour that is all darker inside is as good as one that is all
        // brighter: a sum without sign. Otherwise a negative sum is no evidence.
        let is_signed = self.dark_heads_only || edges.is_of_change();
        Some(if is_signed { mean.max(0.0) } else { mean.abs() })
    }

    /// The same with another integration.
    #[must_use]
    pub fn with(&self, integration: Integration) -> Self {
        Self { integration, ..self.clone() }
    }

    /// The three-dimensional weight (equations 4 to 7).
    pub fn integrate(&self, looks: &Looks) -> f32 {
        looks.integrate(self.integration, self.rays, self.beta)
    }

    /// How well the cameras agree on a head that is trusted so much, by contours that belong to nobody trusted more.
    pub fn support(&self, head: &Vector3<f64>, trust: f32, sight: &Sight<'_>) -> Support {
        let mut looks = Looks::default();
        let mut support = Support::default();
        for ((camera, edges), stage) in self.cameras.iter().zip(sight.edges).zip(sight.stage) {
            let Some(edges) = edges else { continue };
            let Some(weight) = self.weight(camera, edges, head) else { continue };
            if weight >= self.seen_at {
                if sight.everybody.iter().any(|o| o.trust > trust && is_same_contour(camera, head, &o.head)) {
                    continue;
                }
                support.seeing += 1;
            } else {
                // Something that is no head hides it, unless the camera sees the empty scene.
                let is_empty = changed(camera, edges, head).is_some_and(|changed| changed < DENIED_BELOW);
                if !is_empty || is_hidden(stage, head) {
                    continue;
                }
                support.denying += 1;
            }
            looks.push(Look { weight, ray: ray(camera, head) });
        }
        let (best, mean) = looks.pairs(self.rays, self.beta);
        Support { pair: best.max(0.0).sqrt(), all: mean.max(0.0).sqrt(), ..support }
    }
}

/// From a camera to a head, of length 1.
fn ray(camera: &HeadCamera, head: &Vector3<f64>) -> [f32; 3] {
    let ray = head - camera.center.coords;
    Vec3A::new(ray.x as f32, ray.y as f32, ray.z as f32).normalize().to_array()
}

/// Whether two heads would have about the same contour in a camera.
fn is_same_contour(camera: &HeadCamera, head: &Vector3<f64>, other: &Vector3<f64>) -> bool {
    let contours = (camera.contour(head), camera.contour(other));
    let (Some(own), Some(theirs)) = contours else { return false };
    let apart_px = (own.middle[0] - theirs.middle[0]).hypot(own.middle[1] - theirs.middle[1]);
    apart_px < SAME_CONTOUR * theirs.half_height_px()
}

/// The share of a head's inside that is not as in the empty scene.
fn changed(camera: &HeadCamera, edges: &EdgeImage, head: &Vector3<f64>) -> Option<f32> {
    let c = camera.contour(head)?;
    let [mu, mv] = c.middle;
    let half_way = |i: usize| [0.5 * (c.outline.u[i] + mu), 0.5 * (c.outline.v[i] + mv)];
    edges.changed((0..POINTS).step_by(2).map(half_way))
}

/// Whether the static room hides a head from a camera; not so outside the image.
pub fn is_hidden(camera: &StageCamera, head: &Vector3<f64>) -> bool {
    let seen = camera.pinhole.camera_from_world * nalgebra::Point3::from(*head);
    let Some(pixel) = camera.pinhole.intrinsics.project(&seen) else { return false };
    let (u, v) = (pixel.x.round(), pixel.y.round());
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    if !(u >= 0.0 && v >= 0.0 && u < width && v < height) {
        return false;
    }
    f64::from(camera.static_z_m[v as usize * camera.width() as usize + u as usize]) < seen.z - HIDES_M
}
