//! Figures of `tracker run` on live cameras, each beside the required bound: a table, and a line of JSON for each.
//!
//! `cargo build --release --bins && cargo bench -p tests --bench live` measures everything with short durations.
//! Arguments choose scenarios, in seconds where there is an `=`; `all` measures with the durations that the figures
//! are asked for (about 2 hours):
//!
//! * `a=SEED,…` — the office from two network cameras of different clocks; with `--offset auto`, without, and with a
//!   given rate.
//! * `b=S,…` — one camera silent for S seconds.
//! * `c=S,…` — all cameras away for S seconds.
//! * `d=S` — latency from capture to row, measured for S seconds; without and with a given rate.
//! * `e=S,S` — memory at two times.
//! * `f=N,…` — 1920 × 1080 through a wide lens, with N cameras.
//! * `g` — the office from files.
//! * `h` — six cameras with distortion.
//! * `i` — two recordings of unknown offset.
//! * `k=S` — latency from capture to MQTT message, measured for S seconds.
//! * `j=S` — stations, their traffic measured for S seconds.
#![forbid(unsafe_code)]

use tests::live::{Figure, accuracy, capacity, latency, memory, outages, publishing, stations};

const SHORT: [&str; 11] = ["a", "b=5", "c=20", "d=20", "e=60,180", "f=2", "g", "h", "i", "j=20", "k=20"];
const ALL: [&str; 11] =
    ["a=1,2,3", "b=5,30,90", "c=600", "d=120", "e=600,3600", "f=2,8", "g", "h", "i", "j=60", "k=120"];

/// Figures of one scenario with its parameters.
fn measure(scenario: &str, parameters: &[f64]) -> Result<Vec<Figure>, String> {
    let each = |values: &[f64], figures: &dyn Fn(f64) -> Vec<Figure>| -> Vec<Figure> {
        values.iter().flat_map(|value| figures(*value)).collect()
    };
    let or = |default: f64| if parameters.is_empty() { vec![default] } else { parameters.to_vec() };
    Ok(match (scenario, parameters) {
        ("a", _) => each(&or(1.0), &|seed| {
            let given: [&[&str]; 3] = [&["--offset", "auto"], &[], &["--rate", "12"]];
            given.iter().flat_map(|arguments| accuracy::live(seed as u64, arguments)).collect()
        }),
        ("b", _) => each(&or(5.0), &outages::silent),
        ("c", _) => each(&or(20.0), &outages::away),
        ("d", _) => each(&or(20.0), &|measured_s| {
            let given: [&[&str]; 2] = [&[], &["--rate", "12"]];
            given.iter().flat_map(|arguments| latency::capture_to_row(measured_s, arguments)).collect()
        }),
        ("e", []) => memory::growth(60.0, 180.0),
        ("e", [early_s, late_s]) => memory::growth(*early_s, *late_s),
        ("f", _) => {
            let mut figures = each(&or(2.0), &|cameras| capacity::full_hd(cameras as usize));
            figures.extend(capacity::working_size());
            figures
        }
        ("g", []) => capacity::office_from_files(),
        ("h", []) => capacity::hall(),
        ("i", []) => accuracy::recordings(),
        ("k", _) => each(&or(20.0), &publishing::capture_to_message),
        ("j", _) => each(&or(20.0), &stations::stations),
        _ => return Err(format!("{scenario}: no such scenario, or not with {parameters:?}")),
    })
}

fn main() -> Result<(), String> {
    let given: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let chosen: Vec<&str> = match given.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => SHORT.to_vec(),
        ["all"] => ALL.to_vec(),
        ref given => given.to_vec(),
    };
    println!("what | measured | asked");
    for argument in chosen {
        let (scenario, parameters) = argument.split_once('=').unwrap_or((argument, ""));
        let number = |text: &str| text.parse::<f64>().map_err(|e| format!("{argument}: {text}: {e}"));
        let parameters: Vec<f64> =
            parameters.split(',').filter(|text| !text.is_empty()).map(number).collect::<Result<_, _>>()?;
        for figure in measure(scenario, &parameters)? {
            println!("{}", figure.row());
            println!("{}", figure.json(scenario));
        }
    }
    Ok(())
}
