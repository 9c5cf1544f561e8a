//! `tracker serve` for some minutes: two rooms of two cameras that drop at random, a broker that is away for a while, a room
//! that is changed and read again.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::broker::{Broker, BrokerOptions, Subscriber};
use crate::chain::StepResult;
use crate::data::{office, program};
use crate::folder_files::files;
use crate::live::memory::resident_bytes;
use crate::live::office::{self, RATE_HZ};
use crate::live::run::{Scratch, error_line};
use crate::live::{Figure, quantile};
use crate::network_camera::{CameraOptions, Fault, NetworkCamera, Outage};

/// Names of the rooms.
const ROOMS: [&str; 2] = ["hall", "office"];
/// Time in which no camera drops at the beginning and at the end, seconds.
const QUIET_S: f64 = 12.0;
/// Time from one drop of a camera to the next, and its duration, seconds.
const DROPS_EVERY_S: std::ops::Range<f64> = 15.0..45.0;
const DROPS_FOR_S: std::ops::Range<f64> = 1.0..8.0;
/// Time to end, and for the last messages to come.
const PATIENCE: Duration = Duration::from_mins(1);
/// Interval of looks at the memory.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Findings about a service.
#[derive(Debug, Default)]
struct Findings {
    /// Lines of the log about processes that ended by themselves.
    crashes: Vec<String>,
    /// Memory of all its processes, bytes, at times from the start, seconds.
    memory: Vec<(f64, f64)>,
    /// Events in the files, of which the subscriber has not got so many.
    events: usize,
    lost: usize,
    /// Rows of all rooms.
    rows: usize,
    /// Number of drops of cameras.
    drops: usize,
}

/// A service, which is killed when it is dropped.
struct Service {
    child: Child,
    log: Arc<Mutex<Vec<String>>>,
}

impl Service {
    fn start(folder: &Path) -> StepResult<Self> {
        let mut command = program("tracker");
        command.args(["serve", "site.toml"]).current_dir(folder).stdin(Stdio::null());
        let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
        let mut child = child.map_err(|e| e.to_string())?;
        let log = Arc::<Mutex<Vec<String>>>::default();
        if let Some(errors) = child.stderr.take() {
            let own = Arc::clone(&log);
            thread::spawn(move || {
                for line in BufReader::new(errors).lines().map_while(Result::ok) {
                    own.lock().unwrap_or_else(PoisonError::into_inner).push(line);
                }
            });
        }
        Ok(Self { child, log })
    }

    fn log(&self) -> Vec<String> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn signal(&self, name: &str) -> StepResult<()> {
        let sent = Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status();
        sent.map(drop).map_err(|e| format!("kill: {e}"))
    }

    /// Memory of the supervisor and its workers, bytes.
    fn resident(&self) -> StepResult<f64> {
        let own = self.child.id();
        let children = std::fs::read_to_string(format!("/proc/{own}/task/{own}/children"));
        let children = children.map_err(|e| e.to_string())?;
        let workers = children.split_whitespace().filter_map(|id| id.parse().ok());
        // A worker that ends at this very moment counts nothing.
        Ok(resident_bytes(own)? + workers.filter_map(|id| resident_bytes(id).ok()).sum::<f64>())
    }

    fn end(&mut self) -> StepResult<()> {
        self.signal("TERM")?;
        let until = Instant::now() + PATIENCE;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) if status.success() => return Ok(()),
                Ok(Some(status)) => return Err(format!("{status}: {}", error_line(&self.log()))),
                _ if Instant::now() > until => return Err("the service does not end".to_owned()),
                _ => thread::sleep(Duration::from_millis(20)),
            }
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

/// Drops of one camera until a time, seconds.
fn drops(random: &mut Pcg64Mcg, until_s: f64) -> Vec<Outage> {
    let mut drops = Vec::new();
    let mut at_s = QUIET_S + random.random_range(DROPS_EVERY_S) / 2.0;
    while at_s + DROPS_FOR_S.end < until_s - QUIET_S {
        let fault =
            [Fault::Refused, Fault::Silent, Fault::Torn, Fault::Unanswered][random.random_range(0..4)];
        let back_s = at_s + random.random_range(DROPS_FOR_S);
        drops.push(Outage { from_s: at_s, until_s: back_s, fault });
        at_s = back_s + random.random_range(DROPS_EVERY_S);
    }
    drops
}

/// Copies the office's room, in which `more` is appended to the scene.
fn write_room(folder: &Path, name: &str, more: &str) -> StepResult<()> {
    let target = folder.join(name);
    std::fs::create_dir_all(&target).map_err(|e| e.to_string())?;
    for file in ["scene.toml", "room.ply"] {
        let mut content = std::fs::read(office().join("room").join(file)).map_err(|e| e.to_string())?;
        if file == "scene.toml" {
            content.extend(more.as_bytes());
        }
        std::fs::write(target.join(file), content).map_err(|e| e.to_string())?;
    }
    Ok(())
}

fn site(broker: &Broker, cameras: &[[NetworkCamera; 2]]) -> String {
    let mut text = format!(
        "out = \"out\"\n[run]\nno-film = true\nevents = \"on\"\n[mqtt]\nurl = \"mqtt://{}\"\n",
        broker.address()
    );
    for (name, cameras) in ROOMS.iter().zip(cameras) {
        let [first, second] = cameras;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "[[room]]\nname = \"{name}\"\npath = \"rooms/{name}\"\ncameras = {{ cam0 = \"{}\", cam1 = \"{}\" }}",
            first.url(),
            second.url()
        );
    }
    text
}

