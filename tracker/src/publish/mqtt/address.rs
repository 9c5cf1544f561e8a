//! Address of a broker: `mqtt://host:1883/PREFIX`, or `mqtts://` with TLS.

use std::str::FromStr;

use super::topics::DEFAULT_PREFIX;

/// Port of MQTT without TLS, as registered with IANA…
const PORT: u16 = 1883;
/// …and with TLS.
const TLS_PORT: u16 = 8883;

/// Address of a broker, and the prefix of all topics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BrokerAddress {
    /// Whether the connection is encrypted, and the broker's certificate checked.
    pub is_tls: bool,
    /// Name or address; IPv6 without brackets.
    pub host: String,
    /// TCP port.
    pub port: u16,
    /// First levels of all topics, without a slash at either end.
    pub prefix: String,
}

impl FromStr for BrokerAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.contains('@') {
            // The text may hold a password: it is not repeated.
            return Err(
                "the address holds a user or password, which everyone on this machine could read; leave them out and set \
                 ROOMTRACK_MQTT_USER and ROOMTRACK_MQTT_PASSWORD"
                    .to_owned(),
            );
        }
        let wrong =
            |problem: &str| format!("`{text}`: {problem}; write mqtt://host:1883/PREFIX, or mqtts://");
        let (is_tls, rest) = match text.split_once("://") {
            Some(("mqtt", rest)) => (false, rest),
            Some(("mqtts", rest)) => (true, rest),
            Some((other, _)) => return Err(wrong(&format!("`{other}` is not a protocol of brokers"))),
            None => return Err(wrong("the protocol is missing")),
        };
        let (authority, path) = rest.split_once('/').unwrap_or((rest, ""));
        let (host, port) = host_and_port(authority).ok_or_else(|| wrong("the host or port is not valid"))?;
        let prefix = match path.trim_end_matches('/') {
            "" => DEFAULT_PREFIX,
            prefix => prefix,
        };
        let is_level = |level: &str| !level.is_empty() && !level.contains(['+', '#']);
        if prefix.starts_with('$') || prefix.contains(char::is_control) || !prefix.split('/').all(is_level) {
            return Err(wrong("a prefix has no empty level, `+`, `#` or leading `$`"));
        }
        let port = port.unwrap_or(if is_tls { TLS_PORT } else { PORT });
        Ok(Self { is_tls, host: host.to_owned(), port, prefix: prefix.to_owned() })
    }
}

/// Host and, where there is one, port of `host:port` or `[address]:port`; `None` for anything else.
fn host_and_port(authority: &str) -> Option<(&str, Option<u16>)> {
    let (host, rest) = match authority.strip_prefix('[') {
        Some(bracketed) => bracketed.split_once(']')?,
        None => authority.split_at(authority.find(':').unwrap_or(authority.len())),
    };
    let is_host = |c: char| c.is_ascii_alphanumeric() || "-._:%".contains(c);
    if host.is_empty() || !host.chars().all(is_host) {
        return None;
    }
    let port = match rest {
        "" => None,
        // Port 0 is no address.
        rest => Some(rest.strip_prefix(':')?.parse().ok().filter(|port| *port != 0)?),
    };
    Some((host, port))
}

impl std::fmt::Display for BrokerAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let protocol = if self.is_tls { "mqtts" } else { "mqtt" };
        if self.host.contains(':') {
            write!(f, "{protocol}://[{}]:{}", self.host, self.port)
        } else {
            write!(f, "{protocol}://{}:{}", self.host, self.port)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_with_their_defaults() {
        for (text, is_tls, host, port, prefix) in [
            ("mqtt://localhost", false, "localhost", 1883, "roomtrack"),
            ("mqtt://10.0.0.7:1884/", false, "10.0.0.7", 1884, "roomtrack"),
            ("mqtts://broker.example/shop", true, "broker.example", 8883, "shop"),
            ("mqtts://[::1]:8884/site/ground floor/", true, "::1", 8884, "site/ground floor"),
        ] {
            let address: BrokerAddress = text.parse().unwrap();
            assert_eq!((address.is_tls, address.port), (is_tls, port), "{text}");
            assert_eq!((address.host.as_str(), address.prefix.as_str()), (host, prefix), "{text}");
        }
    }

    #[test]
    fn bad_addresses_are_refused_with_the_mend() {
        for (text, problem) in [
            ("broker:1883", "protocol is missing"),
            ("http://broker", "`http` is not"),
            ("mqtt://", "host or port"),
            ("mqtt://:1883", "host or port"),
            ("mqtt://broker:0", "host or port"),
            ("mqtt://broker:99999", "host or port"),
            ("mqtt://::1:1883", "host or port"),
            ("mqtt://[::1", "host or port"),
            ("mqtt://bro ker", "host or port"),
            ("mqtt://broker/a//b", "empty level"),
            ("mqtt://broker/a/#", "empty level"),
            ("mqtt://broker/$SYS", "leading `$`"),
        ] {
            let line = text.parse::<BrokerAddress>().unwrap_err();
            assert!(line.contains(problem) && line.contains("write mqtt://"), "{line}");
        }
        let line = "mqtt://user:secret@broker".parse::<BrokerAddress>().unwrap_err();
        assert!(!line.contains("secret") && line.contains("ROOMTRACK_MQTT_PASSWORD"), "{line}");
    }
}
