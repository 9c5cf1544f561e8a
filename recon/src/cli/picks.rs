//! `recon picks`: corresponding points for a capture project, proposed for a person to confirm.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use calib::files::write_together;
use shell::console::{Console, ProgressStages};
use shell::files::Outputs;
use shell::ranges::THREADS;

use super::build::Quality;
use super::picks_page::PageOptions;
use crate::pipeline::{self, BuildOptions, ReferenceView};
use crate::project::{PickedPoint, Project};
use crate::proposals::{self, CameraPair, Correspondence, ProposalOptions};
use crate::surface::Surface;

/// Distance of a pick from its position by both captures from which on it is reported, pixels.
const DOUBTFUL_PX: f64 = 6.0;

/// Propose points that cameras have in common.
///
/// Works through the captures as `recon build` does, looks for the same physical points in the cameras' reference
/// images, and writes those that both captures' geometry and pictures confirm as [[point]] tables, with a picture in
/// which they are numbered. Look at them there before you copy them into ROOM.toml. Where nothing is confirmed, nothing
/// is proposed: pick at least three points of that pair by hand. Points that ROOM.toml has already are checked; neither
/// they nor a scale are needed.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  recon picks room.toml --page                            # pick, scale, build and check in the browser
  recon picks room.toml --page --room myroom --quality draft --port 0
  recon picks room.toml --out picks.toml
  recon picks room.toml --out picks.toml --room myroom    # then `recon build room.toml --out myroom` takes seconds")]
pub(crate) struct Picks {
    /// The capture project; its cameras suffice.
    #[arg(value_name = "ROOM.toml")]
    project: PathBuf,
    #[command(flatten)]
    page: PageOptions,
    /// File to write the [[point]] tables to.
    #[arg(long, value_name = "FILE", required_unless_present = "page", conflicts_with = "page")]
    out: Option<PathBuf>,
    /// File to draw them in; beside the tables, as PNG, when not given.
    #[arg(long, value_name = "FILE", conflicts_with = "page")]
    picture: Option<PathBuf>,
    /// The room directory that `recon build` makes or made: results of the captures are taken from there, and kept for
    /// it. The page builds it; it is `room` beside ROOM.toml there when not given.
    #[arg(long, value_name = "DIR")]
    room: Option<PathBuf>,
    /// Effort spent on stereo, as for `recon build`.
    #[arg(long, value_enum, default_value_t = Quality::Full)]
    quality: Quality,
    /// Points a pair of cameras, at most; three are the fewest that join two cameras.
    #[arg(long, value_name = "N", default_value_t = ProposalOptions::default().points as u16, value_parser = clap::value_parser!(u16).range(3..))]
    points: u16,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads to work with; all processors by default. The points are the same for any number.
    #[arg(long, value_name = "N", value_parser = THREADS.whole::<u16>())]
    threads: Option<u16>,
}

impl Picks {
    pub(crate) fn run(&self, console: &Console) -> anyhow::Result<()> {
        super::build::limit_threads(self.threads)?;
        let (cameras, points) = Project::read_unpicked(&self.project)?;
        if cameras.len() < 2 {
            bail!(
                "{}: one camera has no points in common with another; add a second [[camera]]",
                self.project.display()
            );
        }
        let options =
            BuildOptions { seed: self.seed, dense: self.quality.dense(), ..BuildOptions::default() };
        let Some(out) = &self.out else {
            let small_pictures = self.quality == Quality::Draft;
            return self.page.serve(
                &self.project,
                self.room.as_deref(),
                BuildOptions { small_pictures, ..options },
            );
        };
        let picture = self.picture.clone().unwrap_or_else(|| out.with_extension("png"));
        if picture == *out {
            bail!("{}: tables and picture need files of their own; give --picture", out.display());
        }
        let of_room = self.room.as_deref().map(scenes::room::files_of).unwrap_or_default();
        let inputs = Project::inputs(&self.project).into_iter().chain(of_room).chain([self.project.clone()]);
        Outputs::new([out.as_path(), picture.as_path()]).refuse(inputs)?;
        let mut stages: Option<ProgressStages> = None;
        let views = pipeline::reference_views(&cameras, self.room.as_deref(), &options, &mut |step| {
            stages.get_or_insert_with(|| console.stages(step.of)).show(step.number, &step.what);
        });
        drop(stages);
        let views = views?;
        let surfaces: Vec<&Surface> = views.iter().map(|v| &v.surface).collect();
        let how =
            ProposalOptions { points: self.points.into(), seed: self.seed, ..ProposalOptions::default() };
        let pairs = proposals::propose(&surfaces, &how)?;
        let mut proposed = Vec::new();
        for pair in &pairs {
            console.line(&describe(pair, &views, &points, &mut proposed));
        }
        if proposed.is_empty() {
            bail!(
                "{}: no two cameras show enough of the same to propose points; pick at least 3 a pair by hand",
                self.project.display()
            );
        }
        write([out, &picture], &views, &proposed)?;
        console.line(&format!(
            "{} points to confirm are in {}, drawn in {}",
            proposed.len(),
            out.display(),
            picture.display()
        ));
        Ok(())
    }
}

