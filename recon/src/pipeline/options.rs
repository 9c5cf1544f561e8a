//! Options of a build: those of its stages, and the checks of them all.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::assemble::AssembleOptions;
use crate::dense::DenseOptions;
use crate::memory::MemoryBound;
use crate::motion::MotionOptions;
use crate::planes::PlaneOptions;
use crate::{Error, Result};

/// Options of building a room. A file of options has those of the stages: `[motion]`, `[motion.features]`, `[dense]`,
/// `[planes]`, `[assemble.merge]`, `[assemble.floor]`, `[assemble.fusion]`; the rest comes from the command line.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BuildOptions {
    /// File with the zones of the new room, in its coordinates; without it the zones of a replaced room are preserved.
    #[serde(skip_deserializing)]
    pub zones: Option<PathBuf>,
    /// Seed of everything random; the room is the same for the same seed, at any number of threads.
    #[serde(skip_deserializing)]
    pub seed: u64,
    /// Options of camera motion.
    pub motion: MotionOptions,
    /// Options of dense stereo.
    pub dense: DenseOptions,
    /// Options of plane detection and filling.
    pub planes: PlaneOptions,
    /// Options of joining cameras, floor, discs.
    pub assemble: AssembleOptions,
    /// Bound on the memory that the captures' pictures take. It decides how many captures are worked on at a time, and, where
    /// one alone does not fit, how many of its frames are used.
    #[serde(skip)]
    pub memory: MemoryBound,
    /// Whether plan and previews are drawn at half their usual size, in a quarter of the time.
    #[serde(skip_deserializing)]
    pub small_pictures: bool,
}

impl BuildOptions {
    /// Reads the options of the stages; those that the file does not name have their defaults.
    ///
    /// # Errors
    /// [`Error::Calib`] for a file that cannot be read, [`Error::File`] for an unknown option or an impossible value.
    pub fn read(path: &Path) -> Result<Self> {
        let text = calib::files::read_text(path)?;
        let options: Self = toml::from_str(&text).map_err(|e| {
            let line = 1 + text[..e.span().map_or(0, |span| span.start)].matches('\n').count();
            Error::content(path, format!("line {line}"), e.message().replace('\n', " "))
        })?;
        match options.defect() {
            Some((option, problem)) => Err(Error::content(path, option, problem)),
            None => Ok(options),
        }
    }

    /// Checks the values.
    ///
    /// # Errors
    /// [`Error::Room`] with the first impossible value.
    pub fn check(&self) -> Result<()> {
        self.defect().map_or(Ok(()), |(option, problem)| Err(Error::Room(format!("{option}: {problem}"))))
    }

