//! Samples of a designed tile: for each strip of rows the planes that can show there, then row by row.

use rayon::prelude::*;

use super::Designed;
use super::envelope::{Piece, Plane, Rect, along_row};
use crate::grid::{Heights, Window};
use crate::screen::Seam;

/// Rows that share one choice of planes. Strips are counted from row 0 of the part, so that a
/// sample sees the same planes whatever window asked for it.
const STRIP: i64 = 16;

/// The function of one cell near a strip.
struct Shape {
    planes: Vec<Plane>,
    centre: [f64; 2],
    elevation: f64,
}

#[derive(Default)]
struct Scratch {
    shapes: Vec<Shape>,
    spare: Vec<Vec<Plane>>,
    pieces: Vec<Piece>,
    own: Vec<f64>,
    best: Vec<f64>,
}

impl Designed {
    /// Heights at the given x, rising by one step, for the rows of a window.
    pub(super) fn sample(&self, mut xs: Vec<f64>, window: Window, datum_mm: f64) -> Heights {
        let mut heights = Heights::empty(window);
        if window.samples() == 0 {
            return heights;
        }
        for x in &mut xs {
            *x += self.origin_mm[0];
        }
        let runs = self.runs(&xs);
        let mut strips = Vec::new();
        let (mut rest, mut row) = (heights.z_mm.as_mut_slice(), window.row);
        while row < window.row_end() {
            let end = ((row.div_euclid(STRIP) + 1) * STRIP).min(window.row_end());
            let (strip, after) = rest.split_at_mut((end - row) as usize * window.columns);
            strips.push((row, strip));
            (rest, row) = (after, end);
        }
        strips.into_par_iter().for_each_init(Scratch::default, |scratch, (row, strip)| {
            let (xs, runs) = (xs.as_slice(), runs.as_slice());
            pulp::Arch::new().dispatch(move || self.fill_strip(xs, runs, row, strip, datum_mm, scratch));
        });
        heights
    }

    /// Which samples stand in which column of cells: (column, first, one past the last).
    fn runs(&self, xs: &[f64]) -> Vec<(i32, usize, usize)> {
        let mut runs: Vec<(i32, usize, usize)> = Vec::new();
        for (index, &x) in xs.iter().enumerate() {
            let column = self.cell_index(x, 0);
            match runs.last_mut() {
                Some(run) if run.0 == column => run.2 = index + 1,
                _ => runs.push((column, index, index + 1)),
            }
        }
        runs.retain(|run| (self.material.c0..self.material.c1).contains(&run.0));
        runs
    }

    /// Inlined into what is compiled for wide vectors, as what it calls.
    #[inline(always)]
    fn fill_strip(
        &self,
        xs: &[f64],
        runs: &[(i32, usize, usize)],
        first_row: i64,
        strip: &mut [f32],
        datum_mm: f64,
        scratch: &mut Scratch,
    ) {
        let columns = xs.len();
        let anchor = first_row.div_euclid(STRIP) * STRIP;
        let y_of = |row: i64| self.lattice.y_mm(row) + self.origin_mm[1];
        let (y_low, y_high) = (y_of(anchor), y_of(anchor + STRIP - 1));
        let count = strip.len() / columns;
        let mut start = 0;
        while start < count {
            let cell_row = self.cell_index(y_of(first_row + start as i64), 1);
            let mut end = start + 1;
            while end < count && self.cell_index(y_of(first_row + end as i64), 1) == cell_row {
                end += 1;
            }
            let rows = (start..end).map(|row| (row, y_of(first_row + row as i64)));
            for &(column, from, to) in runs {
                if !self.material.contains(column, cell_row) {
                    continue;
                }
                if !self.gather(column, cell_row, y_low, y_high, scratch) {
                    continue;
                }
                for (row, y) in rows.clone() {
                    let out = &mut strip[row * columns + from..row * columns + to];
                    self.fill_row(&xs[from..to], y, out, datum_mm, scratch);
                }
            }
            start = end;
        }
    }

