//! The exact drop of a cutter on planar faces, where samples alone would let it fall too far.
//!
//! Samples miss what stands between them: on a ridge or a step the true surface is higher than
//! any of them, and a position from samples gouges by up to some um. Here the cutter is dropped on
//! the faces themselves, in f64: each row meets a face along one stretch and an edge along another, and only
//! there are they looked at.

use super::facets::Facets;
use super::meridian::Meridian;
use super::ridges::{down, up};
use super::touch::{Band, Rest, Stretch};
use super::{Profile, RowTarget};
use crate::grid::Window;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Rows that are lifted together.
const ROWS: usize = 32;

/// Sides of a cell of the index in those of the mean stretch of axis places that one face or edge holds.
const CELL: [f64; 2] = [4.0, 1.0];

/// Cells of the index at most.
const MOST_CELLS: f64 = 4e6;

/// Faces and edges over all cells at most, 12 bytes each.
const MOST_MEMBERS: usize = 1 << 25;

/// Raises cutter locations on samples to the exact drop on convex faces: `outlines_mm` are their
/// corners, counter-clockwise seen from above, in the frame of the samples and with their datum.
/// Row k of `z_mm` stands at row `window.row + k every` of the samples, in the columns of `window`.
///
/// What comes out is the higher of the two: never below the drop on these faces by more than
/// the rounding to f32, and nowhere above what it was where that was higher.
pub fn lift(
    window: Window,
    z_mm: &mut [f32],
    every: usize,
    profile: &Profile,
    outlines_mm: &[Vec<[f64; 3]>],
) {
    let step_mm = profile.step_mm();
    if window.columns == 0 {
        return;
    }
    let facets = Facets::new(outlines_mm);
    let faces = Faces::new(&facets, profile);
    z_mm.par_chunks_mut(ROWS * window.columns).enumerate().for_each(|(chunk, z_mm)| {
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

/// Faces and edges as one cutter meets them, found by place.
#[derive(Debug)]
pub struct Faces<'a> {
    facets: &'a Facets,
    meridian: Meridian,
    rests: Vec<Rest>,
    bands: Vec<Band>,
    low_mm: [f64; 2],
    cell_mm: [f64; 2],
    cells: [usize; 2],
    /// Where each cell's members begin, row by row, and where the last one's end.
    starts: Vec<u32>,
    members: Vec<Member>,
}

/// A face or, numbered from their count on, an edge, and the rows between which it holds an axis.
#[derive(Clone, Copy, Debug)]
struct Member {
    low_mm: f32,
    high_mm: f32,
    nth: u32,
}

/// Lowest and highest place in x and y.
type Places = [[f32; 2]; 2];

impl<'a> Faces<'a> {
    pub fn new(facets: &'a Facets, profile: &Profile) -> Faces<'a> {
        let meridian = Meridian::new(profile);
        let rests: Vec<Rest> = facets.faces.par_iter().map(|face| Rest::new(face, &meridian)).collect();
        let bands: Vec<Band> =
            facets.ridges.par_iter().map(|ridge| Band::new(ridge, facets, &meridian)).collect();
        let mut all = Faces {
            facets,
            meridian,
            rests,
            bands,
            low_mm: [0.0; 2],
            cell_mm: [1.0; 2],
            cells: [0; 2],
            starts: vec![0],
            members: Vec::new(),
        };
        all.index();
        all
    }

    /// Where the axis may stand on each face and edge.
    fn places(&self) -> Vec<Places> {
        let faces = self.facets.faces.par_iter().zip(&self.rests);
        let faces = faces.map(|(face, rest)| rest.places(self.facets.corners_of(face)));
        let ridges = self.facets.ridges.par_iter().zip(&self.bands);
        let all = faces.chain(ridges.map(|(ridge, band)| band.places(ridge, self.facets)));
        all.map(|places| places.map(|[low, high]| [down(low), up(high)])).collect()
    }

    fn index(&mut self) {
        let (mut low_mm, mut high_mm) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut sum_mm = [0.0; 2];
        let all = self.places();
        if all.is_empty() {
            return;
        }
        for places in &all {
            for axis in 0..2 {
                let [low, high] = places[axis].map(f64::from);
                low_mm[axis] = low_mm[axis].min(low);
                high_mm[axis] = high_mm[axis].max(high);
                sum_mm[axis] += high - low;
            }
        }
        let count = all.len() as f64;
        self.low_mm = low_mm;
        let size_mm = [0, 1].map(|axis| high_mm[axis] - low_mm[axis]);
        self.cell_mm = [0, 1].map(|axis| (CELL[axis] * sum_mm[axis] / count).max(1e-6));
        let most = (size_mm[0] / self.cell_mm[0]).max(1.0) * (size_mm[1] / self.cell_mm[1]).max(1.0);
        let coarser = (most / MOST_CELLS).max(1.0).sqrt();
        self.cell_mm = self.cell_mm.map(|mm| mm * coarser);
        // Counted first, so that the index is two flat lists.
        let mut counts = loop {
            self.cells = [0, 1].map(|axis| (size_mm[axis] / self.cell_mm[axis]).floor() as usize + 1);
            let mut counts = vec![0u32; self.cells[0] * self.cells[1] + 1];
            let mut held = 0;
            for places in &all {
                self.each_cell(places, |cell| {
                    counts[cell + 1] = counts[cell + 1].saturating_add(1);
                    held += 1;
                });
            }
            // Long slivers have large boxes.
            if held <= MOST_MEMBERS || self.cells == [1, 1] {
                break counts;
            }
            self.cell_mm = self.cell_mm.map(|mm| 2.0 * mm);
        };
        for cell in 1..counts.len() {
            counts[cell] += counts[cell - 1];
        }
        let mut next = counts.clone();
        let mut members =
            vec![Member { low_mm: 0.0, high_mm: 0.0, nth: 0 }; counts[counts.len() - 1] as usize];
        for (nth, places) in all.iter().enumerate() {
            let [low_mm, high_mm] = places[1];
            let member = Member { low_mm, high_mm, nth: nth as u32 };
            self.each_cell(places, |cell| {
                members[next[cell] as usize] = member;
                next[cell] += 1;
            });
        }
        self.starts = counts;
        self.members = members;
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    fn each_cell(&self, places: &Places, mut tell: impl FnMut(usize)) {
        let [columns, rows]: [RangeInclusive<usize>; 2] = [0, 1].map(|axis| {
            let last = self.cells[axis] - 1;
            let cell = |mm: f32| {
                let at = (f64::from(mm) - self.low_mm[axis]) / self.cell_mm[axis];
                (at as usize).min(last)
            };
            cell(places[axis][0])..=cell(places[axis][1])
        });
        for row in rows {
            for column in columns.clone() {
                tell(row * self.cells[0] + column);
            }
        }
    }

    /// Place of a coordinate among the cells of an axis; None outside.
    fn cell(&self, axis: usize, mm: f64) -> Option<usize> {
        let at = (mm - self.low_mm[axis]) / self.cell_mm[axis];
        (at >= 0.0 && at < self.cells[axis] as f64).then_some(at as usize)
    }

    /// Raises the cutter locations at x0_mm + i pitch_mm of one row to the exact drop.
    pub fn lift_row(&self, target: &RowTarget, pitch_mm: f64, z_mm: &mut [f32]) {
        let Some(row) = self.cell(1, target.y_mm) else { return };
        let count = z_mm.len().min(target.count);
        let (mut x_mm, mut now) = (Vec::new(), Vec::new());
        let at = |i: usize| target.x0_mm + i as f64 * pitch_mm;
        // Positions before the first cell.
        let mut from = ((self.low_mm[0] - target.x0_mm) / pitch_mm).ceil().max(0.0) as usize;
        while from < count {
            let Some(column) = self.cell(0, at(from)) else {
                if at(from) > self.low_mm[0] {
                    return;
                }
                from += 1;
                continue;
            };
            let end_mm = self.low_mm[0] + (column + 1) as f64 * self.cell_mm[0];
            let end = (((end_mm - target.x0_mm) / pitch_mm).ceil() as usize).clamp(from + 1, count);
            x_mm.clear();
            x_mm.extend((from..end).map(at));
            now.clear();
            let z_mm = &mut z_mm[from..end];
            now.extend(z_mm.iter().map(|z| if z.is_nan() { f64::NEG_INFINITY } else { f64::from(*z) }));
            self.raise([column, row], &x_mm, target.y_mm, pitch_mm, &mut now);
            for (z_mm, now) in z_mm.iter_mut().zip(&now) {
                if *now > f64::from(*z_mm) || z_mm.is_nan() && now.is_finite() {
                    *z_mm = *now as f32;
                }
            }
            from = end;
        }
    }

    /// Raises positions of one cell.
    fn raise(&self, [column, row]: [usize; 2], x_mm: &[f64], y_mm: f64, pitch_mm: f64, now: &mut [f64]) {
        let mut stretch = Stretch { x_mm, y_mm, pitch_mm, now };
        let cell = row * self.cells[0] + column;
        let faces = self.facets.faces.len();
        for member in &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
            if y_mm < f64::from(member.low_mm) || y_mm > f64::from(member.high_mm) {
                continue;
            }
            let nth = member.nth as usize;
            if nth < faces {
                let face = &self.facets.faces[nth];
                self.rests[nth].raise(face, self.facets.corners_of(face), &mut stretch);
            } else {
                let nth = nth - faces;
                self.bands[nth].raise(&self.facets.ridges[nth], self.facets, &self.meridian, &mut stretch);
            }
        }
    }

    /// The exact drop at one place [x, y], or `z_mm` where that is higher; NaN is no location.
    pub fn lift_point(&self, place_mm: [f64; 2], z_mm: f64) -> f64 {
        let mut now = [if z_mm.is_nan() { f64::NEG_INFINITY } else { z_mm }];
        if let (Some(column), Some(row)) = (self.cell(0, place_mm[0]), self.cell(1, place_mm[1])) {
            self.raise([column, row], &place_mm[..1], place_mm[1], 1.0, &mut now);
        }
        if now[0].is_finite() { now[0] } else { z_mm }
    }
}
