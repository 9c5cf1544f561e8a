//! Files of a page, compiled into the program.

use axum::Router;
use axum::routing::get;

use super::Answer;

/// One file of a page.
#[derive(Debug)]
pub struct PageFile {
    /// Path at which the file is served.
    pub path: &'static str,
    /// Media type of the file, as HTTP names it.
    pub media_type: &'static str,
    /// Content of the file.
    pub text: &'static str,
}

impl PageFile {
    /// Style sheet with the colours and fonts that all pages share.
    pub const PALETTE: Self = Self::css("/palette.css", include_str!("palette.css"));

    /// An HTML page.
    pub const fn html(path: &'static str, text: &'static str) -> Self {
        Self { path, media_type: "text/html; charset=utf-8", text }
    }

    /// A style sheet.
    pub const fn css(path: &'static str, text: &'static str) -> Self {
        Self { path, media_type: "text/css; charset=utf-8", text }
    }

    /// A script.
    pub const fn script(path: &'static str, text: &'static str) -> Self {
        Self { path, media_type: "text/javascript; charset=utf-8", text }
    }

    /// A drawing.
    pub const fn svg(path: &'static str, text: &'static str) -> Self {
        Self { path, media_type: "image/svg+xml", text }
    }

    /// Routes of a page's files.
    pub fn routes<S: Clone + Send + Sync + 'static>(files: &'static [Self]) -> Router<S> {
        files.iter().fold(Router::new(), |routes, file| {
            routes.route(file.path, get(async || Answer::ok(file.media_type, file.text)))
        })
    }
}
