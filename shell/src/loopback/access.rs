//! Access to a server from other machines: a token that a link carries and a cookie keeps, and TLS.

use std::fmt;
use std::fs;
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

/// Whether a request comes from a page of this server, or from no page: `Origin`, if there is one, names exactly the host
/// and port of `Host`.
pub(super) fn is_of_own_page(headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(ORIGIN) else { return true };
    let origin = origin.to_str().ok();
    let authority = origin.and_then(|o| o.strip_prefix("http://").or_else(|| o.strip_prefix("https://")));
    let host = headers.get(HOST).and_then(|host| host.to_str().ok());
    authority.is_some() && authority == host
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
            ("a:80", Some("ftp://a:80"), false),
        ] {
            assert_eq!(is_of_own_page(&headers(host, origin)), expected, "{host} {origin:?}");
        }
    }
}
