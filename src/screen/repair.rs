//! The areas of facets brought back where cells are stitched to different neighbours.
//!
//! Raising plane i changes the areas by J = -(Laplacian of the edges within cells) + (Laplacian of the seams):
//! inside a cell the lower plane is the surface, across a seam the higher one. J is not definite, and some of
//! its eigenvalues lie near zero: plain Newton steps diverge, and what they would do is not local. So each
//! sweep takes a part of the way towards the areas, and finds each cell's part of it from the cell and those
//! around it alone, as the damped least squares of the exact J.

use rayon::prelude::*;

use super::damped::{Iterates, Sparse};
use super::owned::{Coupling, Owner};
use super::pieces::Planes;
use super::power::Diagram;
use super::{Cell, CellRange, Error, Facet, Profile};
use crate::progress::Progress;

/// Facets with less than this part of their area, which another cell covers, have no say in J: they are
/// first lowered until they have the other part.
const LOST: f64 = 0.1;
const KEPT: f64 = 0.5;
/// ... by at most this part of the cell's width.
const MOST_LOWERED: f64 = 0.025;
/// The damping as a part of the mean stiffness. Less reaches further than the cells around, more leaves more.
const DAMPING: f64 = 1.0 / 150.0;

/// Most that the bases of two neighbours may be apart where they meet, as a part of the cell's width.
const MOST_APART: f64 = 0.025;

/// Gradient of the base of a cell: that of its facets on the whole.
fn mean_gradient(cell: &Cell) -> [f64; 2] {
    let area: f64 = cell.facets.iter().map(|facet| facet.area_mm2).sum();
    [0, 1].map(|axis| cell.facets.iter().map(|f| f.gradient[axis] * f.area_mm2).sum::<f64>() / area)
}

/// Cells around one that it depends on: one for uncovering, and for each sweep one whose step counts and
/// one more for the areas there.
pub(super) fn rings(sweeps: usize) -> i32 {
    if sweeps == 0 { 0 } else { 1 + 2 * sweeps as i32 }
}

/// Cells of a rectangle, by row, then column, on their way to their areas.
pub(super) struct Sheet<'a> {
    pub extent: CellRange,
    pub cells: Vec<Cell>,
    pub profile: Profile,
    pub cell_mm: f64,
    /// Columns and rows of the screen.
    pub screen: (usize, usize),
    pub progress: &'a dyn Progress,
}

/// One cell's areas and what they depend on, and the cells that the couplings name.
struct Owned {
    areas: Vec<f64>,
    couplings: Vec<Coupling>,
    around: Vec<(i32, i32)>,
}

#[derive(Default)]
struct Scratch {
    matrix: Sparse,
    iterates: Iterates,
    wanted: Vec<f64>,
}

