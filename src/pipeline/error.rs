use std::path::PathBuf;

use crate::grid::Lattice;
use crate::screen::CellRange;

/// Why a job was refused, or why it ended early.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Job(#[from] crate::job::Error),
    #[error(transparent)]
    Screen(#[from] crate::screen::Error),
    #[error(transparent)]
    Container(#[from] crate::screen::ContainerError),
    #[error(transparent)]
    Surface(#[from] crate::surface::Error),
    #[error(transparent)]
    Compensation(#[from] crate::compensation::Error),
    #[error(transparent)]
    Machine(#[from] crate::machine::Error),
    #[error(transparent)]
    Budget(#[from] crate::tolerance::Error),
    #[error("operation {number} ({operation}, {tool}), tile {tile}: {source}")]
    Toolpath {
        number: usize,
        operation: &'static str,
        tool: String,
        tile: String,
        source: crate::toolpath::Error,
    },
    #[error(transparent)]
    Post(#[from] crate::post::Error),
    #[error("{path}: {source}")]
    ReadBack { path: PathBuf, source: crate::verify::Error },
    #[error(transparent)]
    Fidelity(#[from] crate::fidelity::Error),
    #[error(transparent)]
    Report(#[from] crate::report::Error),
    #[error(transparent)]
    Cutter(#[from] crate::cutter::ParseError),
    #[error(
        "the inline cutter \"{tool}\" has no {key}; hint: write {key} beside it, or name a tool of the library"
    )]
    InlineFeed { tool: String, key: &'static str },
    #[error("post names \"{name}\" twice")]
    PostTwice { name: String },
    #[error(
        "cells {} {} {} {} do not lie in the design's {} {} {} {}; hint: design them first, screenmill design --cells",
        .cells.c0, .cells.r0, .cells.c1, .cells.r1, .core.c0, .core.r0, .core.c1, .core.r1
    )]
    CellsOutside { cells: CellRange, core: CellRange },
    #[error("tile {tile} holds no data; hint: a smaller part, or a machine that takes it whole")]
    EmptyTile { tile: String },
    #[error("{path}: {source}")]
    Output { path: PathBuf, source: std::io::Error },
    #[error("{path} cannot be written: {source}; hint: choose another --out")]
    OutputFolder { path: PathBuf, source: std::io::Error },
    #[error("limits.on_audience_min is {limit}, and the part is {what}; hint: it is for [part] screen")]
    NoLight { limit: f64, what: &'static str },
    #[error(
        "{surface} has {} x {} samples of {} mm, the design {} x {}; hint: a map of the same part at full resolution \
         ([maps] full = true), or screenmill raster",
        found.columns, found.rows, found.step_mm, wanted.columns, wanted.rows
    )]
    SurfaceOfAnother { surface: PathBuf, wanted: Lattice, found: Lattice },
    #[error(
        "{design} holds cells {} .. {}, {} .. {} of {cell_mm} mm, the screen of {scene} has {columns} x {rows} of \
         {width_mm} mm; hint: the scene that the cells were designed for",
        core.c0, core.c1, core.r0, core.r1
    )]
    DesignOfAnother {
        design: PathBuf,
        scene: PathBuf,
        core: CellRange,
        cell_mm: f64,
        columns: i32,
        rows: i32,
        width_mm: f64,
    },
    #[error("no light of the projector falls on the surface; hint: is this the scene it was designed for?")]
    NoLightFalls,
    #[error("interrupted; nothing was written")]
    Interrupted,
}
