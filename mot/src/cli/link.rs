//! `tracker link`: tracks from the detections of a whole recording.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::{Subcommand, ValueEnum};
use shell::console::Console;
use shell::files::{OutputLock, Outputs, paths_of, refuse_inputs};

use super::flags::named;
use crate::chart;
use crate::link::tune::{TuneOptions, cross_validate};
use crate::link::{self, Detections, LinkOptions, SolverKind, experiment, rate};
use crate::rows::RowFile;

/// Link the detections of a whole recording to the tracks of least total cost.
///
/// DETECTIONS holds MOTChallenge rows, boxes (frame,id,left,top,width,height,score) or floor positions
/// (frame,id,-1,-1,-1,-1,score,x,y,z); ids are ignored. The tracks are written in the same form.
///
/// With one of --max-distance, --max-area-change, --max-colour-distance, --link-cost, --birth-cost or
/// --detection-offset the graph is the paper's: detections that pass the thresholds are linked at a constant cost, and
/// the optimum over this graph is written. With none of them, links cost by a motion model in heights of the person and
/// in seconds, and the resulting tracks are linked again over longer gaps by their motion. Give --rate if the recording
/// has far more or fewer than 25 frames a second.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:
  tracker link detections.txt --out tracks.txt
  tracker link detections.txt --out tracks.txt --rate 10 --report report.json
  tracker link detections.txt --video view1.avi --rate 7 --out tracks.txt
  tracker link detections.txt --out tracks.txt --max-distance 40 --max-area-change 4000 --link-cost 0.1 --birth-cost 2
  tracker link detections.txt --out tracks.txt --direction-threshold 15 --skip 1
  tracker link out/tracks.txt --tracklets --out mended.txt
  tracker link tune detections.txt --truth truth.txt --direction
  tracker link experiment detections.txt --truth truth.txt --out experiment"
)]
pub struct LinkArgs {
    #[command(subcommand)]
    command: Option<LinkCommand>,
    /// File of detections.
    #[arg(required = true)]
    detections: Option<PathBuf>,
    /// File of tracks to write.
    #[arg(long, value_name = "TRACKS", required = true)]
    out: Option<PathBuf>,
    #[command(flatten)]
    options: LinkArguments,
    /// Frames per second [default: the frameRate of a seqinfo.ini beside DETECTIONS or a folder above, else that of
    /// --video, else 25].
    #[arg(long, value_name = "FPS", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Video in which the boxes were found: linked boxes must have similar colours, too.
    #[arg(long, value_name = "VIDEO")]
    video: Option<String>,
    /// Largest difference of two linked boxes' colours: Hellinger distance of the histograms of their middles, 0 to 1
    /// [default: 0.6].
    #[arg(long, value_name = "D", requires = "video")]
    max_colour_distance: Option<f64>,
    /// Number of frames after which links between detections are final, which bounds the time of each one. The
    /// difference of the reported cost and its lower bound limits the loss, which is mostly 0 [default: never].
    #[arg(long, value_name = "FRAMES")]
    window: Option<u32>,
    /// The rows are tracks of an online tracker: keep them all, and link those that continue each other. Ids are those
    /// of the first parts.
    #[arg(long, conflicts_with_all = ["skip", "direction_threshold", "solver", "max_distance", "max_area_change", "link_cost",
        "birth_cost", "detection_offset", "video", "window"])]
    tracklets: bool,
    /// Write a report as JSON: detections, edges, tracks, total cost, its proven lower bound, seconds.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum LinkCommand {
    Tune(TuneArgs),
    Experiment(ExperimentArgs),
}

/// Find the paper's thresholds by cross-validation.
///
/// The recording is cut into folds; each is linked with the thresholds that are best on the others. Prints a line a
/// fold, and the options to use. Tuned for tracking success (people tracked from their first frame to their last by one
/// track) and, where that is equal, for IDF1. A given threshold is kept.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker link tune detections.txt --truth truth.txt
  tracker link tune detections.txt --truth truth.txt --direction --folds 5 --json")]
struct TuneArgs {
    /// File of detections.
    detections: PathBuf,
    /// File of the truth.
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Number of folds.
    #[arg(long, default_value_t = 9)]
    folds: usize,
    /// Use the direction constraint, and tune its threshold.
    #[arg(long)]
    direction: bool,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    options: LinkArguments,
}

