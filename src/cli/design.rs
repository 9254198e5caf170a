//! `screenmill design`: from a scene to designed cells.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use screenmill::progress::Progress;
use screenmill::screen::{
    self, AreaError, CellRange, DesignWriter, Elevation, Frame, Profile, Scene, Seam, SolidWriter, Stitching,
};
use screenmill::whole::{Whole, publish_all};
use serde_json::json;

use super::{Common, Outcome, Refusal, console};

/// Design the cells of a screen: facets, microgeometry, elevation
#[derive(clap::Args)]
pub struct Arguments {
    /// The scene
    #[arg(value_name = "SCREEN.toml")]
    scene: PathBuf,
    /// Where the designed cells go
    #[arg(long, value_name = "FILE.npz")]
    out: PathBuf,
    /// Also write what the cells are as a mesh: a closed solid for each cell, or one if they are stitched
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
    #[error("{path} is asked for twice; hint: --out and --stl take a file each")]
    Twice { path: String },
}

pub fn run(arguments: &Arguments, common: &Common) -> Result<Outcome, Refusal> {
    let scene = Scene::read(&arguments.scene)?;
    // What can be refused is refused before minutes of work.
    writable(&arguments.out)?;
    if let Some(stl) = &arguments.stl {
        writable(stl)?;
        if *stl == arguments.out {
            return Err(Unwritable::Twice { path: stl.display().to_string() }.into());
        }
    }
    let cells = arguments.cells.as_ref().map(|c| CellRange { c0: c[0], r0: c[1], c1: c[2], r1: c[3] });
    let elevation = arguments.elevation.as_deref().map(Elevation::read).transpose()?;
    let frame = screen::frame(&scene, cells)?;
    let mut made = Made::new(frame);
    let watch = Watch::new(common.quiet, frame.extent.columns() * frame.extent.rows());
    let mut writer = DesignWriter::create(&arguments.out, &frame)?;
    console::unfinished(writer.hidden());
    let mut solids = arguments.stl.as_ref().map(|stl| SolidWriter::create(stl, &frame)).transpose()?;
    if let Some(solids) = &solids {
        console::unfinished(solids.hidden());
    }
    let mut stitching = (frame.seam == Seam::Stitched).then(|| Stitching::new(&frame));
    screen::design_streamed::<Refusal>(&scene, &frame, elevation.as_ref(), &watch, &mut |cell| {
        made.count(&cell);
        if let Some(stitching) = &mut stitching {
            watch.begin("measuring areas", 1);
            stitching.push(&cell);
        }
        if let Some(solids) = &mut solids {
            watch.begin("meshing", 1);
            solids.push(&cell)?;
        }
        watch.begin("writing", 1);
        writer.push(&cell)?;
        watch.cell_done();
        Ok(())
    })?;
    made.area_error = stitching.map(Stitching::finish);
    watch.begin("writing", 0);
    let solids = solids.map(SolidWriter::finish).transpose()?;
    let files = std::iter::once(writer.finish()?).chain(solids);
    publish_all(files)
        .map_err(|(path, source)| Unwritable::Parent { path: path.display().to_string(), source })?;
    let times = watch.times();
    if common.verbose {
        for (stage, time) in times {
            eprintln!("{stage}: {:.2} s", time.as_secs_f64());
        }
    }
    summarise(&scene, &made, arguments, common.json);
    Ok(Outcome::Within)
}

/// What is said of a design, gathered while its cells go by.
struct Made {
    frame: Frame,
    cells: usize,
    cells_with_ring: usize,
    facets: usize,
    facets_per_cell: [usize; 2],
    elevation_mm: [f64; 2],
    /// What stitching leaves of the facets' areas.
    area_error: Option<AreaError>,
}

impl Made {
    fn new(frame: Frame) -> Made {
        Made {
            frame,
            cells: 0,
            cells_with_ring: 0,
            facets: 0,
            facets_per_cell: [usize::MAX, 0],
            elevation_mm: [f64::INFINITY, f64::NEG_INFINITY],
            area_error: None,
        }
    }

    fn count(&mut self, cell: &screen::Cell) {
        self.cells_with_ring += 1;
        if !self.frame.core.contains(cell.column, cell.row) {
            return;
        }
        let facets = cell.facets.len();
        self.cells += 1;
        self.facets += facets;
        self.facets_per_cell = [self.facets_per_cell[0].min(facets), self.facets_per_cell[1].max(facets)];
        self.elevation_mm =
            [self.elevation_mm[0].min(cell.elevation_mm), self.elevation_mm[1].max(cell.elevation_mm)];
    }
}

fn writable(path: &Path) -> Result<(), Unwritable> {
    let name = path.display().to_string();
    if path.is_dir() {
        return Err(Unwritable::Folder { path: name });
    }
    Whole::beside(path).map(drop).map_err(|source| Unwritable::Parent { path: name, source })
}

