//! The experiments of the four papers, done again and put beside the papers' own numbers, on one page.
//!
//! `make papers`: writes target/papers/index.html, and beside it what each experiment has printed and drawn. Data that the
//! papers do not publish are replaced by generated or shipped scenes, as each part says.
#![forbid(unsafe_code)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;
use tests::chain::{StepResult, run};
use tests::crossing_boxes::{self, Crossings};
use tests::data::{folder_to_write, office, program};

/// Title of a paper's part of the page, and the experiments in it.
struct Paper {
    citation: &'static str,
    experiments: Vec<Experiment>,
}

/// One figure or table of a paper.
struct Experiment {
    /// Number and subject in the paper.
    title: &'static str,
    /// Result of the paper.
    published: &'static str,
    /// The experiment as it is done here, where it differs from the paper's.
    here: &'static str,
    /// Commands, the output of each of which stands on the page.
    commands: Vec<Command>,
    /// A table that is made of the output of further commands.
    table: Option<String>,
    /// Pictures that they draw.
    pictures: Vec<PathBuf>,
}

fn main() -> StepResult<()> {
    let folder = PathBuf::from(folder_to_write(std::env::args().nth(1))?);
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let started = Instant::now();
    let mut page = String::from(HEAD);
    for mut paper in [mcmc(&folder), condensation(&folder)?, agents(&folder), linking(&folder)?] {
        let _ = writeln!(page, "<section><h2>{}</h2>", escaped(paper.citation));
        for experiment in &mut paper.experiments {
            eprintln!("{:5.0} s  {}", started.elapsed().as_secs_f64(), experiment.title);
            experiment.write(&mut page)?;
        }
        page += "</section>\n";
    }
    let _ = writeln!(page, "<footer>Done in {:.0} s.</footer></main>", started.elapsed().as_secs_f64());
    let path = folder.join("index.html");
    std::fs::write(&path, page).map_err(|e| format!("{}: {e}", path.display()))?;
    println!("{}", path.display());
    Ok(())
}

impl Experiment {
    /// Does the experiment, and writes its part of the page.
    fn write(&mut self, page: &mut String) -> StepResult<()> {
        let _ = writeln!(
            page,
            "<article><h3>{}</h3><dl><dt>The paper</dt><dd>{}</dd><dt>Here</dt><dd>{}</dd></dl>",
            escaped(self.title),
            escaped(self.published),
            escaped(self.here)
        );
        for command in &mut self.commands {
            let printed = run(command)?;
            write_output(page, &printed);
        }
        write_output(page, self.table.as_deref().unwrap_or_default());
        for picture in &self.pictures {
            let bytes = std::fs::read(picture).map_err(|e| format!("{}: {e}", picture.display()))?;
            let name = picture.file_stem().unwrap_or_default().to_string_lossy().replace('_', " ");
            let _ = writeln!(
                page,
                "<figure><img alt=\"{name}\" src=\"data:image/png;base64,{}\"><figcaption>{name}</figcaption></figure>",
                STANDARD.encode(bytes)
            );
        }
        *page += "</article>\n";
        Ok(())
    }
}

fn write_output(page: &mut String, printed: &str) {
    if !printed.trim().is_empty() {
        let _ = writeln!(page, "<pre>{}</pre>", escaped(printed.trim_end()));
    }
}

fn mcmc(folder: &Path) -> Paper {
    let (crossing, route) = (folder.join("crossing"), folder.join("route"));
    Paper {
        citation: "T. Osawa, X. Wu, K. Sudo, K. Wakabayashi, T. Yasuno, “MCMC based Multiple People Tracking using 3D \
                   Environmental Information”",
        experiments: vec![
            Experiment {
                title: "Section 4.2, figures 7 and 8: two people who pass each other, one wholly behind the other",
                published: "Two people, two cameras, one sequence: both are tracked, their ways are separate (no numbers).",
                here: "Ten pairs of rendered people between two cameras that look at each other; the default, and the \
                       published rule.",
                commands: vec![example("crossing", &[&crossing])],
                table: None,
                pictures: vec![
                    crossing.join("crossing_default.png"),
                    crossing.join("crossing_published_power_100.png"),
                ],
            },
            Experiment {
                title: "Section 4.3, figures 9 and 10: one person on a known route, past large occluders",
                published: "Distance from the route: mean 4.86 cm, maximum 29.43 cm; about 5 frames a second.",
                here: "The office, frames 45 to 170. “blind” ignores the room's geometry.",
                commands: vec![example("paper_route", &[&route])],
                table: None,
                pictures: ["default", "published", "blind"]
                    .map(|name| route.join(format!("route_{name}.png")))
                    .to_vec(),
            },
        ],
    }
}

