//! `tracker run --view`: the page that shows a run live.

use std::path::Path;

use clap::Args;
use shell::loopback::Listener;
use tracker::prepared_room::PreparedRoom;
use tracker::view::{Screens, Server};

/// Options of the page.
#[derive(Debug, Args)]
pub(super) struct ViewArguments {
    /// Show the run live on a page in the browser, with the pictures of the films; its address is logged, and only this
    /// machine can open it. Works with --no-film as well. The tracks are the same.
    #[arg(long)]
    view: bool,
    /// Port of that page; 0 uses any free one [default: 8081, or a free one where that is in use]
    #[arg(long, value_name = "PORT", requires = "view")]
    view_port: Option<u16>,
}

impl ViewArguments {
    /// Listener of the page, if it was requested.
    pub(super) fn listener(&self) -> anyhow::Result<Option<Listener>> {
        Ok(if self.view { Some(Server::bind(self.view_port, "--view-port")?) } else { None })
    }
}

/// Serves a screen for each camera of the room, and logs the address.
pub(super) fn serve(listener: Listener, room: &Path, prepared: &PreparedRoom) -> anyhow::Result<Server> {
    let names = prepared.cameras.iter().map(|camera| camera.name.as_str());
    let server = Server::start(listener, Screens::new(room.display().to_string(), names))?;
    tracing::info!("watch the run at http://{}/", server.address());
    Ok(server)
}
