//! `tracker agents`: simulation of the distributed vision agents, without cameras.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use anyhow::bail;
use clap::{Args, Subcommand, ValueEnum};
use shell::console::Console;
use shell::ranges::COUNT;

use crate::method::agents::simulate::{self, Layout, Options, Site, World};

/// Simulate the distributed vision agents.
#[derive(Debug, Args)]
pub(crate) struct AgentsArgs {
    #[command(subcommand)]
    command: AgentsCommand,
}

#[derive(Debug, Subcommand)]
enum AgentsCommand {
    Simulate(SimulateArgs),
}

/// Simulate stations and people, and compare three systems: the published agents (A), the centralised variant (B) and
/// the modern rule (C).
///
/// This is experiment 2 of the paper: six stations, six people who come too close to each other to be distinguished,
/// and doubled measurement errors there. Prints a table of the shares of people tracked, lost and confused with others
/// in the last second, the results of the centralised variant over the factor of the errors, and the speed of both
/// rules. Writes OUT/results.json, and OUT/LAYOUT.png with the trajectories of the first trial. With --people other
/// than six, people walk along a ring-shaped corridor whose length grows with the number of stations, and B is left
/// out.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  tracker agents simulate --out simulated
  tracker agents simulate --layout along --trials 1000 --seed 7 --out simulated
  tracker agents simulate --preset hard --out simulated
  tracker agents simulate --loss 0.3 --out simulated
  tracker agents simulate --stations 50 --people 100 --out simulated")]
