//! Points that a build proposes to itself where a project has none.

use calib::Intrinsics;

use crate::project::{PickedPoint, Project};
use crate::proposals::{self, CameraPair, ProposalOptions};
use crate::surface::Surface;
use crate::{Error, Result};

/// Takes the program's proposals as the project's points; returns their number.
///
/// # Errors
/// [`Error::File`] where not enough agree to join all cameras; [`Error::Calib`] when OpenCV refuses.
pub(super) fn take(
    project: &mut Project,
    surfaces: &[Surface],
    lenses: &[Intrinsics],
    seed: u64,
) -> Result<usize> {
    let surfaces: Vec<&Surface> = surfaces.iter().collect();
    let pairs = proposals::propose(&surfaces, &ProposalOptions { seed, ..ProposalOptions::default() })?;
    let points: Vec<PickedPoint> = pairs.iter().flat_map(|pair| of_pair(pair, &surfaces, lenses)).collect();
    let count = points.len();
    if !project.take_proposed(points) {
        let problem = "there is none, and the pictures do not show enough of the same to propose them; pick at least 3 a \
                       pair by hand (`recon picks --page` shows the pictures side by side)";
        return Err(Error::content(&project.path, "[[point]]", problem));
    }
    tracing::info!(
        "{}: no points are picked; {count} proposed ones join the cameras",
        project.path.display()
    );
    Ok(count)
}

/// Proposals of one pair, as pixels of the filmed pictures.
fn of_pair(pair: &CameraPair, surfaces: &[&Surface], lenses: &[Intrinsics]) -> Vec<PickedPoint> {
    let proposed = pair.found.iter().flat_map(|found| &found.proposals);
    let points = proposed.filter_map(|proposal| {
        let filmed = |side: usize| {
            let camera = proposal.cameras[side];
            let ray = surfaces[camera].intrinsics.unproject(&proposal.pixels[side])?;
            Some((camera, lenses[camera].project(&ray.into())?))
        };
        Some(PickedPoint { picks: vec![filmed(0)?, filmed(1)?] })
    });
    points.collect()
}
