//! Access to a server from other machines: a token that a link carries and a cookie keeps, and TLS.

use std::fmt;
use std::fs;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::path::Path;
use std::sync::Arc;

use axum::extract::Request;
use axum::http::header::{COOKIE, HOST, LOCATION, ORIGIN, SET_COOKIE};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use rustls::ServerConfig;
use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};

use super::authority::Authority;
use super::{Answer, ListenError};

/// Parameter of the link that carries the token, and beginning of the cookie's name.
const TOKEN_PARAMETER: &str = "token";
/// Shortest token that is accepted: 16 characters are not guessed.
const LEAST_CHARACTERS: usize = 16;

/// A secret that a browser has to know: from a link at first, from a cookie afterwards.
#[derive(Clone, PartialEq, Eq)]
pub struct AccessToken(String);

// A token must not appear in logs by accident.
impl fmt::Debug for AccessToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("AccessToken")
    }
}

impl AccessToken {
    /// A random token of 128 bits.
    ///
    /// # Errors
    /// An error of the operating system's random numbers.
    pub fn random() -> std::io::Result<Self> {
        let mut bytes = [0_u8; 16];
        getrandom::fill(&mut bytes).map_err(|e| std::io::Error::other(e.to_string()))?;
        Ok(Self(format!("{:032x}", u128::from_be_bytes(bytes))))
    }

    /// A chosen token.
    ///
    /// # Errors
    /// One line, for a token that is short or has characters that do not fit into a link and a cookie.
    pub fn chosen(text: &str) -> Result<Self, String> {
        let is_plain = text.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
        if !is_plain || text.len() < LEAST_CHARACTERS {
            return Err(format!(
                "a token has at least {LEAST_CHARACTERS} letters, digits, `-` and `_`; write another one"
            ));
        }
        Ok(Self(text.to_owned()))
    }

    /// Link to a server's page that carries the token.
    pub fn link(&self, origin: &str) -> String {
        format!("{origin}/?{TOKEN_PARAMETER}={}", self.0)
    }

    /// Comparison in a time that does not depend on where the texts differ.
    fn is(&self, text: &str) -> bool {
        let (own, other) = (self.0.as_bytes(), text.as_bytes());
        own.len() == other.len() && own.iter().zip(other).fold(0, |all, (a, b)| all | (a ^ b)) == 0
    }
}

/// Passes requests on that know the token by their cookie. A link with the token is answered by the cookie and the
/// page's own address; everything else by 403.
pub(super) async fn require_token(
    token: &AccessToken,
    port: u16,
    is_tls: bool,
    request: Request,
    next: Next,
) -> Response {
    // Cookies belong to a host, not to its port: another server of the machine must not replace this one's.
    let name = format!("{TOKEN_PARAMETER}_{port}");
    let of_link = request.uri().query().and_then(|query| {
        query.split('&').find_map(|part| part.strip_prefix(TOKEN_PARAMETER)?.strip_prefix('='))
    });
    if request.method() == Method::GET && of_link.is_some_and(|text| token.is(text)) {
        let secure = if is_tls { "; Secure" } else { "" };
        let cookie = format!("{name}={}; Path=/; HttpOnly; SameSite=Lax{secure}", token.0);
        let Ok(cookie) = HeaderValue::from_str(&cookie) else {
            return Answer::error(500, "the token fits into no cookie").into_response();
        };
        // A path of its own server: `//host` would lead elsewhere.
        let path = format!("/{}", request.uri().path().trim_start_matches('/'));
        let Ok(path) = HeaderValue::from_str(&path) else {
            return Answer::error(400, "the path is not understood").into_response();
        };
        return (StatusCode::SEE_OTHER, [(SET_COOKIE, cookie), (LOCATION, path)]).into_response();
    }
    let cookies = request.headers().get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
    let mut values = cookies
        .flat_map(|all| all.split(';'))
        .filter_map(|cookie| cookie.trim().strip_prefix(name.as_str())?.strip_prefix('='));
    if values.any(|text| token.is(text)) {
        next.run(request).await
    } else {
        let line = "open the link that the program printed when it started: it carries the token";
        Answer::error(403, line).into_response()
    }
}

/// Whether a request is for this machine: `Host`, given once, is the loopback's name or number or that of the server's
/// address, with or without a port.
pub(super) fn names_this_machine(request: &Request, own: IpAddr) -> bool {
    let Some(host) = host(request.headers()) else { return false };
    // The target of a request may name a host, too.
    let is_same =
        request.uri().authority().is_none_or(|target| Authority::parse(target.as_str()) == Some(host));
    let is_own = match host.ip() {
        Some(ip) => ip == own || ip == Ipv4Addr::LOCALHOST || ip == Ipv6Addr::LOCALHOST,
        None => host.is_localhost(),
    };
    is_same && is_own
}

/// The authority of the only `Host`.
fn host(headers: &HeaderMap) -> Option<Authority<'_>> {
    let mut hosts = headers.get_all(HOST).iter();
    let host = Authority::parse(hosts.next()?.to_str().ok()?);
    host.filter(|_| hosts.next().is_none())
}

