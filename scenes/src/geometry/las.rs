//! LAS and its compressed form LAZ, by the crate `las`: clouds of laser scanners, which are thinned while they are read, so
//! that files larger than the memory can be imported.

use std::io::BufReader;
use std::path::Path;

use las::{PointData, Reader};

use super::scan::{Defect, Placing, Scan};
use super::scan_vertex::ScanVertex;
use super::thinning::VoxelGrid;

/// Number of points that are read at once …
const CHUNK: u64 = 100_000;
/// … unless they take more than so many bytes: each may have 64 KiB of further numbers.
const CHUNK_BYTES: u64 = 64 << 20;

/// Reads a file's points, placed in the room; more than `placing.most_points` are thinned.
///
/// # Errors
/// The place in the file and the problem.
pub(super) fn placed_scan(path: &Path, placing: &Placing<'_>) -> Result<Scan, Defect> {
    let wrong = |e: &dyn std::fmt::Display| {
        ("whole file".to_owned(), format!("this is no LAS or LAZ file that can be read: {e}"))
    };
    let file = std::fs::File::open(path).map_err(|e| ("whole file".to_owned(), e.to_string()))?;
    let mut reader = Reader::new(BufReader::new(file)).map_err(|e| wrong(&e))?;
    let announced = reader.header().number_of_points();
    let mut cloud = Cloud { scan: Scan::default(), grid: None, added: 0 };
    if announced > placing.most_points as u64 {
        cloud.grid = Some(VoxelGrid::new(placing.most_points));
    }
    let point_bytes = u64::from(reader.header().point_format().len()).max(1);
    let chunk = CHUNK.min(CHUNK_BYTES / point_bytes).max(1);
    let mut left = announced;
    while left > 0 {
        let points = reader.read_points(left.min(chunk)).map_err(|e| wrong(&e))?;
        if points.is_empty() {
            let problem = format!(
                "the header announces {announced} points, but {} follow it: the file is cut off; copy or write it again",
                cloud.added
            );
            return Err(("whole file".into(), problem));
        }
        left = left.saturating_sub(points.len() as u64);
        cloud.add(&points, placing)?;
    }
    if let Some(grid) = cloud.grid.take() {
        cloud.scan.take_thinned(grid, cloud.added);
    }
    Ok(cloud.scan)
}

struct Cloud {
    scan: Scan,
    grid: Option<VoxelGrid>,
    added: u64,
}

impl Cloud {
    fn add(&mut self, points: &PointData, placing: &Placing<'_>) -> Result<(), Defect> {
        let places = points.x().zip(points.y()).zip(points.z()).map(|((x, y), z)| [x, y, z]);
        let colors: Option<Vec<[f32; 3]>> =
            points.rgb().map(|rgb| rgb.map(|(r, g, b)| [r, g, b].map(f32::from)).collect());
        // Intensity is as good as a colour to find one's way in a cloud without.
        let levels = colors.unwrap_or_else(|| points.intensity().map(|i| [f32::from(i); 3]).collect());
        if self.added == 0 {
            // Some programs write bytes where the standard has 16 bits.
            let brightest = levels.iter().flatten().copied().fold(0.0, f32::max);
            self.scan.full_level = if brightest > 255.0 { 65_535.0 } else { 255.0 };
        }
        for (position, color) in places.zip(levels) {
            let mut vertex = ScanVertex { position, color, ..ScanVertex::default() };
            placing.place(&mut vertex);
            let number = usize::try_from(self.added).unwrap_or(usize::MAX);
            if let Some(defect) = placing.far_defect(number, &vertex) {
                return Err(defect);
            }
            self.added += 1;
            match &mut self.grid {
                Some(grid) => grid.add(&vertex),
                None => self.scan.vertices.push(vertex),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // numbers that are only copied stay as they are
mod tests {
    use super::*;
    use nalgebra::{Similarity3, Translation3};

    /// A file of a scanner's cloud that laspy wrote (`tests/peers/scans.py`): 60 points of UTM on a floor and a wall.
    fn peer(name: &str) -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/scans").join(name)
    }

    fn near(most_points: usize) -> Placing<'static> {
        let shift = Translation3::new(-500_000.0, -5_400_000.0, 0.0);
        let room_from_scan: Similarity3<f64> = nalgebra::convert(shift);
        Placing { room_from_scan, most_points, ..Placing::default() }
    }

    #[test]
    fn points_of_laspy_come_in_to_the_millimetre() {
        for name in ["floor.las", "floor.laz", "bytes.las"] {
            let scan = placed_scan(&peer(name), &near(1000)).unwrap();
            assert_eq!(scan.vertices.len(), 60, "{name}");
            for (i, vertex) in scan.vertices.iter().enumerate() {
                let [x, y, z] =
                    [0.1 * (i % 10) as f64 + 3.0, 0.1 * (i / 10) as f64 + 10.25, 0.001 * i as f64];
                let off =
                    (vertex.position[0] - x).hypot(vertex.position[1] - y).hypot(vertex.position[2] - z);
                assert!(off < 6e-4, "{name} {i}: {off}");
                let full = if name == "bytes.las" { 1.0 } else { 257.0 };
                assert_eq!(vertex.color, [full * i as f32, full * 200.0, full * (255 - i) as f32], "{name}");
            }
            assert!((scan.full_level - if name == "bytes.las" { 255.0 } else { 65_535.0 }).abs() < 1.0);
        }
    }

    #[test]
    fn a_large_cloud_is_thinned_while_it_is_read() {
        let scan = placed_scan(&peer("floor.laz"), &near(20)).unwrap();
        assert!((5..=20).contains(&scan.vertices.len()), "{}", scan.vertices.len());
        assert!(scan.vertices.iter().all(|v| v.position[0] < 4.0 && v.position[1] < 11.0));
    }

    #[test]
    fn far_frames_and_cut_files_are_refused() {
        let (place, said) = placed_scan(&peer("floor.las"), &Placing::default()).unwrap_err();
        assert!(place == "vertex 0" && said.contains("--shift=-500000,-5400000,0"), "{said}");
        let folder = tempfile::tempdir().unwrap();
        for name in ["floor.las", "floor.laz"] {
            let whole = std::fs::read(peer(name)).unwrap();
            let cut = folder.path().join(name);
            for length in (0..whole.len() - 1).step_by(whole.len() / 40) {
                std::fs::write(&cut, &whole[..length]).unwrap();
                assert!(placed_scan(&cut, &near(1000)).is_err(), "{name} cut to {length} of {}", whole.len());
            }
            // A count of points that nobody has takes no memory.
            let mut many = whole.clone();
            many[107..111].fill(0xff);
            std::fs::write(&cut, &many).unwrap();
            assert!(placed_scan(&cut, &near(1000)).is_err(), "{name}");
        }
    }
}
