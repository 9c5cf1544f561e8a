//! The page's own files, part of the program: it works without a network.

/// A file of the page.
#[derive(Debug)]
pub(super) struct PageFile {
    pub path: &'static str,
    pub media_type: &'static str,
    pub text: &'static str,
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";

/// All of them, by the path they are served at.
pub(super) const FILES: [PageFile; 10] = [
    PageFile { path: "/", media_type: HTML, text: include_str!("page/index.html") },
    PageFile { path: "/icon.svg", media_type: SVG, text: include_str!("page/icon.svg") },
    PageFile { path: "/style.css", media_type: CSS, text: include_str!("page/style.css") },
    PageFile { path: "/editor.js", media_type: SCRIPT, text: include_str!("page/editor.js") },
    PageFile { path: "/drawing.js", media_type: SCRIPT, text: include_str!("page/drawing.js") },
    PageFile { path: "/plan.js", media_type: SCRIPT, text: include_str!("page/plan.js") },
    PageFile { path: "/cameras.js", media_type: SCRIPT, text: include_str!("page/cameras.js") },
    PageFile { path: "/list.js", media_type: SCRIPT, text: include_str!("page/list.js") },
    PageFile { path: "/shapes.js", media_type: SCRIPT, text: include_str!("page/shapes.js") },
    PageFile { path: "/server.js", media_type: SCRIPT, text: include_str!("page/server.js") },
];
