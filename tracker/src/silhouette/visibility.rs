//! How much of each body the room and the other bodies leave visible.

use super::{Body, ImageConic, Silhouette, View};

/// The part of each body that is visible in one view: hidden neither by the room nor by another body.
///
/// One silhouette a body, in the given order; [`fraction`] turns it into a number. Where two bodies overlap, the nearer
/// surface wins pixel by pixel.
pub fn visible_parts(view: &View, bodies: &[Body]) -> Vec<Silhouette> {
    let whole: Vec<Silhouette> = bodies.iter().map(|b| Silhouette::new(view, &b.ellipsoid())).collect();
    let conics: Vec<ImageConic> = bodies.iter().map(|b| ImageConic::new(view, &b.ellipsoid())).collect();
    let mut parts = whole.clone();
    for (i, part) in parts.iter_mut().enumerate() {
        for (j, other) in whole.iter().enumerate() {
            if i != j && overlap(&whole[i], other) {
                part.retain(|u, v| {
                    let depth = |conic: &ImageConic| conic.row(v as i32).near_z_m(u as i32);
                    !other.contains(u, v) || depth(&conics[i]) <= depth(&conics[j])
                });
            }
        }
    }
    parts
}

/// The visible fraction of a body's silhouette within the image; 0 when no part of it is in the image.
pub fn fraction(part: &Silhouette) -> f64 {
    if part.area_px == 0 { 0.0 } else { f64::from(part.visible_px) / f64::from(part.area_px) }
}

/// For each body, its visible fraction in each view.
pub fn visible_fractions(views: &[View], bodies: &[Body]) -> Vec<Vec<f64>> {
    let mut fractions = vec![Vec::with_capacity(views.len()); bodies.len()];
    for view in views {
        for (of_body, part) in fractions.iter_mut().zip(visible_parts(view, bodies)) {
            of_body.push(fraction(&part));
        }
    }
    fractions
}

fn overlap(a: &Silhouette, b: &Silhouette) -> bool {
    let meet = |a: std::ops::Range<usize>, b: std::ops::Range<usize>| a.start < b.end && b.start < a.end;
    meet(a.row_range(), b.row_range()) && meet(a.word_range(), b.word_range())
}
