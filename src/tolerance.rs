//! The error budget: raster + simplify + rounding + controller <= gouge. No other epsilon exists.
//!
//! Every stage that gives way below the exact cutter location takes its share from here, and what
//! a place needs beyond its share is paid by lifting the cutter there, never by gouging.

/// How far above the exact cutter location a simplified pass may run, besides what a unit of the
/// controller's grid takes beyond the simplification's share, in mm: it lets one move follow a facet whose heights are not on the grid.
pub const EXCESS_MM: f64 = 0.0005;

/// Most of the budget that simplification may use, in mm. More would tilt mirrors for little gain:
/// 1 um over a facet of 0.3 mm is 0.2 degrees.
const SIMPLIFY_MOST_MM: f64 = 0.001;

/// Most that is set aside for the surface between two cutter locations, in mm.
const RASTER_MOST_MM: f64 = 0.0005;

/// Least that must be left for raster and simplification, in mm.
const FREE_LEAST_MM: f64 = 0.0001;

/// How a permitted gouge is shared out, all in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// The limit that the parts add up to at most.
    pub gouge_mm: f64,
    /// For the surface between two positions at which the cutter location is evaluated.
    pub raster_mm: f64,
    /// For leaving out positions of a pass.
    pub simplify_mm: f64,
    /// For heights held as 32-bit floats. Rounding to the controller's grid costs nothing: vertices
    /// are laid on it, upwards.
    pub rounding_mm: f64,
    /// For the controller's stated path tolerance on the steepest face, up to 45 degrees; what is
    /// steeper is lifted.
    pub controller_mm: f64,
    /// The controller's path tolerance itself (G64 P plus Q), in any direction.
    pub path_tolerance_mm: f64,
}

/// Why no budget can be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    #[error("gouge_mm is {gouge_mm}, it must be a number above 0; hint: 0.002")]
    Gouge { gouge_mm: f64 },
    #[error("the controller's path tolerance is {path_tolerance_mm} mm, it must be 0 or more")]
    PathTolerance { path_tolerance_mm: f64 },
    #[error(
        "gouge_mm = {gouge_mm} cannot be kept: the controller's path tolerance of {path_tolerance_mm} mm takes {controller_mm:.6} mm on this part's slopes and 32-bit heights {rounding_mm:.7} mm, {least_mm} mm must be left; hint: gouge_mm of at least {enough_mm:.4}, or a smaller path tolerance"
    )]
    Spent {
        gouge_mm: f64,
        path_tolerance_mm: f64,
        controller_mm: f64,
        rounding_mm: f64,
        least_mm: f64,
        enough_mm: f64,
    },
}

impl Budget {
    /// Shares out `gouge_mm` for a part with faces up to `steepest` (|dz/dx|, |dz/dy|) and heights
    /// down to `depth_mm` below its datum, on a controller that leaves its path by up to
    /// `path_tolerance_mm`.
    pub fn split(
        gouge_mm: f64,
        path_tolerance_mm: f64,
        steepest: [f64; 2],
        depth_mm: f64,
    ) -> Result<Budget, Error> {
        if !(gouge_mm.is_finite() && gouge_mm > 0.0) {
            return Err(Error::Gouge { gouge_mm });
        }
        if !(path_tolerance_mm.is_finite() && path_tolerance_mm >= 0.0) {
            return Err(Error::PathTolerance { path_tolerance_mm });
        }
        let slope = steepest[0].hypot(steepest[1]).min(1.0);
        let controller_mm = path_tolerance_mm * (1.0 + slope * slope).sqrt();
        // Three float operations (height, profile, sum), each half an ulp of the deepest value.
        let rounding_mm = (depth_mm.abs() + 1.0) * f64::from(f32::EPSILON);
        let free_mm = gouge_mm - controller_mm - rounding_mm;
        if free_mm < FREE_LEAST_MM {
            return Err(Error::Spent {
                gouge_mm,
                path_tolerance_mm,
                controller_mm,
                rounding_mm,
                least_mm: FREE_LEAST_MM,
                enough_mm: ((controller_mm + rounding_mm + FREE_LEAST_MM) * 1e4).ceil() / 1e4,
            });
        }
        let raster_mm = (0.25 * free_mm).min(RASTER_MOST_MM);
        let simplify_mm = (free_mm - raster_mm).min(SIMPLIFY_MOST_MM);
        Ok(Budget { gouge_mm, raster_mm, simplify_mm, rounding_mm, controller_mm, path_tolerance_mm })
    }

    /// What the parts add up to; never above `gouge_mm`.
    pub fn total_mm(&self) -> f64 {
        self.raster_mm + self.simplify_mm + self.rounding_mm + self.controller_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_stay_within_the_limit() {
        for gouge_mm in [0.0003, 0.001, 0.002, 0.05] {
            for path_tolerance_mm in [0.0, 0.0001] {
                for steep in [0.0, 0.4, 50.0] {
                    let budget = Budget::split(gouge_mm, path_tolerance_mm, [steep, 0.1], 40.0).unwrap();
                    assert!(budget.total_mm() <= gouge_mm, "{budget:?}");
                    assert!(budget.simplify_mm > 0.0 && budget.raster_mm > 0.0);
                }
            }
        }
    }

    #[test]
    fn a_tolerance_that_spends_it_all_is_refused_with_figures() {
        let error = Budget::split(0.002, 0.002, [0.4, 0.4], 1.0).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("0.002298") && text.contains("at least 0.0024"), "{text}");
    }
}