    /// Collects the cells that shape the surface of a cell between two y: itself first, then, where
    /// it is stitched, those neighbours whose function can rise above it there.
    fn gather(&self, column: i32, row: i32, y_low: f64, y_high: f64, scratch: &mut Scratch) -> bool {
        let Some(own) = self.cell(column, row) else { return false };
        scratch.shapes.clear();
        let own_centre = self.centre(column, row);
        let mut planes = scratch.spare.pop().unwrap_or_default();
        own.planes.between(y_low - own_centre[1], y_high - own_centre[1], &mut planes);
        let half = 0.5 * self.design.cell_mm;
        let window = Rect { low: [own_centre[0] - half, y_low], high: [own_centre[0] + half, y_high] };
        let floor = planes
            .iter()
            .flat_map(|p| window.moved([-own_centre[0], -own_centre[1]]).corners().map(|c| p.at(c)))
            .fold(f64::INFINITY, f64::min)
            + own.elevation;
        scratch.shapes.push(Shape { planes, centre: own_centre, elevation: own.elevation });
        if self.design.seam == Seam::Stitched {
            for (dr, dc) in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)] {
                let Some(cell) = self.cell(column + dc, row + dr) else { continue };
                let centre = self.centre(column + dc, row + dr);
                let mut planes = scratch.spare.pop().unwrap_or_default();
                cell.planes.between(y_low - centre[1], y_high - centre[1], &mut planes);
                let corners = window.moved([-centre[0], -centre[1]]).corners();
                let ceiling = planes
                    .iter()
                    .map(|p| corners.iter().map(|&c| p.at(c)).fold(f64::NEG_INFINITY, f64::max))
                    .fold(f64::INFINITY, f64::min)
                    + cell.elevation;
                if planes.is_empty() || ceiling < floor {
                    scratch.spare.push(planes);
                } else {
                    scratch.shapes.push(Shape { planes, centre, elevation: cell.elevation });
                }
            }
        }
        true
    }

    #[inline(always)]
    fn fill_row(&self, xs: &[f64], y: f64, out: &mut [f32], datum_mm: f64, scratch: &mut Scratch) {
        let Scratch { shapes, pieces, own, best, .. } = scratch;
        let sign = self.sign;
        let Some((first, others)) = shapes.split_first() else { return };
        along_row(&first.planes, y - first.centre[1], pieces);
        // Copied, so that nothing that is read can be what is written.
        let (centre, elevation) = (first.centre[0], first.elevation);
        if others.is_empty() {
            self.spans(pieces, xs, centre, |Piece { slope, intercept, .. }, from, to| {
                for (z, x) in out[from..to].iter_mut().zip(&xs[from..to]) {
                    let on = slope * (x - centre) + intercept;
                    *z = (sign * (on + elevation) - datum_mm) as f32;
                }
            });
            return;
        }
        own.resize(xs.len(), 0.0);
        self.spans(pieces, xs, centre, |Piece { slope, intercept, .. }, from, to| {
            for (z, x) in own[from..to].iter_mut().zip(&xs[from..to]) {
                *z = slope * (x - centre) + intercept + elevation;
            }
        });
        best.clone_from(own);
        for shape in others {
            along_row(&shape.planes, y - shape.centre[1], pieces);
            let (centre, elevation) = (shape.centre[0], shape.elevation);
            self.spans(pieces, xs, centre, |Piece { slope, intercept, .. }, from, to| {
                let at = |x: f64| slope * (x - centre) + intercept + elevation;
                // The cell's own function is concave, so over a span it is lowest at an end.
                if at(xs[from]).max(at(xs[to - 1])) <= own[from].min(own[to - 1]) {
                    return;
                }
                for (z, &x) in best[from..to].iter_mut().zip(&xs[from..to]) {
                    *z = z.max(at(x));
                }
            });
        }
        for (z, best) in out.iter_mut().zip(best.iter()) {
            *z = (sign * best - datum_mm) as f32;
        }
    }

    /// The samples of each piece: those at or past its start and before the next one's.
    #[inline(always)]
    fn spans(&self, pieces: &[Piece], xs: &[f64], centre: f64, mut each: impl FnMut(Piece, usize, usize)) {
        let step = self.lattice.step_mm;
        let mut from = 0;
        for (index, piece) in pieces.iter().enumerate() {
            let to = match pieces.get(index + 1) {
                None => xs.len(),
                Some(next) => {
                    let guess = (next.start + centre - xs[0]) / step;
                    let mut to = (guess.max(0.0) as usize).clamp(from, xs.len());
                    while to > from && xs[to - 1] - centre >= next.start {
                        to -= 1;
                    }
                    while to < xs.len() && xs[to] - centre < next.start {
                        to += 1;
                    }
                    to
                }
            };
            if to > from {
                each(*piece, from, to);
                from = to;
            }
            if from == xs.len() {
                return;
            }
        }
    }
}
