//! `scenes check`: checks a room directory and prints its contents.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use nalgebra::{Point2, Vector3};

use crate::depth::render;
use crate::geometry::Geometry;
use crate::raycast::RayScene;
use crate::room::{Room, RoomCamera, ZoneKind};
use crate::walkable::{WalkableMap, unreachable};

/// Width in pixels of the depth map from which the visible share of the room is measured.
const GLANCE_WIDTH_PX: u32 = 160;

/// Check a room directory and print what is in it.
///
/// Exits with 1 and one line that names the problem and its place, if there is one. What merely looks odd is a warning.
#[derive(Args)]
#[command(after_help = "Example:\n  scenes check myroom")]
pub(crate) struct Check {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
}

impl Check {
    pub(crate) fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        let room = Room::read(&self.room)?;
        for warning in room.odd_sizes() {
            tracing::warn!("{}: {warning}", self.room.display());
        }
        let scene = room.geometry.as_ref().map(RayScene::new).transpose()?;
        writeln!(out, "room      {}", self.room.display())?;
        for camera in &room.cameras {
            self.print_camera(out, camera, scene.as_ref())?;
        }
        print_geometry(out, room.geometry.as_ref())?;
        let walkable = WalkableMap::of_room(&room)?;
        match walkable.area_m2() {
            Some(area) => {
                let source =
                    if room.walkable.is_some() { "as scene.toml says" } else { "derived from the geometry" };
                writeln!(out, "floor     {area:.1} m² to stand on, {source}")?;
            }
            None => writeln!(out, "floor     people can stand anywhere")?,
        }
        for zone in &room.zones {
            let kind = match zone.kind {
                ZoneKind::Entry => "people enter",
                ZoneKind::Exit => "people leave",
                ZoneKind::Both => "people enter and leave",
            };
            writeln!(out, "zone      {}: {:.2} m², {kind}", zone.name, zone.polygon.area())?;
        }
        if room.zones.is_empty() {
            writeln!(out, "zone      none: people may appear and disappear anywhere")?;
        }
        for warning in unreachable(&room, &walkable) {
            tracing::warn!("{}: {warning}", self.room.display());
        }
        print_regions(out, &room)?;
        if let Some(source) = room.source {
            let [x, y, z] = source.shift;
            writeln!(out, "source    imported, moved by {x}, {y}, {z} m")?;
        }
        Ok(())
    }

    fn print_camera(
        &self,
        out: &mut impl Write,
        camera_entry: &RoomCamera,
        scene: Option<&RayScene>,
    ) -> anyhow::Result<()> {
        let RoomCamera { name, camera, .. } = camera_entry;
        let (k, eye) = (&camera.intrinsics, camera.center());
        let forward = camera.camera_from_world.rotation.inverse() * Vector3::z();
        let down_deg = (-forward.z).clamp(-1.0, 1.0).asin().to_degrees();
        write!(
            out,
            "camera    {name}: {} × {}, {}at ({:.3}, {:.3}) m, {:.3} m above the floor, looks {down_deg:.1}° down",
            k.width,
            k.height,
            field_of_view_deg(k).map_or(String::new(), |deg| format!("{deg:.1}° wide, ")),
            eye.x,
            eye.y,
            eye.z
        )?;
        if let Some(scene) = scene {
            let height = (GLANCE_WIDTH_PX * k.height / k.width).max(1);
            let glance = calib::Camera { intrinsics: k.resized(GLANCE_WIDTH_PX, height), ..camera.clone() };
            let coverage = render(scene, &glance).coverage();
            write!(out, ", sees the room in {:.1} % of its image", 100.0 * coverage)?;
            if coverage == 0.0 {
                self.warn(name, "it sees nothing of the room; is its pose that of X_cam = R · X_world + t?");
            }
        }
        writeln!(out)?;
        if let Some(problem) = fold_warning(k) {
            self.warn(name, &problem);
        }
        if let Some(problem) = self.reference_defect(camera_entry) {
            self.warn(name, &problem);
        }
        if eye.z <= 0.0 {
            self.warn(
                name,
                "it stands below the floor; is its pose that of X_cam = R · X_world + t, with Z up?",
            );
        }
        Ok(())
    }

    /// Problem of a reference image that exists; [`Room::read`] has warned of missing ones.
    fn reference_defect(&self, entry: &RoomCamera) -> Option<String> {
        let path = self.room.join(entry.reference.as_ref()?);
        let (expected, shown) = (&entry.camera.intrinsics, path.display());
        match calib::picture::size(&path) {
            _ if !path.is_file() => None,
            Ok((width, height)) if (width, height) == (expected.width, expected.height) => None,
            Ok((width, height)) => Some(format!(
                "its reference image {shown} is {width} × {height}, not {} × {}",
                expected.width, expected.height
            )),
            Err(e) => Some(format!("its reference image cannot be used: {e}")),
        }
    }

    fn warn(&self, camera: &str, problem: &str) {
        tracing::warn!("{}: camera `{camera}`: {problem}", self.room.display());
    }
}

