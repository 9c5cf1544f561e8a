//! Experiment 2 (Nakazawa et al., section 4.2): the same trials under the published rule (A), the centralised variant
//! (B) and the modern rule (C).

use std::sync::Arc;
use std::time::Instant;

use nalgebra::Point2;
use rayon::prelude::*;
use serde::Serialize;

use super::super::modern::{Modern, ModernOptions};
use super::super::published::{Published, PublishedOptions};
use super::super::{StationId, TargetId};
use super::trial::{Moment, run_trial};
use super::{
    CentralisedOptions, Crossing, Fates, Judge, Layout, Options, Site, World, hue_difference_deg, judge,
    run_centralised,
};

/// Factors of the errors of close people for which the centralised variant is run, besides that of the options.
const CLOSE_FACTORS: [f64; 2] = [1.0, 1.5];

/// Numbers of people kept, lost and confused over several trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Tally {
    /// Number of trials.
    pub trials: usize,
    /// Number of trials in which all people were kept.
    pub all_kept: usize,
    /// Number of people in all trials.
    pub people: usize,
    /// Number of people kept.
    pub kept: usize,
    /// Number of people lost.
    pub lost: usize,
    /// Number of people confused with others.
    pub confused: usize,
}

impl Tally {
    fn of<'a>(fates: impl Iterator<Item = &'a Fates>) -> Self {
        let count = |people: &[bool]| people.iter().filter(|is| **is).count();
        fates.fold(Self::default(), |sum, fates| Self {
            trials: sum.trials + 1,
            all_kept: sum.all_kept + usize::from(fates.kept.iter().all(|kept| *kept)),
            people: sum.people + fates.kept.len(),
            kept: sum.kept + count(&fates.kept),
            lost: sum.lost + count(&fates.lost),
            confused: sum.confused + count(&fates.confused),
        })
    }

    /// Trials in which all people were kept, percent.
    pub fn all_kept_percent(&self) -> f64 {
        percent(self.all_kept, self.trials)
    }
}

/// Share of a part in a whole, percent.
pub(super) fn percent(part: usize, whole: usize) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

/// Result of one system by one criterion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Name of the system and the criterion.
    pub name: &'static str,
    /// Numbers of people kept, lost and confused.
    pub tally: Tally,
}

/// Results of the centralised variant for one factor of noise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepRow {
    /// Factor of all errors where people are close.
    pub close_factor: f64,
    /// Results with the published options.
    pub published: Tally,
    /// Options with which all people are kept in the most trials.
    pub best_options: CentralisedOptions,
    /// Results with these options.
    pub best: Tally,
}

/// Speed of a rule in its first trial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Speed {
    /// Name of the rule.
    pub name: &'static str,
    /// Ratio of simulated time to run time of the whole trial.
    pub real_time_factor: f64,
    /// Median run time of the rule for one station and frame, microseconds.
    pub station_frame_us: f64,
}

/// Estimated places of each person by one system, metres: `[frame][person]`.
pub type Trace = Vec<Vec<Option<Point2<f64>>>>;

/// Results of one layout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Options of the simulation.
    pub options: Options,
    /// Seed of the trials.
    pub seed: u64,
    /// Results of the systems.
    pub rows: Vec<Row>,
    /// Results of the centralised variant over the factor of noise; empty when it was not run.
    pub sweep: Vec<SweepRow>,
    /// Speed of the two rules.
    pub speeds: Vec<Speed>,
    /// Trajectories of the first trial and names of the systems.
    #[serde(skip)]
    pub traces: Vec<(&'static str, Trace)>,
}

/// The two rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RuleName {
    Published,
    Modern,
}

/// Results of one trial of a rule.
struct Judged {
    leader: Fates,
    mean: Fates,
    each: Fates,
    trace: Trace,
}

