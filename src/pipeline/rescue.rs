//! Which of the library's smaller cutters would reach a cavity: tried on the listed cavities alone, deepest place first.

use geo::Translate;
use rayon::prelude::*;

use super::Error;
use crate::compensation::{self, Profile};
use crate::fidelity::{CAVITY_THRESHOLD_MM, Cavity};
use crate::grid::Window;
use crate::surface::Surface;

/// Samples across the pieces in which a large cavity is tried.
const PIECE: usize = 512;

/// Fills in what each candidate (largest first) leaves of each cavity. Where a candidate fails at the deepest
/// place, what it leaves there stands for the whole. Cavities are in the surface's own frame.
pub fn try_candidates(
    surface: &dyn Surface,
    candidates: &[Profile],
    cavities: &mut [Cavity],
) -> Result<(), Error> {
    cavities.par_iter_mut().try_for_each(|cavity| {
        cavity.residuals_mm.clear();
        for profile in candidates {
            let left_mm = leaves(surface, profile, cavity)?;
            cavity.residuals_mm.push(left_mm);
        }
        Ok(())
    })
}

fn leaves(surface: &dyn Surface, profile: &Profile, cavity: &Cavity) -> Result<f64, Error> {
    let step_mm = surface.lattice().step_mm;
    let index = |mm: f64| (mm / step_mm).floor() as i64;
    let [x_mm, y_mm] = cavity.deepest_mm;
    let deepest = Window { column: index(x_mm), row: index(y_mm), columns: 1, rows: 1 };
    let here_mm = residual(surface, profile, deepest)?;
    if here_mm > CAVITY_THRESHOLD_MM {
        return Ok(here_mm);
    }
    let Some([low_mm, high_mm]) = cavity.outline.bounds_mm() else { return Ok(here_mm) };
    let (column, row) = (index(low_mm[0]), index(low_mm[1]));
    let (columns, rows) =
        ((index(high_mm[0]) - column + 1).max(1) as usize, (index(high_mm[1]) - row + 1).max(1) as usize);
    let mut most_mm = here_mm;
    for start_row in (0..rows).step_by(PIECE) {
        for start_column in (0..columns).step_by(PIECE) {
            let piece = Window {
                column: column + start_column as i64,
                row: row + start_row as i64,
                columns: PIECE.min(columns - start_column),
                rows: PIECE.min(rows - start_row),
            };
            most_mm = most_mm.max(residual(surface, profile, piece)?);
            if most_mm > CAVITY_THRESHOLD_MM {
                return Ok(most_mm);
            }
        }
    }
    Ok(most_mm)
}

/// The most that a cutter leaves over a window, in mm.
fn residual(surface: &dyn Surface, profile: &Profile, window: Window) -> Result<f64, Error> {
    let around = surface.heights(window.grown(2 * profile.reach()), surface.top_mm())?;
    let left = compensation::residual(&compensation::closing(&around, profile, window), &around.crop(window));
    Ok(left.z_mm.iter().filter(|z| z.is_finite()).fold(0.0, |most, z| f64::from(*z).max(most)))
}

/// Moves cavities of a tile's frame into the part's.
pub fn shift(cavities: &mut [Cavity], by_mm: [f64; 2]) {
    for cavity in cavities {
        for place in [&mut cavity.centre_mm, &mut cavity.deepest_mm] {
            *place = [place[0] + by_mm[0], place[1] + by_mm[1]];
        }
        cavity.outline.polygons.translate_mut(by_mm[0], by_mm[1]);
    }
}
