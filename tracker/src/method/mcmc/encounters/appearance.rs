//! Appearance vectors that names showed in the undecided moments, for any set of exchanges: the two-covariance model of N. Brümmer,
//! E. de Villiers, "The speaker partitioning problem", Odyssey 2010.
//!
//! In the few dimensions in which the means of the tracks differ, the vector that a person shows in a second is
//! `x = mean of all + y + e`. The person's own part `y` has the variance `b` between people in each dimension, the error `e` the
//! variance `w` within one person; errors last about a second, so that the vectors of a second count as one. All vectors of one
//! name then have the log density
//!
//! ```text
//! ½ |S|² b / (w (w + n b))  −  ½ ln(1 + n b / w)        S = Σ x − mean of all,  n: number of seconds
//! ```
//!
//! up to what does not depend on who is who. Networks differ in how far apart people are: both variances are those of the window
//! itself, `w` from what each track shows two seconds later, `b` from the tracks' means.

use std::collections::BTreeMap;
use std::ops::Range;

use super::super::person::Key;
use super::super::smoother::LaggedMoment;
use super::super::traits::{HALF_KNOWN_BOXES, LearntTraits};
use crate::identity::mean_vector::MeanVector;

/// Time after which a network's errors are others, seconds.
const ERRORS_LAST_S: f64 = 1.0;
/// Interval of the moments of a track whose difference shows the errors, seconds.
const COMPARED_S: f64 = 2.0;
/// Number of seconds that what was learnt before the window is worth at most: it was seen from other sides.
const KNOWN_SECONDS: f64 = 5.0;
/// Largest number of dimensions, and least length of what a mean adds to those before.
const MOST_DIMENSIONS: usize = 24;
const LEAST_LENGTH: f64 = 0.05;
/// Least variance within a person over all dimensions: of a camera that shows a person twice in the same way, no more is known.
const LEAST_VARIANCE: f64 = 1e-3;

/// Sums of the vectors of tracks and names. A row has the dimensions, and then the number of seconds.
pub(super) struct Appearance {
    /// Length of a row.
    row: usize,
    /// Rows of each name before the window.
    known: Vec<f64>,
    /// Sum of the first moments of each track: `moments + 1` rows a track.
    shown: Vec<f64>,
    moments: usize,
    /// Variances of a second's vector within a person, and between people, in each dimension.
    within: f64,
    between: f64,
}

/// Vector of a track at a moment, in the dimensions.
struct Seen {
    track: usize,
    moment: usize,
    time_s: f64,
    vector: Vec<f64>,
}

impl Appearance {
    /// Sums of these moments, by the numbers of their tracks; `settled`: what was learnt of each name before them. `None` where
    /// no two tracks show different vectors.
    pub(super) fn new<'a>(
        settled: &[Option<&LearntTraits>],
        moments: impl Iterator<Item = &'a LaggedMoment> + Clone,
        tracks: &BTreeMap<Key, usize>,
    ) -> Option<Self> {
        let all = moments.clone().enumerate().flat_map(|(at, moment)| {
            let people = moment.people.iter().filter(|trace| trace.shown.vector.boxes() > 0.0);
            people.filter_map(move |trace| {
                Some((*tracks.get(&trace.key)?, at, moment.time_s, &trace.shown.vector))
            })
        });
        let mut sums = vec![MeanVector::default(); settled.len()];
        for (track, _, _, vector) in all.clone() {
            sums[track].add(vector, f64::INFINITY);
        }
        let dimensions = Dimensions::between(&sums)?;
        let coordinates = |vector: &MeanVector| dimensions.coordinates(vector);
        let seen: Vec<Seen> = all
            .map(|(track, moment, time_s, vector)| Seen {
                track,
                moment,
                time_s,
                vector: coordinates(vector),
            })
            .collect();
        let means: Vec<Vec<f64>> = sums.iter().filter(|sum| sum.boxes() > 0.0).map(coordinates).collect();
        let squared: f64 = means.iter().map(|mean| dot(mean, mean)).sum();
        let count = dimensions.axes.len() as f64;
        let times_s: Vec<f64> = moments.map(|moment| moment.time_s).collect();
        let known = settled.iter().flat_map(|traits| dimensions.known_row(*traits));
        Some(Self {
            row: dimensions.axes.len() + 1,
            known: known.collect(),
            shown: sums_of_tracks(&seen, &seconds_of(&times_s), settled.len(), dimensions.axes.len()),
            moments: times_s.len(),
            within: variance_within(&seen, settled.len())? / count,
            between: squared / (means.len() as f64 * count),
        })
    }

    /// Rows of all names before the window.
    pub(super) fn known(&self) -> &[f64] {
        &self.known
    }

    /// Adds what a track showed in some moments to the row of a name.
    pub(super) fn hand_over(&self, track: usize, moments: Range<usize>, name: usize, names: &mut [f64]) {
        let row = |moment: usize| &self.shown[(track * (self.moments + 1) + moment) * self.row..][..self.row];
        let of_name = &mut names[name * self.row..][..self.row];
        for ((sum, until), since) in of_name.iter_mut().zip(row(moments.end)).zip(row(moments.start)) {
            *sum += until - since;
        }
    }

    /// Log density of the rows of all names, nats.
    pub(super) fn log_density(&self, names: &[f64]) -> f64 {
        names.chunks_exact(self.row).map(|row| self.log_marginal(row)).sum()
    }

    fn log_marginal(&self, row: &[f64]) -> f64 {
        let (seconds, sums) = (row[self.row - 1], &row[..self.row - 1]);
        let squared: f64 = sums.iter().map(|sum| sum * sum).sum();
        let both = self.within + seconds * self.between;
        0.5 * squared * self.between / (self.within * both) - 0.5 * (both / self.within).ln()
    }
}