/// Writes the tables, and the picture in which they are drawn.
fn write(
    [tables, picture]: [&Path; 2],
    views: &[ReferenceView],
    proposed: &[(PickedPoint, f64)],
) -> anyhow::Result<()> {
    let images: Vec<_> = views.iter().map(|v| (v.name.as_str(), &v.picture)).collect();
    let points: Vec<PickedPoint> = proposed.iter().map(|(point, _)| point.clone()).collect();
    let mut png = std::io::Cursor::new(Vec::new());
    proposals::draw(&images, &points)
        .write_to(&mut png, image::ImageFormat::Png)
        .with_context(|| picture.display().to_string())?;
    let names: Vec<&str> = views.iter().map(|v| v.name.as_str()).collect();
    let text = proposals::to_toml(proposed, &names);
    Ok(write_together(&[(picture, png.get_ref()), (tables, text.as_bytes())])?)
}

/// Adds a pair's proposals, and returns a line about the pair.
fn describe(
    pair: &CameraPair,
    views: &[ReferenceView],
    points: &[PickedPoint],
    proposed: &mut Vec<(PickedPoint, f64)>,
) -> String {
    let [a, b] = pair.cameras;
    let both = format!("{} and {}", views[a].name, views[b].name);
    let Some(found) = &pair.found else {
        return format!(
            "{both}: nothing that both show could be borne out; pick at least 3 points by hand, on things that stand still \
             and that both see"
        );
    };
    let before = proposed.len();
    for proposal in &found.proposals {
        let [p, q] = proposal.pixels;
        if let (Some(p), Some(q)) = (views[a].filmed(&p), views[b].filmed(&q)) {
            proposed.push((PickedPoint { picks: vec![(a, p), (b, q)] }, proposal.correlation));
        }
    }
    let count = proposed.len() - before;
    let known = against(found, pair.cameras, views, points);
    format!("{both}: {count} points proposed, of {} that agree{known}", found.matches)
}

/// Comparison of existing points with the proposals, as part of a line.
fn against(
    found: &Correspondence,
    [a, b]: [usize; 2],
    views: &[ReferenceView],
    points: &[PickedPoint],
) -> String {
    let misses: Vec<(usize, f64)> = points
        .iter()
        .enumerate()
        .filter_map(|(index, point)| {
            let pixels = [views[a].pinhole(&point.pixel(a)?)?, views[b].pinhole(&point.pixel(b)?)?];
            Some((index + 1, found.miss_px([&views[a].surface, &views[b].surface], pixels)?))
        })
        .collect();
    if misses.is_empty() {
        return String::new();
    }
    let (fit, off): (Vec<_>, Vec<_>) = misses.iter().partition(|(_, miss)| *miss <= DOUBTFUL_PX);
    let list: Vec<String> =
        off.iter().map(|(number, miss)| format!("[[point]] {number} is {miss:.0} pixels off")).collect();
    let list = if list.is_empty() { String::new() } else { format!("; {}", list.join(", ")) };
    format!("; {} of {} points picked before agree with them{list}", fit.len(), misses.len())
}
