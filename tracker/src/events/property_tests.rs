//! Properties of the events of random walks near all borders.

use mot::jsonl::{FrameLine, PersonLine};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::tests::{events_of, line, person, room};
use super::*;
use crate::TrackId;

/// A person's random path near all borders, with gaps.
fn some_path() -> impl Strategy<Value = Vec<Option<(f64, f64)>>> {
    (any::<u64>(), 20_usize..400).prop_map(|(seed, frames)| {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (mut x, mut y) = (rng.random_range(-1.0..7.0), rng.random_range(-1.2..1.2));
        let (mut vx, mut vy, mut hidden) = (0.0, 0.0, 0);
        (0..frames)
            .map(|_| {
                if rng.random_bool(0.1) {
                    (vx, vy) = (rng.random_range(-1.5..1.5), rng.random_range(-0.5..0.5));
                }
                if rng.random_bool(0.01) {
                    hidden = rng.random_range(1..60);
                }
                (x, y, hidden) = (x + 0.1 * vx, y + 0.1 * vy, hidden - 1);
                (hidden < 0).then_some((x, y))
            })
            .collect()
    })
}

fn lines_of(paths: &[&[Option<(f64, f64)>]]) -> Vec<FrameLine> {
    let frames = paths.iter().map(|path| path.len()).max().unwrap_or(0);
    let people = |i: usize| {
        let each = paths.iter().zip(1..).filter_map(|(path, id)| {
            path.get(i).copied().flatten().map(|(x, y)| {
                let before = i.checked_sub(1).and_then(|before| path[before]).unwrap_or((x, y));
                PersonLine { vx: 10.0 * (x - before.0), vy: 10.0 * (y - before.1), ..person(id, x, y) }
            })
        });
        each.collect()
    };
    (0..frames).map(|i| line(i as u32 + 1, people(i))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever people do: stays alternate and bear their duration, nobody is inside without having come, and what is
    /// taken back was told before.
    #[test]
    fn stays_and_counts_always_agree(path in some_path()) {
        let events = events_of(&lines_of(&[&path]));
        let mut valid: Vec<Event> = Vec::new();
        for event in events {
            if let Some(taken_back) = event.taken_back() {
                let told = valid.iter().rposition(|e| *e == taken_back);
                prop_assert!(told.is_some(), "{taken_back:?} was never told");
                valid.remove(told.unwrap_or_default());
            } else {
                valid.push(event);
            }
        }
        let mut tally = Tally::new(&room());
        for event in &valid {
            tally.add(event);
        }
        for (name, count) in tally.places().filter(|(name, _)| *name != "gate") {
            prop_assert!((0..=1).contains(&count.inside()), "{name}: {count:?}");
        }
        // A dwell is of a stay that goes on then: one more of the place has begun than ended.
        for dwell in valid.iter().filter(|e| e.kind == EventKind::Dwell) {
            let of_place = |kind| valid.iter().filter(move |e| e.kind == kind && e.place == dwell.place);
            let entries = of_place(EventKind::Enter).filter(|e| e.time <= dwell.time).count();
            let ended = of_place(EventKind::Leave).filter(|e| e.time < dwell.time).count();
            prop_assert_eq!(entries, ended + 1, "{:?}", dwell);
        }
        for place in ["door", "counter"] {
            let stays: Vec<&Event> = valid.iter().filter(|e| e.place.as_deref() == Some(place)).filter(|e| matches!(e.kind, EventKind::Enter | EventKind::Leave)).collect();
            for pair in stays.chunks(2) {
                prop_assert_eq!(pair[0].kind, EventKind::Enter);
                if let Some(leave) = pair.get(1) {
                    prop_assert_eq!(leave.kind, EventKind::Leave);
                    let seconds = leave.seconds.unwrap_or(f64::NAN);
                    prop_assert!((seconds - (leave.time - pair[0].time)).abs() < 2e-4, "{leave:?}");
                }
            }
        }
    }

    /// One person's events do not depend on the others.
    #[test]
    fn people_are_independent(a in some_path(), b in some_path()) {
        let together = events_of(&lines_of(&[&a, &b]));
        let absent = vec![None; a.len().max(b.len())];
        for (id, alone) in [(1, lines_of(&[&a, &absent])), (2, lines_of(&[&absent, &b]))] {
            let own: Vec<Event> = together.iter().filter(|e| e.id == Some(TrackId(id))).cloned().collect();
            prop_assert_eq!(events_of(&alone), own);
        }
    }
}
