//! Roughing, parallel finishing and the links between passes, on the controller's own grid.
//!
//! ```text
//!   surface --bands--> strip --row of CL--> envelope --funnel, ends--> pass --pen--> Toolpath
//!                            (certified between samples)  (few vertices, on the grid)  (links, retracts)
//! ```
//!
//! Planning is in the tile's frame: X0 Y0 at its lower left corner, z = 0 at its highest design point. Only
//! the last step, to whole units, moves z to the program's zero.

pub mod beside;
mod eight;
mod ends;
mod envelope;
pub mod finish;
mod funnel;
mod ground;
mod job_grid;
mod levels;
mod link;
mod misfit;
mod passes;
mod pen;
mod ramp;
mod rest;
pub mod rough;
mod slant;
mod strip;
mod table;
mod tilt;
mod track;

pub use job_grid::JobGrid;
pub use passes::{Axis, Layout};
pub use pen::APPROACH_MM;
pub use rest::Rest;
pub use tilt::{Tilt, Worst};

use crate::compensation;
use crate::surface::{self, Surface};
use crate::tolerance::Budget;

/// How a move is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Fastest travel, never in X or Y below the stock's top.
    Rapid,
    /// Straight down into material at the plunge feed.
    Plunge,
    /// Cutting, at the operation's feed.
    Cut,
}

/// A point of the program frame in whole units of the controller's grid.
pub type GridPoint = [i32; 3];

/// A straight move from where the cutter stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Move {
    pub kind: Kind,
    pub to: GridPoint,
}

/// One operation's path in the program frame of its tile. `moves[0]` is a rapid that names X and Y at
/// the clearance plane and the last one is a rapid up to it. `pass_starts` are the indices of the
/// rapids at the clearance plane that stand over the begin of a pass: a program may start again at
/// each of them. `tilt` is known of a finish that leaves no stock.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Toolpath {
    /// mm per grid unit: 0.01 for RML-1, 0.0001 for LinuxCNC.
    pub unit_mm: f64,
    pub moves: Vec<Move>,
    pub pass_starts: Vec<usize>,
    pub tilt: Option<Tilt>,
}

/// Where an operation is planned: the tile, its blank and its controller's grid.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    pub surface: &'a dyn Surface,
    /// Where the tile's lower left corner lies in the part, in mm: passes of all tiles of a part lie on
    /// one lattice, so that seams line up.
    pub origin_mm: [f64; 2],
    /// Whether what stands past the tile's edges is to be kept (a neighbour on the same sheet).
    pub neighbours: bool,
    /// Metal around the tile, in mm; past it is air.
    pub margin_mm: f64,
    /// The blank's top above the tile's highest design point, in mm.
    pub top_allowance_mm: f64,
    /// The program's Z0 above the tile's highest design point, in mm.
    pub z_zero_mm: f64,
    /// The clearance plane above the blank's top, in mm: the way from and to anywhere is free there.
    pub clearance_mm: f64,
    /// A lower plane between passes, where clamps make the clearance plane a high one.
    pub retract: Option<Retract<'a>>,
    /// mm per unit of the controller's grid.
    pub unit_mm: f64,
    /// Passes lie whole numbers of it apart, in mm: a whole number of units, the same for all controllers of a job.
    pub apart_mm: f64,
    pub budget: Budget,
    /// The tightest one among the job's controllers: by it a finish is kept off walls, so that all of them climb at the
    /// same places.
    pub tightest: Budget,
}

/// The retract plane, for ways on which nothing stands.
#[derive(Clone, Copy)]
pub struct Retract<'a> {
    /// Above the blank's top, in mm.
    pub above_mm: f64,
    /// The first pass after so much cutting begins on the clearance plane, so that a program can be cut there.
    pub restart_mm: f64,
    pub guard: &'a crate::machine::Guard,
}

/// Receives the part of the work that is done, 0 .. 1.
pub type Progress<'a> = &'a dyn Fn(f64);

