//! `scenes edit`: the editor of what is drawn on a room's floor.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use shell::loopback::Protection;

use crate::editor::{Server, Session};

/// Draw a room's entry and exit zones, regions, lines and walkable floor, in the browser, and see them in every camera.
///
/// Serves a page until Ctrl-C, on this machine alone unless --host says otherwise. Nothing but the `[[zone]]`,
/// `[[region]]` and `[[line]]` tables and `[floor]` of scene.toml is ever written; changes that others make to the file
/// meanwhile are kept.
#[derive(Args)]
#[command(after_help = "Examples:\n  scenes edit myroom\n  scenes edit myroom --port 0\n  \
                        scenes edit myroom --host 0.0.0.0 --cert cert.pem --key key.pem")]
pub(crate) struct Edit {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
    /// Port to listen on; 0 takes any free one.
    #[arg(long, value_name = "PORT", default_value_t = 8080)]
    port: u16,
    /// Address of this machine on which the page is served to others, such as 0.0.0.0. Beyond the loopback it needs a
    /// token: the link that is printed carries it, and the browser keeps it as a cookie.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: String,
    /// File whose first line is that token; without it each start has a new random one
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Certificate chain (PEM) with which the page is served over HTTPS
    #[arg(long, value_name = "FILE", requires = "key")]
    cert: Option<PathBuf>,
    /// Private key (PEM) of --cert
    #[arg(long, value_name = "FILE", requires = "cert")]
    key: Option<PathBuf>,
}

impl Edit {
    pub(crate) fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        let certificate_and_key = self.cert.clone().zip(self.key.clone());
        let protection = Protection { token_file: self.token_file.clone(), certificate_and_key };
        // The port is bound first: a room may take a while to read.
        let server = Server::bind(&self.host, self.port, &protection)?;
        let session = Session::open(&self.room)?;
        for warning in session.odd_sizes() {
            tracing::warn!("{}: {warning}", self.room.display());
        }
        writeln!(out, "{}: edit it at {} (Ctrl-C ends)", self.room.display(), server.link())?;
        out.flush()?;
        Ok(server.run(session)?)
    }
}