fn condensation(folder: &Path) -> StepResult<Paper> {
    let hall = folder.join("hall");
    run(&mut example("hall", &[&hall]))?;
    let maps = folder.join("maps");
    let mut weightmap = program("tracker");
    weightmap
        .arg("weightmap")
        .arg(hall.join("room"))
        .args(["--frame", "100", "--height", "1.6", "--out"])
        .arg(&maps);
    let cameras = hall.join("video");
    for camera in sorted(&cameras)? {
        let name = camera.file_name().unwrap_or_default().to_string_lossy().into_owned();
        weightmap.arg("--video").arg(format!("{name}={}", camera.display()));
        weightmap.arg("--background").arg(format!("{name}={}", hall.join("empty").join(&name).display()));
    }
    let bench = |part: &str| cargo_bench("condensation", &[part]);
    Ok(Paper {
        citation: "Y. Matsumoto, T. Kato, T. Wada, “An Occlusion Robust Weight Integration Method for Multi-camera \
                   CONDENSATION”",
        experiments: vec![
            Experiment {
                title: "Figures 5 to 8: weights over a horizontal plane, by integration",
                published: "With a camera whose view is blocked the product vanishes at the head; sums keep it, and add ridges \
                            elsewhere; pairs of cameras that see it from different directions keep the head alone.",
                here: "A synthetic hall with six cameras and six people, frame 100, heads at 1.6 m.",
                commands: vec![weightmap],
                table: None,
                pictures: ["product", "sum", "pairs", "pairs-angle", "room"]
                    .map(|name| maps.join(format!("{name}.png")))
                    .to_vec(),
            },
            Experiment {
                title: "Section 5.1, figure 16: a head that some cameras do not see",
                published: "Ten people: the product loses all ten, the proposed integration none.",
                here: "Ten people turn around behind a screen that hides them from half of six cameras.",
                commands: vec![bench("occlusion")],
                table: None,
                pictures: Vec::new(),
            },
            Experiment {
                title: "Section 5.2, figure 17: people who come in are found",
                published: "8 of 10.",
                here: "Twenty people who come in one after the other.",
                commands: vec![bench("entries")],
                table: None,
                pictures: Vec::new(),
            },
            Experiment {
                title: "Section 5.4, tables 3 and 4: errors",
                published: "One person: mean 4.413 cm in table 3 (4.632 in the text), maximum 34.727 cm. Six people: mean 4.225 cm, \
                            maximum 18.491 cm.",
                here: "Heads in the synthetic hall, against their true places.",
                commands: vec![bench("accuracy")],
                table: None,
                pictures: Vec::new(),
            },
            Experiment {
                title: "Table 2: time of a frame",
                published: "One person 3.635 ms, six people 11.563 ms, 150 hypotheses a person, on seven machines of 2005.",
                here: "One core, edges not counted.",
                commands: vec![bench("time")],
                table: None,
                pictures: Vec::new(),
            },
        ],
    })
}

fn agents(folder: &Path) -> Paper {
    let (simulated, ran) = (folder.join("simulated"), folder.join("agents"));
    let mut simulate = program("tracker");
    simulate.args(["agents", "simulate", "--out"]).arg(&simulated);
    let mut track = program("tracker");
    track.arg("run").arg(office().join("room")).args(["--method", "agents", "--no-film", "--out"]).arg(&ran);
    for camera in ["cam0", "cam1"] {
        let film = office().join(format!("video/{camera}.mp4"));
        track.arg("--video").arg(format!("{camera}={}", film.display()));
    }
    Paper {
        citation: "A. Nakazawa, S. Hiura, H. Kato, S. Inokuchi, “Tracking Multiple Persons Using Distributed Vision Systems”",
        experiments: vec![
            Experiment {
                title: "Section 4.1, experiment 1: two people who cross before three stations",
                published: "8 of 10 crossings end with the right ids.",
                here: "50 crossings in synthetic halls, right 8 s after they met; the default rule, and the published one.",
                commands: vec![cargo_bench("crossings", &[])],
                table: None,
                pictures: Vec::new(),
            },
            Experiment {
                title: "Figures 10 to 12: positions, confidences and agencies",
                published: "Positions at each station, confidences that fall at a crossing, and agencies that part and form again.",
                here: "The office, two stations, three people, the default rule.",
                commands: vec![track],
                table: None,
                pictures: ["positions", "confidences", "agencies"]
                    .map(|name| ran.join(format!("agents/{name}.png")))
                    .to_vec(),
            },
            Experiment {
                title: "Section 4.2, experiment 2, figures 13 to 16: six stations, six people, simulated",
                published: "Decentralised (A): all six are tracked. Centralised (B): person 2 is lost, 3 and 4 are confused.",
                here: "300 trials of each of three layouts; C is the default rule.",
                commands: vec![simulate],
                table: None,
                pictures: ["once", "sequence", "along"]
                    .map(|name| simulated.join(format!("{name}.png")))
                    .to_vec(),
            },
        ],
    }
}

