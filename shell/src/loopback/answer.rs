//! What a server answers.

use axum::body::{Body, Bytes};
use axum::http::header::{ALLOW, CONTENT_TYPE};
use axum::http::{HeaderName, HeaderValue, Response, StatusCode};
use serde::Serialize;

use super::PageFile;

/// For every answer: nothing is kept by the browser, taken for another type, framed, loaded from elsewhere, or shown by
/// another site's page.
const HEADERS: [(&str, &str); 5] = [
    ("cache-control", "no-store"),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
];
const JSON: &str = "application/json";

/// What goes back.
#[derive(Debug)]
pub struct Answer {
    status: u16,
    media_type: &'static str,
    /// The methods there are, where another was tried.
    allow: &'static str,
    body: Bytes,
}

impl Answer {
    /// What was asked for.
    pub fn ok(media_type: &'static str, body: impl Into<Bytes>) -> Self {
        Self { status: 200, media_type, allow: "", body: body.into() }
    }

    /// One of the page's files.
    pub fn file(file: &PageFile) -> Self {
        Self::ok(file.media_type, file.text)
    }

    /// What was asked for, as JSON.
    ///
    /// # Errors
    /// The answer that says why it cannot be written as JSON.
    pub fn json(value: &impl Serialize) -> Result<Self, Self> {
        match serde_json::to_vec(value) {
            Ok(body) => Ok(Self::ok(JSON, body)),
            Err(e) => Err(Self::error(500, &e.to_string())),
        }
    }

    /// One line, for a person: `{"error": line}`.
    pub fn error(status: u16, line: &str) -> Self {
        Self { status, ..Self::ok(JSON, serde_json::json!({ "error": line }).to_string()) }
    }

    /// There is nothing at that path.
    pub fn nowhere(path: &str) -> Self {
        Self::error(404, &format!("there is no {path} here"))
    }

    /// The path is asked by another method than those of `allow`, which is as in an `Allow` header.
    pub fn other_method(path: &str, allow: &'static str) -> Self {
        Self { allow, ..Self::error(405, &format!("{path} is for {allow}")) }
    }
}

impl From<Answer> for Response<Body> {
    fn from(answer: Answer) -> Self {
        let mut response = Self::new(answer.body.into());
        // Each of them is a constant of the program.
        *response.status_mut() = StatusCode::from_u16(answer.status).unwrap_or_default();
        let own = [(CONTENT_TYPE, answer.media_type), (ALLOW, answer.allow)];
        let common = HEADERS.map(|(name, value)| (HeaderName::from_static(name), value));
        for (name, value) in own.into_iter().chain(common).filter(|(_, value)| !value.is_empty()) {
            response.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        response
    }
}
