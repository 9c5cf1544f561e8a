//! The counts of a changing state, kept up to date by looking only at the pixels that change.

use image::GrayImage;

use super::cover::{Change, Cover, MAX_BODIES};
use super::{Counts, Layers};
use crate::silhouette::{Silhouette, View};

/// The simulated masks of all layers beside the foreground masks of the moment.
///
/// A state's bodies are [`Self::insert`]ed once a frame; after that each step asks [`Self::try_change`] for the counts
/// that a change of one body would give, and [`Self::commit`]s what is accepted. Nothing allocates after the first frames.
#[derive(Debug, Clone)]
pub struct Simulation {
    layers: Vec<SimulatedLayer>,
    bodies: usize,
}

#[derive(Debug, Clone)]
struct SimulatedLayer {
    cover: Cover,
    camera: usize,
    /// Whether the camera has a mask at this moment.
    in_use: bool,
    counts: Counts,
    /// What the body that is tried without takes with it.
    removal: Change,
    tried: Counts,
}

/// A mask as packed words, row by row; bit 0 is the leftmost pixel. Any value but 0 is foreground; a view's pixel that
/// stands for a block of the mask's is foreground when half of the block is.
pub fn pack(mask: &GrayImage, view: &View) -> Vec<u64> {
    let (width, block) = (mask.width() as usize, usize::from(view.block));
    let mut packed = Vec::with_capacity(view.words_per_row * view.height as usize);
    // Of a row of blocks: the foreground of each column, and of all columns to the left of each and one more.
    let mut found = vec![0_u8; width];
    let mut running = vec![0_u32; width + 1];
    for rows in mask.chunks(width * block) {
        found.fill(0);
        for row in rows.chunks(width) {
            for (sum, pixel) in found.iter_mut().zip(row) {
                *sum += u8::from(*pixel != 0);
            }
        }
        let mut sum = 0;
        for (running, found) in running[1..].iter_mut().zip(&found) {
            sum += u32::from(*found);
            *running = sum;
        }
        let height = rows.len() / width;
        let is_foreground = |first: usize| {
            // The last block of a row may be narrower than the others.
            let end = (first + block).min(width);
            2 * (running[end] - running[first]) as usize >= (end - first) * height
        };
        packed.extend((0..view.words_per_row).map(|word| {
            let blocks = (word * 64..((word + 1) * 64).min(view.width as usize)).rev();
            blocks.fold(0, |bits, u| bits << 1 | u64::from(is_foreground(u * block)))
        }));
    }
    packed
}

impl Simulation {
    /// The most bodies a state may hold.
    pub const MAX_BODIES: usize = MAX_BODIES;

    /// An empty simulation of these layers.
    pub fn new(layers: &Layers) -> Self {
        let layer = |i: usize| {
            let camera = layers.camera(i);
            let view = &layers.views()[camera];
            SimulatedLayer {
                cover: Cover::new(view.words_per_row, view.height as usize),
                camera,
                in_use: false,
                counts: Counts::default(),
                removal: Change::default(),
                tried: Counts::default(),
            }
        };
        Self { layers: (0..layers.count()).map(layer).collect(), bodies: 0 }
    }

    /// Takes the masks of a new moment, one a camera, packed by [`pack`]; `None` leaves a camera out. Forgets all bodies.
    pub fn restart(&mut self, masks: &[Option<Vec<u64>>]) {
        self.bodies = 0;
        for layer in &mut self.layers {
            let mask = &masks[layer.camera];
            layer.in_use = mask.is_some();
            if let Some(mask) = mask {
                layer.cover.restart(mask);
                let foreground = mask.iter().map(|w| i64::from(w.count_ones())).sum();
                layer.counts = Counts { foreground, ..Counts::default() };
                layer.tried = layer.counts;
            }
        }
    }

    /// Whether a layer's camera takes part in this moment.
    pub fn in_use(&self, layer: usize) -> bool {
        self.layers[layer].in_use
    }

    /// Whether any camera takes part in this moment.
    pub fn sees_anything(&self) -> bool {
        self.layers.iter().any(|l| l.in_use)
    }

