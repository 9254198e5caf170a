//! What stitching does to the areas of the facets.

use rayon::prelude::*;

use super::owned::Owner;
use super::power::Diagram;
use super::rows::Rows;
use super::{Cell, Design, Frame};

/// Relative errors of the projected areas of the core's facets, once neighbours' planes have moved
/// the borders of the cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AreaError {
    pub worst: f64,
    pub rms: f64,
    /// Facets of which nothing is on the surface.
    pub lost: usize,
}

/// Measures stitched cells as they go by, exactly: what of each facet is on the surface.
pub struct Stitching {
    frame: Frame,
    rows: Rows,
    worst: f64,
    squares: f64,
    lost: usize,
    facets: usize,
}

impl Design {
    /// How far each facet of the core is from the area that it was given, as a part of that, by cells in
    /// their order: on the surface as it is, with steps or stitched.
    pub fn area_errors(&self) -> Vec<f64> {
        let mut stitching = Stitching::new(&self.frame());
        let mut errors: Vec<f64> = self.cells.iter().flat_map(|cell| stitching.errors_with(cell)).collect();
        errors.extend(stitching.errors_at_the_end());
        errors
    }
}

impl Stitching {
    pub fn new(frame: &Frame) -> Stitching {
        Stitching { frame: *frame, rows: Rows::new(frame), worst: 0.0, squares: 0.0, lost: 0, facets: 0 }
    }

    /// Takes the next cell, by row, then column, the ring of a stitched design included.
    pub fn push(&mut self, cell: &Cell) {
        let errors = self.errors_with(cell);
        self.count(&errors);
    }

    /// The errors of all.
    pub fn finish(mut self) -> AreaError {
        let errors = self.errors_at_the_end();
        self.count(&errors);
        let rms = (self.squares / self.facets.max(1) as f64).sqrt();
        AreaError { worst: self.worst, rms, lost: self.lost }
    }

    fn count(&mut self, errors: &[f64]) {
        for error in errors {
            self.worst = self.worst.max(error.abs());
            self.squares += error * error;
            // None of its area is an error of all of it.
            self.lost += usize::from(*error <= -1.0);
        }
        self.facets += errors.len();
    }

    fn errors_with(&mut self, cell: &Cell) -> Vec<f64> {
        self.rows.push(cell).map_or_else(Vec::new, |row| self.errors_of(row))
    }

    fn errors_at_the_end(&self) -> Vec<f64> {
        self.rows.last().map_or_else(Vec::new, |row| self.errors_of(row))
    }

    fn errors_of(&self, row: i32) -> Vec<f64> {
        let columns = self.frame.core.c0..self.frame.core.c1;
        let errors: Vec<Vec<f64>> = columns
            .into_par_iter()
            .map_init(Diagram::default, |diagram, column| self.errors(diagram, column, row))
            .collect();
        errors.concat()
    }

    fn errors(&self, diagram: &mut Diagram, column: i32, row: i32) -> Vec<f64> {
        let Some(cell) = self.rows.cell(column, row) else { return Vec::new() };
        let planes = self.rows.planes(column, row);
        // Without neighbours a cell ends at its own square.
        let there = |dc: i32, dr: i32| planes.len() > 1 && self.rows.cell(column + dc, row + dr).is_some();
        let owner = Owner::new(diagram, &planes, self.frame.cell_mm, there);
        let areas = owner.map_or_else(Vec::new, |mut owner| owner.areas());
        cell.facets.iter().zip(areas).map(|(facet, area)| area / facet.area_mm2 - 1.0).collect()
    }
}
