//! `screenmill design`: from a scene to designed cells.

use std::cell::Cell;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};
use screenmill::screen::{self, CellRange, Design, Elevation, Profile, Scene, Seam, SolidError};
use serde_json::json;

use super::{Common, Outcome, Refusal};

/// Design the cells of a screen: facets, microgeometry, elevation
#[derive(clap::Args)]
pub struct Arguments {
    /// The scene
    #[arg(value_name = "SCREEN.toml")]
    scene: PathBuf,
    /// Where the designed cells go
    #[arg(long, value_name = "FILE.npz")]
    out: PathBuf,
    /// Also write closed solids, one a cell, for step seams
    #[arg(long, value_name = "FILE.stl")]
    stl: Option<PathBuf>,
    /// Cells C0 <= column < C1, R0 <= row < R1; all if left out
    #[arg(long, num_args = 4, value_names = ["C0", "R0", "C1", "R1"], allow_negative_numbers = true)]
    cells: Option<Vec<i32>>,
    /// Elevations of all cells in mm, rows x columns, the lowest row first, taken as given
    #[arg(long, value_name = "FILE.npy")]
    elevation: Option<PathBuf>,
}

/// A file that cannot be written where it is asked for.
#[derive(Debug, thiserror::Error)]
enum Unwritable {
    #[error("{path} is a folder; hint: name a file in it")]
    Folder { path: String },
    #[error("{path} cannot be written: {source}; hint: its folder must exist and be writable")]
    Parent { path: String, source: std::io::Error },
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let scene = Scene::read(&arguments.scene)?;
    // What can be refused is refused before minutes of work.
    writable(&arguments.out)?;
    if let Some(stl) = &arguments.stl {
        writable(stl)?;
        if scene.microgeometry.seam == Seam::Stitched {
            return Err(SolidError::Stitched.into());
        }
    }
    let cells = arguments.cells.as_ref().map(|c| CellRange { c0: c[0], r0: c[1], c1: c[2], r1: c[3] });
    let elevation = arguments.elevation.as_deref().map(Elevation::read).transpose()?;
    let design = screen::design(&scene, cells, elevation.as_ref(), &progress(common.quiet))?;
    design.write(&arguments.out)?;
    if let Some(stl) = &arguments.stl {
        design.write_stl(stl)?;
    }
    summarise(&scene, &design, arguments, common.json);
    Ok(Outcome::Within)
}

fn writable(path: &Path) -> Result<(), Unwritable> {
    let name = path.display().to_string();
    if path.is_dir() {
        return Err(Unwritable::Folder { path: name });
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    tempfile::tempfile_in(folder).map(|_| ()).map_err(|source| Unwritable::Parent { path: name, source })
}

/// A bar on a terminal, a line at every tenth elsewhere.
fn progress(quiet: bool) -> impl Fn(usize, usize) {
    let terminal = std::io::stderr().is_terminal();
    let bar = if quiet || !terminal { ProgressBar::hidden() } else { ProgressBar::no_length() };
    if let Ok(style) = ProgressStyle::with_template("cells {bar:40} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    let said = Cell::new(0);
    move |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        let tenth = 10 * done / total.max(1);
        if !quiet && !terminal && tenth > said.replace(tenth) {
            eprintln!("cells {done} of {total}");
        }
        if done == total {
            bar.finish_and_clear();
        }
    }
}

fn summarise(scene: &Scene, design: &Design, arguments: &Arguments, json: bool) {
    let cells = design.core_cells().count();
    let counts = design.core_cells().map(|cell| cell.facets.len());
    let (fewest, most) = (counts.clone().min().unwrap_or(0), counts.clone().max().unwrap_or(0));
    let facets: usize = counts.sum();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for cell in design.core_cells() {
        low = low.min(cell.elevation_mm);
        high = high.max(cell.elevation_mm);
    }
    let CellRange { c0, r0, c1, r1 } = design.core;
    let [width_mm, height_mm] = design.size_mm();
    let profile = if design.profile == Profile::Bump { "bump" } else { "dish" };
    let seam = if design.seam == Seam::Step { "step" } else { "stitched" };
    let out = arguments.out.display().to_string();
    let stl = arguments.stl.as_ref().map(|path| path.display().to_string());
    let of_cells = |length_m: f64, count: usize| 1e3 * length_m - count as f64 * design.cell_mm;
    let bare = [of_cells(scene.width_m, scene.columns()), of_cells(scene.height_m, scene.rows())]
        .map(|mm| if mm < 1e-5 * design.cell_mm { 0.0 } else { mm });
    if json {
        let summary = json!({
            "file": out, "stl": stl, "core": [c0, r0, c1, r1], "cells": cells,
            "cells_with_ring": design.cells.len(), "cell_mm": design.cell_mm,
            "width_mm": width_mm, "height_mm": height_mm, "profile": profile, "seam": seam,
            "facets": facets, "facets_per_cell": [fewest, most],
            "elevation_mm": [low, high], "bare_mm": bare,
        });
        println!("{summary}");
        return;
    }
    println!(
        "{cells} cells of {} mm: columns {c0} to {c1}, rows {r0} to {r1}, {width_mm} x {height_mm} mm",
        design.cell_mm
    );
    let per_cell = if fewest == most { format!("{most}") } else { format!("{fewest} to {most}") };
    println!("{per_cell} facets a cell, {facets} in all; profile {profile}, seam {seam}");
    println!("elevation {low:.3} to {high:.3} mm");
    if bare != [0.0, 0.0] {
        println!(
            "a strip of {:.3} mm at the right and {:.3} mm at the top of the screen holds no whole cell",
            bare[0], bare[1]
        );
    }
    println!("{out}");
    if let Some(stl) = stl {
        println!("{stl}");
    }
}
