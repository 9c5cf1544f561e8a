//! The guide's commands (`docs/*.md`), run as its reader runs them: the blocks ```` ```sh ```` of a chapter one after the
//! other in a copy of the office, ```` ```sh,serves ```` until Ctrl-C. Those that install something (```` ```sh,install ````)
//! are run by `packaging/smoke.sh`.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use calib::Camera;
use calib::video::{FilmWriter, FrameSource};
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Vector3};
use tests::board::Board;
use tests::broker::{Broker, BrokerOptions};
use tests::data::{office, program};
use tests::office_room::{give_stages, give_stages_of_draft};

/// Frames of the office's films that are used: 20 without people, then the first ones who come in.
const FRAMES: usize = 72;
/// Time for which a command that serves is left to serve, seconds.
const SERVES_S: u32 = 7;

/// Exit status of a program that Ctrl-C has ended.
const INTERRUPTED: i32 = 130;

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

/// Whether a file of the guide's folder is text of the guide.
fn is_chapter(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "md")
}

/// A block of commands, and whether they serve until they are interrupted.
struct Block {
    commands: String,
    serves: bool,
    line: usize,
}

/// The blocks of a chapter that are run here.
fn blocks(chapter: &str) -> Vec<Block> {
    let text = std::fs::read_to_string(docs().join(chapter)).unwrap();
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    let mut is_other = false;
    for (i, line) in text.lines().enumerate() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(_), None) if is_other => is_other = false,
            (Some("sh"), None) => open = Some(Block { commands: String::new(), serves: false, line: i + 1 }),
            (Some("sh,serves"), None) => {
                open = Some(Block { commands: String::new(), serves: true, line: i + 1 });
            }
            (Some(_), None) => is_other = true,
            (None, Some(block)) => writeln!(block.commands, "{line}").unwrap(),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{chapter}: a block without an end");
    blocks
}

/// A film's first frames.
fn cut(film: &Path, to: &Path) {
    let mut frames = FrameSource::open(&film.to_string_lossy()).unwrap();
    let mut frame = RgbImage::default();
    let mut writer: Option<FilmWriter> = None;
    for _ in 0..FRAMES {
        assert!(frames.read(&mut frame).unwrap());
        let create = || FilmWriter::create(to, frame.width(), frame.height(), 12.0).unwrap();
        writer.get_or_insert_with(create).write(&frame).unwrap();
    }
    writer.unwrap().finish().unwrap();
}

/// Pictures of a chessboard as `calib intrinsics` wants them, by the office's first camera.
fn film_board(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    let intrinsics = calib::files::read_intrinsics(&office().join("cam0.toml")).unwrap();
    let camera = Camera { intrinsics, camera_from_world: Isometry3::identity() };
    for i in 0..15 {
        // In each of five parts of the picture, three tilts.
        let (part, tilt) = (i % 5, f64::from(i / 5) - 1.0);
        let (right, down) =
            [(0.0, 0.0), (-0.16, -0.1), (0.16, -0.1), (-0.16, 0.1), (0.16, 0.1)][part as usize];
        let turned = Vector3::new(0.45 * tilt, 0.4 - 0.35 * f64::from(part) * 0.5, 0.1 * tilt);
        let middle = Vector3::new(-0.125, -0.0875, 0.0);
        let place = Isometry3::new(Vector3::new(right, down, 0.45), turned)
            * Isometry3::from_parts(middle.into(), nalgebra::UnitQuaternion::identity());
        let mut picture = RgbImage::from_pixel(640, 480, Rgb([120, 118, 115]));
        Board { side_m: 0.025 }.draw(&mut picture, &camera, &place);
        picture.save(folder.join(format!("{i:02}.png"))).unwrap();
    }
}

/// The reader's folder: a copy of the office, with a shorter recording.
fn folder_of_the_reader() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let copied = Command::new("cp").arg("-r").arg(office().join(".")).arg(folder.path()).status().unwrap();
    assert!(copied.success());
    for camera in ["cam0", "cam1"] {
        let film = format!("video/{camera}.mp4");
        std::fs::remove_file(folder.path().join(&film)).unwrap();
        cut(&office().join(&film), &folder.path().join(&film));
    }
    folder
}

