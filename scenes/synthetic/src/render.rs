//! Pictures of a synthetic room with people in it: one ray a sample through the hierarchy for the room, closed forms
//! for the people's parts, baked light, soft shadows under people, sensor noise and flicker.

use calib::Camera;
use glam::{IVec2, Vec3};
use image::{GrayImage, Luma, RgbImage};
use rayon::prelude::*;

use super::light::Lamps;
use super::person::BodyPart;
use super::room::SyntheticRoom;
use super::shape::Met;
use super::texture::unit;
use scenes::depth::DepthMap;
use scenes::geometry::point_from_vec3;
use scenes::view::RayImage;

/// Options of rendered pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderOptions {
    /// Rays along each side of a pixel.
    pub samples: u32,
    /// Standard deviation of the sensor's noise, of 255.
    pub noise: f32,
    /// Share by which the brightness varies from frame to frame.
    pub flicker: f32,
    /// Soft shadows on the floor under people; they are not part of any mask.
    pub shadows: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { samples: 2, noise: 2.0, flicker: 0.01, shadows: true }
    }
}

impl RenderOptions {
    /// One ray a pixel, no noise, no flicker, no shadows: pictures that differ exactly where a person is visible.
    pub fn exact() -> Self {
        Self { samples: 1, noise: 0.0, flicker: 0.0, shadows: false }
    }
}

/// A camera's view of the empty room.
#[derive(Debug, Clone)]
pub(super) struct StaticView {
    /// Colours are in linear light.
    rays: RayImage,
}

/// A person as seen by one camera: parts with the columns and rows (of the finer grid) that each can touch.
pub(super) struct BodyView {
    parts: Vec<(BodyPart, [usize; 4])>,
    bounds: [usize; 4],
    /// Positions of the feet, for the shadow.
    feet: [Vec3; 2],
    shadow_bounds: [usize; 4],
}

/// Visible person at the centre of each pixel.
pub(super) struct PersonLabels {
    /// 0 for nobody, else one more than the index of the person.
    pub owners: Vec<u16>,
    /// Distance along the ray, people included.
    pub distances: Vec<f32>,
    /// For each person: pixels that would show them if they were alone in an empty world, and those that do.
    pub counts: Vec<(usize, usize)>,
}

impl StaticView {
    pub(super) fn new(room: &SyntheticRoom, camera: &Camera, samples: u32) -> Self {
        let rays = RayImage::cast(camera, samples, Vec3::ZERO, |eye, direction| {
            let hit = room.scene.cast(eye, direction)?;
            let point = eye + direction * hit.distance;
            Some((hit.distance, room.radiance(hit.primitive, point)))
        });
        Self { rays }
    }

    /// Colours of the empty room in linear light.
    pub(super) fn colors(&self) -> Vec<Vec3> {
        self.rays.colors.clone()
    }

