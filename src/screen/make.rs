use super::elevation::{Elevation, elevation};
use super::facets::Wanted;
use super::microgeometry::{Workspace, solve};
use super::repair::{self, Sheet};
use super::{Cell, CellRange, Design, Error, Facet, Frame, Grazing, Scene, Seam, directions, facets};
use crate::progress::{Progress, Silent, in_order, in_order_with};

/// Bytes that a facet of a design takes.
const FACET_BYTES: f64 = size_of::<Facet>() as f64;
/// Most that is held in memory at once; a whole screen of 2 x 1 m takes 0.75 GiB.
const MOST_GIB: f64 = 4.0;
/// Largest container that is written: its gradients stay below what a reader takes.
const MOST_CONTAINER_GIB: f64 = 32.0;
const GIB: f64 = (1u64 << 30) as f64;
/// Cells that are sampled, then solved, at a time.
const BATCH: usize = 512;
/// Rows of cells whose areas are repaired at a time, with those around them that they depend on.
const REPAIRED_ROWS: i32 = 32;

/// Designs cells of a screen (paper, sections 3.1 and 3.2): all of them, or a range; with the
/// scene's elevation, or a given one. A cell's design depends on the scene and its own elevation
/// only, never on which others are asked for or on threads. A stitched design also gets the ring
/// of neighbours around the range, where the screen has them; with `area_sweeps` a cell also depends on
/// the cells within 2 `area_sweeps` + 1 rings around it, which are made and left out again. `progress` is told the cells done and
/// their number. [`design_streamed`] holds no more than a few rows.
pub fn design(
    scene: &Scene,
    cells: Option<CellRange>,
    given: Option<&Elevation>,
    progress: &dyn Fn(usize, usize),
) -> Result<Design, Error> {
    let frame = frame(scene, cells)?;
    let count = frame.extent.columns() * frame.extent.rows();
    refuse_above(MOST_GIB, scene, count, |cells, facets, gib, most_gib| Error::TooMuchAtOnce {
        cells,
        facets,
        gib,
        most_gib,
    })?;
    let mut done = Vec::with_capacity(count);
    progress(0, count);
    run(scene, &frame, given, &Silent, &mut |cell| {
        done.push(cell);
        if done.len() % BATCH == 0 || done.len() == count {
            progress(done.len(), count);
        }
        Ok::<(), Error>(())
    })?;
    let Frame { core, cell_mm, profile, seam, .. } = frame;
    Ok(Design { core, cell_mm, profile, seam, cells: done })
}

/// The same, cell by cell into `take`, by row, then column, each as soon as it is done: for whole
/// screens, which need not be in memory. `progress` hears of a stage "elevation", then by turns of
/// "sampling", "solving" and, where that is asked for, "repairing areas" with the cells of each; it may end the work. An error of `take` does too.
pub fn design_streamed<E: From<Error>>(
    scene: &Scene,
    frame: &Frame,
    given: Option<&Elevation>,
    progress: &dyn Progress,
    take: &mut dyn FnMut(Cell) -> Result<(), E>,
) -> Result<(), E> {
    run(scene, frame, given, progress, take)
}

/// What a design of these cells, or of all, will cover. Refuses cells outside the screen, and more
/// than one container can hold.
pub fn frame(scene: &Scene, cells: Option<CellRange>) -> Result<Frame, Error> {
    let (columns, rows) = (scene.columns(), scene.rows());
    let core = cells.unwrap_or(CellRange { c0: 0, r0: 0, c1: columns as i32, r1: rows as i32 });
    let CellRange { c0, r0, c1, r1 } = core;
    let inside = |low: i32, high: i32, count: usize| 0 <= low && low < high && high as usize <= count;
    if !inside(c0, c1, columns) || !inside(r0, r1, rows) {
        return Err(Error::CellsOutside { c0, r0, c1, r1, columns, rows });
    }
    let microgeometry = &scene.microgeometry;
    let ring = i32::from(microgeometry.seam == Seam::Stitched);
    let extent = core.grown(ring).within(columns, rows);
    refuse_above(
        MOST_CONTAINER_GIB,
        scene,
        extent.columns() * extent.rows(),
        |cells, facets, gib, most_gib| Error::TooMuchForAFile { cells, facets, gib, most_gib },
    )?;
    let (profile, seam) = (microgeometry.profile, microgeometry.seam);
    Ok(Frame { core, extent, cell_mm: microgeometry.width_mm, profile, seam })
}

fn refuse_above(
    most_gib: f64,
    scene: &Scene,
    cells: usize,
    error: impl Fn(usize, usize, f64, f64) -> Error,
) -> Result<(), Error> {
    let facets = scene.microgeometry.facets;
    let gib = cells as f64 * facets as f64 * FACET_BYTES / GIB;
    if gib > most_gib { Err(error(cells, facets, gib, most_gib)) } else { Ok(()) }
}

