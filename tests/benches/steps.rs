//! Time of a step of the sampler: on the office beside OpenCV's MOG2 on the same images, from 3 people to 30, and
//! beside the oracle that casts a ray through every pixel. Ratios within one run.
//!
//! `cargo bench -p tests --bench steps`
#![forbid(unsafe_code)]

use std::time::Instant;

use calib::video::FrameSource;
use calib::vision::{AdaptiveBackground, AdaptiveKind};
use calib::{Camera, Intrinsics};
use image::{GrayImage, Luma, RgbImage};
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera};
use tests::chain::{StepResult, run};
use tests::data::{office, program};
use tracker::likelihood::{Layers, Simulation, oracle, pack};
use tracker::method::Method;
use tracker::method::mcmc::{Mcmc, McmcOptions};
use tracker::observation::Mask;
use tracker::prepared_room::{PreparationOptions, PreparedCamera, PreparedRoom};
use tracker::silhouette::{Body, Shape, Silhouette, View};
use tracker::{CameraFrame, Moment};

fn row(what: &str, value: f64, unit: &str, bound: &str) {
    println!("{what:<62} {value:>9.3} {unit:<9} {bound}");
}

fn told(error: impl std::fmt::Display) -> String {
    error.to_string()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() -> StepResult<()> {
    // All times are those of one thread, here and in OpenCV.
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().map_err(told)?;
    calib::vision::set_threads(1).map_err(told)?;
    on_the_office()?;
    from_three_to_thirty()?;
    beside_the_oracle()
}

/// The median frame of the office, 200 steps, and OpenCV's background subtraction of the same two images.
fn on_the_office() -> StepResult<()> {
    let (home, scratch) = (office(), tempfile::tempdir().map_err(told)?);
    let names = ["cam0", "cam1"];
    let film = |name: &str| home.join(format!("video/{name}.mp4"));
    let mut command = program("tracker");
    command.args(["masks", "--rate", "12", "--out"]).arg(scratch.path());
    for name in names {
        command.arg("--video").arg(format!("{name}={}", film(name).display()));
    }
    run(&mut command)?;
    let room = Room::read(&home.join("room")).map_err(told)?;
    let stage =
        PreparedRoom::prepare(&room, &home.join("room"), &PreparationOptions::default()).map_err(told)?;
    let mut sources = Vec::new();
    let mut mog2 = Vec::new();
    for name in names {
        sources.push(FrameSource::open(&film(name).display().to_string()).map_err(told)?);
        mog2.push(AdaptiveBackground::new(AdaptiveKind::Mog2, 500).map_err(told)?);
    }
    let undistort: Vec<_> = stage.cameras.iter().map(|c| c.undistort.clone()).collect();
    let mut mcmc = Mcmc::new(stage, McmcOptions::default()).map_err(told)?;
    let (mut inference, mut subtraction) = (Vec::new(), Vec::new());
    let (mut picture, mut labels) = (RgbImage::default(), GrayImage::default());
    for frame in 1..=300_u32 {
        let mut cameras = Vec::new();
        let mut spent = 0.0;
        for (camera, source) in sources.iter_mut().enumerate() {
            source.read(&mut picture).map_err(told)?;
            if labels.dimensions() != picture.dimensions() {
                labels = GrayImage::new(picture.width(), picture.height());
            }
            let started = Instant::now();
            mog2[camera].label(&picture, -1.0, &mut labels).map_err(told)?;
            spent += started.elapsed().as_secs_f64();
            let file = scratch.path().join(names[camera]).join(format!("{frame:06}.png"));
            let mask = image::open(&file).map_err(told)?.into_luma8();
            let mut straight = GrayImage::new(mask.width(), mask.height());
            undistort[camera].mask(&mask, &mut straight);
            cameras.push(CameraFrame::of_mask(&straight));
        }
        subtraction.push(1e3 * spent);
        let moment = Moment { frame, time_s: f64::from(frame - 1) / 12.0, cameras: &cameras };
        let started = Instant::now();
        std::hint::black_box(mcmc.step(&moment).map_err(told)?);
        inference.push(1e3 * started.elapsed().as_secs_f64());
    }
    let (inference, subtraction) = (median(inference), median(subtraction));
    row("office, inference, 200 steps, one thread, median", inference, "ms", "<= 1.0");
    row("office, OpenCV's MOG2 on the same two images, median", subtraction, "ms", "");
    row("inference against MOG2", inference / subtraction, "x", "<= 0.5");
    Ok(())
}

/// A hall of 20 × 14 m without furniture, seen from its corners.
fn hall() -> Room {
    let corners = [(0.0, 0.0), (20.0, 0.0), (20.0, 14.0), (0.0, 14.0)];
    let camera = |(i, (x, y)): (usize, (f64, f64))| {
        let (eye, aim) = (Point3::new(x, y, 4.0), Point3::new(10.0, 7.0, 0.5));
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 75.0);
        // OpenCV's camera looks along +z with y down: the mirror image of what `look_at_rh` calls up.
        let camera_from_world = Isometry3::look_at_lh(&eye, &aim, &-Vector3::z());
        RoomCamera {
            name: format!("c{i}"),
            camera: Camera { intrinsics, camera_from_world },
            reference: None,
        }
    };
    Room {
        cameras: corners.into_iter().enumerate().map(camera).collect(),
        walkable: Some(vec![Polygon::rectangle(Point2::new(1.0, 1.0), Point2::new(19.0, 13.0))]),
        ..Room::default()
    }
}

