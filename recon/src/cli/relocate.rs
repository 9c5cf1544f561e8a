//! `recon relocate`: where a bumped or turned camera stands now.

use std::path::PathBuf;

use scenes::room::Room;
use shell::console::Console;

use crate::{pipeline, relocation};

/// Find where a bumped or turned camera stands now, from one picture.
///
/// The picture is compared with the room's reference pictures, and their depth tells the pose. It is written into
/// scene.toml, and the picture becomes the camera's reference picture; everything else in the room stays as it is. Where
/// the pose is not certain, nothing is written. `recon build` makes the room from the capture anew, with the old pose.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  recon relocate myroom --camera cam1 --image now.jpg
  recon relocate myroom --camera cam1 --image rtsp://192.168.1.20/stream")]
pub(crate) struct Relocate {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
    /// The camera's name in scene.toml.
    #[arg(long, value_name = "NAME")]
    camera: String,
    /// Picture that the camera takes now, best of the empty room: a file, or a stream, of which the first frame is taken.
    #[arg(long, value_name = "FILE|URL")]
    image: String,
}

impl Relocate {
    pub(crate) fn run(&self, console: &Console) -> anyhow::Result<()> {
        let _lock = pipeline::lock_room(&self.room, "recon relocate")?;
        let room = Room::read(&self.room)?;
        let before = room.camera(&self.camera)?;
        let now = relocation::relocate(&self.room, &room, &self.camera, &self.image)?;
        let (found, name) = (&now.found, &self.camera);
        let place = now.position;
        console.line(&format!(
            "{name}: at {:.3} {:.3} {:.3} m, ± {:.1} cm and ± {:.2}° (one standard deviation), by {} points to {:.2} px",
            place.x,
            place.y,
            place.z,
            100.0 * found.sigma_m,
            found.sigma_deg,
            found.agreeing,
            found.rms_px
        ));
        if now.is_unmoved() {
            console.line(&format!("{name}: stands where the room has it; nothing is written"));
            return Ok(());
        }
        let reference = relocation::write(&self.room, before, &now, &self.image)?;
        console.line(&format!(
            "{name}: has moved by {:.1} cm and turned by {:.2}°; the new pose is in {}, with {} as reference picture",
            100.0 * now.moved_m,
            now.turned_deg,
            self.room.join(scenes::room::SCENE_FILE).display(),
            reference.display()
        ));
        Ok(())
    }
}
