//! Options of the link between stations and their gatherer.

use std::path::PathBuf;

use anyhow::bail;
use clap::Args;

use crate::wire::{Endpoint, Endpoints, Tls};

#[derive(Debug, Args)]
#[command(next_help_heading = "Network")]
pub(super) struct EndpointArguments {
    /// Listen at this address, as in 0.0.0.0:7447 (or tls/0.0.0.0:7447), for the other side to connect; may be repeated
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',')]
    listen: Vec<Endpoint>,
    /// Discover the other side by multicast in the local network
    #[arg(long)]
    discover: bool,
    /// The addresses to connect to are those of Zenoh routers, to which the other side connects, too
    #[arg(long = "router")]
    via_router: bool,
    /// Certificate of this machine in PEM form, for tls/ endpoints; both sides need one
    #[arg(long, value_name = "FILE", requires_all = ["tls_key", "tls_authority"])]
    tls_certificate: Option<PathBuf>,
    /// Private key of the certificate
    #[arg(long, value_name = "FILE", requires = "tls_certificate")]
    tls_key: Option<PathBuf>,
    /// Certificates of the authorities that may have signed the other side's certificate
    #[arg(long, value_name = "FILE", requires = "tls_certificate")]
    tls_authority: Option<PathBuf>,
    /// Accept only peers whose certificate has this common name; may be repeated
    #[arg(long, value_name = "NAME")]
    allow: Vec<String>,
}

impl EndpointArguments {
    /// The endpoints, including those of the other side.
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

    /// Refuses options that have no effect without stations.
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

    /// Whether stations are to be expected at an address of this side, or discovered.
    pub(super) fn gathers(&self) -> bool {
        !self.listen.is_empty() || self.discover
    }
}
