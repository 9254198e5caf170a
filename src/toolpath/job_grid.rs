//! What the grids of a job's controllers have in common, so that each of them is given the same work.
//!
//! Passes of a finish lie whole numbers of the coarsest unit apart. Roughing is planned on one grid altogether:
//! where a cut ends, which cut it is linked to and how high depends on whole units: on each controller's own grid
//! the same job would be roughed in another order. What roughing leaves is tenths of a millimetre, and hundredths
//! are fine enough for it.

use super::rough::{Params, STEPOVER};
use super::{Error, Site, Toolpath};
use crate::tolerance::Budget;

/// mm; what RML-1 counts in, and a whole number of units of every finer grid that comes along.
const COMMON_MM: f64 = 0.01;

/// The path tolerance that is planned for at least, in mm: what the dialects that come along state at most.
const PATH_TOLERANCE_MM: f64 = 0.001;

/// Rounding a stepdown or stepover down to the common grid may take this part of it.
const MOST_LOST: f64 = 0.1;

/// What the controllers of a job have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobGrid {
    /// The coarsest unit in mm, if it is a whole number of each other one.
    coarsest_mm: Option<f64>,
    /// Whether [`COMMON_MM`] is a whole number of every unit.
    common: bool,
    loosest_mm: f64,
}

impl JobGrid {
    /// For controllers by their unit and path tolerance in mm.
    pub fn of(controllers: &[(f64, f64)]) -> JobGrid {
        let units = || controllers.iter().map(|controller| controller.0);
        let coarsest_mm = units().fold(0.0, f64::max);
        let holds_all = |grid_mm: f64| units().all(|unit_mm| multiple(grid_mm, unit_mm).is_some());
        JobGrid {
            coarsest_mm: holds_all(coarsest_mm).then_some(coarsest_mm),
            common: holds_all(COMMON_MM),
            loosest_mm: controllers.iter().fold(0.0, |most, controller| most.max(controller.1)),
        }
    }

    /// The site as roughing by `params` is planned on it; [`Toolpath::in_units`] brings the path back to the
    /// controller's own grid. Cuts stay at or above what is to be left, without a share of the budget.
    pub fn site<'a>(&self, site: &Site<'a>, params: &Params) -> Site<'a> {
        let stepover_mm = params.stepover_mm.unwrap_or(STEPOVER * 2.0 * params.shape.radius_mm());
        let unit_mm = self.unit_mm([params.stepdown_mm, stepover_mm]);
        let path_tolerance_mm = self.loosest_mm.max(PATH_TOLERANCE_MM);
        let budget = Budget { simplify_mm: 0.0, path_tolerance_mm, ..site.budget };
        Site { unit_mm: unit_mm.unwrap_or(site.unit_mm), budget, ..*site }
    }

    /// The coarsest unit in mm, on which passes of all of them can lie; that of one of them where it is no whole number
    /// of the others.
    pub fn apart_mm(&self, unit_mm: f64) -> f64 {
        self.coarsest_mm.unwrap_or(unit_mm)
    }

    /// Most that one of the controllers may leave its path, in mm.
    pub fn loosest_mm(&self) -> f64 {
        self.loosest_mm
    }

    /// The grid in mm for such distances; None where each controller has to keep to its own.
    fn unit_mm(&self, distances_mm: [f64; 2]) -> Option<f64> {
        let fits = |distance_mm: f64| {
            let rounded_mm = (distance_mm / COMMON_MM + 1e-9).floor() * COMMON_MM;
            distance_mm - rounded_mm <= MOST_LOST * distance_mm
        };
        if self.common && distances_mm.into_iter().all(fits) { Some(COMMON_MM) } else { self.coarsest_mm }
    }
}

impl Toolpath {
    /// The same path in units of `unit_mm`, of which its own unit is a whole number.
    ///
    /// # Errors
    /// It is not, or the path reaches farther than 32-bit numbers count.
    pub fn in_units(mut self, unit_mm: f64) -> Result<Toolpath, Error> {
        let grid = |reach_mm: f64| {
            let limit_mm = f64::from(i32::MAX) * unit_mm;
            Error::Grid { reach_mm, unit_mm, limit_mm }
        };
        let times = multiple(self.unit_mm, unit_mm).ok_or_else(|| grid(self.unit_mm))?;
        for value in self.moves.iter_mut().flat_map(|to| &mut to.to) {
            *value = value.checked_mul(times).ok_or_else(|| grid(f64::from(*value) * self.unit_mm))?;
        }
        self.unit_mm = unit_mm;
        Ok(self)
    }
}

/// How many units a length is, if it is a whole number of them.
fn multiple(length_mm: f64, unit_mm: f64) -> Option<i32> {
    let times = length_mm / unit_mm;
    let whole = times.round();
    ((1.0..1e6).contains(&whole) && (times - whole).abs() < 1e-6 * whole).then_some(whole as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_of(units_mm: &[f64], stepdown_mm: f64) -> Option<f64> {
        let controllers: Vec<(f64, f64)> = units_mm.iter().map(|&unit_mm| (unit_mm, 0.0)).collect();
        JobGrid::of(&controllers).unit_mm([stepdown_mm, 1.2])
    }

    #[test]
    fn one_grid_for_all_that_come_along() {
        for controllers in [&[0.0001][..], &[0.001], &[0.01], &[0.01, 0.0001, 0.001]] {
            assert_eq!(unit_of(controllers, 0.3), Some(0.01));
        }
        assert_eq!(unit_of(&[0.025], 0.3), Some(0.025));
        assert_eq!(unit_of(&[0.025, 0.0001], 0.3), Some(0.025));
        assert_eq!(unit_of(&[0.025, 0.01], 0.3), None);
        assert_eq!(unit_of(&[0.00254], 0.3), Some(0.00254));
        // A stepdown of 15 um would become one of 10.
        assert_eq!(unit_of(&[0.0001], 0.015), Some(0.0001));
        assert_eq!(unit_of(&[0.0001], 0.02), Some(0.01));
    }
}