fn linking(folder: &Path) -> StepResult<Paper> {
    let made = folder.join("crossings");
    std::fs::create_dir_all(&made).map_err(|e| format!("{}: {e}", made.display()))?;
    let (truth, found) = (made.join("truth.txt"), made.join("found.txt"));
    let Crossings { truth: true_boxes, found: found_boxes } = crossing_boxes::crossings().cluttered();
    for (path, text) in [(&truth, &true_boxes), (&found, &found_boxes)] {
        std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let experiment_out = made.join("experiment");
    let mut experiment = program("tracker");
    experiment
        .args(["link", "experiment"])
        .arg(&found)
        .arg("--truth")
        .arg(&truth)
        .arg("--out")
        .arg(&experiment_out);
    Ok(Paper {
        citation: "A. Okada, N. Ukita, N. Hagita, “Globally-Optimal Multi-Object Tracking with Constraints on Moving Directions”",
        experiments: vec![
            Experiment {
                title: "Figure 7: detection with and without the constraint",
                published: "True positives over false ones: the constraint changes them hardly, for any of its thresholds.",
                here: "A hundred generated crossings, a tenth of the boxes missed, false ones beside them; least score by row, \
                       threshold of the constraint by column: true positives, false positives, per cent.",
                commands: Vec::new(),
                table: Some(detection_by_threshold(&made, &truth, &found)?),
                pictures: Vec::new(),
            },
            Experiment {
                title: "Table 1 and figure 9: tracking success with and without the constraint, over skipped frames",
                published: "Without: 65.8 and 60.5 %. With: 68.5 and 61.0 %. Best with one skipped frame, falling from three on.",
                here: "A hundred generated crossings, thresholds cross-validated as in the paper (its data set is not public).",
                commands: vec![experiment],
                table: None,
                pictures: vec![experiment_out.join("figure9.png")],
            },
        ],
    })
}

/// Table of true and false positives of the linked boxes, by their least score and the constraint's threshold.
fn detection_by_threshold(folder: &Path, truth: &Path, found: &Path) -> StepResult<String> {
    const THRESHOLDS_PX: [Option<&str>; 5] = [None, Some("32"), Some("16"), Some("8"), Some("4")];
    let mut table = format!("{:<12}", "least score");
    for threshold in THRESHOLDS_PX {
        let _ = write!(table, "{:>16}", threshold.map_or("without".into(), |px| format!("{px} px")));
    }
    for least in ["0", "0.5", "0.7", "0.85"] {
        let _ = write!(table, "\n{least:<12}");
        for threshold in THRESHOLDS_PX {
            let linked = folder.join("linked.txt");
            let mut link = program("tracker");
            link.arg("link").arg(found).arg("--out").arg(&linked).args(["--min-score", least, "--keep-gaps"]);
            link.args(["--max-distance", "25", "--link-cost", "0.1", "--max-gap", "1"]);
            link.args(threshold.map(|px| ["--direction-threshold", px]).into_iter().flatten());
            run(&mut link)?;
            let mut eval = program("tracker");
            eval.args(["eval", "--json", "--truth"]).arg(truth).arg("--tracks").arg(&linked);
            let figures: Value = serde_json::from_str(&run(&mut eval)?).map_err(|e| e.to_string())?;
            let figure = |name: &str| figures[name].as_f64().unwrap_or(f64::NAN);
            let _ = write!(table, "{:>9.1} {:>6.1}", figure("recall"), 100.0 - figure("precision"));
        }
    }
    Ok(table)
}

/// An example of this crate, built with the same profile.
fn example(name: &str, arguments: &[&Path]) -> Command {
    let mut command = program(&format!("examples/{name}"));
    command.args(arguments);
    command
}

/// A benchmark of this crate, built with the same profile.
fn cargo_bench(name: &str, arguments: &[&str]) -> Command {
    // target/PROFILE/examples/papers.
    let own = std::env::current_exe().unwrap_or_default();
    let profile = own.parent().and_then(Path::parent).and_then(Path::file_name).unwrap_or_default();
    let mut command = Command::new(option_env!("CARGO").unwrap_or("cargo"));
    command.args(["bench", "--quiet", "--locked", "--workspace", "--features", "tracker/zenoh", "--profile"]);
    command.arg(if profile == "debug" { "dev".as_ref() } else { profile });
    command.args(["--bench", name, "--"]).args(arguments);
    command
}

fn sorted(folder: &Path) -> StepResult<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    Ok(paths)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Beginning of the page.
const HEAD: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>The four papers, done again</title><style>\
:root{color-scheme:light dark}body{margin:0;font:16px/1.5 system-ui,sans-serif}\
main{max-width:60rem;margin:auto;padding:1.5rem}h1{font-size:1.6rem}h2{font-size:1.2rem;margin-top:3rem;border-top:1px solid #8886;\
padding-top:1rem}h3{font-size:1rem}dl{display:grid;grid-template-columns:max-content 1fr;gap:.3rem 1rem}dt{opacity:.7}dd{margin:0}\
pre{overflow-x:auto;padding:.8rem;background:#8882;border-radius:6px;font-size:.85rem}figure{display:inline-block;margin:.5rem 1rem .5rem 0;\
max-width:100%}img{max-width:100%;max-height:26rem;background:#fff}figcaption{opacity:.7;font-size:.85rem}footer{opacity:.7;margin:3rem 0}\
</style><main><h1>The four papers, done again</h1><p>Each experiment beside the paper's own result. The papers' recordings are not \
public; what replaces them is told with each.</p>\n";
