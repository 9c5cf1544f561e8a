//! `tracker run --view`: the page that shows a run live.

use std::path::{Path, PathBuf};

use clap::Args;
use scenes::room::Room;
use shell::loopback::{Listener, Protection};

use crate::prepared_room::PreparedRoom;
use crate::view::{RoomPage, Screens, Server};

/// Options of the page.
#[derive(Debug, Args)]
pub(super) struct ViewArguments {
    /// Show the run live on a page in the browser: plan and room in 3-D with the people, events, counts, and the pictures
    /// of the films; its address is logged, and only this machine can open it. Works with --no-film as well. The tracks
    /// are the same.
    #[arg(long)]
    view: bool,
    /// Port of that page; 0 uses any free one [default: 8081, or a free one where that is in use]
    #[arg(long, value_name = "PORT", requires = "view")]
    view_port: Option<u16>,
    /// Address of this machine on which that page is served to others, such as 0.0.0.0. Beyond the loopback it needs a
    /// token: the link that is logged carries it, and the browser keeps it as a cookie.
    #[arg(long, value_name = "ADDRESS", requires = "view", default_value = "127.0.0.1")]
    view_host: String,
    /// File whose first line is that token; without it each run has a new random one
    #[arg(long, value_name = "FILE", requires = "view")]
    view_token_file: Option<PathBuf>,
    /// Certificate chain (PEM) with which that page is served over HTTPS
    #[arg(long, value_name = "FILE", requires = "view_key")]
    view_cert: Option<PathBuf>,
    /// Private key (PEM) of --view-cert
    #[arg(long, value_name = "FILE", requires = "view_cert")]
    view_key: Option<PathBuf>,
}

impl ViewArguments {
    /// Listener of the page, if it was requested.
    pub(super) fn listener(&self) -> anyhow::Result<Option<Listener>> {
        if !self.view {
            return Ok(None);
        }
        let listener = Server::bind(&self.view_host, self.view_port, "--view-port")?;
        let certificate_and_key = self.view_cert.clone().zip(self.view_key.clone());
        let protection = Protection { token_file: self.view_token_file.clone(), certificate_and_key };
        Ok(Some(listener.protected(&protection)?))
    }
}

/// Serves the page of a run in this room, and logs its address.
pub(super) fn serve(
    listener: Listener,
    room: &Room,
    room_dir: &Path,
    prepared: &PreparedRoom,
) -> anyhow::Result<Server> {
    let names: Vec<String> = prepared.cameras.iter().map(|camera| camera.name.clone()).collect();
    let title = room_dir.display().to_string();
    let page = RoomPage::new(room, room_dir, &title, &names)?;
    let screens = Screens::new(title, names.iter().map(String::as_str));
    let server = Server::start(listener, screens, page, names)?;
    tracing::info!("watch the run at {}", server.link());
    Ok(server)
}
