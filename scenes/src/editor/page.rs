//! Files of the editor's page, compiled into the program.

use shell::loopback::PageFile;

/// All files of the page.
pub(super) const FILES: [PageFile; 15] = [
    PageFile::html("/", include_str!("page/index.html")),
    PageFile::svg("/icon.svg", include_str!("page/icon.svg")),
    PageFile::PALETTE,
    PageFile::css("/style.css", include_str!("page/style.css")),
    PageFile::script("/editor.js", include_str!("page/editor.js")),
    PageFile::script("/drawing.js", include_str!("page/drawing.js")),
    PageFile::script("/plan.js", include_str!("page/plan.js")),
    PageFile::script("/cameras.js", include_str!("page/cameras.js")),
    PageFile::script("/geometry.js", include_str!("page/geometry.js")),
    PageFile::script("/kinds.js", include_str!("page/kinds.js")),
    PageFile::script("/numbers.js", include_str!("page/numbers.js")),
    PageFile::script("/plan_shapes.js", include_str!("page/plan_shapes.js")),
    PageFile::script("/list.js", include_str!("page/list.js")),
    PageFile::script("/shapes.js", include_str!("page/shapes.js")),
    PageFile::script("/server.js", include_str!("page/server.js")),
];
