//! Tests of linking an online tracker's tracks: tracklets by themselves, and all files of a run.

use std::fmt::Write;

use super::whole_tests::rows;
use super::*;
use crate::jsonl;
use crate::rows::RowFile;

#[test]
fn tracklets_keep_their_rows_and_get_the_first_ones_id() {
    let walk = |id: u32, frames: std::ops::Range<u32>, y: f64| {
        frames.fold(String::new(), |mut text, f| {
            writeln!(text, "{f},{id},-1,-1,-1,-1,0.9,{},{y},0", 0.1 * f64::from(f)).unwrap();
            text
        })
    };
    // Person 4 is lost for six frames and returns as 9; 7 walks two metres beside them.
    let text = [walk(4, 1..20, 1.0), walk(7, 1..50, 3.0), walk(9, 26..50, 1.02)].concat();
    let found = link_tracklets(&rows(&text), &LinkOptions::default()).unwrap();
    assert_eq!(found.ids, [4, 7]);
    assert_eq!(found.renamed.into_iter().collect::<Vec<_>>(), [(4, 4), (7, 7), (9, 4)]);
    assert_eq!(found.tracks.iter().map(Vec::len).collect::<Vec<_>>(), [49, 49]);
    assert!((found.tracks[0][21].place.x - 2.2).abs() < 1e-9 && !found.tracks[0][21].is_seen);
    let error = link_tracklets(&rows("1,-1,-1,-1,-1,-1,1,0,0,0\n"), &LinkOptions::default()).unwrap_err();
    assert!(error.to_string().contains("line 1"), "{error}");
}

#[test]
fn a_run_is_mended_in_its_own_files() {
    let out = tempfile::tempdir().unwrap();
    std::fs::create_dir(out.path().join("boxes")).unwrap();
    let (mut floor, mut image) = (String::new(), String::new());
    for f in (1..=40u32).filter(|f| !(15..20).contains(f)) {
        let id = if f < 15 { 1 } else { 2 };
        writeln!(floor, "{f},{id},-1,-1,-1,-1,0.9,{:.4},1,0", 0.1 * f64::from(f)).unwrap();
        // The camera does not see them in frames 30 to 33.
        if !(30..34).contains(&f) {
            writeln!(image, "{f},{id},{},20,30,80,0.9,-1,-1,-1", 10 * f).unwrap();
        }
    }
    std::fs::write(out.path().join("tracks.txt"), floor).unwrap();
    std::fs::write(out.path().join("boxes/a.txt"), image).unwrap();
    let lines: String = (1..=40u32).map(moment).collect();
    std::fs::write(out.path().join("tracks.jsonl"), lines).unwrap();
    assert_eq!(mend_run(out.path(), 10.0).unwrap().tracks, 1);
    let read = |name: &str| RowFile::read(&out.path().join(name)).unwrap().rows;
    let frames = |name: &str| read(name).iter().map(|r| r.frame).collect::<Vec<_>>();
    assert_eq!(frames("tracks.txt"), (1..=40).collect::<Vec<_>>());
    assert_eq!(frames("boxes/a.txt"), (1..30).chain(34..=40).collect::<Vec<_>>());
    assert!(read("boxes/a.txt").iter().chain(&read("tracks.txt")).all(|r| r.id == Some(1)));
    let lines = jsonl::read(&out.path().join("tracks.jsonl")).unwrap();
    assert_eq!(lines.len(), 40);
    for (line, f) in lines.iter().zip(1..) {
        let [person] = line.people.as_slice() else { panic!("{line:?}") };
        assert_eq!((line.frame, person.id.0, line.count.len()), (f, 1, 2));
        assert!((person.x - 0.1 * f64::from(f)).abs() < 1e-4 && (person.vx - 1.0).abs() < 1e-3, "{person:?}");
    }
    // Halfway through the gap between frames 14 and 20.
    assert!((lines[16].people[0].visible["a"] - 0.7).abs() < 1e-9);
}

/// A line of `tracks.jsonl` at 10 frames a second: a walking person who is missing in frames 15 to 19 and has another
/// id afterwards.
fn moment(f: u32) -> String {
    let (id, visible) = if f < 15 { (1, 0.4) } else { (2, 1.0) };
    let person = format!(
        r#"{{"id":{id},"x":{:.4},"y":1,"radius":0.2,"height":1.7,"vx":1,"vy":0,"sigma":[0.1,0.1],"confidence":0.9,"visible":{{"a":{visible}}}}}"#,
        0.1 * f64::from(f)
    );
    let people = if (15..20).contains(&f) { String::new() } else { person };
    format!("{{\"frame\":{f},\"time\":{:.1},\"people\":[{people}]}}\n", 0.1 * f64::from(f - 1))
}
