use rayon::prelude::*;

use super::elevation::{Elevation, elevation};
use super::microgeometry::{Workspace, solve};
use super::{Cell, CellRange, Design, Error, Facet, Grazing, Profile, Scene, Seam, directions, facets};

/// Bytes that a facet of a design takes.
const FACET_BYTES: f64 = size_of::<Facet>() as f64;
/// Most that is designed at once; a whole screen of 2 x 1 m takes 0.75 GiB.
const MOST_GIB: f64 = 4.0;
const GIB: f64 = (1u64 << 30) as f64;
/// Cells between two reports of progress.
const BATCH: usize = 512;

/// Designs cells of a screen (paper, sections 3.1 and 3.2): all of them, or a range; with the
/// scene's elevation, or a given one. A cell's design depends on the scene and its own elevation
/// only, never on which others are asked for or on threads. A stitched design also gets the ring
/// of neighbours around the range, where the screen has them. `progress` is told the cells done and
/// their number.
pub fn design(
    scene: &Scene,
    cells: Option<CellRange>,
    given: Option<&Elevation>,
    progress: &dyn Fn(usize, usize),
) -> Result<Design, Error> {
    let (columns, rows) = (scene.columns(), scene.rows());
    let core = cells.unwrap_or(CellRange { c0: 0, r0: 0, c1: columns as i32, r1: rows as i32 });
    let CellRange { c0, r0, c1, r1 } = core;
    let inside = |low: i32, high: i32, count: usize| 0 <= low && low < high && high as usize <= count;
    if !inside(c0, c1, columns) || !inside(r0, r1, rows) {
        return Err(Error::CellsOutside { c0, r0, c1, r1, columns, rows });
    }
    let microgeometry = &scene.microgeometry;
    let ring = i32::from(microgeometry.seam == Seam::Stitched);
    let all = CellRange {
        c0: (c0 - ring).max(0),
        r0: (r0 - ring).max(0),
        c1: (c1 + ring).min(columns as i32),
        r1: (r1 + ring).min(rows as i32),
    };
    let count = all.columns() * all.rows();
    let gib = count as f64 * microgeometry.facets as f64 * FACET_BYTES / GIB;
    if gib > MOST_GIB {
        return Err(Error::TooMuchAtOnce {
            cells: count,
            facets: microgeometry.facets,
            gib,
            most_gib: MOST_GIB,
        });
    }
    let own;
    let elevation = match given {
        Some(given) => {
            given.check(scene)?;
            given
        }
        None => {
            own = elevation(scene)?;
            &own
        }
    };
    let mut done = Vec::with_capacity(count);
    while done.len() < count {
        progress(done.len(), count);
        let batch = done.len()..(done.len() + BATCH).min(count);
        // Cells first, errors after: the first in order is the one reported, whatever the threads.
        let made: Vec<Result<Cell, Error>> = batch
            .into_par_iter()
            .map_init(Workspace::default, |workspace, at| {
                let column = all.c0 + (at % all.columns()) as i32;
                let row = all.r0 + (at / all.columns()) as i32;
                cell(scene, workspace, column, row, elevation.at(column as usize, row as usize))
            })
            .collect();
        for cell in made {
            done.push(cell?);
        }
    }
    progress(count, count);
    Ok(Design {
        core,
        cell_mm: microgeometry.width_mm,
        profile: microgeometry.profile,
        seam: microgeometry.seam,
        cells: done,
    })
}

fn cell(
    scene: &Scene,
    workspace: &mut Workspace,
    column: i32,
    row: i32,
    elevation_mm: f64,
) -> Result<Cell, Error> {
    let x = scene.centre_m(f64::from(column), f64::from(row), 1e-3 * elevation_mm);
    scene.check_point((column, row), x)?;
    let microgeometry = &scene.microgeometry;
    let wanted = microgeometry.facets;
    let sampled = directions(&scene.view(x), wanted).ok_or(Error::SeesTooLittle {
        column,
        row,
        x_m: x.x,
        y_m: x.y,
        z_m: x.z,
        facets: wanted,
        most: super::MOST_SAMPLES,
    })?;
    let wanted = facets(scene, x, &sampled.list)
        .map_err(|Grazing { mean_gradient: [mx, my] }| Error::Grazing { column, row, mx, my })?;
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
    let sign = match microgeometry.profile {
        Profile::Bump => 1.0,
        Profile::Dish => -1.0,
    };
    let facets = (0..solved.gradients.len())
        .map(|k| Facet {
            gradient: solved.gradients[k],
            offset_mm: sign * solved.offsets_mm[k],
            area_mm2: solved.areas_mm2[k],
        })
        .collect();
    Ok(Cell { column, row, elevation_mm, facets })
}
