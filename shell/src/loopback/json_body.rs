//! Bodies of requests that change or query something.

use axum::body::to_bytes;
use axum::extract::{FromRequest, Request};
use axum::http::header::CONTENT_TYPE;
use serde::de::DeserializeOwned;

use super::Answer;

/// Largest body that is read.
const MOST_BODY_BYTES: usize = 1 << 20;
const JSON: &str = "application/json";

/// Body of a request, which has to come as JSON: a browser does not send that across sites without a preflight request.
#[derive(Debug)]
pub struct JsonBody<T>(pub T);

impl<T: DeserializeOwned, S: Sync> FromRequest<S> for JsonBody<T> {
    type Rejection = Answer;

    async fn from_request(request: Request, _: &S) -> Result<Self, Answer> {
        let content_type = request.headers().get(CONTENT_TYPE).and_then(|value| value.to_str().ok());
        let media_type = content_type.and_then(|content_type| content_type.split(';').next());
        if !media_type.is_some_and(|media_type| media_type.trim().eq_ignore_ascii_case(JSON)) {
            return Err(Answer::error(415, "the body has to be JSON, with `Content-Type: application/json`"));
        }
        // A body a little too large is read to its end, so that the client reads the answer.
        let body = match to_bytes(request.into_body(), 2 * MOST_BODY_BYTES).await {
            Ok(body) if body.len() <= MOST_BODY_BYTES => body,
            Ok(_) => return Err(Answer::error(413, "the body is larger than 1 MiB; draw less")),
            Err(e) => {
                let line = format!("the body is larger than 1 MiB, or ends early: {e}");
                return Err(Answer::error(413, &line));
            }
        };
        let parsed = serde_json::from_slice(&body).map(Self);
        parsed.map_err(|e| Answer::error(400, &format!("the body is not understood: {e}")))
    }
}
