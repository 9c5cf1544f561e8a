//! Files of the page, compiled into the program.

use scenes::editor::{CONTROLS_STYLE, ROWS_SCRIPT, SERVER_SCRIPT, SHAPES_SCRIPT};
use shell::loopback::PageFile;

/// All files of the page.
pub(super) const FILES: [PageFile; 12] = [
    PageFile::html("/", include_str!("page/index.html")),
    PageFile::PALETTE,
    CONTROLS_STYLE,
    SERVER_SCRIPT,
    SHAPES_SCRIPT,
    ROWS_SCRIPT,
    PageFile::css("/picks.css", include_str!("page/picks.css")),
    PageFile::script("/picks.js", include_str!("page/picks.js")),
    PageFile::script("/picture.js", include_str!("page/picture.js")),
    PageFile::script("/magnified.js", include_str!("page/magnified.js")),
    PageFile::script("/scale.js", include_str!("page/scale.js")),
    PageFile::script("/build.js", include_str!("page/build.js")),
];
