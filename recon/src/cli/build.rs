//! `recon build`: builds a room directory from a capture project.

use std::path::PathBuf;

use anyhow::Context;
use clap::ValueEnum;
use shell::console::{Console, ProgressStages};
use shell::files::Outputs;
use shell::ranges::THREADS;

use crate::dense::DenseOptions;
use crate::memory::MemoryBound;
use crate::pipeline::{self, BuildOptions, BuildReport};
use crate::project::Project;
use crate::scale::LengthResidual;
use crate::scale::control::ControlResidual;
use crate::verdict::{Light, RoomEvidence, Verdict};

/// Build a room directory from a capture project.
///
/// Besides scene.toml, room.ply and the reference images, the room gets pictures that show whether it worked: plan.png
/// (the floor plan) and preview/NAME.png (reference image, depth, the room redrawn); and report.json.
///
/// It ends with a verdict, which report.json and the preview have, too: green, amber (doubtful: look at the preview, mend what
/// is named) or red (the room contradicts itself, or has an impossible size). A red room is kept beside DIR, as DIR.red, and
/// replaces nothing; the exit status is 1 then.
///
/// Results of each capture are kept (in DIR.unfinished, later in DIR/cache): an interrupted build is resumed, and
/// another pick or distance costs seconds.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  recon build room.toml --out myroom
  recon build room.toml --out first-look --quality draft
  recon build room.toml --out myroom --zones zones.toml
  recon build room.toml --out myroom --threads 2 --seed 7 -v")]
pub(crate) struct Build {
    /// The capture project.
    #[arg(value_name = "ROOM.toml")]
    project: PathBuf,
    /// The room directory to make; a room that is there already is replaced once the new one is finished.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Take the [[zone]] tables of this file, in the new room's coordinates; without it a replaced room's zones are preserved.
    #[arg(long, value_name = "FILE")]
    zones: Option<PathBuf>,
    /// Effort spent on stereo: a draft shows whether picks, floor and metres are right.
    #[arg(long, value_enum, default_value_t = Quality::Full, conflicts_with = "options")]
    quality: Quality,
    /// Options of the stages, in tables [motion], [dense], [planes], [assemble.merge], … as `options` of a room's
    /// report.json lists them; what the file leaves out has its default.
    #[arg(long, value_name = "FILE.toml")]
    options: Option<PathBuf>,
    /// Take focal length and radial distortion from both where a capture clearly contradicts its intrinsics file.
    #[arg(long)]
    refine_intrinsics: bool,
    /// Memory that the captures' pictures may take, as in 6G or 800M; a quarter of the machine's by default. Within it as many
    /// captures as fit are worked on at a time; of one that does not fit alone fewer frames are used.
    #[arg(long, value_name = "AMOUNT")]
    memory: Option<MemoryBound>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads to work with; all processors by default. The room is the same for any number.
    #[arg(long, value_name = "N", value_parser = THREADS.whole::<u16>())]
    threads: Option<u16>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Quality {
    /// Fewer key frames and rounds
    Draft,
    /// Quality for tracking people
    Full,
}

impl Quality {
    pub(super) fn dense(self) -> DenseOptions {
        match self {
            Self::Draft => DenseOptions::draft(),
            Self::Full => DenseOptions::default(),
        }
    }
}

/// Limits the number of worker threads from now on, if one is given.
pub(super) fn limit_threads(threads: Option<u16>) -> anyhow::Result<()> {
    if let Some(threads) = threads.map(usize::from) {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().context("--threads")?;
        calib::vision::set_threads(threads)?;
    }
    Ok(())
}

/// A finished room that is not to be believed.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: the verdict is red, so nothing was replaced; the room is kept in {} to look at its preview: mend what is named above and \
     build again", asked.display(), kept.display()
)]
pub(crate) struct RedRoom {
    asked: PathBuf,
    kept: PathBuf,
}

