//! Numbers, sizes, names and outputs that no program may believe: refused in one short line, before anything is lost.

use std::fs;
use std::os::unix::fs::symlink;
use std::process::Output;

use image::{Rgb, RgbImage};

use crate::folder::{Folder, camera_table, door_table};
use crate::refusal::{refused, refused_with};

const ROOM: &str = concat!("\nformat = 1\n", camera_table!("a", "0.0"), door_table!());

const ROWS: &str = "1,-1,10,10,30,60,0.9\n2,-1,11,10,30,60,0.9\n3,-1,12,10,30,60,0.9\n";

/// A room, a camera's pictures, detections.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("room/scene.toml", ROOM);
    folder.write("det.txt", ROWS);
    for frame in 1..=4_u8 {
        let noisy = |u: u32, v: u32| Rgb([90 + ((u * 7 + v * 13) % 5) as u8 + frame; 3]);
        folder.picture(&format!("frames/a/{frame:02}.png"), &RgbImage::from_fn(64, 48, noisy));
    }
    folder
}

/// Runs a command line; words are separated by spaces.
fn run(folder: &Folder, line: &str) -> Output {
    let words: Vec<&str> = line.split_whitespace().collect();
    let output = folder.run_program(words[0], &words[1..]);
    let said = String::from_utf8_lossy(&output.stderr);
    let long = said.lines().find(|line| line.len() > 300);
    assert!(long.is_none() && !said.contains('\u{1b}'), "{line}: {said}");
    output
}

const RUN: &str = "tracker run room --video a=frames/a --out out --no-film";

#[test]
fn rooms_with_numbers_beyond_every_room_are_refused_by_all_programs() {
    for (from, to, words) in [
        ("[1.0, 1.0]]", "[2147483648.0, 1.0]]", &["zone 1", "corner 3", "10000 metres"][..]),
        ("[1.0, 1.0]]", "[1.0, -9.3e18]]", &["zone 1", "10000 metres"]),
        ("3.0]", "1e308]", &["camera 1", "translation", "1e308", "10000 metres"]),
        ("width = 64", "width = 19999", &["camera 1", "megapixels"]),
        ("[60.0, 0.0, 31.5]", "[1e200, 0.0, 31.5]", &["matrix", "1e200"]),
        ("[0.0, 0.0, 0.0, 0.0, 0.0]", "[1e30, 0.0, 0.0, 0.0, 0.0]", &["distortion", "1e30"]),
    ] {
        let folder = folder();
        let room = ROOM
            .replacen(from, to, 1)
            .replace("height = 48", if from == "width = 64" { "height = 19999" } else { "height = 48" });
        folder.write("room/scene.toml", room);
        refused(&run(&folder, RUN), words);
        refused(&run(&folder, "scenes plan room --out plan.png"), words);
        refused_with(1, &run(&folder, "scenes check room"), words);
    }
}

