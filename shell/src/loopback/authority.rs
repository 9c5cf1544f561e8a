//! Host and port of a URL (RFC 3986, section 3.2), without user names.

use std::net::{IpAddr, Ipv6Addr};

/// Host and port, as in `localhost:8080` or `[::1]`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Authority<'a> {
    /// A name or an IPv4 address, or an IPv6 address in brackets.
    host: &'a str,
    port: Option<u16>,
}

impl<'a> Authority<'a> {
    /// Parses the whole text; `None` for anything that is no host, or a host and a port.
    pub(super) fn parse(text: &'a str) -> Option<Self> {
        let end = match text.strip_prefix('[') {
            Some(rest) => rest.find(']')? + 2,
            None => text.find(':').unwrap_or(text.len()),
        };
        let (host, rest) = text.split_at(end);
        let is_host = if let Some(address) = host.strip_prefix('[') {
            address.strip_suffix(']')?.parse::<Ipv6Addr>().is_ok()
        } else {
            let fits = |c: u8| c.is_ascii_alphanumeric() || matches!(c, b'-' | b'.' | b'_');
            !host.is_empty() && host.bytes().all(fits)
        };
        let port = match rest.strip_prefix(':') {
            // A sign would be parsed, too.
            Some(digits) if digits.bytes().all(|c| c.is_ascii_digit()) => Some(digits.parse().ok()?),
            None if rest.is_empty() => None,
            _ => return None,
        };
        is_host.then_some(Self { host, port })
    }

    /// Address of the host, if it is one.
    pub(super) fn ip(&self) -> Option<IpAddr> {
        match self.host.strip_prefix('[') {
            Some(rest) => rest.strip_suffix(']')?.parse().ok().map(IpAddr::V6),
            None => self.host.parse().ok(),
        }
    }

    /// Whether the host is the name of the loopback.
    pub(super) fn is_localhost(&self) -> bool {
        self.host.eq_ignore_ascii_case("localhost")
    }
}

impl PartialEq for Authority<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.port == other.port && self.host.eq_ignore_ascii_case(other.host)
    }
}
