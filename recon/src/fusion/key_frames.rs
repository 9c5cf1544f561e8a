//! Surfaces that key frames see beside the reference view: past the borders of its picture, behind its near things, and
//! in its holes.
//!
//! The camera's own view from its installed pose always takes precedence; but a person behind a cupboard walks on floor
//! that only key frames saw. Each key frame's view is completed as the reference's is ([`complete`]), and surfaces that
//! several of them confirm, and none looks past, are added.

use glam::Vec3;
use nalgebra::{Isometry3, Similarity3};
use rayon::prelude::*;
use scenes::geometry::Disc;

use super::witness::Witness;
use super::{FusionOptions, blocks, moved};
use crate::dense::DenseView;
use crate::planes::{Completed, PlaneOptions, complete};
use crate::surface::Surface;

/// Relative difference of two key frames' depths below which they are the same surface: key frames share the capture's
/// motion, so they differ by less than two cameras do.
const SAME_SURFACE: f32 = 0.015;
/// Least number of other key frames that must see the same surface.
const LEAST_AGREEING: usize = 2;

/// Discs in the reference camera's frame. `views`: the reference first, then the key frames; `reference`: its completed
/// view.
pub(crate) fn discs(
    views: &[DenseView],
    reference: &Completed,
    planes: &PlaneOptions,
    options: &FusionOptions,
) -> Vec<Disc> {
    let keys: Vec<KeyFrameView> =
        (1..views.len()).into_par_iter().filter_map(|key| KeyFrameView::of(views, key, planes)).collect();
    let each = |index: usize| {
        let key = &keys[index];
        let reference_from_key = rigid(&key.camera_from_reference.inverse());
        let installed = Witness::new(&reference.surface, &reference_from_key, true);
        let others: Vec<Witness<'_>> = (0..keys.len())
            .filter(|other| *other != index)
            // Of two key frames that see a surface the earlier one makes the disc: they were chosen farthest first.
            .map(|other| Witness::new(&keys[other].surface, &key.to(&keys[other]), other < index))
            .collect();
        let is_beside = |point: Vec3| {
            is_unseen(&installed, point, options)
                && !is_outside(reference, installed.from_camera.transform_point3(point))
                && is_confirmed(&others, point)
        };
        let keep: Vec<bool> =
            (0..key.surface.depth.len()).map(|i| key.surface.point(i).is_some_and(is_beside)).collect();
        let found = blocks::discs(&key.surface, &keep, options.flatness);
        let free = found.into_iter().filter(|disc| !hangs_before(disc, &installed, options));
        free.map(|disc| moved(&disc, &reference_from_key)).collect::<Vec<_>>()
    };
    (0..keys.len()).into_par_iter().flat_map_iter(each).collect()
}

/// Completed view of a key frame.
struct KeyFrameView {
    surface: Surface,
    camera_from_reference: Isometry3<f64>,
}

impl KeyFrameView {
    fn of(views: &[DenseView], key: usize, planes: &PlaneOptions) -> Option<Self> {
        let camera_from_reference = views[key].camera_from_reference;
        let from_key = |view: &DenseView| DenseView {
            camera_from_reference: view.camera_from_reference * camera_from_reference.inverse(),
            ..view.clone()
        };
        let others = views.iter().enumerate().filter(|(other, _)| *other != key).map(|(_, view)| view);
        let ordered: Vec<DenseView> = std::iter::once(&views[key]).chain(others).map(from_key).collect();
        Some(Self { surface: complete(&ordered, planes)?.surface, camera_from_reference })
    }

    fn to(&self, other: &Self) -> Similarity3<f64> {
        rigid(&(other.camera_from_reference * self.camera_from_reference.inverse()))
    }
}

/// Tells whether a disc of one camera's key frames adds to another camera's view: it is neither on nor before surfaces
/// that the camera sees itself, and not so near that it would be a blot in its picture.
pub(super) fn is_new(disc: &Disc, other: &Witness<'_>, options: &FusionOptions) -> bool {
    let is_blot = other
        .pixel(disc.center)
        .is_some_and(|(_, _, z)| disc.radius * other.scale * other.camera.fx > options.largest_radius_px * z);
    !is_blot && is_unseen(other, disc.center, options) && !hangs_before(disc, other, options)
}

/// Tells whether a disc beside a view's surfaces overlaps it: past the border of its picture, or round an edge.
fn hangs_before(disc: &Disc, view: &Witness<'_>, options: &FusionOptions) -> bool {
    const RIM: u8 = 8;
    let (right, up) = disc.normal.any_orthonormal_pair();
    (0..RIM).any(|k| {
        let (sin, cos) = (std::f32::consts::TAU * f32::from(k) / f32::from(RIM)).sin_cos();
        let rim = disc.center + disc.radius * (cos * right + sin * up);
        view.seen_at(rim).is_some_and(|(seen, z)| z < seen * (1.0 - options.same_surface))
    })
}

