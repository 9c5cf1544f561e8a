//! The verdict of `recon build` about projects of synthetic rooms that were never tuned on: good ones should be green,
//! those with one of five usual mistakes red (or refused) or amber. Draft quality.
//!
//! `cargo bench -p tests --bench verdict [-- GOOD [SPOILT [FIRST-SEED]] [good|pick|swapped …]]`: GOOD good projects, and SPOILT
//! projects of each mistake, or of the mistakes that are named; 12 and 4 by default. The whole campaign is `-- 60 12`: 60 good
//! and 60 spoilt projects.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::path::Path;

use recon::dense::DenseOptions;
use recon::pipeline::{BuildOptions, BuildReport, build};
use recon::verdict::Light;
use tests::accuracy::RelativePoseError;
use tests::chain::StepResult;
use tests::spoilt::{FilmedRoom, Mistake};

/// First seed where none is given. Bounds were chosen on seeds 1 to 999.
const FIRST_SEED: u64 = 1000;

/// Outcomes of one kind of projects.
#[derive(Default)]
struct Outcomes {
    green: Vec<u64>,
    amber: usize,
    red: usize,
    refused: usize,
}

fn main() -> StepResult<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let names: Vec<&String> = arguments.iter().filter(|a| a.parse::<u64>().is_err()).collect();
    let kinds: Vec<String> = std::iter::once(None).chain(Mistake::ALL.map(Some)).map(kind_name).collect();
    if let Some(unknown) = names.iter().find(|name| !kinds.contains(name)) {
        return Err(format!("{unknown}: one of {}", kinds.join(", ")));
    }
    let mut asked = arguments.iter().filter_map(|a| a.parse::<u64>().ok());
    let good = asked.next().unwrap_or(12);
    let spoilt = asked.next().unwrap_or(4);
    let first = asked.next().unwrap_or(FIRST_SEED);
    let mut outcomes: BTreeMap<String, Outcomes> = BTreeMap::new();
    for seed in first..first + good.max(spoilt) {
        let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
        let filmed = FilmedRoom::new(scratch.path(), seed)?;
        let is_spoilt = seed < first + spoilt;
        let kinds = std::iter::once(None).chain(Mistake::ALL.map(Some));
        for mistake in kinds.filter(|kind| if kind.is_some() { is_spoilt } else { true }) {
            let name = kind_name(mistake);
            if !names.is_empty() && !names.contains(&&name) {
                continue;
            }
            let project = filmed.project(mistake)?;
            let of_kind = outcomes.entry(name.clone()).or_default();
            match built(&project) {
                Ok(report) => {
                    // A red room is kept elsewhere.
                    let off = filmed.error(&project.with_file_name("room"), mistake).ok();
                    describe(seed, &name, &report, off);
                    match report.verdict.light {
                        Light::Green => of_kind.green.push(seed),
                        Light::Amber => of_kind.amber += 1,
                        Light::Red => of_kind.red += 1,
                    }
                }
                Err(line) => {
                    println!("{seed} {name:<12} refused  {line}");
                    of_kind.refused += 1;
                }
            }
        }
    }
    println!("\nseeds from {first}        green  amber    red refused   seeds that are green");
    for (name, Outcomes { green, amber, red, refused }) in &outcomes {
        println!("{name:<24} {:>5} {amber:>6} {red:>6} {refused:>7}   {green:?}", green.len());
    }
    Ok(())
}

fn kind_name(mistake: Option<Mistake>) -> String {
    mistake.map_or("good".to_owned(), |m| format!("{m:?}").to_lowercase())
}

fn built(project: &Path) -> Result<BuildReport, String> {
    let options =
        BuildOptions { dense: DenseOptions::draft(), small_pictures: true, ..BuildOptions::default() };
    build(project, &project.with_file_name("room"), &options, &mut |_| {}).map_err(|e| e.to_string())
}

/// Prints a verdict with the figures it was made of.
fn describe(seed: u64, name: &str, report: &BuildReport, off: Option<RelativePoseError>) {
    let evidence = &report.evidence;
    let off = off
        .map(|off| format!("off {:.1} cm, {:.2}°; ", off.position_cm, off.rotation_deg))
        .unwrap_or_default();
    println!(
        "{seed} {name:<12} {:<6}   {off}reach {:.1} m, floor {:.3}",
        report.verdict.light.word(),
        evidence.reach_m,
        evidence.floor_share
    );
    for (camera, film) in evidence.cameras.iter().zip(&report.cameras) {
        println!(
            "      height {:.2} m, lines {} × {:.2}, parallax {:.2}°, explained {:.2}, {} doubts",
            camera.height_m,
            camera.lean_deg.map_or("none".to_owned(), |deg| format!("{deg:.1}°")),
            camera.outvoted,
            film.parallax_deg,
            film.explained_share,
            film.doubts.len()
        );
    }
    for pair in &evidence.pairs {
        println!(
            "      {} picks, {} left out, {:.2} px; {} overlapping, {:.3} in the way; correlation {:.2} at {}; shared features: {}",
            pair.picks,
            pair.left_out,
            pair.rms_px,
            pair.overlapping,
            pair.in_the_way,
            pair.correlation,
            pair.compared,
            pair.shared_features.map_or("not searched".to_owned(), |count| count.to_string())
        );
    }
    for reason in &report.verdict.reasons {
        println!("      {}: {}", reason.light.word(), reason.text);
    }
}
