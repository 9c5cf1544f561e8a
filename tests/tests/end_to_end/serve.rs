//! `tracker serve` on the office as two rooms: files of the day, `kill -9`, SIGHUP with a bad and a good file, SIGTERM.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use mot::jsonl::{self, FrameLine};
use tests::data::{office, program};
use tests::live::run::free_address;

use crate::folder::Folder;
use crate::refusal::refused;

const PATIENCE: Duration = Duration::from_secs(90);

/// A service, which is killed when it is dropped.
struct Service {
    child: Child,
    log: Arc<Mutex<Vec<String>>>,
}

impl Service {
    fn start(folder: &Folder) -> Self {
        let mut command = program("tracker");
        command.args(["serve", "site.toml"]).current_dir(folder.path(""));
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let log = Arc::<Mutex<Vec<String>>>::default();
        let (own, errors) = (Arc::clone(&log), child.stderr.take().unwrap());
        thread::spawn(move || {
            for line in BufReader::new(errors).lines().map_while(Result::ok) {
                own.lock().unwrap().push(line);
            }
        });
        Self { child, log }
    }

    fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(Command::new("kill").args([&format!("-{name}"), &id]).status().unwrap().success());
    }

    fn has_logged(&self, words: &str) -> bool {
        self.log.lock().unwrap().iter().any(|line| line.contains(words))
    }

    fn wait_for(&self, what: &str, is_true: impl Fn() -> bool) {
        let until = Instant::now() + PATIENCE;
        while !is_true() {
            assert!(Instant::now() < until, "{what}: {:?}", self.log.lock().unwrap());
            thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // An error means that it has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn site(metrics: SocketAddr, more: &str) -> String {
    let (office, mut text) = (office(), String::from("out = \"out\"\n[run]\nno-film = true\n"));
    for (name, own) in [("hall", format!("metrics = \"{metrics}\"\n")), ("office", String::new())] {
        let [room, cam0, cam1] = ["room", "video/cam0.mp4", "video/cam1.mp4"].map(|path| office.join(path));
        let (room, cam0, cam1) = (room.display(), cam0.display(), cam1.display());
        text.extend([
            format!("[[room]]\nname = \"{name}\"\npath = \"{room}\"\n{own}"),
            format!("cameras = {{ cam0 = \"{cam0}\", cam1 = \"{cam1}\" }}\n"),
        ]);
    }
    text + "[[door]]\nrooms = [\"hall\", \"office\"]\nzones = [\"door A\", \"door B\"]\nseconds = [0, 4]\n"
        + more
}

/// The file of the day; `None` before there is one.
fn of_day(folder: &Folder, room: &str, name: &str) -> Option<PathBuf> {
    let days = std::fs::read_dir(folder.path("out").join(room)).ok()?.flatten();
    days.map(|day| day.path().join(name)).find(|path| path.is_file())
}

fn rows(folder: &Folder, room: &str) -> Vec<FrameLine> {
    of_day(folder, room, "tracks.jsonl").map_or_else(Vec::new, |path| jsonl::read(&path).unwrap())
}

fn has_person_above(folder: &Folder, room: &str, id: u32) -> bool {
    rows(folder, room).iter().flat_map(|row| &row.people).any(|person| person.id.0 > id)
}

fn page(address: SocketAddr) -> String {
    let Ok(mut stream) = TcpStream::connect(address) else { return String::new() };
    let mut text = String::new();
    write!(stream, "GET /metrics HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
    stream.read_to_string(&mut text).unwrap();
    text
}

#[test]
fn a_service_goes_on_after_a_kill_and_obeys_signals() {
    let (folder, metrics) = (Folder::new(), free_address().unwrap());
    folder.write("site.toml", site(metrics, ""));
    let mut service = Service::start(&folder);
    service.wait_for("rows of both rooms", || {
        ["hall", "office"].iter().all(|room| has_person_above(&folder, room, 0))
    });
    assert!(page(metrics).contains("roomtrack_frames_total"));

    folder.write("site.toml", site(metrics, "[garden]\n"));
    service.signal("HUP");
    service.wait_for("the refusal of a bad file", || service.has_logged("garden"));
    let before = rows(&folder, "hall").len();
    service.wait_for("the service as before", || rows(&folder, "hall").len() > before + 5);

    service.signal("KILL");
    service.child.wait().unwrap();
    folder.write("site.toml", site(metrics, ""));
    let highest =
        |room: &str| rows(&folder, room).iter().flat_map(|row| &row.people).map(|p| p.id.0).max().unwrap();
    service = Service::start(&folder);
    // The workers of the killed service have ended by themselves by then.
    service.wait_for("the resumption", || service.has_logged("hall: INFO goes on after frame"));
    let (first, last) = (highest("hall"), rows(&folder, "hall").last().unwrap().frame);
    service.wait_for("new ids", || has_person_above(&folder, "hall", first));
    // The reader refuses torn lines and frames that do not increase.
    assert!(rows(&folder, "hall").last().unwrap().frame > last);

    let one_room = site(metrics, "");
    let (one_room, _) = one_room.split_once("[[room]]\nname = \"office\"").unwrap();
    folder.write("site.toml", one_room);
    service.signal("HUP");
    service.wait_for("a room less", || service.has_logged("1 rooms go on, 1 have ended, 0 start"));
    service.signal("TERM");
    assert_eq!(service.child.wait().unwrap().code(), Some(0), "{:?}", service.log.lock().unwrap());
    for name in ["events.jsonl", "counts.csv", "heat.png", "groups.csv"] {
        assert!(of_day(&folder, "hall", name).is_some(), "{name}");
    }
    assert!(of_day(&folder, "site", "people.jsonl").is_some());
}

#[test]
fn a_site_that_cannot_be_followed_is_refused_before_anything_starts() {
    let folder = Folder::new();
    folder.write("site.toml", site(free_address().unwrap(), "").replace("door B", "door C"));
    let serve = |more: &[&str]| folder.run_program("tracker", &[&["serve", "site.toml"], more].concat());
    refused(&serve(&[]), &["site.toml", "[[door]] 1", "`door C`", "`door A`, `door B`"]);
    refused(&serve(&["--check"]), &["site.toml", "[[door]] 1"]);
    assert!(!folder.path("out").exists(), "something was written");
    let example = folder.run_program("tracker", &["serve", "--example"]);
    folder.write("example.toml", &example.stdout);
    // It is a valid file, whose rooms are not there.
    refused(&folder.run_program("tracker", &["serve", "example.toml"]), &["example.toml", "rooms/hall"]);
    assert!(!Path::new(&folder.path("out")).exists());
}