fn free_port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Runs a chapter. Ports, which a machine has once, are other ones than the guide's.
fn run_chapter(chapter: &str) {
    let blocks = blocks(chapter);
    assert!(!blocks.is_empty(), "{chapter} has no commands");
    let folder = folder_of_the_reader();
    let needs = |word: &str| blocks.iter().any(|block| block.commands.contains(word));
    // Rooms that the reader builds: the captures' stages are those of another build.
    for room in ["myroom", "first-look"]
        .into_iter()
        .filter(|room| needs(&format!("--out {room}")) || needs(&format!("--room {room}")))
    {
        let give = if needs("--quality draft") { give_stages_of_draft } else { give_stages };
        give(&folder.path().join(room)).unwrap();
    }
    if needs("board/") {
        film_board(&folder.path().join("board"));
    }
    let broker = needs("mqtt://localhost:1883").then(|| Broker::start(&BrokerOptions::default()).unwrap());
    let broker = broker.as_ref().map_or("localhost:1883".to_owned(), |broker| broker.address().to_string());
    let [first, second, third, metrics] = [(); 4].map(|()| free_port().to_string());
    let programs = PathBuf::from(program("roomtrack").get_program()).parent().unwrap().to_owned();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap_or_default());

    for Block { commands, serves, line } in blocks {
        let commands = [
            ("localhost:1883", broker.as_str()),
            ("7447", &first),
            ("7448", &second),
            ("7449", &third),
            ("9464", &metrics),
            ("scenes edit room", "scenes edit room --port 0"),
            ("room.toml --page", "room.toml --page --port 0"),
        ]
        .iter()
        .fold(commands, |commands, (written, here)| commands.replace(written, here));
        let commands = if serves {
            format!("exec timeout --preserve-status --signal INT {SERVES_S} {}", commands.trim())
        } else {
            commands
        };
        let ran = Command::new("bash")
            .args(["-euo", "pipefail", "-c", &commands])
            .current_dir(folder.path())
            .env("PATH", &path)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ran.stderr);
        // Ctrl-C ends a program that has nothing to complete.
        let is_right = ran.status.success() || (serves && ran.status.code() == Some(INTERRUPTED));
        assert!(is_right, "docs/{chapter}:{line}: {}\n{commands}\n{said}", ran.status);
        assert!(!said.contains("error:"), "docs/{chapter}:{line}\n{commands}\n{said}");
    }
}

/// A test a chapter, so that they run beside each other, and one that no chapter is forgotten.
macro_rules! chapters {
    ($($name:ident => $file:literal,)*) => {
        $(#[test]
        fn $name() {
            run_chapter($file);
        })*

        #[test]
        fn all_chapters_with_commands_are_run() {
            let mut with_commands: Vec<String> = std::fs::read_dir(docs())
                .unwrap()
                .map(|entry| entry.unwrap().file_name().into_string().unwrap())
                .filter(|name| is_chapter(name) && !blocks(name).is_empty())
                .collect();
            with_commands.sort();
            let mut run = vec![$($file.to_owned()),*];
            run.sort();
            assert_eq!(with_commands, run);
        }
    };
}

chapters! {
    the_tutorials_commands_work => "tutorial.md",
    the_commands_about_filming_work => "filming.md",
    the_commands_about_picks_work => "picks.md",
    the_commands_about_calibration_work => "calibration.md",
    the_commands_about_zones_work => "zones.md",
    the_commands_about_other_programs_work => "exchange.md",
    the_commands_about_tracking_work => "tracking.md",
    the_commands_about_live_input_work => "live.md",
    the_commands_about_events_work => "events.md",
    the_commands_about_the_service_work => "service.md",
    the_commands_about_evaluation_work => "evaluation.md",
    the_commands_about_tuning_work => "tuning.md",
    the_commands_of_troubleshooting_work => "troubleshooting.md",
}

#[test]
fn every_chapter_is_in_the_summary_and_every_entry_exists() {
    let summary = std::fs::read_to_string(docs().join("SUMMARY.md")).unwrap();
    let mut listed: Vec<&str> =
        summary.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    listed.sort_unstable();
    let mut there: Vec<String> = std::fs::read_dir(docs())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| is_chapter(name) && name != "SUMMARY.md")
        .collect();
    there.sort();
    assert_eq!(listed, there);
}
