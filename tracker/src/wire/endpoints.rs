//! Addresses and certificates of the link between a station and a gatherer, and the peers that are accepted.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::{Error, Result};

/// Address to listen at or to connect to: `host:port`, `tcp/host:port` or `tls/host:port`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    /// Whether the link is encrypted, and certificates are checked.
    pub is_tls: bool,
    /// Name or address; IPv6 in brackets.
    pub host: String,
    /// TCP port; 0 means a free port, for a listener only.
    pub port: u16,
}

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong =
            |problem: &str| format!("`{text}`: {problem}; write host:port, tcp/host:port or tls/host:port");
        let (is_tls, address) = match text.split_once('/') {
            None => (false, text),
            Some(("tcp", address)) => (false, address),
            Some(("tls", address)) => (true, address),
            Some((other, _)) => return Err(wrong(&format!("`{other}` is not a protocol of stations"))),
        };
        let (host, port) = address.rsplit_once(':').ok_or_else(|| wrong("the port is missing"))?;
        let port = port.parse().map_err(|_| wrong("the port is not a number from 0 to 65535"))?;
        let is_bracketed = host.starts_with('[') && host.ends_with(']');
        let is_name = |c: char| c.is_ascii_alphanumeric() || "-._".contains(c);
        let is_address = |c: char| c.is_ascii_hexdigit() || ":.%".contains(c);
        let is_host = if is_bracketed {
            host[1..host.len() - 1].chars().all(is_address)
        } else {
            host.chars().all(is_name)
        };
        if host.is_empty() || !is_host {
            return Err(wrong("the host is not a name or an address (IPv6 in brackets)"));
        }
        Ok(Self { is_tls, host: host.to_owned(), port })
    }
}

impl std::fmt::Display for Endpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}:{}", if self.is_tls { "tls" } else { "tcp" }, self.host, self.port)
    }
}

/// Files in PEM form that `tls/` endpoints need. Both sides present a certificate, and check the other's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tls {
    /// Certificate of this machine.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// Certificates of the authorities that may have signed the other side's certificate.
    pub authority: PathBuf,
}

/// Options of the link between a station and its gatherer.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Endpoints {
    /// Addresses at which the other side may connect.
    pub listen: Vec<Endpoint>,
    /// Addresses of the other side. Of two machines one listens and the other connects.
    pub connect: Vec<Endpoint>,
    /// Whether the addresses to connect to are those of a Zenoh router, to which the other side connects, too.
    pub via_router: bool,
    /// Certificate, key and authority for `tls/` endpoints.
    pub tls: Option<Tls>,
    /// Common names of the accepted certificates; empty: all that the authority has signed. Other peers are refused,
    /// and so is every peer without TLS.
    pub allow: Vec<String>,
    /// Whether to look for the other side by multicast in the local network.
    pub discover: bool,
}

impl Endpoints {
    /// Checks that these endpoints can work together, and that their files can be read.
    ///
    /// # Errors
    /// One line that names the option and the mend.
    pub fn check(&self) -> Result<()> {
        if self.listen.is_empty() && self.connect.is_empty() && !self.discover {
            return Err(Error::option(
                "listen",
                "there is no endpoint; give an address to listen at or to connect to, or discover the other side",
            ));
        }
        if self.via_router && (self.connect.is_empty() || !self.listen.is_empty() || self.discover) {
            let problem = "both sides only connect to a router; do not listen or discover as well";
            return Err(Error::option("via_router", problem));
        }
        if let Some(zero) = self.connect.iter().find(|endpoint| endpoint.port == 0) {
            return Err(Error::option(
                "connect",
                format!("{zero}: port 0 cannot be connected to; give its port"),
            ));
        }
        let mut all = self.listen.iter().chain(&self.connect);
        let encrypted = all.clone().find(|endpoint| endpoint.is_tls);
        if let (Some(endpoint), None) = (encrypted, &self.tls) {
            let problem = format!(
                "{endpoint} needs a certificate; give its file, those of its key and of the authority"
            );
            return Err(Error::option("tls", problem));
        }
        if let (Some(open), false) = (all.find(|endpoint| !endpoint.is_tls), self.allow.is_empty()) {
            let problem =
                format!("{open} has no certificates to tell names by; write tls/ before its address");
            return Err(Error::option("allow", problem));
        }
        if let Some(tls) = &self.tls {
            check_pem("tls.certificate", &tls.certificate, "CERTIFICATE")?;
            check_pem("tls.key", &tls.key, "PRIVATE KEY")?;
            check_pem("tls.authority", &tls.authority, "CERTIFICATE")?;
        }
        Ok(())
    }
}

