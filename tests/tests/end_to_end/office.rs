//! The whole chain on the office: films → room → tracks, each against the truth.

use tests::chain::{build_room, compare_rooms, evaluate, track};
use tests::data::office;

#[test]
fn people_are_followed_in_the_true_room() {
    let (office, out) = (office(), tempfile::tempdir().unwrap());
    let room = office.join("room");
    track(&office, &room, out.path(), &[]).unwrap();
    let tracking = evaluate(&office, &room, out.path()).unwrap();
    assert!(tracking.mota >= 92.0 && tracking.idf1 >= 95.0, "{tracking:?}");
    assert!(tracking.mean_m <= 0.10 && tracking.maximum_m <= 0.50, "{tracking:?}");
}

#[test]
fn the_room_comes_out_right_and_people_are_followed_in_it() {
    let (office, scratch) = (office(), tempfile::tempdir().unwrap());
    let (room, out) = (scratch.path().join("room"), scratch.path().join("tracks"));
    build_room(&office, &room).unwrap();

    let errors = compare_rooms(&room, &office.join("room"), 50).unwrap();
    assert!(errors.relative.position_cm <= 3.0 && errors.relative.rotation_deg <= 0.5, "{errors:?}");
    for (_, camera) in &errors.cameras {
        assert!(camera.tilt_deg <= 0.3 && camera.height_cm.abs() <= 2.0, "{errors:?}");
    }
    for (_, depth) in &errors.depth {
        assert!(depth.within >= 0.6, "{errors:?}");
    }

    track(&office, &room, &out, &[]).unwrap();
    let tracking = evaluate(&office, &room, &out).unwrap();
    assert!(tracking.mota >= 88.0 && tracking.idf1 >= 90.0 && tracking.mean_m <= 0.12, "{tracking:?}");
}

#[test]
fn the_same_seed_gives_the_same_bytes_at_any_number_of_threads() {
    let (office, scratch) = (office(), tempfile::tempdir().unwrap());
    let tracks = |threads: &str| {
        let out = scratch.path().join(threads);
        track(&office, &office.join("room"), &out, &["--threads", threads, "--seed", "5"]).unwrap();
        ["tracks.txt", "tracks.jsonl", "boxes/cam0.txt"].map(|file| std::fs::read(out.join(file)).unwrap())
    };
    let one = tracks("1");
    assert!(!one[0].is_empty());
    assert_eq!(one, tracks("2"));
}
