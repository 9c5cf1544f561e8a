//! Stations that track together, one process a camera, on two network cameras of the office.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::chain::StepResult;
use crate::live::Figure;
use crate::live::office::{self, CAMERAS, RATE_HZ};
use crate::live::proxy::Proxy;
use crate::live::rows::LiveRow;
use crate::live::run::{LiveRun, Scratch, free_address};
use crate::network_camera::NetworkCamera;

/// Time for which the cameras show the empty room, seconds: stations start, which takes longer where nothing has been read
/// from the disk yet.
const EMPTY_S: f64 = 8.0;
/// Frame of the office, from 0, at which one person is inside, and two come in soon…
pub const FIRST_FRAME: usize = 130;
/// …and frames in which both cameras see all three people, away from the doors. The films show them to and fro. One camera alone
/// cannot tell whether a hidden person turned round, or whether a person in a door left.
pub const INSIDE: std::ops::Range<usize> = 244..257;
/// Length of the films, seconds.
const FILM_S: f64 = 150.0;
/// Rows in which both stations must agree until they are taken to.
const AGREED: usize = 4;
/// Bound of every wait.
const BOUND: Duration = Duration::from_mins(1);

/// Two stations, their cameras, and the network between them.
#[derive(Debug)]
pub struct StationPair {
    /// Station of each camera; `None` while it does not run.
    pub stations: [Option<LiveRun>; 2],
    /// The second station's way to the first.
    pub network: Proxy,
    /// Addresses of the stations.
    pub addresses: [SocketAddr; 2],
    /// Time at which both films reach the frames [`INSIDE`].
    inside: Instant,
    cameras: [NetworkCamera; 2],
    scratch: Scratch,
    starts: usize,
}

impl StationPair {
    /// Starts two stations; people come in from this frame of the office on.
    ///
    /// # Errors
    /// A camera or a process that does not start.
    pub fn start(first_frame: usize) -> StepResult<Self> {
        let pictures = |seconds: f64| (seconds * RATE_HZ) as usize;
        let middle = INSIDE.start + (INSIDE.len() - 1) / 2;
        let coming = first_frame.min(middle)..middle;
        let inside_s = EMPTY_S + coming.len() as f64 / RATE_HZ;
        let inside = office::pendulum(INSIDE).take(pictures(FILM_S));
        let order: Vec<usize> = office::empty(pictures(EMPTY_S)).chain(coming).chain(inside).collect();
        let (cameras, epoch) = office::cameras(&order, false, Default::default())?;
        let addresses = [free_address()?, free_address()?];
        let network = Proxy::start(addresses[0])?;
        let (scratch, stations) = (Scratch::new()?, [None, None]);
        let inside = epoch + Duration::from_secs_f64(inside_s);
        let mut pair = Self { stations, network, addresses, inside, cameras, scratch, starts: 0 };
        pair.begin(0, &[])?;
        pair.begin(1, &[])?;
        Ok(pair)
    }

    /// Starts the station of a camera, again where it has run before.
    ///
    /// # Errors
    /// The process does not start.
    pub fn begin(&mut self, camera: usize, further: &[&str]) -> StepResult<()> {
        let mut arguments = vec!["--video".to_owned(), self.cameras[camera].url()];
        arguments.extend(["--listen".to_owned(), format!("tcp/{}", self.addresses[camera])]);
        if camera == 1 {
            arguments.extend(["--connect".to_owned(), format!("tcp/{}", self.network.address)]);
        }
        arguments.extend(further.iter().map(|&argument| argument.to_owned()));
        let out = self.out();
        self.starts += 1;
        self.stations[camera] =
            Some(LiveRun::start_agents(&office::room(), CAMERAS[camera], &out, &arguments)?);
        Ok(())
    }

    /// Folder of the station that is started next.
    fn out(&self) -> PathBuf {
        self.scratch.path(&self.starts.to_string())
    }

    /// Kills the station of a camera.
    pub fn kill(&mut self, camera: usize) {
        drop(self.stations[camera].take());
    }

    /// A running station.
    ///
    /// # Errors
    /// The station does not run.
    pub fn station(&mut self, camera: usize) -> StepResult<&mut LiveRun> {
        let station = self.stations[camera].as_mut();
        station.ok_or_else(|| format!("the station of {} does not run", CAMERAS[camera]))
    }

    /// Ids of everybody of whom a station knew in its last rows, where they are the same in all of them.
    ///
    /// # Errors
    /// The station does not run.
    pub fn people(&mut self, camera: usize) -> StepResult<Option<BTreeSet<u32>>> {
        let rows = self.station(camera)?.rows();
        let last = &rows[rows.len().saturating_sub(AGREED)..];
        let sets: Vec<BTreeSet<u32>> = last.iter().map(ids).collect();
        let is_steady = sets.len() == AGREED && sets.windows(2).all(|pair| pair[0] == pair[1]);
        Ok(sets.last().filter(|_| is_steady).cloned())
    }

