//! Triangle strips: after two corners, each further one makes a triangle with the two before it; −1 ends a strip.

/// Index that stands for −1 in a list of corners.
pub(super) const END_OF_STRIP: u32 = u32::MAX;

/// Appends the triangles of strips, all seen from the side of each strip's first triangle. A repeated corner, by which
/// strips are joined, makes no triangle.
pub(super) fn triangles(corners: &[u32], triangles: &mut Vec<[u32; 3]>) {
    for strip in corners.split(|corner| *corner == END_OF_STRIP) {
        for (number, corners) in strip.windows(3).enumerate() {
            let &[a, b, c] = corners else { continue };
            if a == b || b == c || c == a {
                continue;
            }
            triangles.push(if number.is_multiple_of(2) { [a, b, c] } else { [b, a, c] });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_corner_after_two_makes_a_triangle_that_faces_as_the_first() {
        let mut found = Vec::new();
        let strips = [0, 1, 2, 3, END_OF_STRIP, 4, 5, 6, 6, 7, 8, END_OF_STRIP, END_OF_STRIP, 1, 2];
        triangles(&strips, &mut found);
        // The repeated corner counts, so the last triangle is an odd one, which is turned.
        assert_eq!(found, [[0, 1, 2], [2, 1, 3], [4, 5, 6], [7, 6, 8]]);
    }
}