    /// A person's parts with the pixels of this picture that they can touch.
    pub(super) fn figure(&self, parts: Vec<BodyPart>) -> BodyView {
        let parts: Vec<(BodyPart, [usize; 4])> = parts
            .into_iter()
            .map(|part| {
                let (center, radius) = part.shape.around();
                (part, self.bounds(center, radius))
            })
            .collect();
        let join =
            |a: [usize; 4], b: [usize; 4]| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])];
        let nothing = [usize::MAX, usize::MAX, 0, 0];
        let bounds =
            parts.iter().filter(|(_, b)| b[0] < b[2] && b[1] < b[3]).fold(nothing, |a, (_, b)| join(a, *b));
        // The last parts of a leg are its foot; both feet's capsules touch the floor.
        let low = |skip: usize| {
            let mut lowest: Vec<Vec3> = parts.iter().map(|(part, _)| part.shape.around().0).collect();
            lowest.sort_by(|a, b| a.z.total_cmp(&b.z));
            lowest.get(skip).copied().unwrap_or_default().with_z(0.0)
        };
        let feet = [low(0), low(1)];
        let middle = 0.5 * (feet[0] + feet[1]);
        BodyView { parts, bounds, feet, shadow_bounds: self.bounds(middle, 1.0) }
    }

    /// Left, top, right, bottom (exclusive) of the pixels that a sphere can touch.
    fn bounds(&self, center: Vec3, radius: f32) -> [usize; 4] {
        /// Factor for the stretching by the lens's distortion.
        const SLACK: f64 = 1.3;
        let world = point_from_vec3(center);
        let in_camera = self.rays.camera.camera_from_world * world;
        let radius = f64::from(radius);
        if in_camera.z < -radius {
            return [0; 4];
        }
        let whole = [0, 0, self.rays.width(), self.rays.height()];
        let Some(pixel) = self.rays.camera.intrinsics.project(&in_camera) else { return whole };
        if in_camera.z < 2.0 * radius {
            return whole;
        }
        let k = &self.rays.camera.intrinsics;
        // Away from the axis a sphere's image is an ellipse, longer by the obliqueness.
        let oblique = in_camera.coords.norm() / in_camera.z;
        let reach = SLACK * oblique * k.fx.max(k.fy) * radius / (in_camera.z - radius) + 1.0;
        let s = f64::from(self.rays.samples);
        let clamp = |v: f64, limit: usize| ((v + 0.5) * s).clamp(0.0, limit as f64) as usize;
        [
            clamp(pixel.x - reach, self.rays.width()),
            clamp(pixel.y - reach, self.rays.height()),
            clamp(pixel.x + reach + 1.0, self.rays.width()),
            clamp(pixel.y + reach + 1.0, self.rays.height()),
        ]
    }

    /// Colours of the room with people in it, in linear light.
    pub(super) fn with_people(&self, lamps: &Lamps, figures: &[BodyView], shadows: bool) -> Vec<Vec3> {
        let width = self.rays.width();
        let mut colors = self.rays.colors.clone();
        colors.par_chunks_exact_mut(width).enumerate().for_each(|(row, line)| {
            for (column, color) in line.iter_mut().enumerate() {
                let i = row * width + column;
                let mut nearest = self.rays.distances[i];
                let mut body = None;
                for figure in figures {
                    if let Some((met, part)) =
                        figure.meet(self.rays.eye, self.rays.directions[i], column, row)
                        && met.distance < nearest
                    {
                        nearest = met.distance;
                        body = Some((met, part));
                    }
                }
                if let Some((met, part)) = body {
                    let point = self.rays.eye + self.rays.directions[i] * met.distance;
                    let albedo = part.material.color(part.shape.place(point)).powf(2.2);
                    *color = albedo * lamps.open(point, met.normal);
                } else if shadows && nearest.is_finite() {
                    let point = self.rays.eye + self.rays.directions[i] * nearest;
                    for figure in figures.iter().filter(|f| within(f.shadow_bounds, column, row)) {
                        *color *= figure.shadow(point);
                    }
                }
            }
        });
        colors
    }

    /// Visible person at each pixel; for views of one ray a pixel.
    pub(super) fn labels(&self, figures: &[BodyView]) -> PersonLabels {
        let width = self.rays.width();
        let rows: Vec<PersonLabels> = (0..self.rays.height())
            .into_par_iter()
            .map(|row| {
                let start = row * width;
                let mut owners = vec![0_u16; width];
                let mut distances = self.rays.distances[start..start + width].to_vec();
                let mut counts = vec![(0, 0); figures.len()];
                for column in 0..width {
                    for (k, figure) in figures.iter().enumerate() {
                        let direction = self.rays.directions[start + column];
                        if let Some((met, _)) = figure.meet(self.rays.eye, direction, column, row) {
                            counts[k].0 += 1;
                            if met.distance < distances[column] {
                                distances[column] = met.distance;
                                owners[column] = k as u16 + 1;
                            }
                        }
                    }
                    if owners[column] > 0 {
                        counts[usize::from(owners[column]) - 1].1 += 1;
                    }
                }
                PersonLabels { owners, distances, counts }
            })
            .collect();
        let mut labels = PersonLabels {
            owners: Vec::with_capacity(self.rays.distances.len()),
            distances: Vec::with_capacity(self.rays.distances.len()),
            counts: vec![(0, 0); figures.len()],
        };
        for row in rows {
            labels.owners.extend(row.owners);
            labels.distances.extend(row.distances);
            for (sum, count) in labels.counts.iter_mut().zip(row.counts) {
                *sum = (sum.0 + count.0, sum.1 + count.1);
            }
        }
        labels
    }

    /// Converts distances along rays to depth along the camera's z.
    pub(super) fn depth(&self, distances: &[f32]) -> DepthMap {
        let forward = self.rays.camera.camera_from_world.rotation.inverse() * nalgebra::Vector3::z();
        let forward = Vec3::new(forward.x as f32, forward.y as f32, forward.z as f32);
        let z = |(distance, direction): (&f32, &Vec3)| {
            if distance.is_finite() { distance * direction.dot(forward) } else { 0.0 }
        };
        DepthMap {
            width: self.rays.camera.intrinsics.width * self.rays.samples,
            height: self.rays.camera.intrinsics.height * self.rays.samples,
            z_m: distances.iter().zip(&self.rays.directions).map(z).collect(),
        }
    }

    /// Mask of the pixels that show a person.
    pub(super) fn mask(&self, labels: &PersonLabels) -> GrayImage {
        let width = self.rays.width();
        GrayImage::from_fn(self.rays.width() as u32, self.rays.height() as u32, |x, y| {
            Luma([if labels.owners[y as usize * width + x as usize] > 0 { 255 } else { 0 }])
        })
    }
}

