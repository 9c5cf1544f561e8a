//! Silhouettes by which a body is compared with the masks: one for each camera and each shape of the rule.

use crate::silhouette::{Body, Shape, Silhouette, View};

/// Product of cameras and shapes, camera by camera: layer `c · shapes + s` is shape `s` seen by camera `c`.
#[derive(Debug, Clone)]
pub struct Layers {
    views: Vec<View>,
    shapes: &'static [Shape],
}

impl Layers {
    /// Layers of every shape in every view.
    pub fn new(views: Vec<View>, shapes: &'static [Shape]) -> Self {
        Self { views, shapes }
    }

    /// Views of the cameras.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// Shapes, the innermost first.
    pub fn shapes(&self) -> &'static [Shape] {
        self.shapes
    }

    /// Number of layers.
    pub fn count(&self) -> usize {
        self.views.len() * self.shapes.len()
    }

    /// Index of a layer's camera.
    pub fn camera(&self, layer: usize) -> usize {
        layer / self.shapes.len()
    }

    /// Index of a layer's shape.
    pub fn shape(&self, layer: usize) -> usize {
        layer % self.shapes.len()
    }

    /// Layer of a camera's outermost shape.
    pub fn outermost(&self, camera: usize) -> usize {
        (camera + 1) * self.shapes.len() - 1
    }

    /// Layer of a camera's innermost shape.
    pub fn innermost(&self, camera: usize) -> usize {
        camera * self.shapes.len()
    }

    /// Draws a body into one layer.
    pub fn draw(&self, layer: usize, body: &Body, into: &mut Silhouette) {
        into.draw(&self.views[self.camera(layer)], &self.shapes[self.shape(layer)].of(body));
    }

    /// Silhouettes of a body in every layer that is `wanted`; empty in the others.
    pub fn silhouettes(&self, body: &Body, wanted: impl Fn(usize) -> bool) -> Vec<Silhouette> {
        let mut drawn = vec![Silhouette::default(); self.count()];
        for (layer, silhouette) in drawn.iter_mut().enumerate().filter(|(layer, _)| wanted(*layer)) {
            self.draw(layer, body, silhouette);
        }
        drawn
    }
}
