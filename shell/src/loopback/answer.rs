//! Answers of a server, with the headers that all of them carry.

use axum::body::{Body, Bytes};
use axum::http::header::{ALLOW, CONTENT_TYPE};
use axum::http::{HeaderName, HeaderValue, Response, StatusCode};
use serde::Serialize;

use super::PageFile;

/// Headers of every answer: the browser must not cache it, take it for another type, frame it or load parts from
/// elsewhere, and another site's page must not show it.
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

/// One HTTP answer.
#[derive(Debug)]
pub struct Answer {
    status: u16,
    media_type: &'static str,
    /// Methods that the path accepts, where another was used; empty otherwise.
    allow: &'static str,
    body: Bytes,
}

impl Answer {
    /// Answer 200 with the requested content.
    pub fn ok(media_type: &'static str, body: impl Into<Bytes>) -> Self {
        Self { status: 200, media_type, allow: "", body: body.into() }
    }

    /// Answer 200 with one of the page's files.
    pub fn file(file: &PageFile) -> Self {
        Self::ok(file.media_type, file.text)
    }

    /// Answer 200 with a value as JSON.
    ///
    /// # Errors
    /// An answer 500 with the reason when the value cannot be written as JSON.
    pub fn json(value: &impl Serialize) -> Result<Self, Self> {
        match serde_json::to_vec(value) {
            Ok(body) => Ok(Self::ok(JSON, body)),
            Err(e) => Err(Self::error(500, &e.to_string())),
        }
    }

    /// Error answer with one line for a person: `{"error": line}`.
    pub fn error(status: u16, line: &str) -> Self {
        Self { status, ..Self::ok(JSON, serde_json::json!({ "error": line }).to_string()) }
    }

    /// Answer 404: there is nothing at that path.
    pub fn not_found(path: &str) -> Self {
        Self::error(404, &format!("there is no {path} here"))
    }

    /// Answer 405: the path accepts only the methods of `allow`, which is written as in an `Allow` header.
    pub fn other_method(path: &str, allow: &'static str) -> Self {
        Self { allow, ..Self::error(405, &format!("{path} is for {allow}")) }
    }
}

impl From<Answer> for Response<Body> {
    fn from(answer: Answer) -> Self {
        let mut response = Self::new(answer.body.into());
        // Each status is a constant of the program and valid.
        *response.status_mut() = StatusCode::from_u16(answer.status).unwrap_or_default();
        let own = [(CONTENT_TYPE, answer.media_type), (ALLOW, answer.allow)];
        let common = HEADERS.map(|(name, value)| (HeaderName::from_static(name), value));
        for (name, value) in own.into_iter().chain(common).filter(|(_, value)| !value.is_empty()) {
            response.headers_mut().insert(name, HeaderValue::from_static(value));
        }
        response
    }
}
