//! `recon picks --page`: the page on which points are picked.

use std::io::Write;
use std::path::{Path, PathBuf};

use shell::files::Outputs;
use shell::loopback::Protection;

use crate::picks_page::{Server, Session};
use crate::pipeline::BuildOptions;
use crate::project::Project;

/// Options of the page.
#[derive(Debug, clap::Args)]
pub(super) struct PageOptions {
    /// Serve a page, until Ctrl-C, on which you pick points in two reference pictures side by side, click the scale, save
    /// ROOM.toml, build, and go on to the zones.
    #[arg(long)]
    pub(super) page: bool,
    /// Port of the page; 0 takes any free one.
    #[arg(long, value_name = "PORT", default_value_t = 8080, requires = "page")]
    port: u16,
    /// Address of this machine on which the page is served to others, such as 0.0.0.0. Beyond the loopback it needs a
    /// token: the link that is printed carries it, and the browser keeps it as a cookie.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1", requires = "page")]
    host: String,
    /// File whose first line is that token; without it each start has a new random one.
    #[arg(long, value_name = "FILE", requires = "page")]
    token_file: Option<PathBuf>,
    /// Certificate chain (PEM) with which the page is served over HTTPS.
    #[arg(long, value_name = "FILE", requires_all = ["page", "key"])]
    cert: Option<PathBuf>,
    /// Private key (PEM) of --cert.
    #[arg(long, value_name = "FILE", requires_all = ["page", "cert"])]
    key: Option<PathBuf>,
}

impl PageOptions {
    /// Serves the page of a project until the process ends. `room`: directory that its builds make; `room` beside the
    /// project where it is not named.
    pub(super) fn serve(
        &self,
        project: &Path,
        room: Option<&Path>,
        options: BuildOptions,
    ) -> anyhow::Result<()> {
        let room = room.map_or_else(|| project.with_file_name("room"), Path::to_owned);
        let captures = Project::inputs(project);
        Outputs::new([room.as_path()]).refuse(captures.iter().map(PathBuf::as_path).chain([project]))?;
        let certificate_and_key = self.cert.clone().zip(self.key.clone());
        let protection = Protection { token_file: self.token_file.clone(), certificate_and_key };
        let server = Server::bind(&self.host, self.port, &protection)?;
        let session = Session::open(project, &room, options, &self.host, &protection)?;
        let mut out = shell::console::stdout();
        writeln!(out, "{}: pick its points at {} (Ctrl-C ends)", project.display(), server.link())?;
        out.flush()?;
        Ok(server.run(session)?)
    }
}
