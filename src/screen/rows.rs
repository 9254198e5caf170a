//! Rows of cells that go by, with those a row needs beside it.

use std::collections::VecDeque;

use super::pieces::Planes;
use super::{Cell, Frame, Seam};

/// The last rows of a design that comes cell by cell, by row, then column: with vertical steps the
/// last one; stitched, also its neighbours.
pub(super) struct Rows {
    frame: Frame,
    rows: VecDeque<Vec<Cell>>,
    coming: Vec<Cell>,
}

impl Rows {
    pub fn new(frame: &Frame) -> Rows {
        Rows { frame: *frame, rows: VecDeque::new(), coming: Vec::new() }
    }

    fn stitched(&self) -> bool {
        self.frame.seam == Seam::Stitched
    }

    /// Takes the next cell; the row that has all it needs with this one.
    pub fn push(&mut self, cell: &Cell) -> Option<i32> {
        self.coming.push(cell.clone());
        if self.coming.len() < self.frame.extent.columns() {
            return None;
        }
        self.rows.push_back(std::mem::take(&mut self.coming));
        if self.rows.len() > if self.stitched() { 3 } else { 1 } {
            self.rows.pop_front();
        }
        self.core_row(self.rows.len().checked_sub(if self.stitched() { 2 } else { 1 })?)
    }

    /// The row that only the end of the design completes.
    pub fn last(&self) -> Option<i32> {
        self.core_row(self.rows.len().checked_sub(1)?).filter(|_| self.stitched())
    }

    fn core_row(&self, at: usize) -> Option<i32> {
        let row = self.rows.get(at)?.first()?.row;
        (self.frame.core.r0..self.frame.core.r1).contains(&row).then_some(row)
    }

    /// A cell of the rows that are at hand.
    pub fn cell(&self, column: i32, row: i32) -> Option<&Cell> {
        let first = self.rows.front()?.first()?;
        let at = usize::try_from(row - first.row).ok()?;
        self.rows.get(at)?.get(usize::try_from(column - first.column).ok()?)
    }

    /// The planes that shape a cell's surface, its own first, in its own frame and over its own elevation.
    pub fn planes(&self, column: i32, row: i32) -> Vec<Planes> {
        let Frame { cell_mm, profile, .. } = self.frame;
        let reach = i32::from(self.stitched());
        let datum_mm = self.cell(column, row).map_or(0.0, |cell| cell.elevation_mm);
        let around = (-reach..=reach).flat_map(|dr| (-reach..=reach).map(move |dc| (dc, dr)));
        std::iter::once((0, 0))
            .chain(around.filter(|&offset| offset != (0, 0)))
            .filter_map(|(dc, dr)| {
                let from = [f64::from(dc) * cell_mm, f64::from(dr) * cell_mm];
                Some(Planes::of(self.cell(column + dc, row + dr)?, profile, from, datum_mm))
            })
            .collect()
    }
}
