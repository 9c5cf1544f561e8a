//! Expected box of a person in one camera, and the hidden part of it.

use nalgebra::{Matrix3, Vector3};

use crate::prepared_room::PreparedCamera;
use crate::silhouette::{Body, View};

/// Distance of the lowest visible point of a person (the feet) from their place, towards the camera, metres.
const FOOT_M: f64 = 0.08;
/// Least depth of a person with a box, along the camera's z, metres.
pub(super) const LEAST_DEPTH_M: f64 = 0.4;

/// Columns of the grid of points that measures the visible part of a box, as fractions of the width.
const COLUMNS: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Rows of the same grid, as fractions of the height.
const ROWS: [f64; 6] = [0.06, 0.236, 0.412, 0.588, 0.764, 0.94];
/// Number of points of the grid.
pub(super) const POINTS: u32 = (COLUMNS.len() * ROWS.len()) as u32;
/// Mask of all points.
const ALL: u32 = (1 << POINTS) - 1;

/// Least difference of depth at which one person hides another, metres.
const NEARER_M: f64 = 0.12;
/// Fraction of a box's width, at either side, that its person does not fill.
const EMPTY_SIDE: f64 = 0.06;
/// Least difference of depth at which the room hides a person's points, metres.
const ROOM_NEARER_M: f64 = 0.3;

/// Expected box. Pixels of the pinhole image at the working size.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ExpectedBox {
    /// Left, upper, right and lower edge, pixels.
    pub(super) edges: [f64; 4],
    /// Depth of the person's middle along the camera's z, metres.
    pub(super) depth_m: f64,
}

/// Projection of one camera, as boxes need it.
#[derive(Debug, Clone)]
pub(super) struct BoxCamera {
    /// K R and K t: homogeneous pixels from the world.
    matrix: Matrix3<f64>,
    offset: Vector3<f64>,
    /// Products of the entries of the matrix's rows i and j, summed over x and y, and those of z, for (i, j) = (0,
    /// 0), (0, 2), (1, 1), (1, 2), (2, 2).
    products: [[f64; 2]; 5],
    center: [f64; 2],
    /// Focal length, pixels.
    pub(super) focal_px: f64,
    pub(super) width_px: f64,
    pub(super) height_px: f64,
    /// Static depth of the room; `None` where nothing hides the floor.
    room: Option<View>,
}

impl BoxCamera {
    pub(super) fn new(camera: &PreparedCamera) -> Self {
        let k = &camera.pinhole.intrinsics;
        let intrinsics = Matrix3::new(k.fx, 0.0, k.cx, 0.0, k.fy, k.cy, 0.0, 0.0, 1.0);
        let pose = &camera.pinhole.camera_from_world;
        let matrix = intrinsics * pose.rotation.to_rotation_matrix().matrix();
        let product = |i: usize, j: usize| {
            let of = |column: usize| matrix[(i, column)] * matrix[(j, column)];
            [of(0) + of(1), of(2)]
        };
        let center = camera.pinhole.center();
        Self {
            products: [product(0, 0), product(0, 2), product(1, 1), product(1, 2), product(2, 2)],
            matrix,
            offset: intrinsics * pose.translation.vector,
            center: [center.x, center.y],
            focal_px: k.fx,
            width_px: f64::from(k.width),
            height_px: f64::from(k.height),
            room: (!camera.is_bare()).then(|| View::new(camera)),
        }
    }

    /// Expected box of a body. The image of its ellipsoid has the dual conic `P Q* Pᵀ`, whose tangents along rows and
    /// columns are the roots of quadratics; the lower edge is that of the feet. `None` for a person not wholly in
    /// front of the camera.
    pub(super) fn expected(&self, body: &Body) -> Option<ExpectedBox> {
        let half = 0.5 * body.height_m;
        let p = self.matrix * Vector3::new(body.x_m, body.y_m, half) + self.offset;
        if p.z < LEAST_DEPTH_M {
            return None;
        }
        let (across, along) = (body.radius_m * body.radius_m, half * half);
        let [uu, uz, vv, vz, zz] = self.products.map(|[xy, z]| across * xy + along * z);
        let square = zz - p.z * p.z;
        if square >= 0.0 {
            return None;
        }
        let roots = |diagonal: f64, mixed: f64| {
            let root = (mixed * mixed - diagonal * square).max(0.0).sqrt();
            [(mixed + root) / square, (mixed - root) / square]
        };
        let [left, right] = roots(uu - p.x * p.x, uz - p.x * p.z);
        let [top, _] = roots(vv - p.y * p.y, vz - p.y * p.z);
        let (dx, dy) = (self.center[0] - body.x_m, self.center[1] - body.y_m);
        let step = FOOT_M / (dx * dx + dy * dy).sqrt().max(FOOT_M);
        let (x, y) = (body.x_m + step * dx, body.y_m + step * dy);
        let row = |i: usize| self.matrix[(i, 0)] * x + self.matrix[(i, 1)] * y + self.offset[i];
        let foot_z = row(2);
        if foot_z < 0.5 * LEAST_DEPTH_M {
            return None;
        }
        Some(ExpectedBox { edges: [left, top, right, row(1) / foot_z], depth_m: p.z })
    }

    /// Points of a box that are outside the image, a bit each.
    pub(super) fn outside(&self, expected: &ExpectedBox) -> u32 {
        ALL & !inside(expected, [0.0, 0.0, self.width_px, self.height_px])
    }

