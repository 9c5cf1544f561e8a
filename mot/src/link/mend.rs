//! Tracklets of an online tracker linked over the whole recording, which corrects ids and fills gaps.
//!
//! An online tracker that loses a person and finds them again gives them another id. Here its tracks are the nodes of
//! the graph: all are kept, and those that continue each other by their motion become one, with the id of the first.

use std::collections::{BTreeMap, HashSet};
use std::path::Path;
use std::time::Instant;

use super::detection::Detections;
use super::options::LinkOptions;
use super::report::LinkReport;
use super::solver::exact;
use super::tracklet::{self, Ends};
use super::{Linked, chain, fill, mend_lines, track_file};
use crate::jsonl;
use crate::rows::RowFile;
use crate::{Error, Result};

/// Links the tracks of a file.
///
/// # Errors
/// A row without an id, or invalid options.
pub fn link_tracklets(file: &RowFile, options: &LinkOptions) -> Result<Linked> {
    options.check()?;
    if let Some(row) = file.rows.iter().find(|r| r.id.is_none()) {
        return Err(Error::content(
            &file.path,
            format!("line {}", row.line),
            "has no id, which tracklets need; link detections as such",
        ));
    }
    let started = Instant::now();
    let detections = Detections::from_rows(file, |row| options.wants(row))?;
    let mut by_id: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (node, detection) in detections.all.iter().enumerate() {
        by_id.entry(detection.tracklet.unwrap_or_default()).or_default().push(node as u32);
    }
    let mut tracklets: Vec<(u32, Vec<u32>)> = by_id.into_iter().collect();
    tracklets.sort_by_key(|(_, nodes)| nodes.first().copied());
    let (ids, tracklets): (Vec<u32>, Vec<Vec<u32>>) = tracklets.into_iter().unzip();
    let joining = options.joining(detections.on_floor);
    let [_, max_gap] = joining.max_gaps;
    let ends = Ends::of(&detections, &tracklets, &joining.model);
    // Each track gains more than a track costs, so none is dropped.
    let inner = vec![-(2.0 * joining.prices.birth + 1.0); tracklets.len()];
    let graph = tracklet::graph(&ends, &inner, joining.prices.birth, max_gap, &joining.model)?;
    let build_seconds = started.elapsed().as_secs_f64();
    let started = Instant::now();
    let solution = exact::solve(&graph);
    let report = LinkReport {
        detections: detections.all.len(),
        edges: graph.link_count(),
        tracks: solution.tracks.len(),
        total_cost: solution.total.value(),
        lower_bound: solution.bound.value(),
        is_optimal: solution.total == solution.bound,
        build_seconds,
        solve_seconds: started.elapsed().as_secs_f64(),
        solver: options.solver,
        published_graph: false,
        joining: Vec::new(),
    };
    let mut fill = options.fill();
    fill.smooth_frames = options.smooth_frames.unwrap_or(0.0);
    let tracks = solution.tracks.iter();
    Ok(Linked {
        ids: tracks.clone().filter_map(|t| t.first()).map(|t| ids[*t as usize]).collect(),
        tracks: tracks.map(|t| fill::rows(&detections, &chain(&tracklets, t), &fill)).collect(),
        renamed: solution
            .tracks
            .iter()
            .flat_map(|t| t.iter().map(|later| (ids[*later as usize], ids[t[0] as usize])))
            .collect(),
        report,
    })
}

/// Post-processing of a run: links `OUT/tracks.txt` over the whole recording and rewrites it, with `OUT/tracks.jsonl`
/// and `OUT/boxes/*.txt` under the same ids; people and boxes are filled in where their track was.
///
/// # Errors
/// Files that cannot be read or written.
pub fn mend_run(out: &Path, frames_per_s: f64) -> Result<LinkReport> {
    let path = out.join("tracks.txt");
    let options = LinkOptions { frames_per_s: Some(frames_per_s), ..LinkOptions::default() };
    let linked = link_tracklets(&RowFile::read(&path)?, &options)?;
    let filled: HashSet<(u32, u32)> = linked
        .ids
        .iter()
        .zip(&linked.tracks)
        .flat_map(|(id, track)| track.iter().filter(|r| !r.is_seen).map(|r| (*id, r.frame)))
        .collect();
    let mut files = vec![(path, track_file(&linked))];
    let lines = out.join("tracks.jsonl");
    if lines.is_file() {
        let mended = mend_lines::mended(jsonl::read(&lines)?, &linked);
        let text: Result<String> = mended.iter().map(|line| line.text(&lines)).collect();
        files.push((lines, text?));
    }
    let folder = out.join("boxes");
    if folder.is_dir() {
        let entries = std::fs::read_dir(&folder).map_err(Error::io(&folder))?;
        let mut boxes: Vec<_> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
        boxes.sort();
        for path in boxes.into_iter().filter(|p| p.extension().is_some_and(|e| e == "txt")) {
            let text = mended_boxes(&RowFile::read(&path)?, &linked, &filled)?;
            files.push((path, text));
        }
    }
    let files: Vec<(&Path, &[u8])> = files.iter().map(|(p, text)| (p.as_path(), text.as_bytes())).collect();
    calib::files::write_together(&files)?;
    Ok(linked.report)
}

/// A camera's boxes under the new ids; gaps are filled only where the track on the floor was filled.
fn mended_boxes(file: &RowFile, linked: &Linked, filled: &HashSet<(u32, u32)>) -> Result<String> {
    let detections = Detections::from_rows(file, |_| true)?;
    let mut by_id: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (node, detection) in detections.all.iter().enumerate() {
        let id = detection.tracklet.unwrap_or_default();
        by_id.entry(linked.renamed.get(&id).copied().unwrap_or(id)).or_default().push(node as u32);
    }
    let straight = fill::FillOptions { interpolate: true, smooth_frames: 0.0 };
    let keeps = |id: u32, row: &fill::TrackRow| row.is_seen || filled.contains(&(id, row.frame));
    let tracks: Vec<Vec<fill::TrackRow>> = by_id
        .iter()
        .map(|(id, nodes)| {
            fill::rows(&detections, nodes, &straight).into_iter().filter(|r| keeps(*id, r)).collect()
        })
        .collect();
    Ok(track_file(&Linked { ids: by_id.into_keys().collect(), tracks, ..linked.clone() }))
}
