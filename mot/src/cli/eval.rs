//! `tracker eval`: evaluation of tracks against the truth.

use std::path::PathBuf;

use scenes::room;

use shell::files::refuse_inputs;

use super::flags::named;
use crate::eval::{
    DetectionCurve, EvalOptions, Evaluation, FrameRange, FrameSelection, JudgedArea, JudgedRows, Protocol,
    Sequences, align, plots,
};
use crate::rows::RowFile;

/// Evaluate tracks against the truth: MOTA, MOTP, MODA, IDF1, HOTA, errors in metres, calibration.
///
/// Confidences that are probabilities (0 to 1) are evaluated for calibration too: the difference from
/// the share of rows that match a person, and how often the true number of people is in the 90 % set that they imply.
///
/// Both files hold MOTChallenge rows, either on the floor (frame,id,-1,-1,-1,-1,confidence,x,y,z; matched on distance)
/// or in an image (frame,id,left,top,width,height,confidence; matched on overlap). Rows of the truth whose 7th column
/// is 0 do not count. Truth with ids of -1 has no identities: then only detection is evaluated.
///
/// Truth with classes in the 8th column of its boxes, as MOT16, MOT17 and MOT20 have, is judged by their protocol: only
/// people (1) count, and tracks on distractors (still people, reflections, people on vehicles) do not.
///
/// With two folders, every sequence TRUTH/SEQUENCE/truth.txt (or gt/gt.txt) is compared with TRACKS/SEQUENCE.txt (or
/// SEQUENCE/tracks.txt), each on its own and all together.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker eval --truth truth.txt --tracks out/tracks.txt
  tracker eval --truth truth.txt --tracks out/tracks.txt --truth-room office/room --room myroom --json
  tracker eval --truth truth_boxes.txt --tracks out/boxes/view1.txt --frames 1-400
  tracker eval --truth truth.txt --tracks out/tracks.txt --area '2.1,0 7.6,3.4'
  tracker eval --truth truth.txt --tracks detections.txt --roc --plots plots
  tracker eval --truth mot15 --tracks linked --json")]
