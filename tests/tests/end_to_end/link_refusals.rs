//! Error lines of `tracker detect`, `link` and `eval` on bad input; no file is half-written.

use std::path::{Path, PathBuf};
use std::process::Output;

use tests::data::program;

use crate::refusal::refused;

struct LinkBench {
    folder: tempfile::TempDir,
}

impl LinkBench {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }
    fn file(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

fn tracker(words: &[&str], paths: &[&Path]) -> Output {
    let mut command = program("tracker");
    // A path is taken where a word is empty.
    let mut paths = paths.iter();
    for word in words {
        match *word {
            "" => command.arg(paths.next().unwrap()),
            word => command.arg(word),
        };
    }
    command.output().unwrap()
}

const ROWS: &str = "1,-1,10,10,30,60,0.9\n2,-1,11,10,30,60,0.9\n3,-1,12,10,30,60,0.9\n";

#[test]
fn linking_names_file_line_and_option() {
    let bench = LinkBench::new();
    let (good, out) = (bench.file("good.txt", ROWS), bench.file("out.txt", "as it was\n"));
    let bad = bench.file("bad.txt", "1,-1,10,10,30,60,0.9\n2,-1,10,NaN,30,60,0.9\n");
    refused(&tracker(&["link", "", "--out", ""], &[&bad, &out]), &["bad.txt", "line 2", "top"]);
    refused(&tracker(&["link", "", "--out", ""], &[&bench.path("none.txt"), &out]), &["none.txt"]);
    for (option, value) in [("--max-gap", "0"), ("--max-distance", "nan"), ("--birth-cost", "1e30")] {
        refused(&tracker(&["link", "", "--out", "", option, value], &[&good, &out]), &[option]);
    }
    let greedy = ["link", "", "--out", "", "--solver", "greedy", "--direction-threshold", "3"];
    refused(&tracker(&greedy, &[&good, &out]), &["greedy"]);
    refused(
        &tracker(&["link", "", "--out", "", "--tracklets"], &[&good, &out]),
        &["good.txt", "line 1", "id"],
    );
    // A report that cannot be written keeps the tracks from being written, too.
    let nowhere = bench.path("good.txt/report.json");
    refused(&tracker(&["link", "", "--out", "", "--report", ""], &[&good, &out, &nowhere]), &["good.txt"]);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "as it was\n");

    let done = tracker(&["link", "", "--out", ""], &[&good, &out]);
    assert!(done.status.success());
    assert_ne!(std::fs::read_to_string(&out).unwrap(), "as it was\n");
}

#[test]
fn colours_need_the_video_that_the_boxes_were_found_in() {
    let bench = LinkBench::new();
    let (good, out, video) = (bench.file("good.txt", ROWS), bench.path("out.txt"), bench.path("video"));
    std::fs::create_dir(&video).unwrap();
    let write = |frames: std::ops::RangeInclusive<u32>, size: u32| {
        for frame in frames {
            image::RgbImage::new(size, size).save(video.join(format!("{frame:04}.png"))).unwrap();
        }
    };
    let link = ["link", "", "--video", "", "--out", ""];
    write(1..=2, 100);
    refused(&tracker(&link, &[&good, &video, &out]), &["video", "frame 3"]);
    write(3..=3, 100);
    assert!(tracker(&link, &[&good, &video, &out]).status.success());
    std::fs::remove_file(&out).unwrap();
    write(1..=3, 16);
    refused(&tracker(&link, &[&good, &video, &out]), &["video", "frame 1", "16 × 16"]);
    let floor = bench.file("floor.txt", "1,-1,-1,-1,-1,-1,1,0.5,0.5,0\n");
    refused(&tracker(&link, &[&floor, &video, &out]), &["--video", "floor.txt"]);
    refused(&tracker(&link, &[&good, &bench.path("none"), &out]), &["none"]);
    assert!(!out.exists());
}

#[test]
fn files_that_are_none_are_named_and_so_is_a_rate_that_is_none() {
    let bench = LinkBench::new();
    let (good, out) = (bench.file("good.txt", ROWS), bench.path("out.txt"));
    refused(&tracker(&["link", "", "--out", ""], &[bench.folder.path(), &out]), &["Is a directory"]);
    let cut = bench.file("cut.txt", "1,-1,10,10,30,60,0.9\n2,-1,10");
    refused(&tracker(&["link", "", "--out", ""], &[&cut, &out]), &["cut.txt", "line 2", "3 columns"]);
    refused(&tracker(&["link", "", "--out", "", "--rate", "0"], &[&good, &out]), &["--rate"]);
    bench.file("seqinfo.ini", "[Sequence]\nframeRate=x\n");
    refused(&tracker(&["link", "", "--out", ""], &[&good, &out]), &["seqinfo.ini", "line 2"]);
    assert!(!out.exists());
}

#[test]
fn tuning_and_evaluating_name_what_is_missing() {
    let bench = LinkBench::new();
    let good = bench.file("good.txt", ROWS);
    refused(&tracker(&["link", "tune", "", "--truth", ""], &[&good, &good]), &["good.txt", "ids"]);
    let truth = bench.file("truth.txt", &ROWS.replace("-1,", "1,"));
    let many = ["link", "tune", "", "--truth", "", "--folds", "9"];
    refused(&tracker(&many, &[&good, &truth]), &["--folds"]);
    refused(
        &tracker(&["eval", "--truth", "", "--tracks", ""], &[bench.folder.path(), &good]),
        &["no sequence"],
    );
}

#[test]
fn detecting_names_video_and_model() {
    let bench = LinkBench::new();
    let (out, model) = (bench.path("out.txt"), bench.file("model.json", "{\"format\":1,\"weights\":[1.0]}"));
    let (none, empty) = (bench.path("none.avi"), bench.file("empty.avi", ""));
    refused(&tracker(&["detect", "", "--out", ""], &[&none, &out]), &["none.avi"]);
    refused(&tracker(&["detect", "", "--out", ""], &[&empty, &out]), &["empty.avi", "empty"]);
    refused(&tracker(&["detect", "", "--model", "", "--out", ""], &[&empty, &model, &out]), &["model.json"]);
    let small = ["detect", "", "--out", "", "--min-height", "1"];
    refused(&tracker(&small, &[&empty, &out]), &["--min-height"]);
    assert!(!out.exists());
}
