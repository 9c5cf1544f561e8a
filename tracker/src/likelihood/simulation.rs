//! The counts of a changing state, kept up to date by looking only at the pixels that change.

use image::GrayImage;

use super::Counts;
use super::cover::{Change, Cover, MAX_BODIES};
use crate::silhouette::{Silhouette, View};

/// The simulated masks of all cameras beside the foreground masks of the moment.
///
/// A state's bodies are [`Self::insert`]ed once a frame; after that each step asks [`Self::try_change`] for the counts
/// that a change of one body would give, and [`Self::commit`]s what is accepted. Nothing allocates after the first frames.
#[derive(Debug, Clone)]
pub struct Simulation {
    cameras: Vec<SimulatedCamera>,
    bodies: usize,
}

#[derive(Debug, Clone)]
struct SimulatedCamera {
    cover: Cover,
    /// Whether the camera has a mask at this moment.
    in_use: bool,
    counts: Counts,
    tried: Counts,
}

/// A mask as packed words, row by row; bit 0 is the leftmost pixel. Any value but 0 is foreground.
pub fn pack(mask: &GrayImage) -> Vec<u64> {
    mask.chunks(mask.width() as usize)
        .flat_map(|row| row.chunks(64))
        .map(|word| word.iter().rev().fold(0, |bits, pixel| bits << 1 | u64::from(*pixel != 0)))
        .collect()
}

impl Simulation {
    /// The most bodies a state may hold.
    pub const MAX_BODIES: usize = MAX_BODIES;

    /// An empty simulation for these cameras.
    pub fn new(views: &[View]) -> Self {
        let camera = |view: &View| SimulatedCamera {
            cover: Cover::new(view.words_per_row, view.height as usize),
            in_use: false,
            counts: Counts::default(),
            tried: Counts::default(),
        };
        Self { cameras: views.iter().map(camera).collect(), bodies: 0 }
    }

    /// Takes the masks of a new moment, packed by [`pack`]; `None` leaves a camera out. Forgets all bodies.
    pub fn restart(&mut self, masks: &[Option<Vec<u64>>]) {
        self.bodies = 0;
        for (camera, mask) in self.cameras.iter_mut().zip(masks) {
            camera.in_use = mask.is_some();
            if let Some(mask) = mask {
                camera.cover.restart(mask);
                let foreground = mask.iter().map(|w| i64::from(w.count_ones())).sum();
                camera.counts = Counts { foreground, ..Counts::default() };
                camera.tried = camera.counts;
            }
        }
    }

    /// Whether a camera takes part in this moment.
    pub fn in_use(&self, camera: usize) -> bool {
        self.cameras[camera].in_use
    }

    /// The number of cameras that take part in this moment.
    pub fn cameras_in_use(&self) -> usize {
        self.cameras.iter().filter(|c| c.in_use).count()
    }

