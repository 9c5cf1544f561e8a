//! Visible person at each pixel of a camera: the nearest body that no static surface hides.

use nalgebra::Point2;

use crate::silhouette::{Body, ImageConic, ImageOutline, View};

/// Visible surface at one pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct VisibleSurface {
    /// Index of the body + 1, or 0 without a body.
    owner: u16,
    /// Cosine of the angle between the surface's normal and the ray to the camera, 0 to 1.
    pub(super) facing: f32,
}

impl VisibleSurface {
    /// Index of the visible body.
    pub(super) fn owner(self) -> Option<usize> {
        usize::from(self.owner).checked_sub(1)
    }
}

/// Surfaces of the pinhole image, row by row.
#[derive(Debug, Clone)]
pub(super) struct SurfaceMap {
    width: usize,
    pub(super) surfaces: Vec<VisibleSurface>,
}

impl SurfaceMap {
    pub(super) fn new(view: &View, bodies: &[Body]) -> Self {
        let (width, pixels) = (view.width as usize, view.width as usize * view.height as usize);
        let mut layers = Self { width, surfaces: vec![VisibleSurface::default(); pixels] };
        let mut nearest = vec![f32::INFINITY; pixels];
        for (index, body) in bodies.iter().enumerate().take(usize::from(u16::MAX)) {
            layers.add(view, body, index as u16 + 1, &mut nearest);
        }
        layers
    }

    fn add(&mut self, view: &View, body: &Body, owner: u16, nearest: &mut [f32]) {
        let conic = ImageConic::new(view, &body.ellipsoid());
        let rows = match conic.outline() {
            ImageOutline::Ellipse(ellipse) => ellipse.rows,
            ImageOutline::Open if !conic.holds_camera() => conic.image()[0].clone(),
            ImageOutline::Open | ImageOutline::Nowhere => return,
        };
        let ellipsoid = body.ellipsoid();
        let (axes, from_body) = (ellipsoid.semi_axes, view.center - ellipsoid.center);
        for v in rows {
            let row = conic.row(v);
            for u in conic.spans(&row).into_iter().flatten().flatten() {
                let (at, z) = (v as usize * self.width + u as usize, row.near_z_m(u));
                if z as f32 >= nearest[at].min(view.static_z_m(u, v)) {
                    continue;
                }
                let ray = view.ray(f64::from(u), f64::from(v));
                // The gradient of |X / axes|² is perpendicular to the surface.
                let normal = (from_body + ray * z).component_div(&axes).component_div(&axes).normalize();
                nearest[at] = z as f32;
                let facing = (-normal.dot(&ray.normalize())).max(0.0) as f32;
                self.surfaces[at] = VisibleSurface { owner, facing };
            }
        }
    }

    /// Index of the body that is visible at a pixel; `None` outside the image or without a body.
    pub(super) fn owner_at(&self, pixel: Point2<f64>) -> Option<usize> {
        let (u, v) = (pixel.x.round(), pixel.y.round());
        let at =
            (u >= 0.0 && v >= 0.0 && u < self.width as f64).then(|| v as usize * self.width + u as usize)?;
        self.surfaces.get(at)?.owner()
    }
}