/// Whether a request comes from a page of this server, or from no page: `Origin`, if there is one, names exactly the host
/// and port of `Host`, and the browser does not say that a page of another site asks for a part of this one.
pub(super) fn is_of_own_page(headers: &HeaderMap) -> bool {
    let says = |name: &str, words: &[&str]| {
        headers.get(name).is_some_and(|value| words.iter().any(|word| value.as_bytes() == word.as_bytes()))
    };
    // A link on another page may be followed.
    if says("sec-fetch-site", &["cross-site", "same-site"]) && !says("sec-fetch-mode", &["navigate"]) {
        return false;
    }
    let mut origins = headers.get_all(ORIGIN).iter();
    let Some(origin) = origins.next() else { return true };
    let text = origin.to_str().ok().filter(|_| origins.next().is_none());
    let authority = text.and_then(|o| o.strip_prefix("http://").or_else(|| o.strip_prefix("https://")));
    let origin = authority.and_then(Authority::parse);
    origin.is_some() && origin == host(headers)
}

/// Configuration of TLS from a certificate chain and its private key, both in PEM form.
///
/// # Errors
/// [`ListenError`] with the file and the mend.
pub(super) fn tls(certificate: &Path, key: &Path) -> Result<Arc<ServerConfig>, ListenError> {
    let defect = |path: &Path, problem: String| ListenError { address: path.display().to_string(), problem };
    let read =
        |path: &Path| fs::read(path).map_err(|e| defect(path, format!("{e}; name a file in PEM form")));
    let (chain_text, key_text) = (read(certificate)?, read(key)?);
    let chain: Result<Vec<CertificateDer<'static>>, _> =
        CertificateDer::pem_slice_iter(&chain_text).collect();
    let chain = chain.map_err(|e| defect(certificate, format!("is no certificate in PEM form ({e})")))?;
    if chain.is_empty() {
        return Err(defect(certificate, "holds no certificate in PEM form; name another file".into()));
    }
    let private = PrivateKeyDer::from_pem_slice(&key_text)
        .map_err(|e| defect(key, format!("holds no private key in PEM form ({e}); name another file")))?;
    let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, private))
        .map_err(|e| defect(key, format!("does not belong to {} ({e})", certificate.display())))?;
    Ok(Arc::new(config))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_random_long_and_compared_whole() {
        let (a, b) = (AccessToken::random().unwrap(), AccessToken::random().unwrap());
        assert!(a != b && a.0.len() == 32 && AccessToken::chosen(&a.0).unwrap() == a);
        assert!(a.is(&a.0) && !a.is(&b.0) && !a.is(&a.0[..31]) && !a.is(""));
        assert_eq!(format!("{a:?}"), "AccessToken");
        for text in ["", "short", "0123456789abcdef;", "0123456789abcdefé"] {
            assert!(AccessToken::chosen(text).unwrap_err().contains("16 letters"), "{text}");
        }
    }

    #[test]
    fn parts_of_the_page_are_for_the_page_alone() {
        for (site, mode, expected) in [
            ("same-origin", "cors", true),
            ("none", "navigate", true),
            ("cross-site", "navigate", true),
            ("cross-site", "no-cors", false),
            ("same-site", "no-cors", false),
        ] {
            let mut headers = HeaderMap::new();
            headers.insert("sec-fetch-site", site.parse().unwrap());
            headers.insert("sec-fetch-mode", mode.parse().unwrap());
            assert_eq!(is_of_own_page(&headers), expected, "{site} {mode}");
        }
    }

    #[test]
    fn requests_for_other_hosts_are_told_apart() {
        let own: IpAddr = "127.0.0.2".parse().unwrap();
        let is_own = |target: &str, hosts: &[&str]| {
            let mut request = Request::builder().uri(target);
            for host in hosts {
                request = request.header(HOST, *host);
            }
            names_this_machine(&request.body(axum::body::Body::empty()).unwrap(), own)
        };
        for host in ["localhost", "LocalHost:9000", "127.0.0.1:8080", "127.0.0.2", "[::1]:8080", "[::1]"] {
            assert!(is_own("/", &[host]), "{host}");
        }
        for host in [
            "",
            "evil",
            "[::1]evil",
            "[::1]:80evil",
            "127.0.0.1:1@evil",
            "localhost@evil",
            "localhost.evil",
            "localhost:",
            "localhost:99999",
            "localhost:+80",
            "127.0.0.1.evil",
            "127.1",
            "[127.0.0.1]",
            "::1",
            "localhost/",
            "localhost:80:80",
            "192.168.0.1",
            "localhost ",
            "[::1",
        ] {
            assert!(!is_own("/", &[host]), "{host}");
        }
        assert!(!is_own("/", &[]) && !is_own("/", &["localhost", "localhost"]));
        assert!(is_own("http://localhost:8080/", &["localhost:8080"]));
        assert!(!is_own("http://evil/", &["localhost"]));
    }

    #[test]
    fn a_page_of_another_origin_is_told_apart() {
        let headers = |host: &str, origin: Option<&str>| {
            let mut headers = HeaderMap::new();
            headers.insert(HOST, host.parse().unwrap());
            origin.map(|origin| headers.insert(ORIGIN, origin.parse().unwrap()));
            headers
        };
        for (host, origin, expected) in [
            ("a:80", None, true),
            ("a:80", Some("http://a:80"), true),
            ("a:80", Some("https://a:80"), true),
            ("a:80", Some("http://a:81"), false),
            ("a:80", Some("http://a"), false),
            ("a:80", Some("http://a:80.example.org"), false),
            ("a:80", Some("null"), false),
            ("a:80", Some("http://b@a:80"), false),
            ("a:80", Some("http://a:80/"), false),
            ("a:80", Some("http://A:80"), true),
            ("[::1]:80", Some("http://[::1]:80"), true),
            ("[::1]evil", Some("http://[::1]evil"), false),
            ("a:80", Some("ftp://a:80"), false),
        ] {
            assert_eq!(is_of_own_page(&headers(host, origin)), expected, "{host} {origin:?}");
        }
    }
}
