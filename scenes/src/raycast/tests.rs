//! Rays against a slow oracle in `f64`, and the cases that hierarchies get wrong.

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{RayScene, SEGMENT_END_MARGIN_M};
use crate::geometry::{Disc, Geometry, Mesh};

fn vector(rng: &mut Pcg64Mcg, reach: f32) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| rng.random_range(-reach..reach)))
}

fn discs(count: usize, rng: &mut Pcg64Mcg) -> Geometry {
    let disc = |rng: &mut Pcg64Mcg| Disc {
        center: vector(rng, 3.0),
        // Every third one faces along an axis, as walls and floors do.
        normal: if rng.random_range(0..3) == 0 { Vec3::Z } else { vector(rng, 1.0).normalize() },
        radius: rng.random_range(0.05..0.5),
        color: [0; 3],
        filled: false,
        confidence: 1.0,
    };
    Geometry::Discs((0..count).map(|_| disc(rng)).collect())
}

fn mesh(count: usize, rng: &mut Pcg64Mcg) -> Geometry {
    let mut mesh = Mesh::default();
    for i in 0..count as u32 {
        let center = vector(rng, 3.0);
        mesh.vertices.extend((0..3).map(|_| center + vector(rng, 0.6)));
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh.colors = vec![[0; 3]; mesh.vertices.len()];
    Geometry::Mesh(mesh)
}

/// Distance to one primitive whose outline is moved outwards by `grow` metres, in double precision.
fn slow_distance(geometry: &Geometry, i: usize, origin: DVec3, direction: DVec3, grow: f64) -> Option<f64> {
    let plane = |point: DVec3, normal: DVec3| {
        let t = normal.dot(point - origin) / normal.dot(direction);
        (t > 0.0).then(|| (t, origin + t * direction))
    };
    match geometry {
        Geometry::Discs(discs) => {
            let (t, p) = plane(discs[i].center.into(), discs[i].normal.into())?;
            (p.distance(discs[i].center.into()) <= f64::from(discs[i].radius) + grow).then_some(t)
        }
        Geometry::Mesh(mesh) => {
            let corners = mesh.corners(mesh.triangles[i]).map(DVec3::from);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let (t, p) = plane(corners[0], normal)?;
            let inside = (0..3).all(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                normal.cross(b - a).normalize().dot(p - a) >= -grow
            });
            inside.then_some(t)
        }
    }
}