struct SimulateArgs {
    /// Number of trials [default: 300; 100 with --preset hard; 1 in a corridor].
    #[arg(long, value_parser = COUNT.whole::<usize>())]
    trials: Option<usize>,
    /// Seed of the trials, which have different trajectories and errors.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Trajectories of the six people.
    #[arg(long, value_enum, default_value_t = LayoutChoice::All)]
    layout: LayoutChoice,
    /// Simulated scenario.
    #[arg(long, value_enum, default_value_t = Preset::Published)]
    preset: Preset,
    /// Number of stations [default: 6; 8 with --preset hard; half the people in a corridor].
    #[arg(long)]
    stations: Option<usize>,
    /// Number of people [default: 6; 20 with --preset hard].
    #[arg(long)]
    people: Option<usize>,
    /// Fraction of packets lost, 0 to 1 [default: 0; 0.2 with --preset hard].
    #[arg(long, value_name = "P")]
    loss: Option<f64>,
    /// Folder to write to.
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LayoutChoice {
    /// All six cross one line at the same time.
    Once,
    /// Meetings of four, three and two people, one after the other.
    Sequence,
    /// Four walk side by side; one stays and meets two others.
    Along,
    /// All three layouts.
    All,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Preset {
    /// As in the paper: all stations see everybody.
    Published,
    /// A hall with walls and partial views, 20 people, attributes 0.03 apart, 20 % of the packets lost.
    Hard,
}

/// Runs the subcommand.
pub(super) fn agents(args: &AgentsArgs, console: &Console) -> anyhow::Result<String> {
    match &args.command {
        AgentsCommand::Simulate(args) => simulate(args, console),
    }
}

fn simulate(args: &SimulateArgs, console: &Console) -> anyhow::Result<String> {
    let all = args.options()?;
    let trials = args.trials(&all[0]);
    let _lock = shell::files::lock(&args.out)?;
    let progress = Mutex::new(console.progress("simulating", Some(2 * (trials * all.len()) as u64)));
    let step = || progress.lock().unwrap_or_else(PoisonError::into_inner).advance();
    let mut comparisons = Vec::new();
    let mut texts = Vec::new();
    for options in &all {
        let comparison = simulate::compare(options, args.seed, trials, step);
        let site = std::sync::Arc::new(Site::new(options));
        let first = World::new(options, &site, args.seed, 0);
        let path = args.out.join(format!("{}.png", options.layout));
        calib::picture::write(&path, &simulate::draw(&first, &comparison.traces))?;
        texts.push(simulate::text(&comparison));
        comparisons.push(comparison);
    }
    let json = serde_json::to_string(&comparisons)? + "\n";
    calib::files::write_atomic(&args.out.join("results.json"), json.as_bytes())?;
    Ok(texts.join("\n"))
}

impl SimulateArgs {
    /// Options of the simulations, one a layout.
    fn options(&self) -> anyhow::Result<Vec<Options>> {
        if self.people.is_some_and(|n| n == 0 || n > 2000) {
            bail!("--people {}: give 1 to 2000", self.people.unwrap_or_default());
        }
        if self.stations.is_some_and(|n| n == 0 || n > 255) {
            bail!("--stations {}: give 1 to 255", self.stations.unwrap_or_default());
        }
        let mut all: Vec<Options> = match (self.preset, self.people) {
            (Preset::Hard, _) => vec![Options::hard()],
            (Preset::Published, Some(people)) if people != 6 => {
                vec![Options::corridor(people.div_ceil(2).clamp(4, 255), people)]
            }
            (Preset::Published, _) => match self.layout {
                LayoutChoice::Once => vec![Options::published(Layout::Once)],
                LayoutChoice::Sequence => vec![Options::published(Layout::Sequence)],
                LayoutChoice::Along => vec![Options::published(Layout::Along)],
                LayoutChoice::All => Layout::SIX.map(Options::published).to_vec(),
            },
        };
        if self.layout != LayoutChoice::All && matches!(all[0].layout, Layout::Hall | Layout::Corridor) {
            bail!("--layout: is for six people; leave it out with --preset hard and other numbers of people");
        }
        for options in &mut all {
            options.stations = self.stations.unwrap_or(options.stations);
            options.people = self.people.unwrap_or(options.people);
            options.loss = self.loss.unwrap_or(options.loss);
            if !(0.0..=1.0).contains(&options.loss) {
                bail!("--loss {}: give a fraction from 0 to 1", options.loss);
            }
        }
        Ok(all)
    }

    fn trials(&self, options: &Options) -> usize {
        self.trials.unwrap_or(match options.layout {
            Layout::Once | Layout::Sequence | Layout::Along => 300,
            Layout::Hall => 100,
            Layout::Corridor => 1,
        })
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct ParsedLine {
        #[command(flatten)]
        args: SimulateArgs,
    }

    fn options(line: &str) -> Result<Vec<Options>, String> {
        let words = ["simulate", "--out", "out"].into_iter().chain(line.split_whitespace());
        let parsed = ParsedLine::try_parse_from(words).map_err(|error| error.to_string())?;
        parsed.args.options().map_err(|error| error.to_string())
    }

    #[test]
    fn presets_are_changed_by_single_options() {
        let six = options("--loss 0.3").unwrap();
        assert_eq!(six.iter().map(|o| o.layout).collect::<Vec<_>>(), Layout::SIX);
        assert!(six.iter().all(|o| o.stations == 6 && (o.loss - 0.3).abs() < 1e-12));
        let hard = options("--preset hard --people 12").unwrap();
        assert_eq!((hard[0].people, hard[0].stations, hard[0].layout), (12, 8, Layout::Hall));
        let corridor = options("--stations 50 --people 100").unwrap();
        assert_eq!(
            (corridor[0].people, corridor[0].stations, corridor[0].layout),
            (100, 50, Layout::Corridor)
        );
    }

    #[test]
    fn senseless_numbers_are_refused() {
        for line in
            ["--trials 0", "--people 0", "--stations 256", "--loss 1.5", "--preset hard --layout once"]
        {
            let refusal = options(line).unwrap_err();
            let option = line.rsplit("--").next().and_then(|last| last.split(' ').next()).unwrap();
            assert!(refusal.contains(&format!("--{option}")), "{line}: {refusal}");
        }
    }
}
