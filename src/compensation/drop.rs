//! The exact drop of a cutter on planar faces, where samples alone would let it fall too far.
//!
//! Samples miss what stands between them: on a ridge or a step the true surface is higher than
//! any of them, and a position from samples gouges by up to some um. Here the cutter is dropped on
//! the faces themselves, in f64, at every position that its bound says a face could raise.

use super::meridian::Meridian;
use super::touch::Face;
use super::{Profile, RowTarget};
use crate::grid::Heights;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Rows that are lifted together.
const ROWS: usize = 32;

/// Positions of a row that are compared with a face at once, by many, by few, before each is by itself.
const LONG_RUN: usize = 32;
const RUN: usize = 8;

/// Cells of the index to a cutter's radius.
const CELLS: f64 = 2.0;

/// Cells of the index at most; more positions than faces would only look at empty ones.
const MOST_CELLS: f64 = 4e6;

/// Faces over all cells at most, 4 bytes each.
const MOST_MEMBERS: usize = 1 << 25;

/// Raises cutter locations on samples to the exact drop on convex faces: `outlines_mm` are their
/// corners, counter-clockwise seen from above, in the frame of the samples and with their datum.
/// Row k of `cl` stands at row `cl.window.row + k every` of the samples.
///
/// What comes out is the higher of the two: never below the drop on these faces by more than
/// the rounding to f32, and nowhere above what it was where that was higher.
pub fn lift(cl: &mut Heights, every: usize, profile: &Profile, outlines_mm: &[Vec<[f64; 3]>]) {
    let window = cl.window;
    let step_mm = profile.step_mm();
    if window.columns == 0 {
        return;
    }
    let faces = Faces::new(outlines_mm, profile);
    cl.z_mm.par_chunks_mut(ROWS * window.columns).enumerate().for_each(|(chunk, z_mm)| {
        for (k, z_mm) in z_mm.chunks_exact_mut(window.columns).enumerate() {
            let row = window.row + ((chunk * ROWS + k) * every) as i64;
            let target = RowTarget {
                x0_mm: (window.column as f64 + 0.5) * step_mm,
                y_mm: (row as f64 + 0.5) * step_mm,
                count: window.columns,
            };
            faces.lift_row(&target, step_mm, z_mm);
        }
    });
}