/// The nearest hit and its primitive.
fn slow_cast(geometry: &Geometry, origin: Vec3, direction: Vec3, grow: f64) -> Option<(f64, usize)> {
    (0..geometry.len())
        .filter_map(|i| Some((slow_distance(geometry, i, origin.into(), direction.into(), grow)?, i)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

#[test]
fn casts_agree_with_the_oracle() {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let (mut hits, mut misses) = (0, 0);
    for count in [1, 2, 3, 7, 40, 400, 2000] {
        for geometry in [discs(count, &mut rng), mesh(count, &mut rng)] {
            let scene = RayScene::new(&geometry).unwrap();
            for _ in 0..500 {
                let origin = vector(&mut rng, 4.0);
                // The direction leads to the scene and has any length.
                let direction = (vector(&mut rng, 2.0) - origin) * rng.random_range(0.2..3.0);
                let found = scene.cast(origin, direction);
                // Rounding decides within ten micrometres of an outline: both answers are right there.
                let strict = slow_cast(&geometry, origin, direction, -1e-5);
                let loose = slow_cast(&geometry, origin, direction, 1e-5);
                let Some(hit) = found else {
                    misses += 1;
                    assert_eq!(strict, None, "missed what is there");
                    continue;
                };
                hits += 1;
                let within = |share: f32| scene.cast_within(origin, direction, share * hit.distance);
                assert_eq!((within(0.999), within(1.001)), (None, Some(hit)));
                let (t, tolerance) = (f64::from(hit.distance), 1e-4);
                assert!(loose.is_some_and(|(near, _)| t > near - tolerance), "{t} is nearer than {loose:?}");
                assert!(strict.is_none_or(|(far, _)| t < far + tolerance), "{t} is farther than {strict:?}");
                let own =
                    slow_distance(&geometry, hit.primitive as usize, origin.into(), direction.into(), 1e-5);
                assert!(own.is_some_and(|own| (own - t).abs() < tolerance), "wrong index");
                assert!(hit.normal.dot(direction) <= 0.0 && (hit.normal.length() - 1.0).abs() < 1e-4);
            }
        }
    }
    assert!(hits > 1000 && misses > 1000, "{hits} hits, {misses} misses: the test tests little");
}

#[test]
fn segments_agree_with_the_oracle() {
    let mut rng = Pcg64Mcg::seed_from_u64(8);
    let (mut blocked, mut free) = (0, 0);
    for geometry in [discs(150, &mut rng), mesh(150, &mut rng)] {
        let scene = RayScene::new(&geometry).unwrap();
        for _ in 0..3000 {
            let (from, to) = (vector(&mut rng, 4.0), vector(&mut rng, 4.0));
            let margin = f64::from(SEGMENT_END_MARGIN_M / from.distance(to));
            let inner = |grow: f64, margin: f64| {
                (0..geometry.len()).any(|i| {
                    slow_distance(&geometry, i, from.into(), (to - from).into(), grow)
                        .is_some_and(|t| (margin..1.0 - margin).contains(&t))
                })
            };
            if scene.is_blocked(from, to) {
                blocked += 1;
                assert!(inner(1e-5, 0.99 * margin));
            } else {
                free += 1;
                assert!(!inner(-1e-5, 1.01 * margin));
            }
        }
    }
    assert!(blocked > 500 && free > 500, "{blocked} blocked, {free} free");
}

/// The floor of a room as `n × n` squares of two triangles.
fn tiled_floor(n: u32, side: f32) -> Geometry {
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let mut mesh = Mesh::default();
    for i in 0..=n {
        for j in 0..=n {
            mesh.vertices.push(Vec3::new(i as f32 * side, j as f32 * side, 0.0));
        }
    }
    for i in 0..n {
        for j in 0..n {
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            mesh.triangles.push([at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)]);
        }
    }
    mesh.colors = vec![[0; 3]; mesh.vertices.len()];
    Geometry::Mesh(mesh)
}

#[test]
fn no_ray_slips_between_triangles() {
    let scene = RayScene::new(&tiled_floor(30, 0.1)).unwrap();
    let eye = Vec3::new(1.234, 1.777, 2.5);
    for k in 0..30 {
        for step in 0..300 {
            // Straight at the edges between the triangles, and at their corners.
            let along = step as f32 * 0.01;
            for target in [Vec3::new(0.1 * k as f32, along, 0.0), Vec3::new(along, 0.1 * k as f32, 0.0)] {
                if target.min_element() < 0.0 || target.x.min(target.y) < 0.01 {
                    continue; // the floor's own outline
                }
                let hit = scene.cast(eye, target - eye).unwrap_or_else(|| panic!("slipped at {target}"));
                assert!((hit.distance - 1.0).abs() < 1e-4);
                assert!(scene.is_blocked(eye, target - 0.1 * Vec3::Z));
                assert!(!scene.is_blocked(eye, target), "a segment's end lies on its own surface");
            }
        }
    }
}

#[test]
fn degenerate_scenes_and_rays_are_harmless() {
    let nothing = RayScene::new(&Geometry::Discs(vec![])).unwrap();
    assert_eq!(nothing.cast(Vec3::ZERO, Vec3::X), None);
    assert!(!nothing.is_blocked(Vec3::ZERO, Vec3::X));

    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let scene = RayScene::new(&discs(10, &mut rng)).unwrap();
    for direction in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
        assert_eq!(scene.cast(Vec3::ZERO, direction), None);
        assert_eq!(scene.cast(direction, Vec3::NAN), None);
        assert!(!scene.is_blocked(Vec3::ZERO, direction));
    }

    // A sliver without area, and the same wall twice: the smaller index wins.
    let mut mesh = Mesh {
        vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y, 2.0 * Vec3::X],
        triangles: vec![[0, 1, 3], [0, 1, 2], [0, 1, 2], [0, 0, 0]],
        colors: vec![[0; 3]; 4],
    };
    let scene = RayScene::new(&Geometry::Mesh(mesh.clone())).unwrap();
    let hit = scene.cast(Vec3::new(0.2, 0.2, 3.0), -Vec3::Z).unwrap();
    assert_eq!((hit.primitive, hit.distance, hit.normal), (1, 3.0, Vec3::Z));
    assert_eq!(scene.cast(Vec3::new(0.2, 0.2, -3.0), Vec3::Z).unwrap().normal, -Vec3::Z);
    mesh.vertices[1].x = f32::NAN;
    assert!(RayScene::new(&Geometry::Mesh(mesh)).is_err());
}