impl Sheet<'_> {
    /// Repairs the cells of `target`: `extent` must reach as far around as [`rings`] say and the screen goes.
    /// What becomes of a cell depends on those cells only, not on `target`.
    pub fn repair(&mut self, target: CellRange, sweeps: usize) -> Result<(), Error> {
        if sweeps == 0 {
            return Ok(());
        }
        let around = self.around(target, 2 * sweeps);
        self.refuse_steps(around)?;
        self.uncover(around)?;
        let mut start = vec![Vec::new(); self.cells.len()];
        for sweep in 0..sweeps {
            // The last two take aim at the areas themselves.
            let way = ((sweep + 1) as f64 / sweeps.saturating_sub(1).max(1) as f64).min(1.0);
            self.sweep(self.around(target, 2 * (sweeps - 1 - sweep)), way, &mut start)?;
        }
        Ok(())
    }

    fn around(&self, target: CellRange, rings: usize) -> CellRange {
        target.grown(rings as i32).within(self.screen.0, self.screen.1)
    }

    /// Refuses cells whose bases do not meet: one then covers much of the other, and the derivative of what is left
    /// says little of what to do.
    fn refuse_steps(&self, range: CellRange) -> Result<(), Error> {
        let most_mm = MOST_APART * self.cell_mm;
        for (column, row) in (range.r0..range.r1).flat_map(|r| (range.c0..range.c1).map(move |c| (c, r))) {
            for (dc, dr) in [(1, 0), (0, 1)] {
                let (next_column, next_row) = (column + dc, row + dr);
                let (Some(cell), Some(next)) = (self.cell(column, row), self.cell(next_column, next_row))
                else {
                    continue;
                };
                // Half a cell along each base.
                let axis = dr as usize;
                let climb = 0.5 * self.cell_mm * (mean_gradient(cell)[axis] + mean_gradient(next)[axis]);
                let step_mm = (next.elevation_mm - cell.elevation_mm - climb).abs();
                if step_mm > most_mm {
                    return Err(Error::BasesApart { column, row, next_column, next_row, step_mm, most_mm });
                }
            }
        }
        Ok(())
    }

    fn uncover(&mut self, range: CellRange) -> Result<(), Error> {
        let mut lowered = Vec::new();
        for row in range.r0..range.r1 {
            self.go_on()?;
            let of_row: Vec<Vec<f64>> = (range.c0..range.c1)
                .into_par_iter()
                .map_init(Diagram::default, |diagram, column| {
                    let wanted: Vec<f64> = self.facets(column, row).iter().map(|f| f.area_mm2).collect();
                    self.owner(diagram, column, row).map_or_else(Vec::new, |(mut owner, _)| {
                        owner.uncover(&wanted, LOST, KEPT, MOST_LOWERED * self.cell_mm)
                    })
                })
                .collect();
            lowered.extend((range.c0..range.c1).zip(of_row).map(|(column, by)| (column, row, by)));
        }
        for (column, row, by) in lowered {
            self.raise(column, row, by.into_iter().map(|by| -by));
        }
        Ok(())
    }

    /// All cells of a range at once, from the heights before: `way` of the way from the areas at the start
    /// to those wanted.
    fn sweep(&mut self, range: CellRange, way: f64, start: &mut [Vec<f64>]) -> Result<(), Error> {
        let known = self.around(range, 1);
        let mut rows: Vec<(i32, Vec<Owned>)> = Vec::new();
        let mut steps = Vec::new();
        for row in range.r0..range.r1 {
            rows.retain(|(r, _)| *r >= row - 1);
            let first = rows.last().map_or(known.r0.max(row - 1), |(last, _)| last + 1);
            for r in first..(row + 2).min(known.r1) {
                self.go_on()?;
                let owned: Vec<Owned> = (known.c0..known.c1)
                    .into_par_iter()
                    .map_init(Diagram::default, |diagram, column| self.owned(diagram, column, r))
                    .collect();
                for (column, owned) in (known.c0..known.c1).zip(&owned) {
                    let start = &mut start[self.at(column, r)];
                    if start.is_empty() {
                        start.clone_from(&owned.areas);
                    }
                }
                rows.push((r, owned));
            }
            let start = &*start;
            let of_row: Vec<Vec<f64>> = (range.c0..range.c1)
                .into_par_iter()
                .map_init(Scratch::default, |scratch, column| {
                    self.step(scratch, &rows, known.c0, (column, row), way, start)
                })
                .collect();
            steps.extend((range.c0..range.c1).zip(of_row).map(|(column, step)| (column, row, step)));
        }
        for (column, row, step) in steps {
            self.raise(column, row, step.into_iter());
        }
        Ok(())
    }

    /// By how much the planes of a cell rise, as bumps: its part of the step of the cells around it.
    fn step(
        &self,
        scratch: &mut Scratch,
        rows: &[(i32, Vec<Owned>)],
        first_column: i32,
        (column, row): (i32, i32),
        way: f64,
        start: &[Vec<f64>],
    ) -> Vec<f64> {
        let known = |c: i32, r: i32| {
            let of_row = &rows.iter().find(|(known, _)| *known == r)?.1;
            of_row.get(usize::try_from(c - first_column).ok()?)
        };
        let mut patch: Vec<((i32, i32), &Owned, usize)> = Vec::new();
        let (mut unknowns, mut own) = (0, 0..0);
        for (c, r) in (row - 1..=row + 1).flat_map(|r| (column - 1..=column + 1).map(move |c| (c, r))) {
            let Some(owned) = known(c, r) else { continue };
            patch.push(((c, r), owned, unknowns));
            let first = unknowns;
            unknowns += owned.areas.len();
            if (c, r) == (column, row) {
                own = first..unknowns;
            }
        }
        let Scratch { matrix, iterates, wanted, .. } = scratch;
        matrix.clear();
        wanted.clear();
        for ((c, r), owned, _) in &patch {
            let places: Vec<Option<usize>> = owned
                .around
                .iter()
                .map(|cell| patch.iter().find(|(place, ..)| place == cell).map(|(_, _, first)| *first))
                .collect();
            let mut couplings = owned.couplings.iter().peekable();
            let goal = self.facets(*c, *r).iter().zip(&start[self.at(*c, *r)]);
            for (plane, (area, (facet, start))) in owned.areas.iter().zip(goal).enumerate() {
                let mut sum = 0.0;
                while let Some(coupling) = couplings.next_if(|coupling| coupling.plane as usize == plane) {
                    sum += coupling.mm2_per_mm;
                    if let Some(first) = places[coupling.cell as usize] {
                        matrix.entry(first + coupling.other as usize, coupling.mm2_per_mm);
                    }
                }
                matrix.end_row(-sum);
                wanted.push(start + way * (facet.area_mm2 - start) - area);
            }
        }
        let damping = DAMPING * matrix.stiffness();
        matrix.solve(wanted, damping, iterates)[own].to_vec()
    }

    fn owned(&self, diagram: &mut Diagram, column: i32, row: i32) -> Owned {
        let Some((mut owner, around)) = self.owner(diagram, column, row) else {
            return Owned { areas: Vec::new(), couplings: Vec::new(), around: Vec::new() };
        };
        let (areas, couplings) = owner.areas_and_couplings();
        Owned { areas, couplings, around }
    }

    /// A cell among those around it, and their columns and rows, its own first.
    fn owner(&self, diagram: &mut Diagram, column: i32, row: i32) -> Option<(Owner, Vec<(i32, i32)>)> {
        let datum_mm = self.cell(column, row)?.elevation_mm;
        let around: Vec<(i32, i32)> = std::iter::once((0, 0))
            .chain((-1..=1).flat_map(|dr| (-1..=1).map(move |dc| (dc, dr))).filter(|&o| o != (0, 0)))
            .map(|(dc, dr)| (column + dc, row + dr))
            .filter(|&(c, r)| self.extent.contains(c, r))
            .collect();
        let planes: Vec<Planes> = around
            .iter()
            .filter_map(|&(c, r)| {
                let from = [f64::from(c - column), f64::from(r - row)].map(|cells| cells * self.cell_mm);
                Some(Planes::of(self.cell(c, r)?, self.profile, from, datum_mm))
            })
            .collect();
        let there = |dc: i32, dr: i32| self.extent.contains(column + dc, row + dr);
        Some((Owner::new(diagram, &planes, self.cell_mm, there)?, around))
    }

    fn raise(&mut self, column: i32, row: i32, by: impl Iterator<Item = f64>) {
        let (at, sign) = (self.at(column, row), self.profile.sign());
        for (facet, by) in self.cells[at].facets.iter_mut().zip(by) {
            facet.offset_mm += sign * by;
        }
    }

    fn at(&self, column: i32, row: i32) -> usize {
        (row - self.extent.r0) as usize * self.extent.columns() + (column - self.extent.c0) as usize
    }

    fn cell(&self, column: i32, row: i32) -> Option<&Cell> {
        self.extent.contains(column, row).then(|| &self.cells[self.at(column, row)])
    }

    fn facets(&self, column: i32, row: i32) -> &[Facet] {
        self.cell(column, row).map_or(&[], |cell| &cell.facets)
    }

    fn go_on(&self) -> Result<(), Error> {
        if self.progress.interrupted() { Err(Error::Interrupted) } else { Ok(()) }
    }
}
