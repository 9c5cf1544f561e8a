//! Surfaces of a room as a small binary for the page's 3-D view.
//!
//! Every geometry becomes oriented discs, at most [`MOST_DISCS`]. The bytes, little-endian: `u32` number of discs; `f32`
//! smallest x, y, z, then the size of a step along x, y, z, metres; then 12 bytes a disc: `u16` steps along x, y, z; `i8`
//! octahedral normal u, v; `u8` radius in [`RADIUS_STEP_M`]; `u8` red, green, blue.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};
use nalgebra::Vector3;

use crate::geometry::{Disc, Geometry, Mesh, vec3_from_point};
use crate::room::Room;
use crate::view::exposure;

/// Largest number of discs: 720 kB on the page.
const MOST_DISCS: usize = 60_000;
/// Step of a radius, metres.
const RADIUS_STEP_M: f32 = 0.002;
/// Largest number of discs that a mesh is sampled with before they are merged.
const MOST_SAMPLES: f32 = 400_000.0;

/// Radius of a merged disc in sides of its cell: neighbours' middles are up to two sides apart, so that smaller discs leave
/// holes.
const COVERS: f32 = 1.2;

/// Bytes of a room's surfaces, which face its cameras; `None` for a room without geometry.
pub fn of_room(room: &Room) -> Option<Vec<u8>> {
    let centers = room.cameras.iter().map(|camera| camera.camera.center().coords);
    let eye = centers.sum::<Vector3<f64>>() / room.cameras.len().max(1) as f64;
    Some(encode(room.geometry.as_ref()?, vec3_from_point(&eye.into())))
}

/// Bytes of a room's surfaces; `eye` is a place in the room towards which the sides of a mesh's triangles are turned.
fn encode(geometry: &Geometry, eye: Vec3) -> Vec<u8> {
    let discs = match geometry {
        Geometry::Mesh(mesh) => sampled(mesh, eye),
        Geometry::Discs(discs) => discs.clone(),
    };
    let gain = exposure(geometry);
    let mut discs = merged(discs);
    for disc in &mut discs {
        // The conversion saturates.
        disc.color = disc.color.map(|c| (gain * f32::from(c)).round() as u8);
    }
    bytes(&discs)
}