    /// Points of a box that the room hides, a bit each, except those outside the image.
    pub(super) fn hidden_by_room(&self, expected: &ExpectedBox, outside: u32) -> u32 {
        let Some(room) = &self.room else { return 0 };
        let [left, top, right, bottom] = expected.edges;
        let mut hidden = 0;
        for (i, y) in ROWS.iter().enumerate() {
            for (j, x) in COLUMNS.iter().enumerate() {
                let bit = 1 << (i * COLUMNS.len() + j);
                if outside & bit != 0 {
                    continue;
                }
                let (u, v) = (left + (right - left) * x, top + (bottom - top) * y);
                let (u, v) = ((u as i32).min(room.width as i32 - 1), (v as i32).min(room.height as i32 - 1));
                if f64::from(room.static_z_m(u, v)) < expected.depth_m - ROOM_NEARER_M {
                    hidden |= bit;
                }
            }
        }
        hidden
    }

    /// Place on the floor (metres) of a person whose middle is at column `u` and who appears in row `v` at the height
    /// `height_m` above the floor; `None` where the ray does not meet that height.
    pub(super) fn place(&self, u: f64, v: f64, height_m: f64) -> Option<[f64; 2]> {
        let inverse = self.matrix.try_inverse()?;
        let center = -(inverse * self.offset);
        let ray = inverse * Vector3::new(u, v, 1.0);
        let steps = (height_m - center.z) / ray.z;
        (steps > 0.0 && steps.is_finite()).then(|| [center.x + steps * ray.x, center.y + steps * ray.y])
    }
}

/// Points of a box that another person hides, a bit each.
pub(super) fn hidden_by(expected: &ExpectedBox, other: &ExpectedBox) -> u32 {
    let [left, top, right, bottom] = other.edges;
    let apart = other.depth_m >= expected.depth_m - NEARER_M
        || left >= expected.edges[2]
        || right <= expected.edges[0]
        || top >= expected.edges[3]
        || bottom <= expected.edges[1];
    if apart {
        return 0;
    }
    let side = EMPTY_SIDE * (right - left);
    inside(expected, [left + side, top, right - side, bottom])
}

/// Points of a box that are within these edges, a bit each.
fn inside(expected: &ExpectedBox, [from_u, from_v, to_u, to_v]: [f64; 4]) -> u32 {
    let [left, top, right, bottom] = expected.edges;
    let within = |parts: &[f64], start: f64, length: f64, from: f64, to: f64| {
        parts.iter().enumerate().fold(0_u32, |bits, (i, part)| {
            let at = start + length * part;
            bits | u32::from(at > from && at < to) << i
        })
    };
    let columns = within(&COLUMNS, left, right - left, from_u, to_u);
    let rows = within(&ROWS, top, bottom - top, from_v, to_v);
    // The bits of the columns, repeated at the start of each row that is inside.
    (0..ROWS.len()).fold(0, |bits, i| bits | (((rows >> i) & 1) * columns) << (i * COLUMNS.len()))
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::{empty_room, standing};
    use super::*;
    use crate::silhouette::Silhouette;

    #[test]
    fn the_box_is_that_of_the_silhouette_but_for_the_feet() {
        let stage = empty_room();
        for camera in &stage.cameras {
            let (of_boxes, view) = (BoxCamera::new(camera), View::new(camera));
            let mut seen = 0;
            for (x, y) in [(3.0, 1.6), (2.0, 3.0), (3.5, 2.2)] {
                let body = standing(x, y);
                let drawn = Silhouette::new(&view, &body.ellipsoid());
                let expected = of_boxes.expected(&body).unwrap();
                if of_boxes.outside(&expected) != 0 {
                    continue;
                }
                seen += 1;
                let columns = drawn.pixels().map(|(u, _)| f64::from(u));
                let (left, right) = columns.fold((1e9_f64, 0.0_f64), |(l, r), u| (l.min(u), r.max(u)));
                let top = drawn.row_range().start as f64;
                assert!((expected.edges[0] - left).abs() < 1.01 && (expected.edges[2] - right).abs() < 1.01);
                assert!((expected.edges[1] - top).abs() < 1.01, "{} {top}", expected.edges[1]);
                let foot = camera.pinhole.project(&nalgebra::Point3::new(x, y, 0.0)).unwrap();
                assert!(expected.edges[3] > foot.y, "feet are nearer to the camera than the middle");
            }
            assert!(seen > 0);
        }
    }

    #[test]
    fn points_are_hidden_by_who_is_nearer_and_by_the_border() {
        let expected = ExpectedBox { edges: [100.0, 50.0, 140.0, 150.0], depth_m: 5.0 };
        let left_half = ExpectedBox { edges: [80.0, 0.0, 121.0, 200.0], depth_m: 4.0 };
        assert_eq!(hidden_by(&expected, &left_half).count_ones(), 12, "two columns of six points");
        assert_eq!(hidden_by(&expected, &ExpectedBox { depth_m: 4.95, ..left_half }), 0);
        assert_eq!(hidden_by(&left_half, &expected), 0);
        let stage = empty_room();
        let camera = BoxCamera::new(&stage.cameras[0]);
        let cut = ExpectedBox { edges: [-20.0, 50.0, 20.0, 100.0], depth_m: 5.0 };
        assert_eq!(camera.outside(&cut).count_ones(), 18, "the points at the border are not inside");
    }
}
