//! Runs on network cameras: short forms of the measurements of the benchmark `live`.

use tests::live::{latency, outages};

#[test]
fn rows_come_while_two_cameras_film() {
    let latencies = latency::latencies(3.0, &[]).unwrap();
    assert!(!latencies.rows_s.is_empty() && !latencies.page_s.is_empty());
}

#[test]
fn a_run_outlasts_the_absence_of_all_cameras() {
    let absence = outages::all_away(4.0).unwrap();
    assert!(absence.rows_before > 0);
}