    /// The counts of the present state in each layer; `None` for a camera that is left out.
    pub fn counts(&self) -> impl Iterator<Item = Option<Counts>> + '_ {
        self.layers.iter().map(|l| l.in_use.then_some(l.counts))
    }

    /// The counts that the change last tried would give.
    pub fn tried(&self) -> impl Iterator<Item = Option<Counts>> + '_ {
        self.layers.iter().map(|l| l.in_use.then_some(l.tried))
    }

    /// Works out the counts that would follow if the body drawn as `old` (one silhouette a layer; now in the state) were
    /// drawn as `new`. Without `old` a body is added, without `new` removed.
    pub fn try_change(&mut self, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        self.try_removal(old);
        for layer in 0..self.layers.len() {
            self.try_addition(layer, old, new);
        }
    }

    /// The first half of a change: takes `old` out of every layer. What then counts as tried in a layer, until
    /// [`Self::try_addition`] tells, is the best that any addition could come to: it explains all foreground, and nothing
    /// else is expected.
    pub fn try_removal(&mut self, old: Option<&[Silhouette]>) {
        for (i, layer) in self.layers.iter_mut().enumerate().filter(|(_, l)| l.in_use) {
            layer.removal = old.map_or(Change::default(), |old| layer.cover.removal(&old[i]));
        }
        self.try_again();
    }

    /// Forgets the additions that were tried since [`Self::try_removal`], for another of the same body.
    pub fn try_again(&mut self) {
        for layer in self.layers.iter_mut().filter(|l| l.in_use) {
            let Counts { foreground, simulated, both } = layer.counts;
            let in_vain = simulated - both + layer.removal.simulated - layer.removal.both;
            layer.tried = Counts { foreground, simulated: foreground + in_vain, both: foreground };
        }
    }

    /// The second half, in one layer: adds `new` after [`Self::try_removal`] of the same `old`. Nothing happens in a layer
    /// that is not in use.
    pub fn try_addition(&mut self, layer: usize, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        let SimulatedLayer { cover, in_use, counts, tried, removal, .. } = &mut self.layers[layer];
        if *in_use {
            let old = old.map(|s| &s[layer]);
            let addition = new.map_or(Change::default(), |new| cover.addition(&new[layer], old));
            *tried = Counts {
                foreground: counts.foreground,
                simulated: counts.simulated + removal.simulated + addition.simulated,
                both: counts.both + removal.both + addition.both,
            };
        }
    }

    /// Makes the change last tried, with the same arguments.
    pub fn commit(&mut self, old: Option<&[Silhouette]>, new: Option<&[Silhouette]>) {
        self.bodies = self.bodies + usize::from(new.is_some()) - usize::from(old.is_some());
        debug_assert!(self.bodies <= MAX_BODIES, "more bodies than the digits of a pixel can count");
        for (i, layer) in self.layers.iter_mut().enumerate().filter(|(_, l)| l.in_use) {
            if let Some(old) = old {
                layer.cover.remove(&old[i]);
            }
            if let Some(new) = new {
                layer.cover.add(&new[i]);
            }
            layer.counts = layer.tried;
        }
    }

    /// Adds a body.
    pub fn insert(&mut self, silhouettes: &[Silhouette]) {
        self.try_change(None, Some(silhouettes));
        self.commit(None, Some(silhouettes));
    }

    /// How many of a silhouette's visible pixels are foreground in one layer, whoever else covers them.
    pub fn foreground_under(&self, layer: usize, silhouette: &Silhouette) -> u32 {
        self.layers[layer].cover.foreground_under(silhouette)
    }

    /// The foreground that the present state leaves unexplained in one layer, packed as the masks are.
    pub fn unexplained(&self, layer: usize) -> impl Iterator<Item = u64> + '_ {
        self.layers[layer].cover.unexplained()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::oracle;
    use crate::silhouette::{Body, ImageConic, Outline, Shape};
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
        let mut up = Vector3::new(rng.random_range(-0.2..0.2), 0.1, 1.0);
        if rng.random::<f32>() < 0.3 {
            // Hung in any way, upside down as well.
            up = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        }
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

    fn by_rays(camera: &StageCamera, shape: &Shape, bodies: &[Body], mask: &GrayImage) -> Counts {
        let width = camera.width();
        let solids: Vec<_> = bodies.iter().map(|body| shape.of(body)).collect();
        oracle::counts(camera, &solids, mask, |u, v| camera.static_z_m[(v * width + u) as usize])
    }

    /// Thousands of moves on random scenes, every one against a ray through every pixel. Bodies overlap, are cut by the
    /// border, stand behind the camera, around it, in front of and behind what is static.
    #[test]
    fn every_change_counts_what_rays_count() {
        const SHAPES: [&[Shape]; 4] = [&[Shape::BODY], &[Shape::CORE], &[Shape::LIMBS], &[Shape::REACH]];
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let (mut around_camera, mut behind_plane, mut cut, mut hidden, mut in_floor) = (0, 0, 0, 0, 0);
        for scene in 0..300 {
            let mut camera = random_camera(&mut rng);
            let shapes = SHAPES[scene % SHAPES.len()];
            if rng.random() {
                camera.set_floor();
            }
            let view = View::new(&camera);
            let mask = GrayImage::from_fn(camera.width(), camera.height(), |u, v| {
                Luma([if (u / 9 + v / 7) % 3 == 0 || rng.random::<f32>() < 0.1 { 255 } else { 0 }])
            });
            let layers = Layers::new(vec![view.clone()], shapes);
            let mut simulation = Simulation::new(&layers);
            simulation.restart(&[Some(pack(&mask, &view))]);
            let mut bodies: Vec<Body> = Vec::new();
            let draw = |body: &Body| layers.silhouettes(body, |_| true);
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
                    let solid = shapes[0].of(body);
                    let d = (eye - solid.center).component_div(&solid.semi_axes);
                    around_camera += u32::from(d.norm() <= 1.0);
                    let conic = ImageConic::new(&view, &solid);
                    behind_plane += u32::from(conic.nearest_z_m <= 0.0 && drawn[0].area_px > 0);
                    cut +=
                        u32::from(drawn[0].area_px > 0 && drawn[0].row_range().end == view.height as usize);
                    hidden += u32::from(drawn[0].visible_px < drawn[0].area_px);
                    in_floor += u32::from(match conic.outline() {
                        Outline::Ellipse(whole) => drawn[0].row_range().end < whole.rows.end as usize,
                        Outline::Nowhere | Outline::Open => false,
                    });
                }
                simulation.try_removal(drawn_old.as_deref());
                let hoped = simulation.tried().next().flatten().unwrap();
                simulation.try_addition(0, drawn_old.as_deref(), drawn_new.as_deref());
                let mut changed = bodies.clone();
                if let Some(which) = old {
                    changed.swap_remove(which);
                }
                changed.extend(new);
                let expected = by_rays(&camera, &shapes[0], &changed, &mask);
                assert_eq!(
                    simulation.tried().next().flatten(),
                    Some(expected),
                    "{:?}\n{changed:?}",
                    camera.real
                );
                let in_vain = |c: &Counts| c.simulated - c.both;
                assert!(hoped.both >= expected.both && in_vain(&hoped) <= in_vain(&expected), "{hoped:?}");
                // What was tried and not taken must leave no trace.
                if rng.random::<f32>() < 0.6 {
                    simulation.commit(drawn_old.as_deref(), drawn_new.as_deref());
                    bodies = changed;
                    assert_eq!(simulation.counts().next().flatten(), Some(expected));
                }
            }
        }
        // The scenes are worth their name only if the rare cases are among them.
        let rare = [around_camera, behind_plane, cut, hidden, in_floor];
        assert!(rare.iter().all(|n| *n > 40), "{rare:?}");
    }

    #[test]
    fn packed_masks_keep_every_pixel_or_most_of_every_block() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for block in [1, 2, 3, 5_u8] {
            let camera = StageCamera::new(
                "c",
                &Camera {
                    intrinsics: Intrinsics::from_horizontal_fov(131, 31, 60.0),
                    camera_from_world: Isometry3::identity(),
                },
            );
            let view = View::coarse(&camera, block);
            let mask = GrayImage::from_fn(131, 31, |u, v| {
                Luma([if (u / 4 + v / 3) % 3 == 0 || rng.random::<f32>() < 0.3 { 255 } else { 0 }])
            });
            let packed = pack(&mask, &view);
            assert_eq!(packed.len(), view.words_per_row * view.height as usize);
            let block = u32::from(block);
            for (u, v) in (0..view.height).flat_map(|v| (0..view.width).map(move |u| (u, v))) {
                let members: Vec<bool> = (v * block..((v + 1) * block).min(31))
                    .flat_map(|y| (u * block..((u + 1) * block).min(131)).map(move |x| (x, y)))
                    .map(|(x, y)| mask.get_pixel(x, y)[0] != 0)
                    .collect();
                let expected = 2 * members.iter().filter(|m| **m).count() >= members.len();
                let bit = packed[v as usize * view.words_per_row + u as usize / 64] >> (u % 64) & 1;
                assert_eq!(bit == 1, expected, "{u}, {v} of blocks of {block}");
            }
        }
    }

    #[test]
    fn a_camera_without_a_mask_is_left_out() {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let views: Vec<View> = (0..2).map(|_| View::new(&random_camera(&mut rng))).collect();
        let empty = vec![0; views[1].words_per_row * views[1].height as usize];
        let mut simulation = Simulation::new(&Layers::new(views, &[Shape::CORE, Shape::REACH]));
        assert!(!simulation.sees_anything());
        simulation.restart(&[None, Some(empty)]);
        assert!(simulation.sees_anything() && !simulation.in_use(1) && simulation.in_use(2));
        let nothing = Some(Counts::default());
        assert_eq!(simulation.counts().collect::<Vec<_>>(), [None, None, nothing, nothing]);
    }
}
