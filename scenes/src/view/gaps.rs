//! Small gaps between the discs of a reconstruction, closed in pictures.
//!
//! For display only: rays that estimate anything pass through gaps as they are.

use rayon::prelude::*;

/// Empty cells of a grid that are surrounded by others within `reach` cells, each with those others, the nearest in
/// each of eight directions. At a rim (fewer than six directions hit a filled cell) nothing grows.
pub(crate) fn surrounded(
    width: usize,
    is_empty: &(impl Fn(usize) -> bool + Sync),
    count: usize,
    reach: usize,
) -> Vec<(usize, Vec<usize>)> {
    const DIRECTIONS: [(i64, i64); 8] =
        [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];
    const LEAST: usize = 6;
    let width = width.max(1) as i64;
    let height = count as i64 / width;
    (0..count)
        .into_par_iter()
        .filter(|i| is_empty(*i))
        .filter_map(|i| {
            let (column, row) = (i as i64 % width, i as i64 / width);
            let nearest = |(dx, dy): (i64, i64)| {
                (1..=reach as i64).find_map(|k| {
                    let (u, v) = (column + k * dx, row + k * dy);
                    let inside = (0..width).contains(&u) && (0..height).contains(&v);
                    let there = (v * width + u) as usize;
                    (inside && !is_empty(there)).then_some(there)
                })
            };
            let around: Vec<usize> = DIRECTIONS.into_iter().filter_map(nearest).collect();
            (around.len() >= LEAST).then_some((i, around))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_close_and_rims_do_not_grow() {
        let picture = [
            "..........",
            ".########.",
            ".##.#####.",
            ".####..##.",
            ".####..##.",
            ".########.",
            "..........",
        ];
        let full: Vec<bool> = picture.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        let found: Vec<usize> =
            surrounded(10, &|i| !full[i], full.len(), 2).into_iter().map(|(i, _)| i).collect();
        assert_eq!(found, [23, 35, 36, 45, 46]);
        assert!(surrounded(10, &|i| !full[i], full.len(), 0).is_empty());
        assert!(surrounded(0, &|_| true, 0, 3).is_empty());
    }
}
