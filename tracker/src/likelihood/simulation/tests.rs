//! Tests of the counts for arbitrary depth pictures: random walls and slabs with holes, and every count bit for bit.

use super::*;
use crate::likelihood::oracle;
use crate::likelihood::random_body::random_body;
use crate::prepared_room::PreparedCamera;
use crate::silhouette::{Body, ImageConic, ImageOutline, Shape};
use calib::{Camera, Intrinsics};
use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A small camera at a random place in a 6 × 5 m room, with a static scene of random slabs and pillars.
fn random_camera(rng: &mut Pcg64Mcg) -> PreparedCamera {
    let (width, height) = (rng.random_range(40..150), rng.random_range(30..90));
    let mut intrinsics = Intrinsics::from_horizontal_fov(width, height, rng.random_range(40.0..100.0));
    intrinsics.fy *= rng.random_range(0.8..1.2);
    let eye = Point3::new(rng.random_range(0.0..6.0), rng.random_range(0.0..5.0), rng.random_range(0.3..3.0));
    let aim = Point3::new(rng.random_range(0.0..6.0), rng.random_range(0.0..5.0), rng.random_range(0.0..2.0));
    let mut up = Vector3::new(rng.random_range(-0.2..0.2), 0.1, 1.0);
    if rng.random::<f32>() < 0.3 {
        // Any roll, upside down as well.
        up = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
    }
    // OpenCV's camera looks along +z with y down: the mirror image of `look_at_rh`.
    let camera_from_world = Isometry3::look_at_lh(&eye, &aim, &-up);
    let mut camera = PreparedCamera::new("c", &Camera { intrinsics, camera_from_world });
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

fn by_rays(camera: &PreparedCamera, shape: &Shape, bodies: &[Body], mask: &GrayImage) -> Counts {
    let width = camera.width();
    let solids: Vec<_> = bodies.iter().map(|body| shape.of(body)).collect();
    oracle::counts(camera, &solids, mask, |u, v| camera.static_z_m[(v * width + u) as usize])
}

/// Thousands of moves on random scenes, each compared with a ray through every pixel. Bodies overlap, are cut by the
/// border, stand behind the camera, around it, in front of and behind static surfaces.
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
        simulation.restart(&[Some(pack(&Mask::from(&mask), &view))]);
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
                cut += u32::from(drawn[0].area_px > 0 && drawn[0].row_range().end == view.height as usize);
                hidden += u32::from(drawn[0].visible_px < drawn[0].area_px);
                in_floor += u32::from(match conic.outline() {
                    ImageOutline::Ellipse(whole) => drawn[0].row_range().end < whole.rows.end as usize,
                    ImageOutline::Nowhere | ImageOutline::Open => false,
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
            assert_eq!(simulation.tried().next().flatten(), Some(expected), "{:?}\n{changed:?}", camera.real);
            let in_vain = |c: &Counts| c.simulated - c.both;
            assert!(hoped.both >= expected.both && in_vain(&hoped) <= in_vain(&expected), "{hoped:?}");
            // A change that was tried but not committed must leave no trace.
            if rng.random::<f32>() < 0.6 {
                simulation.commit(drawn_old.as_deref(), drawn_new.as_deref());
                bodies = changed;
                assert_eq!(simulation.counts().next().flatten(), Some(expected));
            }
        }
    }
    // The test is meaningful only if the rare cases occurred.
    let rare = [around_camera, behind_plane, cut, hidden, in_floor];
    assert!(rare.iter().all(|n| *n > 40), "{rare:?}");
}

#[test]
fn packed_masks_keep_every_pixel_or_most_of_every_block() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    for block in [1, 2, 3, 5_u8] {
        let camera = PreparedCamera::new(
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
        let packed = pack(&Mask::from(&mask), &view);
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