pub struct EvalArgs {
    /// Truth: a file, or a folder of sequences.
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Tracks to evaluate: a file, or a folder of one file a sequence.
    #[arg(long, value_name = "FILE")]
    tracks: PathBuf,
    /// Room directory of the truth's frame; with --room, the tracks are transformed there by the cameras' poses.
    #[arg(long, value_name = "DIR", requires = "room")]
    truth_room: Option<PathBuf>,
    /// Room directory of the tracks' frame.
    #[arg(long, value_name = "DIR", requires = "truth_room")]
    room: Option<PathBuf>,
    /// Evaluate only the frames A to B, both included.
    #[arg(long, value_name = "A-B")]
    frames: Option<FrameRange>,
    /// Evaluate only the frames listed in this file, one a line.
    #[arg(long, value_name = "FILE")]
    annotated: Option<PathBuf>,
    /// Evaluate only this part of the floor: its corners in the truth's frame, or two opposite ones of a rectangle,
    /// metres. Tracks outside do not count unless they are near enough to match a person inside.
    #[arg(long, value_name = "X,Y X,Y …", allow_hyphen_values = true)]
    area: Option<JudgedArea>,
    /// Largest distance of a match in metres, or its least overlap for boxes [default: 0.5; wildtrack: 1]
    #[arg(long)]
    gate: Option<f64>,
    /// Rules by which rows count: auto, mot15, mot16, mot17, mot20 or wildtrack. auto: mot17, or mot20, where the truth
    /// has classes, otherwise mot15. wildtrack: annotated frames, on the floor, within 1 m
    #[arg(long, value_name = "NAME", default_value_t = Protocol::Auto)]
    protocol: Protocol,
    /// Draw HOTA over the strictness, a strip of tracks for each person, and the detection curve into this folder.
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    /// Evaluate the rows as detections by their score, too: recall and precision over the least score.
    #[arg(long)]
    roc: bool,
    /// Print one JSON object instead of a table; percentages are 0 to 100.
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand and returns what to print.
///
/// # Errors
/// The file or flag at fault, and its mend.
pub fn eval(args: &EvalArgs) -> anyhow::Result<String> {
    evaluate(args).map_err(named)
}

fn evaluate(args: &EvalArgs) -> anyhow::Result<String> {
    if let Some(folder) = &args.plots {
        let rooms = args.truth_room.iter().chain(&args.room).flat_map(|dir| room::files_of(dir));
        let files = [&args.truth, &args.tracks].into_iter().chain(&args.annotated).cloned();
        refuse_inputs(folder, files.chain(rooms))?;
    }
    let annotated = args.annotated.as_deref().map(FrameSelection::read_annotated).transpose()?;
    let alignment = match (&args.truth_room, &args.room) {
        (Some(truth), Some(tracks)) => Some(align::between(truth, tracks)?),
        _ => None,
    };
    let options = EvalOptions {
        gate: args.gate,
        frames: FrameSelection { range: args.frames, annotated },
        protocol: args.protocol,
    };
    if args.truth.is_dir() {
        return sequences(args, &options);
    }
    let (mut truth, mut tracks) = (RowFile::read(&args.truth)?, RowFile::read(&args.tracks)?);
    if let Some(area) = &args.area {
        let to_truth = alignment.as_ref().map(|a| &a.truth_from_room);
        let is_empty = truth.rows.is_empty();
        (truth, tracks) = area.of(truth, tracks, options.gate.or(Some(options.protocol.gate())), to_truth)?;
        if truth.rows.is_empty() && !is_empty {
            tracing::warn!(
                "{}: no row of the truth is in --area; is it in metres of the truth's frame?",
                args.truth.display()
            );
        }
    }
    let is_drawn = args.plots.is_some() && alignment.is_none();
    if args.roc && alignment.is_some() {
        anyhow::bail!("--roc: compares files of one room; leave --truth-room and --room out");
    }
    let curve = if args.roc || is_drawn {
        let JudgedRows { truth, tracks, .. } = options.protocol.judged(&truth, &tracks)?;
        let gate = args.gate.unwrap_or(options.protocol.gate());
        DetectionCurve::new(&truth, &tracks, gate, &options.frames)?
    } else {
        None
    };
    let evaluation = Evaluation::of_rows(&truth, &tracks, &options, alignment)?;
    if let Some(folder) = &args.plots {
        plots::write(folder, &evaluation, curve.as_ref())?;
    }
    if let Some(alignment) = &evaluation.alignment {
        tracing::info!(
            "aligned by {} camera(s), centres {:.3} m apart (rms)",
            alignment.cameras,
            alignment.center_rms_m
        );
    }
    let curve = curve.filter(|_| args.roc);
    Ok(if args.json {
        let mut json = evaluation.json();
        if let Some(curve) = curve {
            json["roc"] = curve.json();
        }
        format!("{json}\n")
    } else {
        let precision = curve.map(|curve| 100.0 * curve.average_precision);
        let line = precision.map(|p| format!("average precision of the detections by score: {p:.2} %\n"));
        evaluation.table() + &line.unwrap_or_default()
    })
}

/// Compares two folders.
fn sequences(args: &EvalArgs, options: &EvalOptions) -> anyhow::Result<String> {
    if args.truth_room.is_some() || args.roc || args.area.is_some() {
        anyhow::bail!(
            "--truth {}: is a folder; --truth-room, --area and --roc take files",
            args.truth.display()
        );
    }
    let sequences = Sequences::of_folders(&args.truth, &args.tracks, options)?;
    if let Some(folder) = &args.plots {
        for (name, evaluation) in &sequences.each {
            plots::write(&folder.join(name), evaluation, None)?;
        }
    }
    Ok(if args.json { format!("{}\n", sequences.json()) } else { sequences.table() })
}