fn within(bounds: [usize; 4], column: usize, row: usize) -> bool {
    (bounds[0]..bounds[2]).contains(&column) && (bounds[1]..bounds[3]).contains(&row)
}

impl BodyView {
    /// Part that a ray hits first.
    fn meet(&self, eye: Vec3, direction: Vec3, column: usize, row: usize) -> Option<(Met, &BodyPart)> {
        if !within(self.bounds, column, row) {
            return None;
        }
        let parts = self.parts.iter().filter(|(_, bounds)| within(*bounds, column, row));
        parts
            .filter_map(|(part, _)| Some((part.shape.intersect(eye, direction)?, part)))
            .reduce(|nearer, other| if other.0.distance < nearer.0.distance { other } else { nearer })
    }

    /// Share of the light that is left at a point near the person's feet.
    fn shadow(&self, point: Vec3) -> f32 {
        /// Height above which there is no shadow.
        const LOW_M: f32 = 0.05;
        if point.z > LOW_M {
            return 1.0;
        }
        let soft = |center: Vec3, spread_m: f32| {
            (-0.5 * (point - center).truncate().length_squared() / (spread_m * spread_m)).exp()
        };
        let middle = 0.5 * (self.feet[0] + self.feet[1]);
        let contact = 0.35 * soft(self.feet[0], 0.1).max(soft(self.feet[1], 0.1));
        1.0 - contact - 0.3 * soft(middle, 0.32)
    }
}

impl SyntheticRoom {
    /// Light that a triangle sends to the eye from a point of it: its surface's colour there, lit.
    fn radiance(&self, triangle: u32, point: Vec3) -> Vec3 {
        let t = &self.tessellation;
        let quad = &self.surfaces.quads[t.quad_of_triangle[triangle as usize] as usize];
        let corners = t.mesh.triangles[triangle as usize];
        let [a, b, c] = corners.map(|i| t.mesh.vertices[i as usize]);
        let normal = (b - a).cross(c - a);
        let area = normal.length_squared().max(f32::MIN_POSITIVE);
        let at_b = (point - a).cross(c - a).dot(normal) / area;
        let at_c = (b - a).cross(point - a).dot(normal) / area;
        let [la, lb, lc] = corners.map(|i| self.light[i as usize]);
        let light = la * (1.0 - at_b - at_c) + lb * at_b + lc * at_c;
        quad.color(point).powf(2.2) * light.max(0.0)
    }
}

/// Converts linear light at the samples to a picture as a sensor gives it.
pub(super) fn finish(
    colors: &[Vec3],
    still: &StaticView,
    seed: u64,
    frame: u64,
    options: &RenderOptions,
) -> RgbImage {
    let (width, s) = (still.rays.camera.intrinsics.width as usize, still.rays.samples as usize);
    let fine = still.rays.width();
    // One stream of noise a frame.
    let seed = (seed ^ (seed >> 32)) as u32 ^ (frame as u32).wrapping_mul(0x9e37_79b9);
    let swing = 2.0 * unit(IVec2::new(-1, -1), seed) - 1.0;
    let gain = 1.0 + options.flicker * swing;
    let mut image = RgbImage::new(still.rays.camera.intrinsics.width, still.rays.camera.intrinsics.height);
    image.par_chunks_exact_mut(3 * width).enumerate().for_each(|(y, line)| {
        for (x, pixel) in line.chunks_exact_mut(3).enumerate() {
            let samples = (0..s).flat_map(|j| {
                let start = (y * s + j) * fine + x * s;
                &colors[start..start + s]
            });
            let mean = samples.sum::<Vec3>() * (gain / (s * s) as f32);
            for (channel, (value, light)) in (0..).zip(pixel.iter_mut().zip(mean.to_array())) {
                let exact = light.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0;
                // Three uniform numbers add up to nearly a normal one of variance 1/4.
                let cell = IVec2::new((y * width + x) as i32, channel);
                let sum: f32 = (0..3).map(|k| unit(cell, seed.wrapping_add(k * 77_777))).sum();
                let noise = options.noise * 2.0 * (sum - 1.5);
                *value = (exact + noise).round().clamp(0.0, 255.0) as u8;
            }
        }
    });
    image
}
