//! Figures of a service: `tracker serve` on four streams for a while, its messages, its page. A table.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench serve [-- PART[=SECONDS] …]`:
//!
//! * `service=S` — 4 synthetic streams for S seconds (120), cameras dropping at random, the broker away for a sixth of the
//!   time (at most 60 s), a room changed and read again by SIGHUP: crashes, memory growth, events lost;
//! * `mqtt=S` — latency from capture to MQTT message, measured for S seconds (20);
//! * `viewers=S` — rows with 20 viewers against none, in four turns of S seconds (12);
//! * `page` — weight and first paint of the page, in Chromium.
#![forbid(unsafe_code)]

use std::time::{Duration, Instant};

use browser::Page;
use tests::live::{Figure, publishing, service, viewers};

/// Seed of the cameras' drops.
const SEED: u64 = 1000;

fn main() -> Result<(), String> {
    let given: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let chosen = if given.is_empty() {
        ["service", "mqtt", "viewers", "page"].map(str::to_owned).to_vec()
    } else {
        given
    };
    println!("what | measured | asked");
    for argument in chosen {
        let (part, seconds) = argument.split_once('=').unwrap_or((&argument, ""));
        let seconds = |or: f64| {
            if seconds.is_empty() {
                Ok(or)
            } else {
                seconds.parse::<f64>().map_err(|e| format!("{argument}: {e}"))
            }
        };
        let figures: Vec<Figure> = match part {
            "service" => {
                let length_s = seconds(120.0)?;
                service::service(length_s, (length_s / 6.0).min(60.0), SEED)
            }
            "mqtt" => publishing::capture_to_message(seconds(20.0)?),
            "viewers" => viewers::viewers(20, seconds(12.0)?),
            "page" => viewers::page_weight(painted),
            _ => return Err(format!("{argument}: there are service, mqtt, viewers and page")),
        };
        for figure in figures {
            println!("{}", figure.row());
            println!("{}", figure.json(part));
        }
    }
    Ok(())
}

/// Bytes that a page has loaded, without the cameras' pictures, and its first paint, seconds.
fn painted(url: &str) -> Option<(f64, f64)> {
    let mut page = Page::open(url)?;
    let until = Instant::now() + Duration::from_secs(30);
    let paint = "(performance.getEntriesByName('first-contentful-paint')[0] || {startTime: -1}).startTime";
    loop {
        let paint_ms = page.value(paint).as_f64().unwrap_or(-1.0);
        if paint_ms >= 0.0 {
            // Files that the page loads after its first answer count, too.
            std::thread::sleep(Duration::from_secs(3));
            let bytes = page.value(
                "performance.getEntriesByType('navigation').concat(performance.getEntriesByType('resource')
                     .filter(e => !/camera|moment/.test(e.name))).reduce((sum, e) => sum + e.transferSize, 0)",
            );
            return Some((bytes.as_f64()?, paint_ms / 1000.0));
        }
        if Instant::now() > until {
            return None;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}