fn findings(length_s: f64, broker_away_s: f64, seed: u64) -> StepResult<Findings> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut findings = Findings::default();
    let mut broker = Broker::start(&BrokerOptions::default())?;
    let subscriber = Subscriber::start(&broker)?;
    let scratch = Scratch::new()?;
    let folder = scratch.path("site");
    let rooms = folder.join("rooms");
    let order = office::repeated(8.0, office::FRAMES + (8.0 * RATE_HZ) as usize);
    let mut cameras = Vec::new();
    for name in ROOMS {
        write_room(&rooms, name, "")?;
        let options = [(); 2].map(|()| {
            let faults = drops(&mut random, length_s);
            findings.drops += faults.len();
            CameraOptions { faults, seed: seed + findings.drops as u64, ..CameraOptions::default() }
        });
        cameras.push(office::cameras(&order, false, options)?.0);
    }
    std::fs::write(folder.join("site.toml"), site(&broker, &cameras)).map_err(|e| e.to_string())?;
    let mut service = Service::start(&folder)?;
    let started = Instant::now();
    // The broker goes at a third, the room changes at a half.
    let away_from_s = length_s / 3.0;
    let back_s = away_from_s + broker_away_s;
    let (mut is_away, mut is_changed) = (false, false);
    loop {
        let now_s = started.elapsed().as_secs_f64();
        if now_s >= length_s {
            break;
        }
        if (away_from_s..back_s).contains(&now_s) != is_away {
            is_away = !is_away;
            if is_away { broker.kill() } else { broker.restart()? }
        }
        if now_s >= length_s / 2.0 && !is_changed {
            is_changed = true;
            let region = "\n[[region]]\nname = \"middle\"\npolygon = [[0.5, -1.0], [2.5, -1.0], [2.5, 1.0], [0.5, 1.0]]\n";
            write_room(&rooms, ROOMS[0], region)?;
            service.signal("HUP")?;
        }
        findings.memory.push((now_s, service.resident()?));
        thread::sleep(LOOK_EVERY);
    }
    let ended = service.end();
    let log = service.log();
    let is_crash = |line: &&String| {
        line.contains("has failed") || line.contains("was lost") || line.contains("panicked")
    };
    findings.crashes.extend(log.iter().filter(is_crash).cloned());
    findings.crashes.extend(ended.err());
    // Every line of the event files must have been published, at least as often as it is in them.
    let mut written: BTreeMap<(String, String), usize> = BTreeMap::new();
    for (name, content) in files(&folder.join("out")) {
        let text = String::from_utf8_lossy(&content);
        let Some(room) = ROOMS.into_iter().find(|room| name.starts_with(room)) else { continue };
        if name.ends_with("tracks.jsonl") {
            findings.rows += text.lines().count();
        }
        if name.ends_with("events.jsonl") {
            for line in text.lines() {
                *written.entry((format!("roomtrack/{room}/event"), line.to_owned())).or_default() += 1;
            }
        }
    }
    findings.events = written.values().sum();
    let lost = || -> usize {
        let mut came: BTreeMap<(String, String), usize> = BTreeMap::new();
        for message in subscriber.received() {
            *came.entry((message.topic, message.payload)).or_default() += 1;
        }
        written.iter().map(|(line, times)| times.saturating_sub(came.get(line).copied().unwrap_or(0))).sum()
    };
    let until = Instant::now() + PATIENCE;
    while lost() > 0 && Instant::now() < until {
        thread::sleep(LOOK_EVERY);
    }
    findings.lost = lost();
    Ok(findings)
}

/// A service for so many seconds, its broker away for so many, as figures.
pub fn service(length_s: f64, broker_away_s: f64, seed: u64) -> Vec<Figure> {
    let what = format!("service of 4 streams for {length_s} s");
    let found = match findings(length_s, broker_away_s, seed) {
        Ok(found) => found,
        Err(why) => return vec![Figure::unavailable(what, why, "0")],
    };
    for line in &found.crashes {
        println!("{line}");
    }
    let median = |from: f64, until: f64| {
        let range = from * length_s..until * length_s;
        let within = found.memory.iter().filter(|(at_s, _)| range.contains(at_s));
        quantile(within.map(|(_, bytes)| *bytes), 0.5).unwrap_or(f64::NAN)
    };
    // After the first sixth, as 10 of 60 minutes; the room is read again at a half.
    let [early, before, after, late] =
        [(1.0, 2.0), (2.0, 3.0), (3.2, 4.2), (5.0, 6.0)].map(|(from, until)| median(from / 6.0, until / 6.0));
    let growth = |from: f64, until: f64| 100.0 * (until / from - 1.0);
    vec![
        Figure::new(format!("{what}: drops of cameras"), found.drops as f64, "", ""),
        Figure::new(format!("{what}: rows"), found.rows as f64 / length_s, "1/s", ""),
        Figure::new(format!("{what}: crashes"), found.crashes.len() as f64, "", "0"),
        Figure::new(format!("{what}: memory early"), early / 1e6, "MB", ""),
        Figure::new(
            format!("{what}: memory growth before the room is read again"),
            growth(early, before),
            "%",
            "",
        ),
        Figure::new(format!("{what}: memory growth by reading it"), growth(before, after), "%", ""),
        Figure::new(format!("{what}: memory growth after that"), growth(after, late), "%", ""),
        Figure::new(format!("{what}: memory growth in all"), growth(early, late), "%", "<= 2 (10 to 60 min)"),
        Figure::new(format!("{what}: events"), found.events as f64, "", ""),
        Figure::new(
            format!("{what}: events lost, broker away for {broker_away_s} s"),
            found.lost as f64,
            "",
            "0",
        ),
    ]
}