/// Runs the comparison; `step` is called after each trial of each rule, from any thread. The centralised variant is not
/// run in a corridor, where no centre hears all stations.
pub fn compare(options: &Options, seed: u64, trials: usize, step: impl Fn() + Sync) -> Comparison {
    let site = Arc::new(Site::new(options));
    let world = |trial: usize| World::new(options, &site, seed, trial as u64);
    let mut rows = Vec::new();
    let mut speeds = Vec::new();
    let mut traces = Vec::new();
    for (rule, name) in [(RuleName::Published, "A published"), (RuleName::Modern, "C modern")] {
        let first_world = world(0);
        let begin = Instant::now();
        let (first, station_frame_s) = run(&first_world, rule, true);
        let wall_s = begin.elapsed().as_secs_f64();
        speeds.push(Speed {
            name,
            real_time_factor: options.seconds / wall_s,
            station_frame_us: 1e6 * station_frame_s,
        });
        step();
        let mut judged = vec![first];
        judged.par_extend((1..trials).into_par_iter().map(|trial| {
            let result = run(&world(trial), rule, false).0;
            step();
            result
        }));
        let mut row = |name, fates: fn(&Judged) -> &Fates| {
            rows.push(Row { name, tally: Tally::of(judged.iter().map(fates)) });
        };
        match rule {
            RuleName::Published => {
                row("A published, leader", |j| &j.leader);
                row("A published, mean", |j| &j.mean);
            }
            RuleName::Modern => row("C modern, every station", |j| &j.each),
        }
        traces.push((name, std::mem::take(&mut judged[0].trace)));
    }
    let mut sweep: Vec<SweepRow> = Vec::new();
    if options.layout != Layout::Corridor {
        let factors = CLOSE_FACTORS.into_iter().chain([options.noise.close_factor]);
        sweep = factors.map(|factor| sweep_row(options, &site, seed, trials, factor)).collect();
        if let Some(row) = sweep.last() {
            rows.insert(2, Row { name: "B centralised, as published", tally: row.published });
            rows.insert(3, Row { name: "B centralised, at its best", tally: row.best });
        }
        let mut trace = Trace::new();
        run_centralised(&world(0), &CentralisedOptions::published(), |_, places| trace.push(places.to_vec()));
        traces.insert(1, ("B centralised", trace));
    }
    Comparison { options: options.clone(), seed, rows, sweep, speeds, traces }
}

/// Runs a trial of a rule. Also returns the median run time of the rule for one station and frame, seconds.
fn run(world: &World, rule: RuleName, is_traced: bool) -> (Judged, f64) {
    let mut judge = Judge::new(world);
    let mut seen: Vec<Vec<(TargetId, Point2<f64>)>> = Vec::new();
    let watch = |moment: &Moment<'_>| {
        judge.watch(moment);
        if is_traced {
            seen.push(match rule {
                RuleName::Published => means_of_agencies(moment),
                RuleName::Modern => {
                    moment.people(0).iter().map(|belief| (belief.target, belief.position)).collect()
                }
            });
        }
    };
    let (stations, people) = (world.options.stations, world.options.people);
    let ids = (0..stations).map(|station| StationId(station as u8));
    let station_frame_s = match rule {
        RuleName::Published => {
            let options =
                PublishedOptions::simulation(hue_difference_deg(1.0), world.options.noise.attribute);
            let rules = ids.map(|id| {
                let mut rule = Published::new(id, stations as u8, world.site.clone(), options);
                for person in 0..people as u32 {
                    rule.introduce(person, TargetId(person + 1));
                }
                rule
            });
            run_trial(world, Crossing::Random, rules, watch)
        }
        RuleName::Modern => {
            let options = ModernOptions::simulation();
            let rules = ids.map(|id| Modern::new(id, stations as u8, world.site.clone(), options));
            run_trial(world, Crossing::Swapped, rules, watch)
        }
    };
    let place = |places: &Vec<(TargetId, Point2<f64>)>, person: usize| {
        let target = judge.target(person)?;
        places.iter().find(|(t, _)| *t == target).map(|(_, place)| *place)
    };
    let trace = seen.iter().map(|places| (0..people).map(|person| place(places, person)).collect()).collect();
    (Judged { leader: judge.leader(), mean: judge.mean(), each: judge.each(), trace }, station_frame_s)
}

/// Mean place of the members of each agency, metres.
fn means_of_agencies(moment: &Moment<'_>) -> Vec<(TargetId, Point2<f64>)> {
    let stations = 0..moment.world.options.stations;
    let reports: Vec<_> = stations.flat_map(|s| moment.packet(s).reports.iter()).collect();
    let mut targets: Vec<TargetId> = reports.iter().map(|r| r.target).collect();
    targets.sort_unstable();
    targets.dedup();
    let mean = |target: TargetId| {
        judge::mean(reports.iter().filter(|r| r.target == target).map(|r| r.position)).map(|m| (target, m))
    };
    targets.into_iter().filter_map(mean).collect()
}

/// Results of the centralised variant, as published and with its best options, for one factor of the errors of close
/// people.
fn sweep_row(options: &Options, site: &Arc<Site>, seed: u64, trials: usize, close_factor: f64) -> SweepRow {
    let mut options = options.clone();
    options.noise.close_factor = close_factor;
    let tally = |variant: &CentralisedOptions| {
        let fates: Vec<Fates> = (0..trials)
            .into_par_iter()
            .map(|trial| {
                let world = World::new(&options, site, seed, trial as u64);
                run_centralised(&world, variant, |_, _| {})
            })
            .collect();
        Tally::of(fates.iter())
    };
    let published = tally(&CentralisedOptions::published());
    let mut best = (CentralisedOptions::published(), published);
    for variant in CentralisedOptions::variants() {
        let found = tally(&variant);
        if (found.all_kept, found.kept) > (best.1.all_kept, best.1.kept) {
            best = (variant, found);
        }
    }
    SweepRow { close_factor, published, best_options: best.0, best: best.1 }
}
