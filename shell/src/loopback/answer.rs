//! Answers of a server, with the headers that all of them carry.

use axum::body::Bytes;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

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
    body: Bytes,
}

impl Answer {
    /// Answer 200 with the requested content.
    pub fn ok(media_type: &'static str, body: impl Into<Bytes>) -> Self {
        Self { status: 200, media_type, body: body.into() }
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
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        // Each status is a constant of the program and valid.
        let status = StatusCode::from_u16(self.status).unwrap_or_default();
        (status, [(CONTENT_TYPE, self.media_type)], self.body).into_response()
    }
}

/// Adds the headers that all answers carry.
pub(super) async fn with_common_headers(mut response: Response) -> Response {
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}