/// Why an operation was refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(
        "stepover_mm is {stepover_mm}, it must lie above 0 and up to the cutter's diameter of {diameter_mm} mm"
    )]
    Stepover { stepover_mm: f64, diameter_mm: f64 },
    #[error(
        "a stepover of {stepover_mm:.6} mm is finer than the controller's grid of {unit_mm} mm; hint: {hint}"
    )]
    StepoverUnit { stepover_mm: f64, unit_mm: f64, hint: &'static str },
    #[error(
        "stepdown_mm is {stepdown_mm}, it must be a number above 0, at least one unit of the controller's grid ({unit_mm} mm)"
    )]
    Stepdown { stepdown_mm: f64, unit_mm: f64 },
    #[error(
        "scallop_mm is {scallop_mm}, it must lie above 0 and below the tip radius of {cutter}, {tip_radius_mm} mm"
    )]
    Scallop { scallop_mm: f64, cutter: String, tip_radius_mm: f64 },
    #[error(
        "scallop_mm cannot be kept by {cutter}, which has no round tip; hint: stepover_mm, or a ball or bull cutter"
    )]
    ScallopTip { cutter: String },
    #[error("stock_to_leave_mm is {leave_mm}, it must be 0 or more")]
    StockToLeave { leave_mm: f64 },
    #[error("direction_deg is {direction_deg}: roughing rows run along X (0) or along Y (90)")]
    Direction { direction_deg: f64 },
    #[error("{name} is {value}, it must be {wanted}")]
    Number { name: &'static str, value: f64, wanted: &'static str },
    #[error(
        "the path reaches {reach_mm:.1} mm, a grid of {unit_mm} mm counts to {limit_mm:.1} mm; hint: smaller tiles or a coarser grid"
    )]
    Grid { reach_mm: f64, unit_mm: f64, limit_mm: f64 },
    #[error("nothing to cut: all {samples} samples of the tile are no data")]
    NoData { samples: usize },
    #[error(
        "nothing to rough: the stock's top stands {above_mm:.3} mm above the lowest roughing position, stock_to_leave_mm is {leave_mm}; hint: leave this operation out"
    )]
    NothingToRough { above_mm: f64, leave_mm: f64 },
    #[error(
        "one band of passes needs {samples} samples in memory, at most {most} are held; hint: smaller tiles, or a larger step_mm"
    )]
    Band { samples: usize, most: usize },
    #[error("the hole of {diameter_mm} mm at X {:.3} Y {:.3} {problem}; hint: {hint}", .at_mm[0], .at_mm[1])]
    Hole { diameter_mm: f64, at_mm: [f64; 2], problem: String, hint: &'static str },
    #[error(
        "a hole of {diameter_mm} mm cannot be cut by {cutter}; hint: its own diameter up to twice that, {least_mm} .. {most_mm} mm"
    )]
    Bore { diameter_mm: f64, cutter: String, least_mm: f64, most_mm: f64 },
    #[error(
        "it goes {depth_mm:.3} mm deep, the blank and what may be cut under it are {most_mm:.3} mm; hint: a smaller depth_mm or through_mm, or a fixture with a board to cut into (sacrificial_mm)"
    )]
    Deep { depth_mm: f64, most_mm: f64 },
    #[error(
        "the slot of {cutter} takes {needed_mm:.3} mm around the tile and tabs need metal past it, margin_mm is {margin_mm}; hint: more margin_mm, a thinner cutter, or tabs = 0 where the blank is held all over"
    )]
    Slot { cutter: String, needed_mm: f64, margin_mm: f64 },
    #[error(
        "{tabs} tabs of {width_mm} mm with the cutter's way around them take {needed_mm:.3} mm of a side of {side_mm:.3} mm; hint: fewer tabs, or a smaller tab_width_mm"
    )]
    Tabs { tabs: u32, width_mm: f64, needed_mm: f64, side_mm: f64 },
    #[error(
        "tabs of {height_mm} mm are no lower than the cut of {depth_mm:.3} mm is deep; hint: a smaller tab_height_mm, or no cut-out"
    )]
    TabHeight { height_mm: f64, depth_mm: f64 },
    #[error(
        "the mark \"{text}\" with its cutter takes {needed_mm:.3} mm, there are {room_mm:.3} mm {place}; hint: a smaller height_mm, a finer cutter or more margin_mm"
    )]
    Mark { text: String, needed_mm: f64, room_mm: f64, place: &'static str },
    #[error(transparent)]
    Compensation(#[from] compensation::Error),
    #[error(transparent)]
    Surface(#[from] surface::Error),
}

impl Site<'_> {
    /// Deepest point below the tile's highest, in mm, as a negative number.
    pub(crate) fn bottom_mm(&self) -> f64 {
        self.surface.bottom_mm() - self.surface.top_mm()
    }

    /// The site as what all controllers of a job have in common sees it: the coarsest grid and the tightest budget.
    fn common(&self) -> Self {
        Site { unit_mm: self.apart_mm, budget: self.tightest, ..*self }
    }

    /// How many of its units make one of the coarsest grid.
    fn times(&self) -> i32 {
        ((self.apart_mm / self.unit_mm).round() as i32).max(1)
    }

    /// Refuses what no path could be planned on. `reach_mm` is how far moves go beyond the tile.
    fn validate(&self, reach_mm: f64) -> Result<(), Error> {
        let numbers = [
            ("the controller's grid", self.unit_mm, self.unit_mm > 0.0, "above 0"),
            ("margin_mm", self.margin_mm, self.margin_mm >= 0.0, "0 or more"),
            ("top_allowance_mm", self.top_allowance_mm, self.top_allowance_mm >= 0.0, "0 or more"),
            ("clearance_mm", self.clearance_mm, self.clearance_mm > 0.0, "above 0"),
            ("z_zero_mm", self.z_zero_mm, true, "a number"),
            ("origin_mm", self.origin_mm[0] + self.origin_mm[1], true, "two numbers"),
        ];
        for (name, value, holds, wanted) in numbers {
            if !(value.is_finite() && holds) {
                return Err(Error::Number { name, value, wanted });
            }
        }
        let lattice = self.surface.lattice();
        let across = lattice.width_mm.max(lattice.height_mm) + reach_mm;
        let up = self.top_allowance_mm + self.clearance_mm + self.z_zero_mm.abs() - self.bottom_mm();
        let farthest_mm =
            across.max(up) + self.origin_mm[0].abs().max(self.origin_mm[1].abs()) + 2.0 * self.unit_mm;
        let limit_mm = f64::from(i32::MAX) * self.unit_mm;
        if farthest_mm.is_nan() || farthest_mm >= limit_mm {
            return Err(Error::Grid { reach_mm: farthest_mm, unit_mm: self.unit_mm, limit_mm });
        }
        Ok(())
    }

    /// A place of the tile's frame on the nearest point of the controller's grid.
    fn nearest(&self, xy_mm: [f64; 2], z_mm: f64) -> GridPoint {
        let units = |mm: f64| (mm / self.unit_mm).round() as i32;
        [units(xy_mm[0]), units(xy_mm[1]), self.unit_above(z_mm)]
    }

    /// A height of the tile's frame in units of the program's, not yet rounded.
    fn units(&self, z_mm: f64) -> f64 {
        (z_mm - self.z_zero_mm) / self.unit_mm
    }

    /// The lowest whole unit at or above a height of the tile's frame. A height that is a whole number of
    /// units but for the noise of the division stays where it is.
    fn unit_above(&self, z_mm: f64) -> i32 {
        let units = self.units(z_mm);
        let near = units.round();
        if (units - near).abs() < 1e-6 { near as i32 } else { units.ceil() as i32 }
    }
}