/// Checks that a file is readable and holds a PEM block whose label ends with `label`.
fn check_pem(option: &str, path: &Path, label: &str) -> Result<()> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::option(option, format!("{}: {e}; give a file in PEM form", path.display())))?;
    let is_begin =
        |line: &str| line.starts_with("-----BEGIN ") && line.trim_end().ends_with(&format!("{label}-----"));
    if text.lines().any(is_begin) {
        return Ok(());
    }
    let problem = format!("{}: there is no `{label}` in it; give a file in PEM form", path.display());
    Err(Error::option(option, problem))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn endpoint(text: &str) -> Endpoint {
        text.parse().unwrap()
    }

    #[test]
    fn endpoints_are_read_with_and_without_protocol() {
        for (text, printed) in [
            ("gatherer:7447", "tcp/gatherer:7447"),
            ("tcp/10.0.0.7:1", "tcp/10.0.0.7:1"),
            ("tls/cam-1.site.example:65535", "tls/cam-1.site.example:65535"),
            ("[::1]:7447", "tcp/[::1]:7447"),
            ("tls/[fe80::1%2]:80", "tls/[fe80::1%2]:80"),
        ] {
            assert_eq!(endpoint(text).to_string(), printed);
            assert_eq!(endpoint(printed), endpoint(text));
        }
    }

    #[test]
    fn bad_endpoints_are_refused_with_the_mend() {
        for (text, problem) in [
            ("", "the port is missing"),
            ("host", "the port is missing"),
            ("host:", "not a number from 0 to 65535"),
            ("host:70000", "not a number from 0 to 65535"),
            (":7447", "the host is not a name"),
            ("::1:7447", "the host is not a name"),
            ("udp/host:7447", "`udp` is not a protocol"),
            ("tcp/tcp/host:1", "the host is not a name"),
            ("tcp/ho st:1", "the host is not a name"),
            ("tcp/host#iface=lo:1", "the host is not a name"),
        ] {
            let line = text.parse::<Endpoint>().unwrap_err();
            assert!(line.contains(problem) && line.contains("write host:port"), "{line}");
        }
    }

    #[test]
    fn combinations_that_cannot_work_name_the_option() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, label: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("-----BEGIN {label}-----\nAA==\n-----END {label}-----\n")).unwrap();
            path
        };
        let tls = Tls {
            certificate: file("certificate.pem", "CERTIFICATE"),
            key: file("key.pem", "EC PRIVATE KEY"),
            authority: file("authority.pem", "CERTIFICATE"),
        };
        let tcp = Endpoints { listen: vec![endpoint("host:1")], ..Endpoints::default() };
        let encrypted = Endpoints {
            listen: vec![endpoint("tls/host:1")],
            tls: Some(tls.clone()),
            ..Endpoints::default()
        };
        let discover = Endpoints { discover: true, ..Endpoints::default() };
        for good in
            [&tcp, &encrypted, &discover, &Endpoints { allow: vec!["cam0".into()], ..encrypted.clone() }]
        {
            good.check().unwrap();
        }
        let missing = Tls { key: folder.path().join("none.pem"), ..tls.clone() };
        let swapped = Tls { authority: tls.key.clone(), ..tls };
        let cases = [
            (Endpoints::default(), "listen: there is no endpoint"),
            (Endpoints { via_router: true, ..tcp.clone() }, "via_router: both sides only connect"),
            (Endpoints { connect: vec![endpoint("host:0")], ..tcp.clone() }, "connect: tcp/host:0: port 0"),
            (Endpoints { tls: None, ..encrypted.clone() }, "tls: tls/host:1 needs a certificate"),
            (Endpoints { allow: vec!["cam0".into()], ..tcp }, "allow: tcp/host:1 has no certificates"),
            (Endpoints { tls: Some(missing), ..encrypted.clone() }, "tls.key: "),
            (Endpoints { tls: Some(swapped), ..encrypted }, "tls.authority: "),
        ];
        for (endpoints, expected) in cases {
            let line = endpoints.check().unwrap_err().to_string();
            assert!(line.starts_with(expected), "{line}");
        }
    }
}