/// Tells whether a view has no observation of a point: it lies outside its picture, behind a surface, or in a hole.
fn is_unseen(view: &Witness<'_>, point: Vec3, options: &FusionOptions) -> bool {
    view.seen_at(point).is_none_or(|(seen, z)| z > seen * (1.0 + options.same_surface))
}

/// Tells whether enough key frames agree, none looks past, and no earlier one has made the disc already.
fn is_confirmed(others: &[Witness<'_>], point: Vec3) -> bool {
    let mut agreeing = 0;
    for view in others {
        let Some((seen, z)) = view.seen_at(point) else { continue };
        if (z / seen - 1.0).abs() < SAME_SURFACE {
            if view.first {
                return false;
            }
            agreeing += 1;
        } else if z < seen {
            return false;
        }
    }
    agreeing >= LEAST_AGREEING
}

/// Tells whether a point of the reference's frame lies behind a plane that encloses the room: a reflection, or a
/// mistake.
fn is_outside(reference: &Completed, point: Vec3) -> bool {
    let camera = reference.surface.pinhole();
    let (u, v) = (camera.fx * point.x / point.z + camera.cx, camera.fy * point.y / point.z + camera.cy);
    // A point behind the camera has no pixel, so planes do not exclude it.
    point.z > 0.0
        && reference.enclosing.iter().any(|plane| plane.hides(u, v, point.z, reference.surface.step))
}

fn rigid(pose: &Isometry3<f64>) -> Similarity3<f64> {
    Similarity3::from_isometry(*pose, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::{Pinhole, Support, SupportMap};
    use calib::Intrinsics;
    use image::{Rgb, RgbImage};
    use nalgebra::Vector3;

    const WALL_Z: f32 = 4.0;
    const FLOOR_Y: f32 = 1.2;
    /// A board before the wall: depth, half its width, its upper and its lower edge.
    const BOARD: (f32, f32, [f32; 2]) = (2.0, 0.5, [-0.4, 0.6]);
    /// Stereo's noise, metres at the wall; the measurements of this test are exact.
    const STEP: f32 = 0.002;

    fn lens() -> Intrinsics {
        Intrinsics::from_horizontal_fov(160, 120, 70.0)
    }

    /// A thing past the reference's border that only some views see.
    const THING: (f32, [f32; 2], f32) = (3.0, [2.15, 2.45], 0.3);

    /// Plane that a ray from (x, 0, 0) hits first, `n · X = 1` in the camera's frame there, and its colour.
    fn met(x: f32, ray: Vec3, with_thing: bool) -> (Vec3, [u8; 3]) {
        let (z, [left, right], half) = THING;
        let hit = ray * z + Vec3::X * x;
        if with_thing && (left..right).contains(&hit.x) && hit.y.abs() < half {
            return (Vec3::Z / z, [30, 30, 180]);
        }
        let (z, half, [top, bottom]) = BOARD;
        let hit = ray * z + Vec3::X * x;
        if hit.x.abs() < half && (top..bottom).contains(&hit.y) {
            return (Vec3::Z / z, [180, 30, 30]);
        }
        let (wall, floor) = (Vec3::Z / WALL_Z, Vec3::Y / FLOOR_Y);
        if floor.dot(ray) > wall.dot(ray) { (floor, [120, 80, 50]) } else { (wall, [200, 200, 190]) }
    }

    /// Stereo's view from (x, 0, 0).
    fn view(x: f32, with_thing: bool) -> DenseView {
        let k = lens();
        let camera = Pinhole { fx: k.fx as f32, fy: k.fy as f32, cx: k.cx as f32, cy: k.cy as f32 };
        let all = || (0..120).flat_map(|v| (0..160).map(move |u| (u, v)));
        let supports: Vec<Support> = all()
            .map(|(u, v)| {
                let ray = camera.ray(u as f32, v as f32);
                let (plane, _) = met(x, ray, with_thing);
                Support { w: plane.dot(ray), gu: plane.x / camera.fx, gv: plane.y / camera.fy }
            })
            .collect();
        let picture =
            RgbImage::from_fn(160, 120, |u, v| Rgb(met(x, camera.ray(u as f32, v as f32), with_thing).1));
        DenseView {
            picture,
            intrinsics: k,
            camera_from_reference: Isometry3::translation(-f64::from(x), 0.0, 0.0),
            map: SupportMap { width: 160, height: 120, costs: vec![0.1; supports.len()], supports },
            filmed: vec![true; 160 * 120],
            agreeing: vec![3; 160 * 120],
            step: STEP,
        }
    }

    fn found(views: &[DenseView]) -> Vec<Disc> {
        let planes = PlaneOptions::default();
        discs(views, &complete(views, &planes).unwrap(), &planes, &FusionOptions::default())
    }

    fn true_views() -> Vec<DenseView> {
        [0.0, -0.6, 0.6, -0.5, 0.5, -0.4, 0.4].map(|x| view(x, false)).into()
    }

    /// Tells whether the board hides a point of wall or floor from the reference.
    fn is_hidden(p: Vec3) -> bool {
        let (z, half, [top, bottom]) = BOARD;
        let on_board = p * z / p.z;
        p.z > 1.1 * z && on_board.x.abs() < half && (top..bottom).contains(&on_board.y)
    }

    #[test]
    fn key_frames_tell_what_the_board_hides_and_what_lies_past_the_border() {
        let found = found(&true_views());
        let k = lens();
        let is_past =
            |p: Vec3| !k.contains(&k.project(&nalgebra::Point3::from(p.as_dvec3().to_array())).unwrap());
        let (hidden, past): (Vec<&Disc>, Vec<&Disc>) = (
            found.iter().filter(|d| is_hidden(d.center)).collect(),
            found.iter().filter(|d| is_past(d.center)).collect(),
        );
        assert!(hidden.len() > 50 && past.len() > 50, "{} hidden, {} past", hidden.len(), past.len());
        for disc in &found {
            let off = (disc.center.z - WALL_Z).abs().min((disc.center.y - FLOOR_Y).abs());
            assert!(off < 0.02, "{disc:?}");
        }
        // The three key frames of a side see the wall up to 0.4 behind the board, over its height doubled. Each is
        // counted once: discs that cover squares are π / 2 as large.
        let area: f32 = hidden.iter().map(|d| std::f32::consts::PI * d.radius * d.radius).sum();
        let all = 2.0 * 0.4 * 2.0 * (BOARD.2[1] - BOARD.2[0]);
        assert!(area < 1.3 * std::f32::consts::FRAC_PI_2 * all, "{area} of {all}");
    }

    #[test]
    fn a_thing_has_to_be_seen_by_several_and_looked_past_by_none() {
        let things = |with_thing: &[f32], without: &[f32]| {
            let key = |x: &f32| view(*x, true);
            let mut views = vec![view(0.0, false)];
            views.extend(with_thing.iter().map(key).chain(without.iter().map(|x| view(*x, false))));
            let in_mid_air = |d: &&Disc| (d.center.z - THING.0).abs() < 0.1 && d.center.y < FLOOR_Y - 0.3;
            found(&views).iter().filter(in_mid_air).count()
        };
        assert!(things(&[0.8, 0.7, 0.6], &[-0.6]) > 5, "three see it, the fourth looks elsewhere");
        assert_eq!(things(&[0.8, 0.7], &[-0.6]), 0, "two see it");
        assert_eq!(things(&[0.8, 0.7, 0.6], &[0.5, 0.4]), 0, "two look past it");
        assert!(found(&true_views()[..1]).is_empty());
    }

    #[test]
    fn another_camera_has_the_last_word_in_what_it_sees() {
        let reference = view(0.0, false);
        let surface = Surface::from_view(&reference);
        let aside = Similarity3::new(Vector3::new(0.3, 0.0, 0.0), Vector3::zeros(), 1.0);
        let other = Witness::new(&surface, &aside, true);
        let disc = |z: f32, radius: f32| Disc {
            center: Vec3::new(0.9, 0.0, z),
            normal: -Vec3::Z,
            radius,
            color: [0; 3],
            filled: false,
            confidence: 3.0,
        };
        let options = FusionOptions::default();
        assert!(!is_new(&disc(WALL_Z, 0.02), &other, &options), "on the wall");
        assert!(!is_new(&disc(3.0, 0.02), &other, &options), "before the wall");
        assert!(is_new(&disc(4.5, 0.02), &other, &options), "behind the wall");
        assert!(!is_new(&disc(4.5, 0.4), &other, &options), "a blot");
        assert!(is_new(&disc(-1.0, 0.02), &other, &options), "behind the camera");
        // Its picture ends at x = 0.8 there: tan 35° · 1.6 less the 0.3 it stands aside.
        let at_border = |radius| Disc { center: Vec3::new(0.85, 0.0, 1.6), ..disc(1.6, radius) };
        assert!(is_new(&at_border(0.02), &other, &options), "past the border");
        assert!(!is_new(&at_border(0.08), &other, &options), "hangs into the picture");
    }
}
