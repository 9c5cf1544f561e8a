//! Work that takes minutes, on threads of its own: the captures' pictures and surfaces, proposals, and the build; and its
//! progress.

use std::sync::Arc;
use std::time::Duration;

use super::session::Session;
use super::state::{Progress, ProposedPoint, ReferencePicture, Views};
use crate::Result;
use crate::pipeline::{self, BuildReport};
use crate::project::Project;
use crate::proposals::{self, ProposalOptions};
use crate::surface::Surface;

/// Interval at which a build looks whether the captures are finished.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Starts to read and process the captures.
pub(super) fn start_captures(session: &Arc<Session>) {
    let session = Arc::clone(session);
    session.update(|state| {
        state.captures = Progress::Running { number: 0, of: 1, what: "the reference pictures".into() };
    });
    std::thread::spawn(move || {
        let done = captures(&session);
        session.update(|state| {
            state.captures = match done {
                Ok(()) => Progress::Done,
                Err(problem) => Progress::Failed { problem: problem.to_string() },
            };
        });
    });
}

fn captures(session: &Session) -> Result<()> {
    for (index, camera) in session.cameras().iter().enumerate() {
        let picture = Arc::new(ReferencePicture::read(camera)?);
        session.update(|state| state.pictures[index] = Some(picture));
    }
    let (room, options) = (session.room(), session.options());
    let views = pipeline::reference_views(session.cameras(), Some(room), options, &mut |step| {
        session.update(|state| state.captures = Progress::step(step));
    })?;
    let of = session.cameras().len();
    let what = "points that both see".to_owned();
    session.update(|state| state.captures = Progress::Running { number: of, of, what });
    let surfaces: Vec<&Surface> = views.iter().map(|view| &view.surface).collect();
    let how = ProposalOptions { seed: options.seed, ..ProposalOptions::default() };
    let pairs = proposals::propose(&surfaces, &how)?;
    let found = pairs.iter().filter_map(|pair| pair.found.as_ref());
    let proposed = found.flat_map(|found| &found.proposals).filter_map(|proposal| {
        let [a, b] = proposal.cameras.map(|camera| &views[camera]);
        let pixels = [a.filmed(&proposal.pixels[0])?, b.filmed(&proposal.pixels[1])?];
        let cameras = [a, b].map(|view| view.name.clone());
        Some(ProposedPoint { cameras, pixels, correlation: proposal.correlation })
    });
    let proposed = proposed.collect();
    session.update(|state| {
        state.proposals = proposed;
        state.views = Some(Arc::new(Views { views, pairs }));
    });
    Ok(())
}

/// Starts a build of the project as it is on disk; one that is running goes on. It begins when the captures are finished:
/// it takes their results over.
///
/// # Errors
/// Defects of the project that a build finds before its first stage.
pub(super) fn start_build(session: &Arc<Session>) -> Result<()> {
    Project::read_to_build(session.project())?;
    let is_new = session.update(|state| {
        let is_new = !state.build.is_running();
        if is_new {
            state.build = Progress::Running { number: 0, of: 1, what: "waiting for the captures".into() };
        }
        is_new
    });
    if !is_new {
        return Ok(());
    }
    let session = Arc::clone(session);
    std::thread::spawn(move || {
        while session.update(|state| state.captures.is_running()) {
            std::thread::sleep(LOOK_EVERY);
        }
        let done = build(&session);
        session.update(|state| {
            state.build = match done {
                Ok(report) => {
                    state.built = Some(report.into());
                    state.builds += 1;
                    Progress::Done
                }
                Err(problem) => Progress::Failed { problem: problem.to_string() },
            };
        });
    });
    Ok(())
}

fn build(session: &Session) -> Result<BuildReport> {
    let _lock = pipeline::lock_room(session.room(), "recon picks --page")?;
    pipeline::build(session.project(), session.room(), session.options(), &mut |step| {
        session.update(|state| state.build = Progress::step(step));
    })
}
