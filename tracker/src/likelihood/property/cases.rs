//! The difficult cases, counted by rays: the property test is meaningful only if they occurred.

use std::collections::BTreeMap;
use std::fmt;

use super::Decisions;
use super::scene::{RayMeeting, TestScene, meet};
use crate::silhouette::Ellipsoid;

/// Cases that must have occurred, with the least number of occurrences.
const WANTED: [(&str, u32); 17] = [
    ("scene with a lens", 1500),
    ("scene of blocks", 1500),
    ("part of the twin not filmed", 500),
    ("room of discs", 1000),
    ("room of triangles", 1000),
    ("cut by the left border", 500),
    ("cut by the right border", 500),
    ("cut by the upper border", 500),
    ("cut by the lower border", 500),
    ("behind the camera", 1000),
    ("through the image plane, seen", 200),
    ("around the camera", 200),
    ("partly behind furniture", 800),
    ("wholly behind furniture", 200),
    ("partly below the floor", 1000),
    ("partly beyond the lens", 200),
    ("in front of each other", 2000),
];

/// Number of occurrences of each case.
#[derive(Default)]
pub(super) struct Cases(BTreeMap<&'static str, u32>);

impl Cases {
    fn note(&mut self, case: &'static str, occurs: bool) {
        *self.0.entry(case).or_default() += u32::from(occurs);
    }

    pub(super) fn note_scene(&mut self, scene: &TestScene) {
        self.note("scene with a lens", !scene.camera.real.intrinsics.distortion.is_none());
        self.note("scene of blocks", scene.view.block > 1);
        self.note(
            "part of the twin not filmed",
            scene.traced_pixels.iter().any(|s| s.is_shown == Some(false)),
        );
        let is_of_discs = scene.room.is_of_discs();
        self.note("room of discs", is_of_discs == Some(true));
        self.note("room of triangles", is_of_discs == Some(false));
    }

    /// Notes the cases of a body that comes into a scene or moves in it.
    pub(super) fn note_body(&mut self, scene: &TestScene, body: &Ellipsoid) {
        let eye = scene.eye();
        let forward = scene.to_world(&nalgebra::Vector3::z());
        // Along the camera's z: the body's middle, and its extent from there.
        let middle_m = forward.dot(&(body.center - eye));
        let reach_m = forward.component_mul(&body.semi_axes).norm();
        let is_around = (eye - body.center).component_div(&body.semi_axes).norm() < 1.0;
        self.note("around the camera", is_around);
        self.note("behind the camera", middle_m + reach_m < 0.0);
        if is_around {
            return;
        }
        let (mut seen, mut furniture, mut floor, mut lens) = (0, 0, 0, 0);
        for traced in &scene.traced_pixels {
            let [is_met, is_seen] = traced.of(&eye, body);
            seen += u32::from(is_seen == Some(true));
            if (is_met, is_seen) == (Some(true), Some(false)) {
                match traced.is_shown {
                    Some(true) if traced.furniture.to_m < traced.floor.from_m => furniture += 1,
                    Some(true) => floor += 1,
                    _ => lens += 1,
                }
            }
        }
        self.note("through the image plane, seen", seen > 0 && middle_m - reach_m < 0.0);
        self.note("partly behind furniture", seen > 0 && furniture > 0);
        self.note("wholly behind furniture", seen == 0 && furniture > 0 && lens == 0);
        self.note("partly below the floor", seen > 0 && floor > 0);
        self.note("partly beyond the lens", seen > 0 && lens > 0);
        let [width, height] = scene.size();
        // Seen in the outermost pixel, and met one pixel farther out.
        let is_cut = |inside: (i32, i32), outside: (i32, i32)| {
            let ray = scene.to_world(&scene.middle(outside.0, outside.1).ray);
            scene.traced_pixels[(inside.1 * width + inside.0) as usize].of(&eye, body)[1] == Some(true)
                && matches!(meet(&eye, &ray, body), RayMeeting::At(_))
        };
        self.note("cut by the left border", (0..height).any(|v| is_cut((0, v), (-1, v))));
        self.note("cut by the right border", (0..height).any(|v| is_cut((width - 1, v), (width, v))));
        self.note("cut by the upper border", (0..width).any(|u| is_cut((u, 0), (u, -1))));
        self.note("cut by the lower border", (0..width).any(|u| is_cut((u, height - 1), (u, height))));
    }

    /// Notes overlaps in a state, from the visible pixels of each shape of each body.
    pub(super) fn note_overlap(&mut self, seen: &[Vec<Decisions>]) {
        let pixels = seen.first().map_or(0, |body| body[0].len());
        let several = |i: usize| seen.iter().filter(|body| body[0][i] == Some(true)).nth(1).is_some();
        self.note("in front of each other", (0..pixels).any(several));
    }

    /// Asserts that each case occurred often enough.
    pub(super) fn assert_all(&self) {
        for (case, least) in WANTED {
            let found = self.0.get(case).copied().unwrap_or(0);
            assert!(found >= least, "{case}: {found} times; {least} are wanted");
        }
    }
}

impl fmt::Display for Cases {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|(case, found)| write!(f, "\n{found:6} {case}"))
    }
}