/// Convex faces that one cutter may touch, found by place.
#[derive(Debug)]
pub struct Faces<'a> {
    meridian: Meridian,
    faces: Vec<Face<'a>>,
    low_mm: [f64; 2],
    cell_mm: f64,
    cells: [usize; 2],
    /// Where each cell's faces begin in `members`, row by row, and where the last one's end.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl<'a> Faces<'a> {
    /// Outlines as [`lift`] takes them.
    pub fn new(outlines_mm: &'a [Vec<[f64; 3]>], profile: &Profile) -> Faces<'a> {
        let meridian = Meridian::new(profile);
        let faces: Vec<Face> =
            outlines_mm.iter().filter_map(|outline| Face::new(outline, &meridian)).collect();
        let reach_mm = profile.radius_mm();
        let extreme = |axis: usize, sign: f64| {
            let ends = faces.iter().map(|f| if sign < 0.0 { -f.low[axis] } else { f.high[axis] });
            sign * (ends.fold(f64::NEG_INFINITY, f64::max) + reach_mm)
        };
        let mut all = Faces {
            meridian,
            faces: Vec::new(),
            low_mm: [extreme(0, -1.0), extreme(1, -1.0)],
            cell_mm: reach_mm / CELLS,
            cells: [0; 2],
            starts: vec![0],
            members: Vec::new(),
        };
        if faces.is_empty() {
            return all;
        }
        let size_mm = [0, 1].map(|axis| extreme(axis, 1.0) - all.low_mm[axis]);
        all.cell_mm = all.cell_mm.max((size_mm[0] * size_mm[1] / MOST_CELLS).sqrt());
        loop {
            all.cells = size_mm.map(|mm| (mm / all.cell_mm).floor() as usize + 1);
            let held: usize =
                faces.iter().map(|face| all.span(face).map(|r| r.count()).iter().product::<usize>()).sum();
            // Long slivers have large boxes.
            if held <= MOST_MEMBERS || all.cells == [1, 1] {
                break;
            }
            all.cell_mm *= 2.0;
        }
        // Counted first, so that the index is two flat lists.
        let mut counts = vec![0u32; all.cells[0] * all.cells[1] + 1];
        faces.iter().for_each(|face| all.each_cell(face, |cell| counts[cell + 1] += 1));
        for cell in 1..counts.len() {
            counts[cell] += counts[cell - 1];
        }
        let mut next = counts.clone();
        let mut members = vec![0u32; next[next.len() - 1] as usize];
        for (nth, face) in faces.iter().enumerate() {
            all.each_cell(face, |cell| {
                members[next[cell] as usize] = nth as u32;
                next[cell] += 1;
            });
        }
        Faces { faces, starts: counts, members, ..all }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The columns and rows of cells from which a cutter can touch a face.
    fn span(&self, face: &Face) -> [RangeInclusive<usize>; 2] {
        let reach_mm = self.meridian.reach_mm();
        [0, 1].map(|axis| {
            let cell = |mm: f64| ((mm - self.low_mm[axis]) / self.cell_mm).floor().max(0.0) as usize;
            let last = self.cells[axis] - 1;
            cell(face.low[axis] - reach_mm).min(last)..=cell(face.high[axis] + reach_mm).min(last)
        })
    }

    fn each_cell(&self, face: &Face, mut tell: impl FnMut(usize)) {
        let [columns, rows] = self.span(face);
        for row in rows {
            for column in columns.clone() {
                tell(row * self.cells[0] + column);
            }
        }
    }

    /// Place of a coordinate among the cells of an axis; None outside.
    fn cell(&self, axis: usize, mm: f64) -> Option<usize> {
        let at = ((mm - self.low_mm[axis]) / self.cell_mm).floor();
        (at >= 0.0 && at < self.cells[axis] as f64).then_some(at as usize)
    }

    fn at(&self, column: usize, row: usize) -> &[u32] {
        let cell = row * self.cells[0] + column;
        &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Raises the cutter locations at x0_mm + i pitch_mm of one row to the exact drop.
    pub fn lift_row(&self, target: &RowTarget, pitch_mm: f64, z_mm: &mut [f32]) {
        let Some(row) = self.cell(1, target.y_mm) else { return };
        let count = z_mm.len().min(target.count);
        let x_mm = |i: usize| target.x0_mm + i as f64 * pitch_mm;
        let (mut now, mut near) = (Vec::new(), Vec::new());
        let mut i = 0;
        while i < count {
            let Some(column) = self.cell(0, x_mm(i)) else {
                i += 1;
                continue;
            };
            let end_mm = self.low_mm[0] + (column + 1) as f64 * self.cell_mm;
            let end = (((end_mm - target.x0_mm) / pitch_mm).ceil() as usize).clamp(i + 1, count);
            let members = self.at(column, row);
            for long in (i..end).step_by(LONG_RUN) {
                let z_mm = &mut z_mm[long..(long + LONG_RUN).min(end)];
                now.clear();
                now.extend(z_mm.iter().map(|z| if z.is_nan() { f64::NEG_INFINITY } else { f64::from(*z) }));
                near.clear();
                near.extend(
                    members
                        .iter()
                        .map(|&nth| &self.faces[nth as usize])
                        .filter(|face| face.may_raise(&self.meridian, target.y_mm, |k| x_mm(long + k), &now)),
                );
                for (run, now) in now.chunks_mut(RUN).enumerate() {
                    let x_mm = |k: usize| x_mm(long + run * RUN + k);
                    for face in &near {
                        if face.may_raise(&self.meridian, target.y_mm, x_mm, now) {
                            for (k, now) in now.iter_mut().enumerate() {
                                *now = face.drop_at([x_mm(k), target.y_mm], &self.meridian, *now);
                            }
                        }
                    }
                }
                for (z_mm, now) in z_mm.iter_mut().zip(&now) {
                    if *now > f64::from(*z_mm) || z_mm.is_nan() && now.is_finite() {
                        *z_mm = *now as f32;
                    }
                }
            }
            i = end;
        }
    }

    /// The exact drop at one place [x, y], or `z_mm` where that is higher; NaN is no location.
    pub fn lift_point(&self, place_mm: [f64; 2], z_mm: f64) -> f64 {
        let mut now = if z_mm.is_nan() { f64::NEG_INFINITY } else { z_mm };
        if let (Some(column), Some(row)) = (self.cell(0, place_mm[0]), self.cell(1, place_mm[1])) {
            for &nth in self.at(column, row) {
                now = self.faces[nth as usize].drop_at(place_mm, &self.meridian, now);
            }
        }
        if now.is_finite() { now } else { z_mm }
    }
}