/// Run the paper's experiment: tracking success with and without the direction constraint, against the number of
/// skipped frames.
///
/// Thresholds are cross-validated for each. Writes OUT/figure9.png and OUT/experiment.json and prints the table.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  tracker link experiment detections.txt --truth truth.txt --out experiment")]
struct ExperimentArgs {
    /// File of detections.
    detections: PathBuf,
    /// File of the truth.
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Folder to write to.
    #[arg(long)]
    out: PathBuf,
    /// Number of folds.
    #[arg(long, default_value_t = 9)]
    folds: usize,
    #[command(flatten)]
    options: LinkArguments,
}

/// Options of linking that all subcommands share.
#[derive(Debug, clap::Args)]
pub struct LinkArguments {
    /// Largest distance of two linked boxes' centres, pixels (on the floor: metres) [default: a quarter of the height].
    #[arg(long, value_name = "PX")]
    max_distance: Option<f64>,
    /// Largest difference of two linked boxes' areas, square pixels [default: 35 % of the larger].
    #[arg(long, value_name = "PX2")]
    max_area_change: Option<f64>,
    /// Cost of every link [default: 0].
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    link_cost: Option<f64>,
    /// Cost of a track's beginning, and of its end [default: 1].
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    birth_cost: Option<f64>,
    /// Offset of a detection's cost, which is the offset minus its score [default: 0.2].
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    detection_offset: Option<f64>,
    /// Largest gap of a link, frames; 1 links consecutive frames only [default: 2.5 seconds; the paper's graph: 1, with
    /// --direction-threshold 2].
    #[arg(long, value_name = "FRAMES")]
    max_gap: Option<u32>,
    /// Largest change of a track's velocity at a detection, pixels (metres) a frame. It must be above the noise of the
    /// boxes and below the difference of two people's velocities, so it has no default; `tracker link tune --direction`
    /// finds it. Without the options of the paper's graph, the motion model accounts for the directions of whole
    /// tracklets.
    #[arg(long, value_name = "PX")]
    direction_threshold: Option<f64>,
    /// Number of frames skipped after each linked one; their detections are added to the tracks that pass them.
    #[arg(long, value_name = "N", default_value_t = 0)]
    skip: u32,
    /// Ignore detections with a lower score.
    #[arg(long, value_name = "SCORE", allow_negative_numbers = true)]
    min_score: Option<f64>,
    /// Use only rows with this number in the 8th column, where detectors of several classes write the class.
    #[arg(long, value_name = "N")]
    class: Option<u32>,
    /// Solver of the graph.
    #[arg(long, value_enum, default_value = "exact")]
    solver: SolverName,
    /// Leave gaps in tracks unfilled.
    #[arg(long)]
    keep_gaps: bool,
    /// Smooth each track's boxes by a Gaussian of this standard deviation [default: 0.2 seconds; the paper's graph: 0].
    #[arg(long, value_name = "FRAMES")]
    smooth: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SolverName {
    /// The optimum, with its certificate: successive shortest paths.
    Exact,
    /// Near the optimum: two-pass dynamic programming.
    Greedy,
}

impl LinkArguments {
    fn options(&self) -> LinkOptions {
        LinkOptions {
            max_distance: self.max_distance,
            max_area_change_px2: self.max_area_change,
            max_colour_distance: None,
            link_cost: self.link_cost,
            birth_cost: self.birth_cost,
            detection_offset: self.detection_offset,
            frames_per_s: None,
            max_gap: self.max_gap,
            window: None,
            direction_threshold: self.direction_threshold,
            skip: self.skip,
            min_score: self.min_score,
            class: self.class,
            solver: match self.solver {
                SolverName::Exact => SolverKind::Exact,
                SolverName::Greedy => SolverKind::Greedy,
            },
            keep_gaps: self.keep_gaps,
            smooth_frames: self.smooth,
        }
    }
}

/// Reader of films for `--video`: sets the colours of detections from the video in which they were found, and returns its
/// rate, frames a second.
pub type LookAtVideo = fn(&str, &mut Detections, &Console) -> anyhow::Result<Option<f64>>;

/// Runs the subcommand and returns what to print.
///
/// # Errors
/// The file or flag at fault, and its mend; `--video` without a `look_at_video`.
pub fn link(
    args: &LinkArgs,
    look_at_video: Option<LookAtVideo>,
    console: &Console,
) -> anyhow::Result<String> {
    run(args, look_at_video, console).map_err(named)
}

fn run(args: &LinkArgs, look_at_video: Option<LookAtVideo>, console: &Console) -> anyhow::Result<String> {
    match &args.command {
        Some(LinkCommand::Tune(args)) => return tune(args),
        Some(LinkCommand::Experiment(args)) => return run_experiment(args, console),
        None => {}
    }
    let (Some(detections), Some(out)) = (&args.detections, &args.out) else {
        bail!("give a file of detections and --out TRACKS")
    };
    let mut options = LinkOptions {
        frames_per_s: args.rate,
        max_colour_distance: args.max_colour_distance,
        window: args.window,
        ..args.options.options()
    };
    options.check()?;
    let outputs = std::iter::once(out).chain(&args.report).map(PathBuf::as_path);
    let inputs =
        std::iter::once(detections.clone()).chain(args.video.as_deref().map(paths_of).unwrap_or_default());
    Outputs::new(outputs).refuse(inputs)?;
    let file = RowFile::read(detections)?;
    if options.frames_per_s.is_none() {
        options.frames_per_s = rate::beside(detections)?;
    }
    let linked = if args.tracklets {
        link::link_tracklets(&file, &options)?
    } else {
        let mut found = Detections::from_rows(&file, |row| options.wants(row))?;
        if let Some(video) = &args.video {
            if found.on_floor && !found.all.is_empty() {
                bail!(
                    "--video: {} holds places on the floor; colours are those of boxes",
                    detections.display()
                );
            }
            let look_at_video = look_at_video.context("--video: this program reads no films")?;
            let rate = look_at_video(video, &mut found, console)?;
            options.frames_per_s = options.frames_per_s.or(rate);
        }
        link::link(&found, &options).with_context(|| format!("{}", detections.display()))?
    };
    let tracks = link::track_file(&linked);
    let report = args.report.as_ref().map(|path| Ok::<_, anyhow::Error>((path, linked.report.json(path)?)));
    let report = report.transpose()?;
    let mut files = vec![(out.as_path(), tracks.as_bytes())];
    files.extend(report.iter().map(|(path, text)| (path.as_path(), text.as_bytes())));
    calib::files::write_together(&files)?;
    let r = &linked.report;
    let proof = if r.is_optimal { "proven least".to_owned() } else { format!("at least {}", r.lower_bound) };
    tracing::info!(
        "{} detections, {} edges → {} tracks; total cost {} ({proof}); {:.2} s",
        r.detections,
        r.edges,
        r.tracks,
        r.total_cost,
        r.build_seconds + r.solve_seconds
    );
    Ok(String::new())
}

fn tune(args: &TuneArgs) -> anyhow::Result<String> {
    let link = args.options.options();
    link.check()?;
    let (detections, truth) = (RowFile::read(&args.detections)?, RowFile::read(&args.truth)?);
    let options = TuneOptions {
        folds: args.folds,
        direction: args.direction || link.direction_threshold.is_some(),
        link,
    };
    let found = cross_validate(&detections, &truth, &options)?;
    Ok(if args.json { format!("{}\n", serde_json::to_string(&found)?) } else { found.table() })
}

fn run_experiment(args: &ExperimentArgs, console: &Console) -> anyhow::Result<String> {
    let link = args.options.options();
    link.check()?;
    refuse_inputs(&args.out, [&args.detections, &args.truth])?;
    let (detections, truth) = (RowFile::read(&args.detections)?, RowFile::read(&args.truth)?);
    let _lock = OutputLock::if_present(&args.out)?;
    let steps = 2 * experiment::SKIPS.count() as u64;
    let mut progress = console.progress("validating", Some(steps));
    let rows = experiment::run(&detections, &truth, args.folds, &link, || progress.advance())?;
    drop(progress);
    let json = serde_json::to_string(&rows)? + "\n";
    calib::files::write_atomic(&args.out.join("experiment.json"), json.as_bytes())?;
    chart::save(&experiment::figure(&rows).draw(), &args.out.join("figure9.png"))?;
    Ok(experiment::table(&rows))
}
