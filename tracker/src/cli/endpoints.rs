//! The options that say where stations and their gatherer meet.

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;
use tracker::wire::{Endpoint, Endpoints, Tls};

#[derive(Debug, Args)]
#[command(next_help_heading = "Network")]
pub(super) struct EndpointArguments {
    /// Let the other side connect to this address, as in 0.0.0.0:7447 (or tls/0.0.0.0:7447); may be repeated
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',')]
    listen: Vec<Endpoint>,
    /// Look for the other side by multicast in the local network
    #[arg(long)]
    discover: bool,
    /// The addresses to connect to are those of Zenoh routers, which lead to the other side
    #[arg(long = "router")]
    via_router: bool,
    /// Certificate of this machine in PEM form, for tls/ endpoints; both sides show one
    #[arg(long, value_name = "FILE", requires_all = ["tls_key", "tls_authority"])]
    tls_certificate: Option<PathBuf>,
    /// Private key of the certificate
    #[arg(long, value_name = "FILE", requires = "tls_certificate")]
    tls_key: Option<PathBuf>,
    /// Certificates of the authorities that may have signed the other side's certificate
    #[arg(long, value_name = "FILE", requires = "tls_certificate")]
    tls_authority: Option<PathBuf>,
    /// Let in only whose certificate has this common name; may be repeated
    #[arg(long, value_name = "NAME")]
    allow: Vec<String>,
}

impl EndpointArguments {
    /// The endpoints, with those of the other side.
    pub(super) fn endpoints(&self, connect: &[Endpoint]) -> anyhow::Result<Endpoints> {
        let tls = match (&self.tls_certificate, &self.tls_key, &self.tls_authority) {
            (Some(certificate), Some(key), Some(authority)) => {
                Some(Tls { certificate: certificate.clone(), key: key.clone(), authority: authority.clone() })
            }
            _ => None,
        };
        let endpoints = Endpoints {
            listen: self.listen.clone(),
            connect: connect.to_vec(),
            tls,
            allow: self.allow.clone(),
            discover: self.discover,
            via_router: self.via_router,
        };
        endpoints.check()?;
        Ok(endpoints)
    }

    /// Refuses options that say nothing without stations.
    pub(super) fn check_unused(&self) -> anyhow::Result<()> {
        let given = [
            ("--listen", !self.listen.is_empty()),
            ("--discover", self.discover),
            ("--tls-certificate", self.tls_certificate.is_some()),
            ("--allow", !self.allow.is_empty()),
        ];
        match given.into_iter().find(|(_, is_given)| *is_given) {
            Some((option, _)) => bail!("{option}: is for --stations; leave it out, or give --stations"),
            None => Ok(()),
        }
    }

    /// Whether stations are to be waited for at an address of this side, or looked for.
    pub(super) fn gathers(&self) -> bool {
        !self.listen.is_empty() || self.discover
    }
}