/// Discs over the triangles of a mesh.
fn sampled(mesh: &Mesh, eye: Vec3) -> Vec<Disc> {
    let area = |[a, b, c]: [Vec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let whole: f32 = mesh.triangles.iter().map(|t| area(mesh.corners(*t))).sum();
    let spacing = (whole / MOST_SAMPLES).sqrt().max(0.004);
    let mut discs = Vec::new();
    for triangle in &mesh.triangles {
        let triangle = opposite_first(mesh, *triangle);
        let [a, b, c] = mesh.corners(triangle);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let normal = if normal.dot(eye - a) < 0.0 { -normal } else { normal };
        let color = |i: usize| {
            mesh.colors.get(triangle[i] as usize).map_or(Vec3::splat(150.0), |c| Vec3::from(c.map(f32::from)))
        };
        // Middles of the cells of a barycentric grid along the two shorter edges; a slim triangle has few.
        let [across, along] = [(b - a).length(), (c - a).length()];
        let [steps_u, steps_v] = [across, along].map(|edge| (edge / spacing).ceil().clamp(1.0, 2000.0));
        let radius = 0.8 * (across / steps_u).max(along / steps_v);
        for i in 0..steps_u as usize {
            let u = (i as f32 + 0.33) / steps_u;
            for k in 0..(steps_v * (1.0 - i as f32 / steps_u)).ceil() as usize {
                let v = ((k as f32 + 0.33) / steps_v).min(1.0 - u);
                let mix = color(0) * (1.0 - u - v) + color(1) * u + color(2) * v;
                let color = mix.to_array().map(|c| c.round() as u8);
                let center = a + (b - a) * u + (c - a) * v;
                discs.push(Disc { center, normal, radius, color, filled: false, confidence: 0.0 });
            }
        }
    }
    discs
}

/// A triangle from the corner opposite its longest edge on.
fn opposite_first(mesh: &Mesh, [a, b, c]: [u32; 3]) -> [u32; 3] {
    let longest = |triangle: [u32; 3]| {
        let [_, b, c] = mesh.corners(triangle);
        (c - b).length_squared()
    };
    let turned = [[a, b, c], [b, c, a], [c, a, b]];
    turned.into_iter().max_by(|a, b| longest(*a).total_cmp(&longest(*b))).unwrap_or([a, b, c])
}

/// At most [`MOST_DISCS`] discs: those of a cell that face the same way become one.
fn merged(mut discs: Vec<Disc>) -> Vec<Disc> {
    // Surfaces fill a plane's share of the cells: the number falls with the square of the cell's side.
    let mut cell_m = 0.02_f32;
    while discs.len() > MOST_DISCS {
        let mut cells: BTreeMap<[i32; 4], (Disc, Vec3, f32)> = BTreeMap::new();
        for disc in &discs {
            let place = (disc.center / cell_m).floor().to_array().map(|i| i as i32);
            let key = [place[0], place[1], place[2], facing(disc.normal)];
            let color = Vec3::from(disc.color.map(f32::from));
            let (sum, colors, count) = cells.entry(key).or_insert((
                Disc { center: Vec3::ZERO, normal: Vec3::ZERO, ..*disc },
                Vec3::ZERO,
                0.0,
            ));
            sum.center += disc.center;
            sum.normal += disc.normal;
            sum.radius = sum.radius.max(disc.radius);
            *colors += color;
            *count += 1.0;
        }
        let whole = |(sum, colors, count): (Disc, Vec3, f32)| Disc {
            center: sum.center / count,
            normal: sum.normal.normalize_or(Vec3::Z),
            radius: sum.radius.max(COVERS * cell_m),
            color: (colors / count).to_array().map(|c| c.round() as u8),
            ..sum
        };
        discs = cells.into_values().map(whole).collect();
        cell_m *= 1.25;
    }
    discs
}

/// Number of the axis along which a normal mostly points, with its sign.
fn facing(normal: Vec3) -> i32 {
    let axis = normal.abs().max_position() as i32;
    2 * axis + i32::from(normal[axis as usize] < 0.0)
}

fn bytes(discs: &[Disc]) -> Vec<u8> {
    let low = discs.iter().fold(Vec3::splat(f32::INFINITY), |low, disc| low.min(disc.center));
    let high = discs.iter().fold(Vec3::splat(f32::NEG_INFINITY), |high, disc| high.max(disc.center));
    let (low, high) = if discs.is_empty() { (Vec3::ZERO, Vec3::ZERO) } else { (low, high) };
    let step = ((high - low) / f32::from(u16::MAX)).max(Vec3::splat(1e-6));
    let mut bytes = Vec::with_capacity(28 + 12 * discs.len());
    bytes.extend((discs.len() as u32).to_le_bytes());
    for value in low.to_array().into_iter().chain(step.to_array()) {
        bytes.extend(value.to_le_bytes());
    }
    for disc in discs {
        for steps in ((disc.center - low) / step).round().to_array() {
            bytes.extend((steps as u16).to_le_bytes());
        }
        bytes.extend(octahedral(disc.normal).map(|c| (c * 127.0).round() as i8 as u8));
        bytes.push((disc.radius / RADIUS_STEP_M).round().clamp(1.0, 255.0) as u8);
        bytes.extend(disc.color);
    }
    bytes
}

/// Unit vector as a place of the square −1 to 1 (Q. Meyer et al., "On Floating-Point Normal Vectors", 2010).
fn octahedral(normal: Vec3) -> [f32; 2] {
    let on_plane = normal.truncate() / (normal.x.abs() + normal.y.abs() + normal.z.abs()).max(1e-9);
    if normal.z >= 0.0 {
        return on_plane.to_array();
    }
    let sign = Vec2::new(1.0_f32.copysign(on_plane.x), 1.0_f32.copysign(on_plane.y));
    ((Vec2::ONE - Vec2::new(on_plane.y.abs(), on_plane.x.abs())) * sign).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Discs that the bytes say, as the page reads them.
    fn decoded(bytes: &[u8]) -> Vec<(Vec3, Vec3, f32, [u8; 3])> {
        let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let (low, step) =
            (Vec3::new(float(4), float(8), float(12)), Vec3::new(float(16), float(20), float(24)));
        let of_disc = |d: &[u8]| {
            let steps = [0, 2, 4].map(|i| f32::from(u16::from_le_bytes([d[i], d[i + 1]])));
            let [u, v] = [d[6], d[7]].map(|c| f32::from(c as i8) / 127.0);
            let mut normal = Vec3::new(u, v, 1.0 - u.abs() - v.abs());
            let fold = (-normal.z).max(0.0);
            normal.x -= fold.copysign(normal.x);
            normal.y -= fold.copysign(normal.y);
            (
                low + Vec3::from(steps) * step,
                normal.normalize(),
                f32::from(d[8]) * RADIUS_STEP_M,
                [d[9], d[10], d[11]],
            )
        };
        let discs: Vec<_> = bytes[28..].chunks(12).map(of_disc).collect();
        assert_eq!(discs.len(), u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize);
        discs
    }

    #[test]
    fn few_discs_are_sent_as_they_are() {
        let normals = [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, -0.64, -0.48), Vec3::new(-0.6, 0.0, 0.8)];
        let discs: Vec<Disc> = normals
            .iter()
            .enumerate()
            .map(|(i, normal)| Disc {
                center: Vec3::new(i as f32, -2.0 * i as f32, 0.5),
                normal: *normal,
                radius: 0.02,
                color: [10, 240, i as u8],
                filled: false,
                confidence: 1.0,
            })
            .collect();
        for (disc, (center, normal, radius, color)) in
            discs.iter().zip(decoded(&encode(&Geometry::Discs(discs.clone()), Vec3::ZERO)))
        {
            assert!((disc.center - center).length() < 1e-3 && (disc.normal - normal).length() < 0.03);
            assert!((radius - 0.02).abs() < 1e-6 && color == disc.color);
        }
    }

    #[test]
    fn a_mesh_becomes_few_discs_that_cover_it_and_face_the_room() {
        let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let mesh = Mesh {
            vertices: vec![corner(0.0, 0.0), corner(20.0, 0.0), corner(20.0, 20.0), corner(0.0, 20.0)],
            triangles: vec![[0, 1, 2], [0, 3, 2]],
            colors: vec![[90, 90, 90]; 4],
        };
        let discs = decoded(&encode(&Geometry::Mesh(mesh), Vec3::new(3.0, 3.0, 2.0)));
        assert!((20_000..=MOST_DISCS).contains(&discs.len()), "{}", discs.len());
        assert!(discs.iter().all(|(center, normal, ..)| center.z.abs() < 1e-3 && normal.z > 0.99));
        for (x, y) in [(0.3, 0.2), (7.77, 3.1), (19.9, 10.0), (2.0, 18.0)] {
            let covers = |(center, _, radius, _): &(Vec3, Vec3, f32, [u8; 3])| {
                (*center - corner(x, y)).length() <= 1.5 * radius
            };
            assert!(discs.iter().any(covers), "nothing at {x}, {y}");
        }
    }
}