fn run<E: From<Error>>(
    scene: &Scene,
    frame: &Frame,
    given: Option<&Elevation>,
    progress: &dyn Progress,
    take: &mut dyn FnMut(Cell) -> Result<(), E>,
) -> Result<(), E> {
    let own;
    let elevation = match given {
        Some(given) => {
            given.check(scene)?;
            given
        }
        None => {
            progress.begin("elevation", 1);
            own = elevation(scene)?;
            progress.advance(1);
            &own
        }
    };
    let sweeps = scene.microgeometry.area_sweeps;
    if sweeps == 0 || frame.seam == Seam::Step {
        return solved(scene, frame.extent, elevation, progress, take);
    }
    let screen = (scene.columns(), scene.rows());
    let CellRange { c0, r0, c1, r1 } = frame.extent;
    for r0 in (r0..r1).step_by(REPAIRED_ROWS as usize) {
        let band = CellRange { c0, r0, c1, r1: (r0 + REPAIRED_ROWS).min(r1) };
        let extent = band.grown(repair::rings(sweeps)).within(screen.0, screen.1);
        let mut cells = Vec::with_capacity(extent.columns() * extent.rows());
        solved::<Error>(scene, extent, elevation, progress, &mut |cell| {
            cells.push(cell);
            Ok(())
        })?;
        let Frame { cell_mm, profile, .. } = *frame;
        progress.begin("repairing areas", (band.columns() * band.rows()) as u64);
        let mut sheet = Sheet { extent, cells, profile, cell_mm, screen, progress };
        sheet.repair(band, sweeps)?;
        for cell in sheet.cells.into_iter().filter(|cell| band.contains(cell.column, cell.row)) {
            take(cell)?;
        }
    }
    Ok(())
}

/// The cells of a range, each by itself.
fn solved<E: From<Error>>(
    scene: &Scene,
    extent: CellRange,
    elevation: &Elevation,
    progress: &dyn Progress,
    take: &mut dyn FnMut(Cell) -> Result<(), E>,
) -> Result<(), E> {
    let count = extent.columns() * extent.rows();
    for start in (0..count).step_by(BATCH) {
        let batch: Vec<(i32, i32, f64)> = (start..(start + BATCH).min(count))
            .map(|at| {
                let column = extent.c0 + (at % extent.columns()) as i32;
                let row = extent.r0 + (at / extent.columns()) as i32;
                (column, row, elevation.at(column as usize, row as usize))
            })
            .collect();
        // A cell of thousands of facets takes a tenth of a second, a batch of them half a minute.
        let go_on = || if progress.interrupted() { Err(Error::Interrupted) } else { Ok(()) };
        progress.begin("sampling", batch.len() as u64);
        let wanted: Vec<Wanted> = in_order(batch.len(), |at| {
            go_on()?;
            let (column, row, z_mm) = batch[at];
            sampled(scene, column, row, z_mm)
        })?;
        progress.advance(batch.len() as u64);
        progress.begin("solving", batch.len() as u64);
        let made: Vec<Cell> = in_order_with(batch.len(), Workspace::default, |workspace, at| {
            go_on()?;
            let (column, row, z_mm) = batch[at];
            cell(scene, workspace, column, row, z_mm, &wanted[at])
        })?;
        progress.advance(batch.len() as u64);
        for cell in made {
            take(cell)?;
        }
    }
    Ok(())
}

/// Gradients and areas of the facets that a cell wants.
fn sampled(scene: &Scene, column: i32, row: i32, elevation_mm: f64) -> Result<Wanted, Error> {
    let x = scene.centre_m(f64::from(column), f64::from(row), 1e-3 * elevation_mm);
    scene.check_point((column, row), x)?;
    let wanted = scene.microgeometry.facets;
    let sampled = directions(&scene.view(x), wanted).ok_or(Error::SeesTooLittle {
        column,
        row,
        x_m: x.x,
        y_m: x.y,
        z_m: x.z,
        facets: wanted,
        most: super::MOST_SAMPLES,
    })?;
    facets(scene, x, &sampled.list).map_err(|Grazing { mean_gradient: [mx, my] }| Error::Grazing {
        column,
        row,
        mx,
        my,
    })
}

fn cell(
    scene: &Scene,
    workspace: &mut Workspace,
    column: i32,
    row: i32,
    elevation_mm: f64,
    wanted: &Wanted,
) -> Result<Cell, Error> {
    let microgeometry = &scene.microgeometry;
    let tolerance = microgeometry.area_tolerance;
    let solved = solve(workspace, &wanted.gradients, &wanted.weights, microgeometry.width_mm, tolerance)
        .map_err(|failed| Error::NotConverged {
            column,
            row,
            facets: wanted.gradients.len(),
            error: failed.error,
            iterations: failed.iterations,
            tolerance,
        })?;
    // A dish is the bump turned half a turn and upside down: the same gradients and areas.
    let sign = microgeometry.profile.sign();
    let facets = (0..solved.gradients.len())
        .map(|k| Facet {
            gradient: solved.gradients[k],
            offset_mm: sign * solved.offsets_mm[k],
            area_mm2: solved.areas_mm2[k],
        })
        .collect();
    Ok(Cell { column, row, elevation_mm, facets })
}