    /// The counts of the present state; `None` for a camera that is left out.
    pub fn counts(&self) -> impl Iterator<Item = Option<Counts>> + '_ {
        self.cameras.iter().map(|c| c.in_use.then_some(c.counts))
    }

    /// The counts that the change last tried would give.
    pub fn tried(&self) -> impl Iterator<Item = Option<Counts>> + '_ {
        self.cameras.iter().map(|c| c.in_use.then_some(c.tried))
    }

    /// Works out the counts that would follow if the body drawn as `old` (one silhouette a camera; now in the state) were
    /// drawn as `new`. Without `old` a body is added, without `new` removed.
    pub fn try_change(&mut self, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        for (i, camera) in self.cameras.iter_mut().enumerate().filter(|(_, c)| c.in_use) {
            let Change { simulated, both } = camera.cover.change(old.map(|s| &s[i]), new.map(|s| &s[i]));
            camera.tried = Counts {
                foreground: camera.counts.foreground,
                simulated: camera.counts.simulated + simulated,
                both: camera.counts.both + both,
            };
        }
    }

    /// Makes the change last tried, with the same arguments.
    pub fn commit(&mut self, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        self.bodies = self.bodies + usize::from(new.is_some()) - usize::from(old.is_some());
        debug_assert!(self.bodies <= MAX_BODIES, "more bodies than the digits of a pixel can count");
        for (i, camera) in self.cameras.iter_mut().enumerate().filter(|(_, c)| c.in_use) {
            if let Some(old) = old {
                camera.cover.remove(&old[i]);
            }
            if let Some(new) = new {
                camera.cover.add(&new[i]);
            }
            camera.counts = camera.tried;
        }
    }

    /// Adds a body.
    pub fn insert(&mut self, silhouettes: &[Silhouette]) {
        self.try_change(None, Some(silhouettes));
        self.commit(None, Some(silhouettes));
    }

    /// How many of a silhouette's visible pixels are foreground in one camera, whoever else covers them.
    pub fn foreground_under(&self, camera: usize, silhouette: &Silhouette) -> u32 {
        self.cameras[camera].cover.foreground_under(silhouette)
    }

    /// What adding a body to the present state would newly cover in one camera: pixels, and foreground pixels of these.
    pub fn gain(&self, camera: usize, silhouette: &Silhouette) -> [i64; 2] {
        let change = self.cameras[camera].cover.change(None, Some(silhouette));
        [change.simulated, change.both]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::oracle;
    use crate::silhouette::{Body, Silhouette};
    use crate::stage::StageCamera;
    use calib::{Camera, Intrinsics};
    use image::Luma;
    use nalgebra::{Isometry3, Point3, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// A small camera somewhere in a 6 × 5 m room, looking somewhere, with a static scene of random slabs and pillars.
    fn random_camera(rng: &mut Pcg64Mcg) -> StageCamera {
        let (width, height) = (rng.random_range(40..150), rng.random_range(30..90));
        let mut intrinsics = Intrinsics::from_horizontal_fov(width, height, rng.random_range(40.0..100.0));
        intrinsics.fy *= rng.random_range(0.8..1.2);
        let eye =
            Point3::new(rng.random_range(0.0..6.0), rng.random_range(0.0..5.0), rng.random_range(0.3..3.0));
        let aim =
            Point3::new(rng.random_range(0.0..6.0), rng.random_range(0.0..5.0), rng.random_range(0.0..2.0));
        let up = Vector3::new(rng.random_range(-0.2..0.2), 0.1, 1.0);
        // OpenCV's camera looks along +z with y down: the mirror image of what `look_at_rh` calls up.
        let camera_from_world = Isometry3::look_at_lh(&eye, &aim, &-up);
        let mut camera = StageCamera::new("c", &Camera { intrinsics, camera_from_world });
        for v in 0..height {
            for u in 0..width {
                let wall = 4.0 + 0.01 * u as f32 + 0.02 * v as f32;
                camera.static_z_m[(v * width + u) as usize] = wall;
            }
        }
        for _ in 0..rng.random_range(0..5) {
            let (u0, v0) = (rng.random_range(0..width), rng.random_range(0..height));
            let (u1, v1) = (rng.random_range(u0..width), rng.random_range(v0..height));
            let z = rng.random_range(0.2..6.0);
            let slope = rng.random_range(-0.02..0.02_f32);
            for v in v0..=v1 {
                for u in u0..=u1 {
                    let z = z + slope * (u as f32 - v as f32);
                    camera.static_z_m[(v * width + u) as usize] =
                        if rng.random::<f32>() < 0.02 { 0.0 } else { z.max(0.01) };
                }
            }
        }
        camera
    }

    /// Anywhere in the room, one time in six close to the camera.
    fn random_body(eye: &Point3<f64>, rng: &mut Pcg64Mcg) -> Body {
        let near = rng.random::<f32>() < 0.17;
        let (x, y) =
            if near { (eye.x - 0.4..eye.x + 0.4, eye.y - 0.4..eye.y + 0.4) } else { (-0.5..6.5, -0.5..5.5) };
        Body {
            x_m: rng.random_range(x),
            y_m: rng.random_range(y),
            radius_m: rng.random_range(0.12..0.5),
            height_m: rng.random_range(0.9..2.2),
        }
    }

    fn by_rays(camera: &StageCamera, bodies: &[Body], mask: &GrayImage) -> Counts {
        let width = camera.width();
        oracle::counts(camera, bodies, mask, |u, v| camera.static_z_m[(v * width + u) as usize])
    }

    /// Thousands of moves on random scenes, every one against a ray through every pixel. Bodies overlap, are cut by the
    /// border, stand behind the camera, around it, in front of and behind what is static.
    #[test]
    fn every_change_counts_what_rays_count() {
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let (mut around_camera, mut behind_plane, mut cut, mut hidden) = (0, 0, 0, 0);
        for _ in 0..250 {
            let camera = random_camera(&mut rng);
            let view = View::new(&camera);
            let mask = GrayImage::from_fn(camera.width(), camera.height(), |u, v| {
                Luma([if (u / 9 + v / 7) % 3 == 0 || rng.random::<f32>() < 0.1 { 255 } else { 0 }])
            });
            let mut simulation = Simulation::new(std::slice::from_ref(&view));
            simulation.restart(&[Some(pack(&mask))]);
            let mut bodies: Vec<Body> = Vec::new();
            let draw = |body: &Body| vec![Silhouette::new(&view, body)];
            for _ in 0..16 {
                let kind = rng.random_range(0..3);
                let (old, new) = match kind {
                    0 if bodies.len() < 12 => (None, Some(random_body(&camera.pinhole.center(), &mut rng))),
                    1 if !bodies.is_empty() => (Some(rng.random_range(0..bodies.len())), None),
                    _ if !bodies.is_empty() => {
                        let which = rng.random_range(0..bodies.len());
                        let mut body = bodies[which];
                        body.x_m += rng.random_range(-0.2..0.2);
                        body.y_m += rng.random_range(-0.2..0.2);
                        body.height_m += rng.random_range(-0.1..0.1);
                        (Some(which), Some(body))
                    }
                    _ => continue,
                };
                let (drawn_old, drawn_new) = (old.map(|i| draw(&bodies[i])), new.as_ref().map(draw));
                if let (Some(body), Some(drawn)) = (&new, &drawn_new) {
                    let eye = camera.pinhole.center();
                    let d = (eye - body.center()).component_div(&body.semi_axes());
                    around_camera += u32::from(d.norm() <= 1.0);
                    behind_plane += u32::from(
                        crate::silhouette::ImageConic::new(&view, body).nearest_z_m <= 0.0
                            && drawn[0].area_px > 0,
                    );
                    cut +=
                        u32::from(drawn[0].area_px > 0 && drawn[0].row_range().end == view.height as usize);
                    hidden += u32::from(drawn[0].visible_px < drawn[0].area_px);
                }
                simulation.try_change(drawn_old.as_deref(), drawn_new.as_deref());
                let mut changed = bodies.clone();
                if let Some(which) = old {
                    changed.swap_remove(which);
                }
                changed.extend(new);
                let expected = by_rays(&camera, &changed, &mask);
                assert_eq!(
                    simulation.tried().next().flatten(),
                    Some(expected),
                    "{:?}\n{changed:?}",
                    camera.real
                );
                // What was tried and not taken must leave no trace.
                if rng.random::<f32>() < 0.6 {
                    simulation.commit(drawn_old.as_deref(), drawn_new.as_deref());
                    bodies = changed;
                    assert_eq!(simulation.counts().next().flatten(), Some(expected));
                }
            }
        }
        // The scenes are worth their name only if the rare cases are among them.
        let rare = [around_camera, behind_plane, cut, hidden];
        assert!(rare.iter().all(|n| *n > 40), "{rare:?}");
    }

    #[test]
    fn packed_masks_keep_every_pixel() {
        let mask = GrayImage::from_fn(131, 3, |u, v| Luma([if (u + v) % 5 == 0 { 255 } else { 0 }]));
        let packed = pack(&mask);
        assert_eq!(packed.len(), 3 * 3);
        for (u, v, pixel) in mask.enumerate_pixels() {
            let bit = packed[v as usize * 3 + u as usize / 64] >> (u % 64) & 1;
            assert_eq!(bit == 1, pixel[0] != 0, "{u}, {v}");
        }
    }

    #[test]
    fn a_camera_without_a_mask_is_left_out() {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let views: Vec<View> = (0..2).map(|_| View::new(&random_camera(&mut rng))).collect();
        let mut simulation = Simulation::new(&views);
        let empty = vec![0; views[1].words_per_row * views[1].height as usize];
        simulation.restart(&[None, Some(empty)]);
        assert_eq!(simulation.cameras_in_use(), 1);
        assert_eq!(simulation.counts().collect::<Vec<_>>(), [None, Some(Counts::default())]);
    }
}
