//! `tracker weightmap`: comparison of the integrations of the cameras' weights in one frame.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use image::RgbImage;
use scenes::room::{self, Room};
use shell::ranges::{BODY_M, FRAME_NUMBER};

use shell::files::refuse_inputs;

use super::background::BackgroundArguments;
use super::heads::HeadArguments;
use super::outputs;
use crate::method::Method;
use crate::method::condensation::Condensation;
use crate::method::condensation::integration::Integration;
use crate::prepared_room::{PreparationOptions, PreparedRoom};
use crate::source::{self, NamedSource, NamedSources, VideoSource};
use crate::{CameraFrame, Moment};

/// Draw the weights of heads over a horizontal plane, for one frame and each integration.
///
/// Writes OUT/product.png, sum.png, pairs.png, pairs-angle.png and room.png: the floor from above, dark where no camera
/// sees a head, bright where the weight is largest. `--integration` draws one alone. The cameras' frames of the same
/// number are used.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  tracker weightmap myroom --video a=a.mp4 --video b=b.mp4 --frame 120 --height 1.6 --out maps"
)]
pub(crate) struct WeightMapArgs {
    /// Room directory.
    room: PathBuf,
    /// Video of a camera, as in `tracker run`.
    #[arg(long, value_name = "NAME=PATH", required = true)]
    video: Vec<NamedSource>,
    /// Number of the frame, from 1.
    #[arg(long, default_value_t = 1, value_parser = FRAME_NUMBER.whole::<u32>())]
    frame: u32,
    /// Height of the heads' centres above the floor, metres.
    #[arg(long, default_value_t = 1.6, value_name = "METRES", value_parser = BODY_M.number())]
    height: f64,
    /// Folder to write to.
    #[arg(long)]
    out: PathBuf,
    /// The method as published: all edges in proportion to their strength.
    #[arg(long)]
    published: bool,
    #[command(flatten)]
    background: BackgroundArguments,
    #[command(flatten)]
    heads: HeadArguments,
}

/// Runs the subcommand.
pub(crate) fn weightmap(args: &WeightMapArgs) -> anyhow::Result<String> {
    let inputs = outputs::paths_of_all(&args.video).into_iter().chain(args.background.paths());
    refuse_inputs(&args.out, inputs.chain(room::files_of(&args.room)))?;
    let options = args.heads.options(1, args.published)?;
    let needs_empty = options.edges.moving_only;
    let room = Room::read(&args.room)?;
    let sources = source::open(&room, NamedSources { videos: &args.video, ..NamedSources::default() })?;
    args.background.check_names(&args.video, &[])?;
    let names = sources.iter().map(|s| s.name.clone()).collect();
    let prepared = PreparedRoom::prepare(
        &room,
        &args.room,
        &PreparationOptions { cameras: names, ..PreparationOptions::default() },
    )?;
    let mut method = Condensation::new(prepared.clone(), options)?;
    let mut cameras = Vec::new();
    for (i, source) in sources.into_iter().enumerate() {
        let (name, camera) = (source.name, &prepared.cameras[i]);
        let size = camera.real_size();
        let filmed = (camera.filmed.intrinsics.width, camera.filmed.intrinsics.height);
        let video = source.video.with_context(|| format!("camera `{name}` has no video"))?;
        if needs_empty && let Some(scene) = args.background.start(&name, &video, filmed, size)?.empty_scene()
        {
            method.set_empty_scene(i, &camera.undistort.image(&scene.picture));
        }
        let VideoSource::Recorded(mut video) = video else {
            bail!("--video {name}: is a stream; give a recording");
        };
        let mut picture = RgbImage::new(size.0, size.1);
        for frame in 1..=args.frame {
            let is_there = if frame < args.frame { video.skip() } else { video.advance()? };
            if !is_there {
                bail!("--frame {}: the video of `{name}` ends after frame {}", args.frame, frame - 1);
            }
        }
        video.picture(&mut picture)?;
        cameras.push(CameraFrame::of_image(camera.undistort.image(&picture)));
    }
    let moment = Moment { frame: args.frame, time_s: 0.0, cameras: &cameras };
    let chosen: Vec<Integration> = match args.heads.integration() {
        Some(one) => vec![one],
        None => Integration::ALL.to_vec(),
    };
    let maps = method.weight_maps(&moment, &chosen, args.height)?;
    let _lock = shell::files::lock(&args.out)?;
    for map in maps {
        let path = args.out.join(format!("{}.png", map.integration));
        calib::picture::write(&path, &map.picture(&prepared))?;
    }
    Ok(String::new())
}