/// Warning of a lens that folds within its picture.
fn fold_warning(k: &calib::Intrinsics) -> Option<String> {
    let fold = k.fold()?;
    Some(format!(
        "its lens folds {:.1}° from the axis, at a radius of {:.0} px: the {:.0} % of the picture farther out have no rays, and nobody \
         is seen there; calibrate it with boards in the corners, or with `--model rational` or `fisheye`",
        fold.angle_deg,
        fold.radius_px,
        (100.0 * fold.share).max(1.0)
    ))
}

/// Prints regions and lines.
fn print_regions(out: &mut impl Write, room: &Room) -> anyhow::Result<()> {
    for region in &room.regions {
        let dwell = region
            .dwell_s
            .map_or(String::new(), |seconds| format!(", stays longer than {seconds} s are events"));
        let area = region.polygon.area();
        writeln!(out, "region    {}: {area:.2} m², people are counted and timed{dwell}", region.name)?;
    }
    for line in &room.lines {
        let length_m: f64 = line.pieces().map(|(a, b)| (b - a).norm()).sum();
        writeln!(out, "line      {}: {length_m:.2} m, from its left to its right is in", line.name)?;
    }
    Ok(())
}

/// Horizontal angle of view between the middles of the left and the right edge.
fn field_of_view_deg(k: &calib::Intrinsics) -> Option<f64> {
    let middle = 0.5 * (k.height as f64 - 1.0);
    let left = k.unproject(&Point2::new(-0.5, middle))?;
    let right = k.unproject(&Point2::new(k.width as f64 - 0.5, middle))?;
    Some(left.angle(&right).to_degrees())
}

fn print_geometry(out: &mut impl Write, geometry: Option<&Geometry>) -> anyhow::Result<()> {
    let Some((geometry, (low, high))) = geometry.and_then(|g| Some((g, g.bounds()?))) else {
        writeln!(out, "geometry  none: nothing is hidden by the room")?;
        return Ok(());
    };
    let size = high - low;
    match geometry {
        Geometry::Mesh(mesh) => {
            let (triangles, vertices) = (mesh.triangles.len(), mesh.vertices.len());
            write!(out, "geometry  {triangles} triangles, {vertices} vertices")?;
        }
        Geometry::Discs(discs) => {
            let filled = discs.iter().filter(|d| d.filled).count();
            write!(out, "geometry  {} discs, {filled} of them filled in", discs.len())?;
        }
    }
    writeln!(
        out,
        ", {:.2} × {:.2} × {:.2} m from ({:.2}, {:.2}, {:.2}) to ({:.2}, {:.2}, {:.2})",
        size.x, size.y, size.z, low.x, low.y, low.z, high.x, high.y, high.z
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_that_folds_within_its_picture_is_warned_of_with_its_angle_and_radius() {
        let lens = |fov_deg, k1| calib::Intrinsics {
            distortion: [k1, 0.0, 0.0, 0.0, 0.0].into(),
            ..calib::Intrinsics::from_horizontal_fov(640, 480, fov_deg)
        };
        // The picture of k1 = -0.3 ends where the tangent of the angle is 1.054, at two thirds of that times the focal length.
        let line = fold_warning(&lens(90.0, -0.3)).unwrap();
        assert!(line.contains("46.5°") && line.contains("225 px") && line.contains("rational"), "{line}");
        assert_eq!(fold_warning(&lens(45.0, -0.3)), None);
        assert_eq!(fold_warning(&lens(90.0, 0.0)), None);
    }
}