/// Microseconds a step with `people` people walking about in the hall.
fn step_us(people: usize) -> StepResult<f64> {
    const STEPS: u32 = 4000;
    let room = hall();
    let stage = PreparedRoom::prepare(&room, std::path::Path::new("."), &PreparationOptions::default())
        .map_err(told)?;
    let views: Vec<View> = stage.cameras.iter().map(View::new).collect();
    let options = McmcOptions {
        burn_in_steps: STEPS / 2,
        kept_steps: STEPS / 2,
        steps_per_person: 0,
        steps_for_s: f64::INFINITY,
        surprise: 1.0,
        max_people: 31,
        ..McmcOptions::default()
    };
    let mut mcmc = Mcmc::new(stage, options).map_err(told)?;
    let mut times = Vec::new();
    let mut followed = 0;
    for frame in 1..=60_u32 {
        let time_s = f64::from(frame - 1) / 12.0;
        let bodies: Vec<Body> = (0..people)
            .map(|i| {
                // In rows, each walking around a small circle.
                let (column, line) = ((i % 6) as f64, (i / 6) as f64);
                let turn = i as f64 + 1.5 * time_s;
                Body {
                    x_m: 3.5 + 2.6 * column + 0.6 * turn.cos(),
                    y_m: 2.5 + 2.2 * line + 0.6 * turn.sin(),
                    radius_m: 0.25,
                    height_m: 1.72,
                }
            })
            .collect();
        let drawn = |view: &View| {
            let mut mask = GrayImage::new(view.width, view.height);
            for body in &bodies {
                for (u, v) in Silhouette::new(view, &Shape::BODY.of(body)).pixels() {
                    mask.put_pixel(u, v, Luma([255]));
                }
            }
            CameraFrame::of_mask(&mask)
        };
        let cameras: Vec<CameraFrame> = views.iter().map(drawn).collect();
        let moment = Moment { frame, time_s, cameras: &cameras };
        let started = Instant::now();
        followed = mcmc.step(&moment).map_err(told)?.len();
        if frame > 30 {
            times.push(1e6 * started.elapsed().as_secs_f64() / f64::from(STEPS));
        }
    }
    if followed != people {
        return Err(format!("{people} people in the hall, but {followed} are followed"));
    }
    Ok(median(times))
}

fn from_three_to_thirty() -> StepResult<()> {
    let (few, many) = (step_us(3)?, step_us(30)?);
    row("hall, 4 cameras: a step with 3 people", few, "us", "");
    row("hall, 4 cameras: a step with 30 people", many, "us", "");
    row("30 people against 3", many / few, "x", "<= 1.5");
    Ok(())
}

/// One camera of the office in full resolution, three people, one of them moved.
fn beside_the_oracle() -> StepResult<()> {
    let home = office().join("room");
    let room = Room::read(&home).map_err(told)?;
    let stage = PreparedRoom::prepare(&room, &home, &PreparationOptions::default()).map_err(told)?;
    let camera: &PreparedCamera = &stage.cameras[0];
    let view = View::new(camera);
    let layers = Layers::new(vec![view.clone()], &[Shape::BODY]);
    let body = |x_m: f64, y_m: f64| Body { x_m, y_m, radius_m: 0.25, height_m: 1.7 };
    let mut bodies = vec![body(2.0, 2.5), body(3.0, 3.0), body(4.0, 2.0)];
    let mut mask = GrayImage::new(view.width, view.height);
    for body in &bodies {
        for (u, v) in Silhouette::new(&view, &body.ellipsoid()).pixels() {
            mask.put_pixel(u, v, Luma([255]));
        }
    }
    let mut simulation = Simulation::new(&layers);
    simulation.restart(&[Some(pack(&Mask::from(&mask), &view))]);
    let drawn: Vec<Vec<Silhouette>> = bodies.iter().map(|b| layers.silhouettes(b, |_| true)).collect();
    for silhouettes in &drawn {
        simulation.insert(silhouettes);
    }
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut moved = vec![Silhouette::default()];
    let mut incremental = |which: usize, to: &Body| {
        layers.draw(0, to, &mut moved[0]);
        simulation.try_change(Some(&drawn[which]), Some(&moved));
        std::hint::black_box(simulation.tried().next())
    };
    let (mut steps, mut rays) = (Vec::new(), Vec::new());
    for _ in 0..10 {
        let which = rng.random_range(0..bodies.len());
        let before = bodies[which];
        let to = Body { x_m: before.x_m + rng.random_range(-0.1..0.1), ..before };
        let started = Instant::now();
        for _ in 0..200 {
            incremental(which, &to);
        }
        steps.push(1e6 * started.elapsed().as_secs_f64() / 200.0);
        bodies[which] = to;
        let solids: Vec<_> = bodies.iter().map(Body::ellipsoid).collect();
        let started = Instant::now();
        let counts = oracle::counts(camera, &solids, &mask, |u, v| view.static_z_m(u as i32, v as i32));
        rays.push(1e6 * started.elapsed().as_secs_f64());
        if incremental(which, &to).flatten() != Some(counts) {
            return Err("the incremental counts are not the oracle's".to_owned());
        }
        bodies[which] = before;
    }
    let (step, ray) = (median(steps), median(rays));
    row("one camera, 3 people: a step, incremental", step, "us", "");
    row("one camera, 3 people: a step, a ray a pixel", ray, "us", "");
    row("oracle against incremental", ray / step, "x", ">= 500");
    Ok(())
}
