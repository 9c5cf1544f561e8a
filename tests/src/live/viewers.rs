//! Viewers of a run's page: what they cost the tracker.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::chain::StepResult;
use crate::live::office::{self, RATE_HZ};
use crate::live::run::{LiveRun, Scratch};
use crate::live::{Figure, page, quantile};
use crate::network_camera::CameraOptions;

/// Time for the run to start, seconds.
const START_S: f64 = 12.0;
/// Number of turns with viewers and without, in turn.
const TURNS: usize = 4;

/// Viewers that take whatever the page has, as fast as it gives it, until `has_ended`. Returns the number of pictures.
fn watch(address: SocketAddr, has_ended: &AtomicBool) -> usize {
    let (mut pictures, mut latest) = (0, String::new());
    while !has_ended.load(Ordering::Relaxed) {
        let Ok((_, body)) = page::get(address, &format!("/moment{latest}")) else {
            thread::sleep(Duration::from_millis(100));
            continue;
        };
        let number =
            serde_json::from_slice::<serde_json::Value>(&body).ok().and_then(|m| m["number"].as_u64());
        latest = number.map_or(String::new(), |number| format!("?after={number}"));
        for camera in 0..office::CAMERAS.len() {
            pictures += usize::from(page::get(address, &format!("/camera/{camera}.jpg")).is_ok());
        }
    }
    pictures
}

/// Rows a second and their ages in turns without and with viewers.
fn turns(viewers: usize, turn_s: f64) -> StepResult<([Vec<f64>; 2], usize)> {
    let length_s = START_S + turn_s * TURNS as f64;
    let order = office::repeated(8.0, ((length_s + 20.0) * RATE_HZ) as usize);
    let options = CameraOptions::default();
    let (cameras, epoch) = office::cameras(&order, false, [options.clone(), options])?;
    let scratch = Scratch::new()?;
    let mut given = office::videos(&cameras);
    given.extend(["--no-film", "--lag", "0"].map(str::to_owned));
    let mut run = LiveRun::start_with_page(&office::room(), &scratch.path("out"), &given)?;
    let address = run.page().ok_or("the run has no page")?;
    let at = |s: f64| epoch + Duration::from_secs_f64(s);
    let pictures = Arc::new(AtomicUsize::new(0));
    let mut rates = [Vec::new(), Vec::new()];
    for turn in 0..TURNS {
        let (from_s, until_s) = (START_S + turn_s * turn as f64, START_S + turn_s * (turn + 1) as f64);
        run.wait_until(at(from_s))?;
        let has_ended = Arc::new(AtomicBool::new(false));
        let watching = if turn % 2 == 1 { viewers } else { 0 };
        let threads: Vec<_> = (0..watching)
            .map(|_| {
                let (has_ended, pictures) = (Arc::clone(&has_ended), Arc::clone(&pictures));
                thread::spawn(move || pictures.fetch_add(watch(address, &has_ended), Ordering::Relaxed))
            })
            .collect();
        run.wait_until(at(until_s))?;
        has_ended.store(true, Ordering::Relaxed);
        for thread in threads {
            // A viewer that panicked has printed why.
            let _ = thread.join();
        }
        let counted =
            |row: &&crate::live::rows::LiveRow| (at(from_s + 1.0)..at(until_s)).contains(&row.found);
        let rows = run.rows();
        rates[turn % 2].push(rows.iter().filter(counted).count() as f64 / (turn_s - 1.0));
    }
    run.interrupt()?;
    Ok((rates, pictures.load(Ordering::Relaxed)))
}

/// Cost of viewers, as figures.
pub fn viewers(count: usize, turn_s: f64) -> Vec<Figure> {
    let what = format!("{count} viewers of two live cameras");
    match turns(count, turn_s) {
        Ok(([without, with], pictures)) => {
            let [alone, watched] = [without, with].map(|rates| quantile(rates, 0.5).unwrap_or(f64::NAN));
            vec![
                Figure::new(format!("{what}: rows without them"), alone, "1/s", ""),
                Figure::new(format!("{what}: rows against none"), watched / alone, "×", ">= 0.97"),
                Figure::new(format!("{what}: pictures they got"), pictures as f64, "", ""),
            ]
        }
        Err(why) => vec![Figure::unavailable(what, why, ">= 0.97")],
    }
}

/// Weight of a run's page: everything that it loads from the server before the first picture, bytes, and the time to the
/// first paint as `paint` finds it, seconds.
pub fn page_weight(paint: impl Fn(&str) -> Option<(f64, f64)>) -> Vec<Figure> {
    let what = "page of a run on the loopback";
    let measured = || -> StepResult<(f64, f64)> {
        let order = office::repeated(8.0, (60.0 * RATE_HZ) as usize);
        let options = CameraOptions::default();
        let (cameras, _) = office::cameras(&order, false, [options.clone(), options])?;
        let scratch = Scratch::new()?;
        let mut given = office::videos(&cameras);
        given.push("--no-film".to_owned());
        let mut run = LiveRun::start_with_page(&office::room(), &scratch.path("out"), &given)?;
        let address = run.page().ok_or("the run has no page")?;
        run.wait_for(Instant::now() + Duration::from_mins(1), |rows| rows.len() > 24)?;
        paint(&format!("http://{address}/")).ok_or_else(|| "there is no browser here".to_owned())
    };
    match measured() {
        Ok((bytes, paint_s)) => vec![
            Figure::new(format!("{what}: weight"), bytes / 1e6, "MB", "<= 1.5"),
            Figure::new(format!("{what}: first paint"), paint_s, "s", "<= 1"),
        ],
        Err(why) => vec![Figure::unavailable(what, why, "<= 1.5, <= 1")],
    }
}
