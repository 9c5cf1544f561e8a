//! The loop over all rooms of a site.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use anyhow::Context;
use shell::console::Console;
use signal_hook::consts::SIGHUP;
use signal_hook::flag;

use super::site_plan::SitePlan;
use super::worker_process::{RoomReport, WorkerProcess};
use crate::cli::interrupt;
use crate::cli::room_service::Report;
use crate::serve::{DailyFilm, Day, PersonKey, SiteFiles, SiteIds, remove_older};

/// Interval of looks at signals and processes.
const LOOK: Duration = Duration::from_millis(100);
/// Interval of decisions about people at doors.
const DECIDE_EVERY: Duration = Duration::from_millis(500);
/// Interval of looks for files of old days.
const CLEAR_EVERY: Duration = Duration::from_mins(10);
/// Time that a worker has to write its results and end.
const FAREWELL: Duration = Duration::from_mins(1);

/// Follows the rooms of the site until the program is asked to end.
pub(super) fn supervise(file: &Path, console: &Console, verbose: u8) -> anyhow::Result<()> {
    let plan = SitePlan::read(file)?;
    let is_ended = interrupt::watch_as_service().context("the signals that end a service")?;
    let is_reloaded = Arc::new(AtomicBool::new(false));
    flag::register(SIGHUP, Arc::clone(&is_reloaded)).context("the signal that reads the file again")?;
    let mut supervisor = Supervisor::start(plan, console, verbose)?;
    while !is_ended.load(Ordering::Relaxed) {
        if is_reloaded.swap(false, Ordering::Relaxed) {
            match SitePlan::read(file) {
                Ok(plan) => supervisor.replace(plan)?,
                Err(error) => tracing::warn!("{error:#}; the service goes on as before"),
            }
        }
        supervisor.step()?;
    }
    supervisor.finish()
}

struct Supervisor<'a> {
    plan: SitePlan,
    workers: Vec<WorkerProcess>,
    site: Option<SiteFiles>,
    reports: (Sender<RoomReport>, Receiver<RoomReport>),
    decided: Instant,
    cleared: Option<Instant>,
    console: &'a Console,
    verbose: u8,
}

impl<'a> Supervisor<'a> {
    fn start(plan: SitePlan, console: &'a Console, verbose: u8) -> anyhow::Result<Self> {
        let workers = plan.rooms.iter().cloned().map(WorkerProcess::new).collect();
        let mut supervisor = Self {
            plan,
            workers,
            site: None,
            reports: channel(),
            decided: Instant::now(),
            cleared: None,
            console,
            verbose,
        };
        supervisor.open_site()?;
        Ok(supervisor)
    }

    /// Opens the site's files, or replaces their rooms and doors.
    fn open_site(&mut self) -> anyhow::Result<()> {
        let (doors, names) =
            (self.plan.doors.clone(), self.plan.rooms.iter().map(|room| room.name.clone()).collect());
        let begin = |next_id: u32| SiteIds::new(doors, next_id);
        match &mut self.site {
            Some(site) => site.replace(names, begin)?,
            None => self.site = Some(SiteFiles::open(&self.plan.site_out(), names, begin)?),
        }
        Ok(())
    }

    /// Goes on with another plan: rooms that are the same go on, others start or end.
    fn replace(&mut self, plan: SitePlan) -> anyhow::Result<()> {
        let is_same_site = self.plan.doors == plan.doors
            && self.plan.rooms.iter().map(|room| &room.name).eq(plan.rooms.iter().map(|room| &room.name));
        let is_moved = self.plan.site_out() != plan.site_out();
        let (kept, mut ended): (Vec<_>, Vec<_>) = std::mem::take(&mut self.workers)
            .into_iter()
            .partition(|worker| plan.rooms.contains(&worker.plan));
        ended.iter_mut().for_each(WorkerProcess::end);
        wait_for_end(&mut ended);
        for worker in &ended {
            self.lose(&worker.plan.name);
        }
        self.take_reports()?;
        self.workers = kept;
        for worker in &mut self.workers {
            worker.read_room();
        }
        let mut names: Vec<&str> = self.workers.iter().map(|worker| worker.plan.name.as_str()).collect();
        let started: Vec<_> =
            plan.rooms.iter().filter(|room| !names.contains(&room.name.as_str())).cloned().collect();
        names.extend(started.iter().map(|room| room.name.as_str()));
        tracing::info!(
            "the file was read again: {} rooms go on, {} have ended, {} start",
            self.workers.len(),
            ended.len(),
            started.len()
        );
        self.workers.extend(started.into_iter().map(WorkerProcess::new));
        self.plan = plan;
        self.cleared = None;
        if is_moved && let Some(site) = self.site.take() {
            site.finish()?;
        }
        if is_same_site && !is_moved { Ok(()) } else { self.open_site() }
    }

