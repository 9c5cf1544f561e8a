//! `scenes edit`: the zone editor.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use scenes::editor::{Server, Session};

/// Draw a room's entry and exit zones on its floor plan, in the browser, and see them in every camera.
///
/// Serves a page on this machine alone, until Ctrl-C. Nothing but the `[[zone]]` tables of scene.toml is ever written.
#[derive(Args)]
#[command(after_help = "Examples:\n  scenes edit myroom\n  scenes edit myroom --port 0\n  \
                        scenes edit myroom --host 192.168.1.20")]
pub(crate) struct Edit {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
    /// Port to listen on; 0 takes any free one.
    #[arg(long, value_name = "PORT", default_value_t = 8080)]
    port: u16,
    /// Address to listen on. Beyond the loopback the page needs a token: the printed link carries it, and the browser keeps
    /// it as a cookie.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: String,
}

impl Edit {
    pub(crate) fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        // The port is bound first: a room may take a while to read.
        let server = Server::bind(&self.host, self.port)?;
        let session = Session::open(&self.room)?;
        let address = server.address();
        if !address.ip().is_loopback() {
            tracing::warn!("{address} is no loopback address: whoever has the link can change the zones");
        }
        writeln!(out, "{}: edit its zones at {} (Ctrl-C ends)", self.room.display(), server.link())?;
        out.flush()?;
        Ok(server.run(session)?)
    }
}