/// Number of seconds that each moment counts, by the times of all: its distance from the one before, at most [`ERRORS_LAST_S`].
fn seconds_of(times_s: &[f64]) -> Vec<f64> {
    let mut seconds: Vec<f64> =
        times_s.windows(2).map(|pair| (pair[1] - pair[0]).min(ERRORS_LAST_S)).collect();
    // The moment before the first one is not among them: as far away as the second.
    seconds.insert(0, seconds.first().copied().unwrap_or(ERRORS_LAST_S));
    seconds
}

/// Sums of the first moments of each track, one row for each number of them, with `count` dimensions.
fn sums_of_tracks(seen: &[Seen], seconds: &[f64], tracks: usize, count: usize) -> Vec<f64> {
    let row = count + 1;
    let of_track = row * (seconds.len() + 1);
    let mut sums = vec![0.0; tracks * of_track];
    for Seen { track, moment, vector, .. } in seen {
        let at = track * of_track + (moment + 1) * row;
        for (sum, value) in sums[at..].iter_mut().zip(vector) {
            *sum = seconds[*moment] * value;
        }
        sums[at + count] = seconds[*moment];
    }
    for sums in sums.chunks_exact_mut(of_track) {
        for at in row..of_track {
            sums[at] += sums[at - row];
        }
    }
    sums
}

/// Directions in which the means of the tracks differ, orthonormal, and the mean of all.
struct Dimensions {
    origin: Vec<f64>,
    axes: Vec<Vec<f64>>,
}

impl Dimensions {
    /// Dimensions of these tracks' vectors by the method of Gram and Schmidt; `None` without two that differ.
    fn between(tracks: &[MeanVector]) -> Option<Self> {
        let means: Vec<Vec<f64>> =
            tracks.iter().filter(|track| track.boxes() > 0.0).map(|track| track.mean().collect()).collect();
        let length = means.first()?.len();
        if means.iter().any(|mean| mean.len() != length) {
            return None;
        }
        let origin: Vec<f64> =
            (0..length).map(|i| means.iter().map(|mean| mean[i]).sum::<f64>() / means.len() as f64).collect();
        let mut axes: Vec<Vec<f64>> = Vec::new();
        for mean in &means {
            let mut rest: Vec<f64> = mean.iter().zip(&origin).map(|(value, middle)| value - middle).collect();
            for axis in &axes {
                let along = dot(&rest, axis);
                rest.iter_mut().zip(axis).for_each(|(value, part)| *value -= along * part);
            }
            let norm = dot(&rest, &rest).sqrt();
            if norm > LEAST_LENGTH && axes.len() < MOST_DIMENSIONS {
                axes.push(rest.iter().map(|value| value / norm).collect());
            }
        }
        (!axes.is_empty()).then_some(Self { origin, axes })
    }

    /// Row of what was learnt of a name before the window.
    fn known_row(&self, traits: Option<&LearntTraits>) -> Vec<f64> {
        let Some(vector) = traits.map(LearntTraits::vector).filter(|vector| vector.boxes() > 0.0) else {
            return vec![0.0; self.axes.len() + 1];
        };
        let seconds = KNOWN_SECONDS * vector.boxes() / (vector.boxes() + HALF_KNOWN_BOXES);
        let sums = self.coordinates(vector).into_iter().map(|value| seconds * value);
        sums.chain([seconds]).collect()
    }