    /// Waits for a report for a moment, and looks after everything once.
    fn step(&mut self) -> anyhow::Result<()> {
        let mut lost = Vec::new();
        for worker in &mut self.workers {
            if worker.look(self.console, self.verbose, &self.reports.0) {
                lost.push(worker.plan.name.clone());
            }
        }
        match self.reports.1.recv_timeout(LOOK) {
            Ok(report) => self.take(report)?,
            // The supervisor has a sender itself.
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
        }
        self.take_reports()?;
        for room in lost {
            self.lose(&room);
        }
        if self.decided.elapsed() >= DECIDE_EVERY {
            self.decided = Instant::now();
            if let Some(site) = &mut self.site {
                site.advance()?;
            }
        }
        if self.cleared.is_none_or(|at| at.elapsed() >= CLEAR_EVERY) {
            self.cleared = Some(Instant::now());
            self.clear();
        }
        Ok(())
    }

    fn take_reports(&mut self) -> anyhow::Result<()> {
        while let Ok(report) = self.reports.1.try_recv() {
            self.take(report)?;
        }
        Ok(())
    }

    fn take(&mut self, (name, report): RoomReport) -> anyhow::Result<()> {
        let room = self.room(&name);
        let (Some(room), Some(site)) = (room, &mut self.site) else { return Ok(()) };
        match report {
            Report::Event { utc_s, event } => site.take(room, event, utc_s)?,
            Report::Heights(heights) => {
                for (id, height_m) in heights {
                    site.see(PersonKey { room, id }, height_m);
                }
            }
        }
        Ok(())
    }

    /// Everybody of a room is gone with its worker.
    fn lose(&mut self, name: &str) {
        if let (Some(room), Some(site)) = (self.room(name), &mut self.site) {
            site.lose_room(room);
        }
    }

    fn room(&self, name: &str) -> Option<usize> {
        self.plan.rooms.iter().position(|room| room.name == name)
    }

    /// Removes the files of old days.
    fn clear(&self) {
        let (today, retention) = (Day::today(), self.plan.retention);
        let site = self.plan.site_out();
        let mut outs: Vec<&Path> = self.plan.rooms.iter().map(|room| room.out.as_path()).collect();
        outs.push(&site);
        // A number of days includes the present one.
        let kept = [(retention.film_days, Some(DailyFilm::PREFIX)), (retention.days, None)];
        for (days, prefix) in kept.into_iter().filter_map(|(days, prefix)| days.map(|days| (days, prefix))) {
            let first = today.before(days - 1);
            for out in &outs {
                match remove_older(out, first, prefix) {
                    Ok(removed) if removed.is_empty() => {}
                    Ok(removed) => {
                        let what = if prefix.is_some() { "films" } else { "files" };
                        tracing::info!(
                            "{}: {what} of {} days before {first} were removed",
                            out.display(),
                            removed.len()
                        );
                    }
                    Err(error) => tracing::warn!("{error}; old files stay"),
                }
            }
        }
    }

    fn finish(mut self) -> anyhow::Result<()> {
        tracing::info!("the service ends");
        self.workers.iter_mut().for_each(WorkerProcess::end);
        wait_for_end(&mut self.workers);
        self.take_reports()?;
        if let Some(site) = self.site.take() {
            site.finish()?;
        }
        Ok(())
    }
}

/// Waits until workers that were made to end are gone.
fn wait_for_end(workers: &mut [WorkerProcess]) {
    let begun = Instant::now();
    loop {
        let is_late = begun.elapsed() > FAREWELL;
        let mut are_gone = true;
        for worker in workers.iter_mut() {
            are_gone &= worker.is_gone(is_late);
        }
        if are_gone {
            return;
        }
        std::thread::sleep(LOOK / 4);
    }
}
