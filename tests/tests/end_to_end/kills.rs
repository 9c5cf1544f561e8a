//! A few kills of `recon build` and `tracker run` at random moments; the benchmark `kills` has many.

#[test]
fn a_killed_run_leaves_readable_files_and_is_repeated_to_the_byte() {
    let outcome = tests::kills::run(2, 1).unwrap();
    assert!(outcome.faults.is_empty(), "{outcome:?}");
}

#[test]
fn a_killed_build_leaves_no_half_room_and_is_repeated_to_the_byte() {
    let outcome = tests::kills::build(1, 1).unwrap();
    assert!(outcome.faults.is_empty(), "{outcome:?}");
}