    /// Coordinates of a mean vector.
    fn coordinates(&self, vector: &MeanVector) -> Vec<f64> {
        let from_origin: Vec<f64> =
            vector.mean().zip(&self.origin).map(|(value, middle)| value - middle).collect();
        self.axes.iter().map(|axis| dot(&from_origin, axis)).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Variance of what a track shows in a moment, over all dimensions together: half of the mean squared difference from what it
/// shows [`COMPARED_S`] later. People whom tracks exchanged in between make it larger, and the evidence smaller. `None` where nobody
/// was seen for as long.
fn variance_within(seen: &[Seen], tracks: usize) -> Option<f64> {
    let mut of_tracks: Vec<Vec<&Seen>> = vec![Vec::new(); tracks];
    for seen in seen {
        of_tracks[seen.track].push(seen);
    }
    let (mut sum, mut count) = (0.0, 0);
    for track in &of_tracks {
        let mut later = track.iter().peekable();
        for seen in track {
            while later.next_if(|later| later.time_s < seen.time_s + COMPARED_S - 1e-6).is_some() {}
            let Some(later) = later.peek() else { break };
            let squared: f64 = seen.vector.iter().zip(&later.vector).map(|(a, b)| (a - b).powi(2)).sum();
            sum += 0.5 * squared;
            count += 1;
        }
    }
    (count > 0).then(|| (sum / f64::from(count)).max(LEAST_VARIANCE))
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    /// Integral over the person's own part by the midpoint rule, relative to no part at all.
    #[test]
    fn the_density_of_a_name_is_the_integral_over_the_persons_own_part() {
        let (within, between) = (0.04_f64, 0.3_f64);
        let seconds: [f64; 4] = [0.4, 0.7, 0.2, 0.5];
        let appearance =
            Appearance { row: 2, known: Vec::new(), shown: Vec::new(), moments: 0, within, between };
        let found = appearance.log_density(&[seconds.iter().sum(), 4.0]);
        let step = 1e-3;
        let integral: f64 = (-4000..4000)
            .map(|i| (f64::from(i) + 0.5) * step)
            .map(|own| {
                let prior = (-0.5 * own * own / between).exp() / (std::f64::consts::TAU * between).sqrt();
                let gain = |x: &f64| (x * x - (x - own).powi(2)) / (2.0 * within);
                prior * seconds.iter().map(gain).sum::<f64>().exp() * step
            })
            .sum();
        assert_relative_eq!(found, integral.ln(), max_relative = 1e-6);
    }

    #[test]
    fn a_track_counts_as_many_seconds_as_it_is_seen_and_one_at_most_a_moment() {
        let times_s: Vec<f64> = (0..20).map(|moment| f64::from(moment) * 0.25).collect();
        let seen: Vec<Seen> = (4..16)
            .map(|moment| Seen { track: 1, moment, time_s: times_s[moment], vector: vec![2.0, -1.0] })
            .collect();
        let sums = sums_of_tracks(&seen, &seconds_of(&times_s), 2, 2);
        let row = |track: usize, moments: usize| sums[(track * 21 + moments) * 3..][..3].to_vec();
        assert_eq!((row(0, 20), row(1, 4)), (vec![0.0; 3], vec![0.0; 3]));
        assert_eq!((row(1, 8), row(1, 20)), (vec![2.0, -1.0, 1.0], vec![6.0, -3.0, 3.0]));
        assert_eq!(seconds_of(&[3.0, 8.0, 8.5]), [1.0, 1.0, 0.5]);
        assert_eq!(seconds_of(&[3.0]), [1.0]);
    }

    #[test]
    fn dimensions_are_those_in_which_tracks_differ() {
        let track = |vector: &[f32]| {
            let mut mean = MeanVector::default();
            (0..5).for_each(|_| mean.add_box(vector));
            mean
        };
        let tracks = [[1.0, 1.0, 0.0, 0.5], [1.0, 0.0, 1.0, 0.5], [1.0, -1.0, 0.0, 0.5]].map(|v| track(&v));
        let dimensions = Dimensions::between(&tracks).unwrap();
        assert_eq!(dimensions.axes.len(), 2, "three points span a plane");
        for (i, a) in tracks.iter().enumerate() {
            for b in &tracks[..i] {
                let squared =
                    |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum() };
                let (all_a, all_b): (Vec<f64>, Vec<f64>) = (a.mean().collect(), b.mean().collect());
                let shown = squared(&dimensions.coordinates(a), &dimensions.coordinates(b));
                assert_relative_eq!(shown, squared(&all_a, &all_b), max_relative = 1e-9);
            }
        }
        assert!(Dimensions::between(&[track(&[1.0, 0.0]), track(&[1.0, 0.0])]).is_none(), "nobody differs");
        assert!(Dimensions::between(&[track(&[1.0]), track(&[1.0, 0.0])]).is_none(), "other lengths");
        assert!(Dimensions::between(&[MeanVector::default()]).is_none(), "no vectors");
    }
}