    /// Name and problem of the first impossible value.
    fn defect(&self) -> Option<(&'static str, String)> {
        let Self { motion, dense, planes, assemble, .. } = self;
        let (features, AssembleOptions { merge, floor, fusion }) = (&motion.features, assemble);
        let counts = [
            ("motion.features.count", features.count, 1..=100_000),
            ("motion.features.grid", features.grid, 1..=1000),
            ("motion.features.patch_radius_px", features.patch_radius_px.max(0) as usize, 1..=100),
            ("motion.features.window_px", features.window_px as usize, 3..=1000),
            ("motion.features.pyramid_depth", features.pyramid_depth as usize, 0..=16),
            ("motion.polish_rounds", motion.polish_rounds, 0..=1000),
            ("dense.key_frames", dense.key_frames, 1..=1000),
            ("dense.sources", dense.sources, 1..=8),
            ("dense.best_views", dense.best_views, 1..=1000),
            ("dense.halvings", dense.halvings, 1..=16),
            ("dense.least_agreeing", dense.least_agreeing, 1..=1000),
            ("planes.most_planes", planes.most_planes, 0..=10_000),
            ("planes.rim_px", planes.rim_px, 0..=1000),
            ("assemble.floor.directions", floor.directions, 100..=1_000_000),
            ("assemble.floor.peaks", floor.peaks, 1..=100_000),
        ];
        let shares = [
            ("motion.features.min_correlation", features.min_correlation),
            ("motion.features.corner_quality", features.corner_quality),
            ("motion.min_registered", motion.min_registered),
            ("motion.min_explained", motion.min_explained),
            ("dense.least_shared_view", dense.least_shared_view),
            ("planes.least_share", planes.least_share.into()),
            ("planes.speckle_share", planes.speckle_share.into()),
            ("assemble.floor.largest_behind", floor.largest_behind),
            ("assemble.floor.least_share", floor.least_share),
        ];
        let positive = [
            ("motion.features.min_distance_px", features.min_distance_px),
            ("motion.features.max_return_px", features.max_return_px),
            ("motion.features.max_disagreement_px", features.max_disagreement_px),
            ("motion.max_noise_px", motion.max_noise_px),
            ("motion.min_parallax_deg", motion.min_parallax_deg),
            ("dense.largest_parallax_deg", dense.largest_parallax_deg),
            ("dense.catching_up", dense.catching_up.into()),
            ("dense.color_sigma", dense.color_sigma.into()),
            ("dense.agreement_px", dense.agreement_px.into()),
            ("dense.largest_cost", dense.largest_cost.into()),
            ("planes.tolerance_px", planes.tolerance_px.into()),
            ("planes.loose_tolerance_px", planes.loose_tolerance_px.into()),
            ("planes.facing_deg", planes.facing_deg.into()),
            ("planes.edge_px", planes.edge_px.into()),
            ("planes.edge", planes.edge.into()),
            ("planes.edge_cost", planes.edge_cost.into()),
            ("planes.reach_px", planes.reach_px.into()),
            ("planes.surface_reach_px", planes.surface_reach_px.into()),
            ("planes.looked_past", planes.looked_past.into()),
            ("assemble.merge.pick_sigma_px", merge.pick_sigma_px),
            ("assemble.merge.depth_sigma", merge.depth_sigma),
            ("assemble.merge.motion_sigma", merge.motion_sigma),
            ("assemble.merge.outlier_px", merge.outlier_px),
            ("assemble.floor.distance_cell", floor.distance_cell),
            ("assemble.floor.normal_spread_deg", floor.normal_spread_deg),
            ("assemble.floor.thickness", floor.thickness),
            ("assemble.floor.largest_roll_deg", floor.largest_roll_deg),
            ("assemble.floor.largest_upward_deg", floor.largest_upward_deg),
            ("assemble.floor.correlated", floor.correlated),
            ("assemble.floor.level_sigma_deg", floor.level_sigma_deg),
            ("assemble.fusion.same_surface", fusion.same_surface.into()),
            ("assemble.fusion.largest_radius_px", fusion.largest_radius_px.into()),
            ("assemble.fusion.flatness", fusion.flatness.into()),
        ];
        let count = counts.into_iter().find(|(_, n, range)| !range.contains(n)).map(|(name, n, range)| {
            (name, format!("{n} is not one of {} to {}", range.start(), range.end()))
        });
        let share = shares.into_iter().find(|(_, share)| !(0.0..=1.0).contains(share));
        let share = share.map(|(name, share)| (name, format!("{share} is no share; give 0 to 1")));
        let sized = positive.into_iter().find(|(_, value)| value.is_nan() || *value <= 0.0);
        let sized = sized.map(|(name, value)| (name, format!("{value} is not greater than 0")));
        count.or(share).or(sized)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<BuildOptions> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("options.toml");
        std::fs::write(&path, text).unwrap();
        BuildOptions::read(&path)
    }

    #[test]
    fn options_of_a_file_replace_defaults() {
        let options = read("[dense]\nsources = 3\n[assemble.floor]\npeaks = 7\n").unwrap();
        let mut expected = BuildOptions::default();
        (expected.dense.sources, expected.assemble.floor.peaks) = (3, 7);
        assert_eq!(options, expected);
    }

    /// A report's options, without those of the command line, are a file that reads back as these options.
    #[test]
    fn written_options_read_back() {
        let mut options = BuildOptions { dense: DenseOptions::draft(), ..BuildOptions::default() };
        options.motion.refine_lens = true;
        options.assemble.fusion.flatness = 0.1 + 0.2;
        let mut table = toml::Table::try_from(&options).unwrap();
        for name in ["seed", "small_pictures"] {
            assert!(table.remove(name).is_some(), "{name}");
        }
        assert_eq!(read(&table.to_string()).unwrap(), options);
    }

    #[test]
    fn impossible_options_are_named() {
        BuildOptions::default().check().unwrap();
        BuildOptions { dense: DenseOptions::draft(), ..BuildOptions::default() }.check().unwrap();
        for (text, words) in [
            ("[dense]\nsources = 9", "dense.sources: 9 is not one of 1 to 8"),
            ("[motion]\nmin_registered = 1.5", "motion.min_registered: 1.5 is no share"),
            ("[planes]\nedge_px = nan", "planes.edge_px: NaN is not greater than 0"),
            ("\n[motion]\nsead = 3", "line 3: unknown field `sead`"),
            ("seed = 3", "line 1: unknown field `seed`"),
            ("[dense]\nkey_frames = \"many\"", "line 2: invalid type"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains("options.toml: ") && error.contains(words), "{error}");
        }
    }
}
