//! A page's own files.

/// A file of a page.
#[derive(Debug)]
pub struct PageFile {
    /// Where it is served.
    pub path: &'static str,
    /// What HTTP calls its kind.
    pub media_type: &'static str,
    /// What is in it.
    pub text: &'static str,
}

impl PageFile {
    /// The colours and letters that all pages have.
    pub const PALETTE: Self = Self::css("/palette.css", include_str!("palette.css"));

    /// A page.
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
}
