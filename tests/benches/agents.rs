//! Figures of stations that track together: traffic, time from packet to use, return of a restarted station. Each is
//! printed beside the required bound.
//!
//! `cargo build --release --bins --features tracker/zenoh && cargo bench -p tests --bench agents --features tracker/zenoh`
#![forbid(unsafe_code)]

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use nalgebra::{Matrix2, Point2, Vector2};
use scenes::room::Room;
use tests::chain::StepResult;
use tests::live::proxy::Proxy;
use tests::live::run::free_address;
use tests::live::{Figure, agents, office, quantile};
use tracker::method::agents::{AgentId, Looks, Packet, Report, StationId, TargetId};
use tracker::source::utc_s;
use tracker::wire::mesh::{Membership, OwnClock};
use tracker::wire::{Endpoints, Fingerprint, Mesh};

/// Frames a second of the stations.
const RATE_HZ: f64 = 12.0;
/// Time for which the traffic is measured, seconds.
const TRAFFIC_S: f64 = 20.0;
/// Packets of the measurement of time…
const TIMED: u32 = 2000;
/// …and their interval.
const INTERVAL: Duration = Duration::from_millis(5);
/// Bound of the wait for a link.
const BOUND: Duration = Duration::from_secs(20);

/// Packet of station 0, which sees three people, taken now.
fn packet(sequence: u32) -> Packet {
    let report = |number: u32| Report {
        agent: AgentId { station: StationId(0), number },
        target: TargetId(100 + number),
        position: Point2::new(3.0 + f64::from(number), 2.0),
        covariance: Matrix2::new(0.04, 0.01, 0.01, 0.02),
        velocity: Vector2::new(0.8, -0.6),
        height_m: 1.75,
        looks: Some(Looks::default()),
        confidence: 0.98,
        is_crowded: false,
    };
    let (reports, time_s) = ((1..=3).map(report).collect(), utc_s(SystemTime::now()));
    Packet { station: StationId(0), sequence, time_s, greatest: TargetId(103), reports, ..Packet::default() }
}

/// Mesh of one station of a room of three cameras.
fn mesh(station: u8, endpoints: &Endpoints) -> StepResult<Mesh> {
    let room = Room::read(&office::room()).map_err(|e| e.to_string())?;
    let membership = Membership {
        room: Some(Fingerprint::of(&room)),
        cameras: ["a", "b", "c"].map(str::to_owned).to_vec(),
        station: Some(StationId(station)),
        hears: (0..3).filter(|other| *other != station).map(StationId).collect(),
        clock: OwnClock::default(),
    };
    Mesh::open(&membership, endpoints).map_err(|e| e.to_string())
}

fn endpoints(listen: Option<&str>, connect: Option<&str>) -> StepResult<Endpoints> {
    let parsed = |address: Option<&str>| address.map(str::parse).transpose().map(|e| e.into_iter().collect());
    Ok(Endpoints { listen: parsed(listen)?, connect: parsed(connect)?, ..Endpoints::default() })
}

/// Sends packets until every one of `hearers` has received one.
fn link(sender: &mut Mesh, hearers: &[Mesh], sequence: &mut u32) -> StepResult<()> {
    let begun = Instant::now();
    let mut linked = vec![false; hearers.len()];
    while linked.contains(&false) {
        *sequence += 1;
        sender.publish(&packet(*sequence)).map_err(|e| e.to_string())?;
        for (linked, hearer) in linked.iter_mut().zip(hearers) {
            *linked |= !hearer.wait_received(Duration::from_millis(20)).is_empty();
        }
        if begun.elapsed() > BOUND {
            return Err("the stations are not linked".into());
        }
    }
    Ok(())
}

/// Traffic of a station with three people to two neighbours, with all overhead of the network, bytes per second.
fn traffic() -> StepResult<f64> {
    let address = free_address()?;
    let mut sender = mesh(0, &endpoints(Some(&address.to_string()), None)?)?;
    let proxies = [Proxy::start(address)?, Proxy::start(address)?];
    let hear =
        |(station, proxy): (u8, &Proxy)| mesh(station, &endpoints(None, Some(&proxy.address.to_string()))?);
    let hearers = (1..).zip(&proxies).map(hear).collect::<StepResult<Vec<_>>>()?;
    let mut sequence = 0;
    link(&mut sender, &hearers, &mut sequence)?;
    let sent = || proxies.iter().map(Proxy::bytes).sum::<u64>();
    let (before, begun) = (sent(), Instant::now());
    let count = (TRAFFIC_S * RATE_HZ) as u32;
    for i in 1..=count {
        sender.publish(&packet(sequence + i)).map_err(|e| e.to_string())?;
        thread::sleep(
            (begun + Duration::from_secs_f64(f64::from(i) / RATE_HZ))
                .saturating_duration_since(Instant::now()),
        );
    }
    Ok((sent() - before) as f64 / begun.elapsed().as_secs_f64())
}

/// The other process of the measurement of time: prints the times from sending to use, seconds, one a line.
fn hear(address: &str) -> StepResult<()> {
    let mesh = mesh(1, &endpoints(None, Some(address))?)?;
    let mut last = Instant::now();
    while last.elapsed() < Duration::from_secs(3) {
        for packet in mesh.wait_received(Duration::from_millis(100)) {
            println!("{}", utc_s(SystemTime::now()) - packet.time_s);
            last = Instant::now();
        }
    }
    Ok(())
}

/// Times from sending to use in another process, milliseconds.
fn times_ms() -> StepResult<Vec<f64>> {
    let address = free_address()?.to_string();
    let mut sender = mesh(0, &endpoints(Some(&address), None)?)?;
    let own = std::env::current_exe().map_err(|e| e.to_string())?;
    let child = Command::new(own).args(["hear", &address]).stdout(Stdio::piped()).spawn();
    let child = child.map_err(|e| e.to_string())?;
    thread::sleep(Duration::from_secs(2));
    for sequence in 1..=TIMED {
        sender.publish(&packet(sequence)).map_err(|e| e.to_string())?;
        thread::sleep(INTERVAL);
    }
    let output = child.wait_with_output().map_err(|e| e.to_string())?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let times: Vec<f64> = text.lines().filter_map(|line| line.parse::<f64>().ok()).map(|s| s * 1e3).collect();
    if times.len() < TIMED as usize / 2 {
        return Err(format!("{} of {TIMED} packets were heard", times.len()));
    }
    Ok(times)
}

fn main() -> StepResult<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if let [command, address] = &arguments[..]
        && command == "hear"
    {
        return hear(address);
    }
    let mut figures = Vec::new();
    let what = "a station with three people, 12/s, two neighbours";
    figures.push(match traffic() {
        Ok(rate) => Figure::new(what, rate / 1e3, "kB/s", "<= 10"),
        Err(why) => Figure::unavailable(what, why, "<= 10"),
    });
    let what = "from packet to use, two processes";
    match times_ms() {
        Ok(times) => {
            for (name, share, asked) in [("p50", 0.5, "<= 1"), ("p99", 0.99, "<= 5")] {
                let value = quantile(times.iter().copied(), share).unwrap_or(f64::NAN);
                figures.push(Figure::new(format!("{what}: {name}"), value, "ms", asked));
            }
        }
        Err(why) => figures.push(Figure::unavailable(what, why, "<= 1")),
    }
    figures.extend(agents::restarted());
    println!("what | measured | asked");
    for figure in figures {
        println!("{}", figure.row());
        println!("{}", figure.json("agents"));
    }
    Ok(())
}