/// Prints a verdict with its reasons, a line each.
pub(super) fn tell_verdict(verdict: &Verdict, console: &Console) {
    console.line(&format!("verdict: {}", verdict.light.word()));
    for reason in &verdict.reasons {
        let mark = if reason.light == Light::Green { "note" } else { reason.light.word() };
        console.line(&format!("  {mark}: {}", reason.text));
    }
}

impl Build {
    pub(crate) fn run(&self, console: &Console) -> anyhow::Result<()> {
        limit_threads(self.threads)?;
        let files = [Some(&self.project), self.zones.as_ref(), self.options.as_ref()];
        let captures = Project::inputs(&self.project);
        Outputs::new([self.out.as_path()]).refuse(files.into_iter().flatten().chain(&captures))?;
        let _lock = pipeline::lock_room(&self.out, "recon build")?;
        let mut options = match &self.options {
            Some(file) => BuildOptions::read(file)?,
            None => BuildOptions { dense: self.quality.dense(), ..BuildOptions::default() },
        };
        options.zones.clone_from(&self.zones);
        options.seed = self.seed;
        options.memory = self.memory.unwrap_or_default();
        options.motion.refine_lens |= self.refine_intrinsics;
        options.small_pictures = self.quality == Quality::Draft;
        let mut stages: Option<ProgressStages> = None;
        let report = pipeline::build(&self.project, &self.out, &options, &mut |step| {
            stages.get_or_insert_with(|| console.stages(step.of)).show(step.number, &step.what);
        });
        drop(stages);
        let report = report?;
        summarise(&report, console);
        tell_verdict(&report.verdict, console);
        if report.verdict.light == Light::Red {
            return Err(RedRoom { asked: self.out.clone(), kept: report.room }.into());
        }
        Ok(())
    }
}

/// Prints what each camera and the whole room came to, a line each.
fn summarise(report: &BuildReport, console: &Console) {
    for camera in &report.cameras {
        console.line(&format!(
            "{}: {} of {} frames placed, {} points to {:.2} px; {:.0} % of the image measured, {:.0} % filled",
            camera.name,
            camera.registered,
            camera.frames,
            camera.points,
            camera.reprojection_rms_px,
            100.0 * camera.measured_share,
            100.0 * camera.filled_share
        ));
        if let Some(focal) = camera.estimated_focal_px {
            let start = camera.focal_start.as_ref().map_or(String::new(), |s| format!(" (start: {s})"));
            let sigma = camera.focal_sigma_px.map_or("unknown".to_owned(), |s| format!("{s:.1}"));
            console.line(&format!(
                "{}: focal length {focal:.1} ± {sigma} px, estimated from the capture{start}; `calib intrinsics` does better",
                camera.name
            ));
        }
    }
    print_residuals(&report.evidence, console);
    // A single camera is not joined to others.
    let picks = if report.cameras.len() > 1 {
        format!("picks to {:.2} px, ", report.pick_rms_px)
    } else {
        String::new()
    };
    console.line(&format!(
        "{picks}floor to {:.1} cm, {} discs; the room is in {}",
        100.0 * report.floor_rms_m,
        report.discs,
        report.room.display()
    ));
}

/// Prints how far known lengths and control points are off in the room, a line each. One length alone is as given.
fn print_residuals(evidence: &RoomEvidence, console: &Console) {
    if evidence.lengths.len() > 1 {
        for length in &evidence.lengths {
            let LengthResidual { name, known_m, found_m, sigma_m } = length;
            let [off_cm, sigma_cm] = [found_m - known_m, *sigma_m].map(|metres| 100.0 * metres);
            console.line(&format!("{name}: {known_m:.3} m, {off_cm:+.1} ± {sigma_cm:.1} cm in the room"));
        }
    }
    for ControlResidual { number, off_m, sigma_m } in &evidence.control_points {
        let off: Vec<String> = off_m.iter().map(|off| format!("{:+.1}", 100.0 * off)).collect();
        let sigma_cm = 100.0 * sigma_m;
        console.line(&format!("[[control]] {number}: {} (± {sigma_cm:.1}) cm in the room", off.join(", ")));
    }
}
