//! `tracker run --view`: the page on which a run is seen while it goes on.

use std::path::Path;

use clap::Args;
use shell::loopback::Listener;
use tracker::stage::Stage;
use tracker::view::{Screens, Server};

/// Whether there is a page, and where.
#[derive(Debug, Args)]
pub(super) struct ViewArguments {
    /// Show on a page in the browser, while the run goes on, what the films show; its address is told, and nobody but this
    /// machine is answered. With --no-film as well. The tracks are the same.
    #[arg(long)]
    view: bool,
    /// Port of that page; 0 takes any free one [default: 8081, or a free one where that is in use]
    #[arg(long, value_name = "PORT", requires = "view")]
    view_port: Option<u16>,
}

impl ViewArguments {
    /// The page's address, if there is to be one.
    pub(super) fn listener(&self) -> anyhow::Result<Option<Listener>> {
        Ok(if self.view { Some(Server::bind(self.view_port)?) } else { None })
    }
}

/// Serves a screen for each camera of the stage, and says where.
pub(super) fn serve(listener: Listener, room: &Path, stage: &Stage) -> anyhow::Result<Server> {
    let names = stage.cameras.iter().map(|camera| camera.name.as_str());
    let server = Server::start(listener, Screens::new(room.display().to_string(), names))?;
    tracing::info!("watch the run at http://{}/", server.address());
    Ok(server)
}