#[test]
fn a_zone_that_is_far_away_takes_neither_time_nor_memory() {
    let folder = folder();
    let far = "[[zone]]\nname = \"far\"\npolygon = [[1000.0, 0.0], [1001.0, 0.0], [1001.0, 1.0]]\n";
    folder.write("room/scene.toml", format!("{ROOM}{far}"));
    let output = run(&folder, &format!("{RUN} --steps 20"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn options_out_of_their_ranges_name_the_range() {
    let folder = folder();
    let link = "tracker link det.txt --out tracks.txt";
    for (line, words) in [
        (format!("{link} --skip 4294967295"), ["--skip", "0 to 1000000 frames"]),
        (format!("{link} --smooth 1e12"), ["--smooth", "0 to 1000000 frames"]),
        (format!("{link} --max-gap 4294967295"), ["--max-gap", "1 to 1000000 frames"]),
        (format!("{link} --window 4294967295"), ["--window", "1 to 1000000 frames"]),
        (format!("{link} --rate 1e300"), ["--rate", "frames a second"]),
        (format!("{link} --max-distance 1e300"), ["--max-distance", "pixels"]),
        (format!("{RUN} --threads 1000000000"), ["--threads", "1 to 1024 threads"]),
        (format!("{RUN} --method condensation --hypotheses 1000000000"), ["--hypotheses", "1 to 100000"]),
        (format!("{RUN} --method condensation --layers 1000000000"), ["--layers", "1 to 1000"]),
        (format!("{RUN} --mask-width 4000000000"), ["--mask-width", "20000 pixels"]),
        (format!("{RUN} --latency 1e300"), ["--latency", "seconds"]),
        (format!("{RUN} --counts-every 1e300"), ["--counts-every", "seconds"]),
        (format!("{RUN} --rate 1e-300"), ["--rate", "frames a second"]),
        ("tracker detect frames/a --out d.txt --threads 1000000000".into(), ["--threads", "1024"]),
        ("tracker detect frames/a --out d.txt --min-height 1e300".into(), ["--min-height", "pixels"]),
        ("scenes plan room --out plan.png --cut 1e300".into(), ["--cut", "metres"]),
        ("recon build room.toml --out r --threads 60000".into(), ["--threads", "1024"]),
        ("calib intrinsics a.png --pattern 9x6 --square 1e300 --out c.toml".into(), ["--square", "metres"]),
        ("calib intrinsics a.png --pattern 9x60000000 --square 1 --out c.toml".into(), ["--pattern", "500"]),
    ] {
        refused(&run(&folder, &line), &words);
    }
    assert!(!folder.path("out").exists() && !folder.path("tracks.txt").exists());
}

#[test]
fn rows_out_of_their_ranges_name_line_and_range() {
    let folder = folder();
    for (row, words) in [
        ("4294967295,-1,10,10,30,60,0.9", ["line 1", "4000000000"]),
        ("1,-1,1e300,10,30,60,0.9", ["line 1", "pixels"]),
        ("1,-1,-1,-1,-1,-1,1,1e300,0,0", ["line 1", "10000 metres"]),
    ] {
        folder.write("bad.txt", row);
        refused(&run(&folder, "tracker link bad.txt --out tracks.txt"), &words);
        refused(&run(&folder, "tracker eval --truth bad.txt --tracks det.txt"), &words);
    }
    // One track over a month: its gap is not filled.
    folder.write("month.txt", "1,1,10,10,30,60,0.9\n60000000,1,10,10,30,60,0.9\n");
    let output = run(&folder, "tracker link month.txt --tracklets --out tracks.txt");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(fs::read_to_string(folder.path("tracks.txt")).unwrap().lines().count(), 2);
}

#[test]
fn outputs_that_are_or_hold_inputs_are_refused() {
    let folder = folder();
    symlink("det.txt", folder.path("link.txt")).unwrap();
    symlink("frames", folder.path("shown")).unwrap();
    folder.write("labels.txt", ROWS);
    folder.write("run/tracks.jsonl", "");
    let exported = run(&folder, "scenes export room --format nerfstudio --out transforms.json");
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    let before = folder.files();
    for line in [
        "scenes plan room --out room/scene.toml",
        "scenes depth room --camera a --out room/../room/scene.toml",
        "scenes export room --format nerfstudio --out room/scene.toml",
        "scenes export room --format colmap --out room",
        "scenes import transforms.json --out .",
        "calib pose --size 64x48 --picks det.txt --out link.txt",
        "tracker link det.txt --out det.txt",
        "tracker link det.txt --out link.txt",
        "tracker link link.txt --out ./det.txt",
        "tracker link det.txt --out x.txt --report det.txt",
        "tracker link det.txt --out x.txt --report x.txt",
        "tracker link experiment det.txt --truth labels.txt --out .",
        "tracker detect frames/a --out frames/a/01.png",
        "tracker detect train frames/a --boxes labels.txt --out labels.txt",
        "tracker masks --video a=frames/a --out frames",
        "tracker masks --video a=shown/a --out frames",
        "tracker masks --video a=frames/a/%02d.png --out frames/a",
        "tracker weightmap room --video a=frames/a --out frames/a",
        "tracker run room --video a=frames/a --out frames",
        "tracker run room --video a=frames/a --out .",
        "tracker run room --video a=frames/a --out room",
        "tracker eval --truth det.txt --tracks labels.txt --plots .",
        "tracker report run --room room --out run/tracks.jsonl",
        "tracker export run --room room --mcap run/tracks.jsonl",
        "tracker export run --room room --geojson room/scene.toml",
    ] {
        let output = run(&folder, line);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains("output"), "{line}: {said}");
        assert!(
            said.contains("would be lost") || said.contains("could be lost") || said.contains("name two"),
            "{line}: {said}"
        );
        assert!(folder.files() == before, "{line} has changed something");
    }
}

#[test]
fn what_files_and_names_hold_is_told_in_one_short_plain_line() {
    let folder = folder();
    folder.write("esc.txt", "1,-1,\u{1b}[2J\u{1b}]0;owned\u{7},1,1,1,1\n");
    folder.write("long.txt", format!("1,-1,{},1,1,1,1\n", "A".repeat(3_000_000)));
    refused(&run(&folder, "tracker link esc.txt --out o.txt"), &["esc.txt", "line 1", "\\u{1b}[2J"]);
    refused(&run(&folder, "tracker link long.txt --out o.txt"), &["long.txt", "line 1", "AAA", "no number"]);
    let name = "no\u{1b}[2Jwhere.txt";
    refused(&folder.run_program("tracker", &["link", name, "--out", "o.txt"]), &["no\\u{1b}[2Jwhere.txt"]);
    let skip = "1\u{1b}[2J";
    refused(
        &folder.run_program("tracker", &["link", "det.txt", "--out", "o.txt", "--skip", skip]),
        &["--skip"],
    );
    let zone = ROOM.replace("\"door\"", "\"do\\u001b[2Jor\"");
    folder.write("room/scene.toml", zone);
    let output = run(&folder, "scenes check room");
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(shown.contains("do\\u{1b}[2Jor") && !shown.contains('\u{1b}'), "{shown}");
}

#[test]
fn pictures_that_claim_more_than_they_may_are_refused_by_every_reader() {
    let folder = folder();
    // A PNG of 30,000 × 30,000 black pixels is small; its decoder would allocate 2.7 GB.
    let mut bytes = fs::read(folder.path("frames/a/01.png")).unwrap();
    bytes[16..24].copy_from_slice(&[0, 0, 0x75, 0x30, 0, 0, 0x75, 0x30]);
    let crc = bytes[12..29].iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 * (crc & 1)))
    });
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    folder.write("bombs/01.png", &bytes);
    for line in [
        "calib intrinsics bombs/01.png --pattern 9x6 --square 0.1 --out c.toml",
        "tracker masks --video a=bombs --out m",
        "tracker detect bombs --out d.txt",
        "tracker run room --masks a=bombs --out out",
    ] {
        refused(&run(&folder, line), &["01.png", "30000 × 30000", "200 megapixels"]);
    }
    // FFmpeg reads a single picture as a film, by the same limit.
    let film = format!("{RUN} --background a=bombs/01.png");
    refused(&run(&folder, &film), &["01.png", "200 megapixels"]);
}