/// Cells that are done, on a bar on a terminal or a line at every tenth elsewhere, and how long each
/// stage took: they take turns, so each is the sum of its turns.
struct Watch {
    bar: ProgressBar,
    said: bool,
    state: Mutex<Stages>,
    total: usize,
}

struct Stages {
    running: Option<(String, Instant)>,
    done: Vec<(String, Duration)>,
    cells: usize,
}

impl Watch {
    fn new(quiet: bool, total: usize) -> Watch {
        let terminal = std::io::stderr().is_terminal();
        let bar = if quiet || !terminal { ProgressBar::hidden() } else { ProgressBar::new(total as u64) };
        if let Ok(style) = ProgressStyle::with_template("cells {bar:40} {pos}/{len} {eta}") {
            bar.set_style(style);
        }
        let state = Mutex::new(Stages { running: None, done: Vec::new(), cells: 0 });
        Watch { bar, said: !quiet && !terminal, state, total }
    }

    fn cell_done(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.cells += 1;
        let (cells, total) = (state.cells, self.total.max(1));
        self.bar.set_position(cells as u64);
        if self.said && 10 * cells / total > 10 * (cells - 1) / total {
            eprintln!("cells {cells} of {total}");
        }
        if cells >= total {
            self.bar.finish_and_clear();
        }
    }

    /// Ends the running stage; the stages in their order, each with its time.
    fn times(&self) -> Vec<(String, Duration)> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.end();
        std::mem::take(&mut state.done)
    }
}

impl Stages {
    fn end(&mut self) {
        let Some((name, since)) = self.running.take() else { return };
        let time = since.elapsed();
        match self.done.iter_mut().find(|(known, _)| *known == name) {
            Some(stage) => stage.1 += time,
            None => self.done.push((name, time)),
        }
    }
}

impl Progress for Watch {
    fn begin(&self, stage: &str, _total: u64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.end();
        state.running = Some((stage.to_string(), Instant::now()));
    }

    fn advance(&self, _steps: u64) {}

    fn interrupted(&self) -> bool {
        console::interrupted()
    }
}

fn summarise(scene: &Scene, made: &Made, arguments: &Arguments, json: bool) {
    let Made { frame, cells, facets, facets_per_cell: [fewest, most], elevation_mm: [low, high], .. } = *made;
    let CellRange { c0, r0, c1, r1 } = frame.core;
    let cell_mm = frame.cell_mm;
    let [width_mm, height_mm] = [frame.core.columns(), frame.core.rows()].map(|count| count as f64 * cell_mm);
    let profile = if frame.profile == Profile::Bump { "bump" } else { "dish" };
    let seam = if frame.seam == Seam::Step { "step" } else { "stitched" };
    let out = arguments.out.display().to_string();
    let stl = arguments.stl.as_ref().map(|path| path.display().to_string());
    let of_cells = |length_m: f64, count: usize| 1e3 * length_m - count as f64 * cell_mm;
    let bare = [of_cells(scene.width_m, scene.columns()), of_cells(scene.height_m, scene.rows())]
        .map(|mm| if mm < 1e-5 * cell_mm { 0.0 } else { mm });
    if json {
        let summary = json!({
            "file": out, "stl": stl, "core": [c0, r0, c1, r1], "cells": cells,
            "cells_with_ring": made.cells_with_ring, "cell_mm": cell_mm,
            "width_mm": width_mm, "height_mm": height_mm, "profile": profile, "seam": seam,
            "facets": facets, "facets_per_cell": [fewest, most],
            "elevation_mm": [low, high], "bare_mm": bare,
            "stitched_area_error": made.area_error.map(|error| json!({"rms": error.rms, "worst": error.worst, "lost": error.lost})),
        });
        println!("{summary}");
        return;
    }
    println!(
        "{cells} cells of {} mm: columns {c0} to {c1}, rows {r0} to {r1}, {width_mm} x {height_mm} mm",
        cell_mm
    );
    let per_cell = if fewest == most { format!("{most}") } else { format!("{fewest} to {most}") };
    println!("{per_cell} facets a cell, {facets} in all; profile {profile}, seam {seam}");
    println!("elevation {low:.3} to {high:.3} mm");
    if let Some(AreaError { rms, worst, lost }) = made.area_error {
        let sweeps = match scene.microgeometry.area_sweeps {
            0 => "where their planes meet".to_string(),
            1 => "after 1 sweep".to_string(),
            sweeps => format!("after {sweeps} sweeps"),
        };
        println!(
            "no steps between cells; {sweeps} facet areas are off by {:.1} % rms, {:.0} % at most",
            1e2 * rms,
            1e2 * worst
        );
        if lost > 0 {
            println!(
                "{lost} of them are wholly under other facets: their cells' bases do not meet, or they are small and lie at a seam"
            );
        }
    }
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