    /// Waits until both stations know the same `count` people; returns their ids.
    ///
    /// # Errors
    /// The stations do not agree within a minute (the message has the people of each), or one ends.
    pub fn agreement(&mut self, count: usize) -> StepResult<BTreeSet<u32>> {
        let begun = Instant::now();
        loop {
            let [first, second] = [self.people(0)?, self.people(1)?];
            if let Some(people) = first.clone().filter(|people| people.len() == count)
                && first == second
            {
                return Ok(people);
            }
            if begun.elapsed() > BOUND {
                let logs: Vec<String> = self.stations.iter().flatten().flat_map(LiveRun::log).collect();
                return Err(format!("no agreement on {count} people: {first:?}, {second:?}; {logs:#?}"));
            }
            for camera in [0, 1] {
                self.station(camera)?.wait_until(Instant::now() + Duration::from_millis(20))?;
            }
        }
    }

    /// Waits until both cameras film all three people ([`INSIDE`]) and both stations agree on them; returns their ids.
    ///
    /// # Errors
    /// As [`Self::agreement`].
    pub fn agreement_on_all(&mut self) -> StepResult<BTreeSet<u32>> {
        let inside = self.inside;
        self.station(0)?.wait_until(inside)?;
        self.agreement(3)
    }

    /// Lets time pass while the station of a camera must run.
    ///
    /// # Errors
    /// The station ends.
    pub fn pass(&mut self, camera: usize, time: Duration) -> StepResult<()> {
        self.station(camera)?.wait_until(Instant::now() + time)
    }

    /// Waits until a station's log has a line that contains `text`.
    ///
    /// # Errors
    /// No such line within a minute (the message has the log), or the station ends.
    pub fn line(&mut self, camera: usize, text: &str) -> StepResult<()> {
        self.wait_for_line(camera, text, |line| line.contains(text))
    }

    /// Waits until a station's log has a line that `is_it`; `name` says in the message which.
    ///
    /// # Errors
    /// No such line within a minute (the message has the log), or the station ends.
    pub fn wait_for_line(
        &mut self,
        camera: usize,
        name: &str,
        is_it: impl Fn(&str) -> bool,
    ) -> StepResult<()> {
        let begun = Instant::now();
        loop {
            let log = self.station(camera)?.log();
            if log.iter().any(|line| is_it(line)) {
                return Ok(());
            }
            if begun.elapsed() > BOUND {
                return Err(format!("`{name}` is not in {log:#?}"));
            }
            self.pass(camera, Duration::from_millis(50))?;
        }
    }
}

/// Ids of everybody in a row.
pub fn ids(row: &LiveRow) -> BTreeSet<u32> {
    row.people.iter().map(|(id, _)| *id).collect()
}

/// Result of a station's death and return.
#[derive(Debug, Clone, PartialEq)]
pub struct RestartResult {
    /// Ids at both stations before.
    pub before: BTreeSet<u32>,
    /// Ids in each row of the other station, from the death until the restarted one knew everybody.
    pub meanwhile: Vec<BTreeSet<u32>>,
    /// Time from the first row of the restarted station to the first with everybody under the old ids, seconds.
    pub back_s: f64,
}

/// Kills the second of two stations that know three people, and starts it again `away` later.
///
/// # Errors
/// A station ends, or does not come to know the people.
pub fn restart(pair: &mut StationPair, away: Duration) -> StepResult<RestartResult> {
    let before = pair.agreement_on_all()?;
    pair.kill(1);
    let killed = Instant::now();
    pair.pass(0, away)?;
    pair.begin(1, &[])?;
    let everybody = before.clone();
    let until = Instant::now() + BOUND;
    let is_back = pair.station(1)?.wait_for(until, |rows| rows.iter().any(|row| ids(row) == everybody))?;
    let rows = pair.station(1)?.rows();
    let found = rows.first().zip(rows.iter().find(|row| ids(row) == before));
    let Some((first, back)) = found.filter(|_| is_back) else {
        let last = rows.last().map(ids);
        return Err(format!("the restarted station knows {last:?}, before {before:?}"));
    };
    let others = pair.station(0)?.rows();
    let meanwhile = others.iter().filter(|row| row.found > killed && row.found < back.found).map(ids);
    Ok(RestartResult {
        meanwhile: meanwhile.collect(),
        back_s: (back.found - first.found).as_secs_f64(),
        before,
    })
}

/// [`restart`] as figures.
pub fn restarted() -> Vec<Figure> {
    let what = "a station killed and started again: from its first frame to everybody under the old ids";
    let kept = "the same: frames of the other station meanwhile in which somebody has a new id";
    match StationPair::start(FIRST_FRAME).and_then(|mut pair| restart(&mut pair, Duration::from_secs(3))) {
        Ok(found) => {
            let other = found.meanwhile.iter().filter(|people| !people.is_subset(&found.before)).count();
            vec![Figure::new(what, found.back_s, "s", "<= 1"), Figure::new(kept, other as f64, "frames", "0")]
        }
        Err(why) => vec![Figure::unavailable(what, why, "<= 1")],
    }
}
