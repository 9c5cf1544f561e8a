//! `tracker watch`: a live table of the stations that track together.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::Args;
use scenes::room::{self, Room};
use shell::ranges::INTERVAL_S;

use shell::files::refuse_inputs;

use super::endpoints::EndpointArguments;
use super::interrupt;
use crate::method::agents::{AgencyRecord, Overview, Packet, StationId};
use crate::tracks::AgentsFile;
use crate::wire::mesh::{Membership, OwnClock};
use crate::wire::{Endpoint, Fingerprint, Mesh};

/// Longest wait for packets.
const TICK: Duration = Duration::from_millis(100);
/// Interval of the table.
const TABLE_EVERY: Duration = Duration::from_secs(1);

/// Listen to stations that track together (`tracker station --method agents`), and print who tracks whom.
///
/// Prints a line for each change, and each second a table: people, and the confidence and position of each station's
/// agent for them. Sends nothing. With --out it writes OUT/agents.jsonl (a line for each received packet) and, at the
/// end, the figures positions.png (measured positions by station), confidences.png (confidence of each agent over time)
/// and agencies.png (membership of the agents over time). Ends with Ctrl-C, or after --for.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  tracker watch hall.local:7447,shop.local:7447
  tracker watch hall.local:7447,shop.local:7447 --room myroom --out out --for 60
  tracker watch --discover")]
pub(crate) struct WatchArgs {
    /// Addresses of all stations to be heard, or of a Zenoh router
    #[arg(value_name = "ENDPOINT", value_delimiter = ',')]
    connect: Vec<Endpoint>,
    /// Room directory; stations of other rooms are ignored [default: the room of the first station heard]
    #[arg(long, value_name = "DIR")]
    room: Option<PathBuf>,
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Time to listen, seconds
    #[arg(long = "for", value_name = "SECONDS", value_parser = INTERVAL_S.number())]
    longest: Option<f64>,
    #[command(flatten)]
    endpoints: EndpointArguments,
}

/// Runs the subcommand.
pub(crate) fn watch(args: &WatchArgs) -> anyhow::Result<String> {
    let endpoints = args.endpoints.endpoints(&args.connect)?;
    if let Some((out, room)) = args.out.as_deref().zip(args.room.as_deref()) {
        refuse_inputs(out, room::files_of(room))?;
    }
    let room = args.room.as_deref().map(Room::read).transpose()?;
    let cameras: Vec<String> =
        room.iter().flat_map(|room| &room.cameras).map(|camera| camera.name.clone()).collect();
    let membership = Membership {
        room: room.as_ref().map(Fingerprint::of),
        cameras,
        station: None,
        hears: Vec::new(),
        clock: OwnClock::default(),
    };
    let _lock = args.out.as_deref().map(shell::files::lock).transpose()?;
    let interrupted = interrupt::watch().context("the signals that end this program")?;
    let mesh = Mesh::open(&membership, &endpoints)?;
    let mut watch = WatchState {
        mesh,
        names: BTreeMap::new(),
        overview: Overview::default(),
        record: AgencyRecord::default(),
        file: args.out.as_deref().map(AgentsFile::new),
    };
    let begun = Instant::now();
    let mut table = Instant::now();
    let is_over = || args.longest.is_some_and(|longest| begun.elapsed().as_secs_f64() >= longest);
    while !interrupted.load(Ordering::Relaxed) && !is_over() {
        let is_due = table.elapsed() >= TABLE_EVERY;
        if is_due {
            table = Instant::now();
        }
        // A reader that closes the pipe ends the program.
        if !watch.listen(is_due)? {
            break;
        }
    }
    if let Some(out) = &args.out {
        let most = watch.names.keys().map(|station| usize::from(station.0) + 1).max().unwrap_or(0);
        let name = |i: usize| watch.names.get(&StationId(i as u8)).cloned().unwrap_or_default();
        watch.record.write(out, &(0..most).map(name).collect::<Vec<String>>())?;
    }
    let counts = watch.mesh.counts();
    for (refusal, count) in &counts.refused {
        tracing::warn!("{count} packets or stations were left out: {refusal}");
    }
    Ok(format!("{} packets heard\n", counts.heard))
}

/// State of the program.
struct WatchState {
    mesh: Mesh,
    /// Names of the stations' cameras.
    names: BTreeMap<StationId, String>,
    overview: Overview,
    record: AgencyRecord,
    file: Option<AgentsFile>,
}

impl WatchState {
    /// Waits for packets, and prints changes; returns whether the output is still read.
    fn listen(&mut self, with_table: bool) -> anyhow::Result<bool> {
        let heard = self.mesh.wait_received(TICK);
        if heard.iter().any(|packet| !self.names.contains_key(&packet.station)) {
            self.names = self.mesh.names().into_iter().collect();
        }
        let mut text = String::new();
        for packet in &heard {
            for line in self.take_in(packet)? {
                text.push_str(&stamped(packet.time_s, &line));
            }
        }
        let now_s = OwnClock::default().now_s();
        for line in self.overview.pass(now_s) {
            text.push_str(&stamped(now_s, &line));
        }
        if with_table {
            text += &self.overview.table();
        }
        let mut out = shell::console::stdout();
        Ok(out.write_all(text.as_bytes()).and_then(|()| out.flush()).is_ok())
    }

    fn take_in(&mut self, packet: &Packet) -> anyhow::Result<Vec<String>> {
        let camera = self.names.get(&packet.station).map_or("?", String::as_str);
        if let Some(file) = &mut self.file {
            file.write(packet, camera)?;
        }
        self.record.extend(packet);
        Ok(self.overview.extend(packet, camera))
    }
}

/// A line with its time of day before it, UTC: `12:30:05.25  cam0 is heard`.
fn stamped(time_s: f64, line: &str) -> String {
    let s = time_s.rem_euclid(86_400.0);
    let (hours, minutes) = ((s / 3600.0).floor(), (s / 60.0).floor() % 60.0);
    format!("{hours:02}:{minutes:02}:{:05.2}  {line}\n", s % 60.0)
}
