//! Files of the editor's page, compiled into the program.

use shell::loopback::PageFile;

use crate::space::{SOLIDS_SCRIPT, SPACE_SCRIPT, SPACE_STYLE};

/// Style sheet of what pages with tools have in common: header, footer, buttons, fields.
pub const CONTROLS_STYLE: PageFile = PageFile::css("/controls.css", include_str!("page/controls.css"));
/// Script that asks a page's server.
pub const SERVER_SCRIPT: PageFile = PageFile::script("/server.js", include_str!("page/server.js"));
/// Script of shapes in SVG pictures and of pointers on them.
pub const SHAPES_SCRIPT: PageFile = PageFile::script("/shapes.js", include_str!("page/shapes.js"));
/// Script of lists whose rows stay while they are listed.
pub const ROWS_SCRIPT: PageFile = PageFile::script("/rows.js", include_str!("page/rows.js"));

/// All files of the page.
pub(super) const FILES: [PageFile; 21] = [
    PageFile::html("/", include_str!("page/index.html")),
    PageFile::svg("/icon.svg", include_str!("page/icon.svg")),
    PageFile::PALETTE,
    CONTROLS_STYLE,
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
    PageFile::script("/drawn_scene.js", include_str!("page/drawn_scene.js")),
    SPACE_STYLE,
    SPACE_SCRIPT,
    SOLIDS_SCRIPT,
    SHAPES_SCRIPT,
    SERVER_SCRIPT,
    ROWS_SCRIPT,
];
