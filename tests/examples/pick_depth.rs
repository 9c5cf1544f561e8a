//! Prints the errors of depths that `recon` measures at picked pixels, with true motion: rendered offices and halls.
//!
//! `cargo run --release -p tests --example pick_depth -- [FIRST_SEED] [COUNT]`
#![forbid(unsafe_code)]

use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use recon::ray_depth::{self, Asked, PosedFilm};
use scenes::raycast::RayScene;
use synthetic::{CaptureOptions, RoomOptions, SyntheticRoom};
use tests::chain::StepResult;

/// Picked pixels of each camera.
const PICKS: usize = 60;

fn main() -> StepResult<()> {
    let mut given = std::env::args().skip(1).map(|a| a.parse::<u64>().map_err(|e| format!("{a}: {e}")));
    let first = given.next().transpose()?.unwrap_or(1);
    let count = given.next().transpose()?.unwrap_or(4);
    let (mut offices, mut halls) =
        ([Errors::default(), Errors::default()], [Errors::default(), Errors::default()]);
    for seed in first..first + count {
        let options = RoomOptions { seed, cameras: 2, image_px: [640, 480], ..RoomOptions::default() };
        add(&mut offices, &options.build().map_err(|e| e.to_string())?)?;
        add(&mut halls, &tests::hall::hall(seed, 2, false)?)?;
    }
    println!(
        "{:28} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8}",
        "", "measured", "in frames", "> 1 %", "> 2 %", "> 5 %", "median", "off / σ"
    );
    for (name, of) in [("offices", &offices), ("halls", &halls)] {
        println!("{name:8} facing the camera   {}", of[0].row());
        println!("{name:8} true normals        {}", of[1].row());
    }
    Ok(())
}

#[derive(Default)]
struct Errors {
    asked: usize,
    /// Relative error, its standard deviation, and whether the pixel was registered in the frames.
    told: Vec<(f64, f64, bool)>,
}

impl Errors {
    /// Shares of what was asked; those that are off of what was registered; the root mean square of all errors over their standard
    /// deviations.
    fn row(&self) -> String {
        let percent = |part: usize, of: usize| 100.0 * part as f64 / of as f64;
        let mut registered: Vec<f64> =
            self.told.iter().filter(|told| told.2).map(|(off, ..)| off.abs()).collect();
        registered.sort_by(f64::total_cmp);
        let above =
            |limit: f64| percent(registered.iter().filter(|off| **off > limit).count(), registered.len());
        let median = registered.get(registered.len() / 2).copied().unwrap_or(f64::NAN);
        let squares: f64 = self.told.iter().map(|(off, sigma, _)| (off / sigma).powi(2)).sum();
        format!(
            "{:7.1} % {:7.1} % {:6.1} % {:6.1} % {:6.1} % {:6.2} % {:8.1}",
            percent(self.told.len(), self.asked),
            percent(registered.len(), self.asked),
            above(0.01),
            above(0.02),
            above(0.05),
            100.0 * median,
            (squares / self.told.len() as f64).sqrt()
        )
    }
}

fn add(errors: &mut [Errors; 2], room: &SyntheticRoom) -> StepResult<()> {
    let scene =
        RayScene::new(room.room.geometry.as_ref().ok_or("no geometry")?).map_err(|e| e.to_string())?;
    let single = |p: &Vector3<f64>| Vec3::new(p.x as f32, p.y as f32, p.z as f32);
    let cameras = &room.room.cameras;
    let picks = tests::project::picks(room, [&cameras[0].camera, &cameras[1].camera], PICKS, 1)?;
    for (k, (seed, entry)) in (1..).zip(cameras).enumerate() {
        let options = CaptureOptions { seed, frames: 24, ..CaptureOptions::default() };
        let (frames, poses) = room.capture(&entry.camera, &options);
        let reference = frames.len() - 1;
        let home = poses[reference].inverse();
        let motion: Vec<Option<Isometry3<f64>>> = poses.iter().map(|pose| Some(pose * home)).collect();
        let lens = &entry.camera.intrinsics;
        let film = PosedFilm { frames: &frames, reference, intrinsics: lens, camera_from_world: &motion };
        let pixels: Vec<Point2<f64>> = picks.iter().map(|pixels| pixels[k]).collect();
        let truth: Vec<(f64, Vector3<f64>)> = pixels
            .iter()
            .map(|pixel| {
                let ray = lens.unproject(pixel).ok_or("no ray")?;
                let hit = scene
                    .cast(single(&(home * Point3::origin()).coords), single(&(home.rotation * ray)))
                    .ok_or("nothing hit")?;
                let n = hit.normal;
                let normal =
                    home.rotation.inverse() * Vector3::new(f64::from(n.x), f64::from(n.y), f64::from(n.z));
                Ok::<_, String>((f64::from(hit.distance) * ray.z, normal))
            })
            .collect::<Result<_, _>>()?;
        let depths: Vec<f64> = truth.iter().map(|(z, _)| *z).collect();
        let range = (
            depths.iter().copied().fold(f64::MAX, f64::min) / 2.0,
            depths.iter().copied().fold(0.0, f64::max) * 1.5,
        );
        for (with_normals, of) in [false, true].into_iter().zip(&mut *errors) {
            let asked: Vec<Asked> = pixels
                .iter()
                .zip(&truth)
                .map(|(pixel, (_, normal))| Asked { pixel: *pixel, normal: with_normals.then_some(*normal) })
                .collect();
            of.asked += asked.len();
            for (found, (z, _)) in ray_depth::measure(&film, &asked, range).into_iter().zip(&truth) {
                of.told.extend(found.map(|m| (m.depth.depth / z - 1.0, m.depth.sigma, !m.seen.is_empty())));
            }
        }
    }
    Ok(())
}
