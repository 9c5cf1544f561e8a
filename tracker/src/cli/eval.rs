//! `tracker eval`: tracks against the truth.

use std::path::PathBuf;

use tracker::eval::{EvalOptions, Evaluation, FrameRange, FrameSelection, align};

/// Measures tracks against the truth: MOTA, MOTP, MODA, IDF1, HOTA, errors in metres.
///
/// Both files hold MOTChallenge rows, either on the floor (frame,id,-1,-1,-1,-1,confidence,x,y,z; matched on distance) or in
/// an image (frame,id,left,top,width,height,confidence; matched on overlap). Rows of the truth whose 7th column is 0
/// do not count. Truth with ids of -1 has no identities: then only detection is judged.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker eval --truth truth.txt --tracks out/tracks.txt
  tracker eval --truth truth.txt --tracks out/tracks.txt --truth-room office/room --room myroom --json
  tracker eval --truth truth_boxes.txt --tracks out/boxes/view1.txt --frames 1-400")]
pub(crate) struct EvalArgs {
    /// The truth.
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// The tracks to judge.
    #[arg(long, value_name = "FILE")]
    tracks: PathBuf,
    /// Room directory in whose frame the truth stands; with --room, the tracks are moved there by the cameras' poses.
    #[arg(long, value_name = "DIR", requires = "room")]
    truth_room: Option<PathBuf>,
    /// Room directory in whose frame the tracks stand.
    #[arg(long, value_name = "DIR", requires = "truth_room")]
    room: Option<PathBuf>,
    /// Judge only the frames A to B, both included.
    #[arg(long, value_name = "A-B")]
    frames: Option<FrameRange>,
    /// Judge only the frames listed in this file, one a line.
    #[arg(long, value_name = "FILE")]
    annotated: Option<PathBuf>,
    /// Greatest distance of a match in metres, or its least overlap for boxes.
    #[arg(long, default_value_t = EvalOptions::GATE)]
    gate: f64,
    /// Print one JSON object instead of a table; percentages are 0 to 100.
    #[arg(long)]
    json: bool,
}

/// Runs the subcommand and returns what to print.
pub(crate) fn eval(args: &EvalArgs) -> anyhow::Result<String> {
    let annotated = args.annotated.as_deref().map(FrameSelection::read_annotated).transpose()?;
    let alignment = match (&args.truth_room, &args.room) {
        (Some(truth), Some(tracks)) => Some(align::between(truth, tracks)?),
        _ => None,
    };
    let options =
        EvalOptions { gate: Some(args.gate), frames: FrameSelection { range: args.frames, annotated } };
    let evaluation = Evaluation::of_files(&args.truth, &args.tracks, &options, alignment)?;
    if let Some(alignment) = &evaluation.alignment {
        tracing::info!(
            "aligned by {} camera(s), centres {:.3} m apart (rms)",
            alignment.cameras,
            alignment.center_rms_m
        );
    }
    Ok(if args.json { format!("{}\n", evaluation.json()) } else { evaluation.table() })
}
