//! Measures dense stereo alone, with the true poses of a capture: the share of the reference image that is right.
//!
//! `cargo run --release -p recon --example dense_truth -- ../shared/data/office cam0 [pictures-folder]`

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use calib::video::FrameSource;
use image::{Luma, Rgb, RgbImage};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};
use recon::dense::{DenseOptions, PosedCapture, reconstruct};
use recon::planes::{self, PlaneOptions};
use recon::surface::{DepthOrigin, Surface};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [data, name, rest @ ..] = arguments.as_slice() else {
        anyhow::bail!("DATA-FOLDER CAMERA [PICTURES-FOLDER]")
    };
    let data = Path::new(data);
    let truth: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(data.join("truth.json"))?)?;
    let camera = &truth["cameras"][name];
    let poses: Vec<Option<Isometry3<f64>>> =
        camera["capture"].as_array().context("no capture poses")?.iter().map(pose).collect();
    let frames = FrameSource::open(data.join("capture").join(name).to_str().context("path")?)?.read_all()?;
    let own = data.join(format!("{name}.toml"));
    let lens = if own.exists() { own } else { data.join("intrinsics.toml") };
    let intrinsics = calib::files::read_intrinsics(&lens)?;
    let in_room = data.join(format!("room/depth_{name}.png"));
    let depth_file = if in_room.exists() { in_room } else { data.join(format!("depth_{name}.png")) };
    let depth = image::open(&depth_file)?.into_luma16();

    // Points as of a sparse reconstruction: a coarse grid of the true surface.
    let reference = frames.len() - 1;
    let world_from_reference = poses[reference].context("no pose")?.inverse();
    let points: Vec<Point3<f64>> = (0..depth.height())
        .step_by(24)
        .flat_map(|v| (0..depth.width()).step_by(24).map(move |u| (u, v)))
        .filter_map(|(u, v)| {
            let z = f64::from(depth.get_pixel(u, v)[0]) / 1000.0;
            let ray = intrinsics.unproject(&nalgebra::Point2::new(f64::from(u), f64::from(v)))?;
            (z > 0.0).then(|| world_from_reference * Point3::from(ray * z))
        })
        .collect();
    let capture = PosedCapture {
        name,
        frames: &frames,
        reference,
        intrinsics: &intrinsics,
        camera_from_world: &poses,
        points: &points,
    };
    let start = Instant::now();
    let (views, report) = reconstruct(&capture, &DenseOptions::default())?;
    println!("{:.1} s, {report:?}", start.elapsed().as_secs_f64());
    let view = &views[0];
    let start = Instant::now();
    if let Some(planes::Completed { surface, report, .. }) =
        planes::complete(&views, &PlaneOptions::default())
    {
        println!("{:.1} s, {report:?}", start.elapsed().as_secs_f64());
        completed(name, &surface, &depth, rest.first().map(Path::new))?;
    }
    let (mut total, mut covered, mut within, mut all_within) = (0, 0, 0, 0);
    let mut errors = RgbImage::new(depth.width(), depth.height());
    for (u, v, Luma([mm])) in depth.enumerate_pixels() {
        if *mm == 0 {
            continue;
        }
        let z = f32::from(*mm) / 1000.0;
        let i = v as usize * view.map.width + u as usize;
        let error = (1.0 / view.map.supports[i].w - z).abs();
        total += 1;
        all_within += usize::from(error < 0.05);
        let reliable = view.agreeing[i] > 0;
        covered += usize::from(reliable);
        within += usize::from(reliable && error < 0.05);
        let shade = (255.0 * (error / 0.2).min(1.0)) as u8;
        errors.put_pixel(u, v, if reliable { Rgb([shade, 255 - shade, 0]) } else { Rgb([0, 0, shade]) });
    }
    let percent = |n: usize| 100.0 * n as f64 / total as f64;
    println!(
        "reliable {:.1} %, of the image reliable and within 5 cm {:.1} %, of the reliable {:.1} %, all {:.1} %",
        percent(covered),
        percent(within),
        100.0 * within as f64 / covered.max(1) as f64,
        percent(all_within)
    );
    if let [folder] = rest {
        errors.save(Path::new(folder).join(format!("{name}_error.png")))?;
        let normals = RgbImage::from_fn(depth.width(), depth.height(), |u, v| {
            let i = v as usize * view.map.width + u as usize;
            let n = view.map.supports[i].normal(u as f32, v as f32, &view.pinhole());
            Rgb([n.x, n.y, n.z].map(|c| (127.5 + 127.5 * c) as u8))
        });
        normals.save(Path::new(folder).join(format!("{name}_normals.png")))?;
    }
    Ok(())
}

/// Prints the accuracy after the completion by planes, for measured and for filled depths.
fn completed(
    name: &str,
    surface: &Surface,
    depth: &image::ImageBuffer<Luma<u16>, Vec<u16>>,
    folder: Option<&Path>,
) -> Result<()> {
    let seen = depth.pixels().filter(|p| p[0] > 0).count() as f64;
    let mut picture = RgbImage::new(depth.width(), depth.height());
    for origin in [DepthOrigin::Stereo, DepthOrigin::Filled] {
        let (mut count, mut good, mut near, mut far) = (0, 0, 0, 0);
        for (i, (u, v, Luma([mm]))) in depth.enumerate_pixels().enumerate() {
            if *mm == 0 || surface.origin[i] != origin {
                continue;
            }
            let error = surface.depth[i] - f32::from(*mm) / 1000.0;
            count += 1;
            good += i32::from(error.abs() <= 0.05);
            near += i32::from(error < -0.2);
            far += i32::from(error > 0.2);
            let shade = (255.0 * (error.abs() / 0.2).min(1.0)) as u8;
            let blue = if origin == DepthOrigin::Filled { 150 } else { 0 };
            let pixel = if error.abs() <= 0.05 {
                [0, 255 - shade, blue]
            } else if error < 0.0 {
                [shade, 0, blue]
            } else {
                [shade, shade, blue]
            };
            picture.put_pixel(u, v, Rgb(pixel));
        }
        let percent = |n: i32| 100.0 * f64::from(n) / seen;
        println!(
            "{origin:?}: {:.1} % of the image, within 5 cm {:.1} %, > 20 cm too near {:.1} %, too far {:.1} %",
            percent(count),
            percent(good),
            percent(near),
            percent(far)
        );
    }
    if let Some(folder) = folder {
        picture.save(folder.join(format!("{name}_completed.png")))?;
    }
    Ok(())
}

/// A pose of `truth.json`: `{"R": rows, "t": […]}`.
fn pose(value: &serde_json::Value) -> Option<Isometry3<f64>> {
    let rows: [[f64; 3]; 3] = serde_json::from_value(value["R"].clone()).ok()?;
    let t: [f64; 3] = serde_json::from_value(value["t"].clone()).ok()?;
    let rotation = calib::rotation::from_matrix(&Matrix3::from_fn(|r, c| rows[r][c])).ok()?;
    Some(Isometry3::from_parts(Translation3::from(Vector3::from(t)), rotation))
}
