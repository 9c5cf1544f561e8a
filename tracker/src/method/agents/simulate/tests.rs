//! Experiment 2 with seeds on which no constant was chosen.

use super::{Comparison, Layout, Options, compare, draw, text};

fn all_kept_percent(comparison: &Comparison, name: &str) -> f64 {
    let row = comparison.rows.iter().find(|row| row.name == name).unwrap();
    row.tally.all_kept_percent()
}

#[test]
fn the_published_rule_keeps_all_six_where_the_centralised_variant_does_not() {
    for layout in Layout::SIX {
        let comparison = compare(&Options::published(layout), 1001, 50, || {});
        assert!(all_kept_percent(&comparison, "A published, leader") >= 94.0, "{}", text(&comparison));
        assert!(all_kept_percent(&comparison, "B centralised, as published") <= 5.0, "{}", text(&comparison));
        // Without larger errors at crossings a centre loses fewer people, but it still feeds its errors back.
        let best = |index: usize| comparison.sweep[index].best.kept;
        assert!(best(0) >= best(2), "{}", text(&comparison));
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = Options { seconds: 12.0, ..Options::hard() };
            let comparison = compare(&options, 3, 4, || {});
            let corridor = compare(&Options { seconds: 6.0, ..Options::corridor(20, 40) }, 3, 1, || {});
            (comparison.rows, comparison.sweep, comparison.traces, corridor.rows, corridor.traces)
        })
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn the_figure_has_a_panel_per_system_and_traces_lie_on_the_people() {
    let options = Options { seconds: 8.0, ..Options::published(Layout::Once) };
    let comparison = compare(&options, 1, 1, || {});
    let site = std::sync::Arc::new(super::Site::new(&options));
    let world = super::World::new(&options, &site, 1, 0);
    let picture = draw(&world, &comparison.traces);
    assert_eq!(comparison.traces.len(), 3);
    assert!(picture.width() > 3 * 500);
    // The traces lie on the people at 2 s, before the meeting.
    for (name, trace) in &comparison.traces {
        for (person, found) in trace[20].iter().enumerate() {
            let place = found.unwrap_or_else(|| panic!("{name}: person {person}"));
            assert!((place - world.places(20)[person]).norm() < 0.9, "{name}: person {person}");
        }
    }
}
