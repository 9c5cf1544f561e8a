//! Speed of ray casting: the hierarchy, a static depth map, segments, the walkable map; on the office as a mesh, and as
//! the cloud of discs of a reconstruction (a disc a pixel of each camera).
//!
//! `cargo bench -p tests --bench rays`
#![allow(clippy::expect_used, missing_docs)] // a benchmark that cannot go on should stop; criterion's macro makes a function

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::depth::render;
use scenes::geometry::{Disc, Geometry, vec3_from_point};
use scenes::raycast::RayScene;
use scenes::room::Room;
use scenes::walkable::WalkableMap;

/// A disc for every pixel that sees a surface, facing the camera.
fn cloud(room: &Room, scene: &RayScene) -> Geometry {
    let mut discs = Vec::new();
    for camera in room.cameras.iter().map(|c| &c.camera) {
        let map = render(scene, camera);
        let eye = vec3_from_point(&camera.center());
        for (v, row) in (0..).zip(map.z_m.chunks(map.width as usize)) {
            for (u, &z) in (0..).zip(row) {
                let place = camera.back_project(&Point2::new(f64::from(u), f64::from(v)), f64::from(z));
                let (Some(place), true) = (place, z > 0.0) else { continue };
                let center = vec3_from_point(&place);
                let radius = z / camera.intrinsics.fx as f32;
                let normal = (eye - center).normalize();
                discs.push(Disc { center, normal, radius, color: [0; 3], filled: false, confidence: 1.0 });
            }
        }
    }
    Geometry::Discs(discs)
}

/// Segments between cameras and places in the room, as in occlusion tests.
fn segments(room: &Room, count: usize) -> Vec<(Vec3, Vec3)> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let eyes: Vec<Vec3> = room.cameras.iter().map(|c| vec3_from_point(&c.camera.center())).collect();
    (0..count)
        .map(|i| {
            let place = [6.0, 5.0, 1.8].map(|reach| rng.random_range(0.0..reach));
            (eyes[i % eyes.len()], Vec3::from_array(place))
        })
        .collect()
}

fn rays(criterion: &mut Criterion) {
    let dir = tests::data::office().join("room");
    let mut room = Room::read(&dir).expect("the office's true room");
    let mesh = room.geometry.clone().expect("it has geometry");
    let discs = cloud(&room, &RayScene::new(&mesh).expect("the mesh is sound"));
    for (name, geometry) in [("mesh", mesh), ("discs", discs)] {
        let scene = RayScene::new(&geometry).expect("the geometry is sound");
        let camera = room.cameras[0].camera.clone();
        let segments = segments(&room, 10_000);
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.bench_function(format!("build the hierarchy of {}", geometry.len()), |b| {
            b.iter(|| RayScene::new(black_box(&geometry)));
        });
        group.throughput(Throughput::Elements(640 * 480));
        group.bench_function("depth map 640 × 480", |b| b.iter(|| render(&scene, black_box(&camera))));
        group.throughput(Throughput::Elements(segments.len() as u64));
        group.bench_function("segments blocked, one thread", |b| {
            b.iter(|| segments.iter().filter(|(from, to)| scene.is_blocked(*from, *to)).count());
        });
        group.finish();
        room.geometry = Some(geometry);
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.bench_function("walkable map", |b| b.iter(|| WalkableMap::of_room(black_box(&room))));
        group.finish();
    }
}

criterion_group!(benches, rays);
criterion_main!(benches);
