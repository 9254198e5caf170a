//! The surface of designed cells: exact planes at the samples, without triangles between.

use std::sync::Arc;

use rayon::prelude::*;

use super::envelope::{Piece, Plane, Planes, Rect, along_row, clip_to};
use super::{Error, Level, Surface, columns_mm, covering, mirrored_columns_mm, reversed};
use crate::grid::{Heights, Lattice, Window};
use crate::screen::{CellRange, Design, Seam};

/// Rows that share one choice of planes. Strips are counted from row 0 of the part, so that a
/// sample sees the same planes whatever window asked for it.
const STRIP: i64 = 16;

/// How near to a border, in cells, a sample counts as standing on it.
const ON_BORDER: f64 = 1e-9;

/// A rectangle cut out of a design. A sample on the border of two cells belongs to the right or
/// upper one; on the outer border of the material to the cell inside.
pub struct Designed {
    pub(super) design: Arc<Design>,
    pub(super) material: CellRange,
    /// Lower left corner of the lattice from the core's lower left corner.
    pub(super) origin_mm: [f64; 2],
    pub(super) lattice: Lattice,
    /// 1 for bumps; -1 for dishes, which are handled as bumps upside down.
    pub(super) sign: f64,
    /// Cells whose planes matter: the material, and around a stitched one the ring next to it.
    carried: CellRange,
    cells: Vec<Option<Cell>>,
    top_mm: f64,
    bottom_mm: f64,
    steepest: [f64; 2],
}

pub(super) struct Cell {
    pub planes: Planes,
    /// Elevation of the cell as a bump: times the sign.
    pub elevation: f64,
}

/// Extremes of one cell's function over the part, as a bump.
struct Extent {
    low: f64,
    high: f64,
    steepest: [f64; 2],
}

impl Designed {
    /// The whole core of a design, nothing around it.
    pub fn whole(design: Arc<Design>, step_mm: f64) -> Result<Designed, Error> {
        let core = design.core;
        let size_mm = [core.columns() as f64 * design.cell_mm, core.rows() as f64 * design.cell_mm];
        Designed::new(design, core, [0.0, 0.0], size_mm, step_mm)
    }

    /// The rectangle of `size_mm` at `origin_mm` from the core's lower left corner. Only the cells
    /// of `material` are there, and windows past the lattice see those of them that lie outside:
    /// the cells of the tile alone for separate blanks, the whole core for one sheet. The ring that
    /// a stitched design carries shapes its neighbours but is not material itself.
    pub fn new(
        design: Arc<Design>,
        material: CellRange,
        origin_mm: [f64; 2],
        size_mm: [f64; 2],
        step_mm: f64,
    ) -> Result<Designed, Error> {
        if !(design.cell_mm > 0.0 && design.cell_mm.is_finite()) {
            return Err(Error::CellSize { cell_mm: design.cell_mm });
        }
        let lattice = covering(size_mm[0], size_mm[1], step_mm)?;
        if design.cell_mm < 2.0 * step_mm {
            let (cell_mm, most_mm) = (design.cell_mm, 0.5 * design.cell_mm);
            return Err(Error::CellBelowStep { cell_mm, step_mm, most_mm });
        }
        let CellRange { c0, r0, c1, r1 } = material;
        let no_cells = Error::NoCells { c0, r0, c1, r1 };
        let stitched = design.seam == Seam::Stitched;
        let ring = i32::from(stitched);
        let carried = CellRange { c0: c0 - ring, r0: r0 - ring, c1: c1 + ring, r1: r1 + ring };
        let mut designed = Designed {
            sign: design.profile.sign(),
            design,
            material,
            origin_mm,
            lattice,
            carried,
            cells: Vec::new(),
            top_mm: f64::NAN,
            bottom_mm: f64::NAN,
            steepest: [0.0; 2],
        };
        let Some(region) = designed.region() else { return Err(no_cells) };
        let extents = designed.prepare(&region)?;
        let mut low = f64::INFINITY;
        let mut high = f64::NEG_INFINITY;
        for extent in extents.iter().flatten() {
            low = low.min(extent.low);
            high = high.max(extent.high);
            for axis in 0..2 {
                designed.steepest[axis] = designed.steepest[axis].max(extent.steepest[axis]);
            }
        }
        if high == f64::NEG_INFINITY {
            return Err(no_cells);
        }
        if stitched {
            low = designed.lowest_stitched();
        }
        let ends = [designed.sign * low, designed.sign * high];
        designed.bottom_mm = ends[0].min(ends[1]);
        designed.top_mm = ends[0].max(ends[1]);
        Ok(designed)
    }

    /// The design this was cut from.
    pub fn design(&self) -> &Arc<Design> {
        &self.design
    }

    /// The cells that are there.
    pub fn material(&self) -> CellRange {
        self.material
    }

    /// Lower left corner of the lattice from the core's lower left corner.
    pub fn origin_mm(&self) -> [f64; 2] {
        self.origin_mm
    }

    /// The part that is both material and lattice, from the core's lower left corner.
    pub(super) fn region(&self) -> Option<Rect> {
        let frame = Rect {
            low: self.origin_mm,
            high: [self.origin_mm[0] + self.lattice.width_mm, self.origin_mm[1] + self.lattice.height_mm],
        };
        frame.intersection(&self.sheet())
    }

    /// All that is material, a tile's neighbours in one sheet too, from the core's lower left corner.
    fn sheet(&self) -> Rect {
        let CellRange { c0, r0, c1, r1 } = self.material;
        Rect { low: self.corner(c0, r0), high: self.corner(c1, r1) }
    }

    fn corner(&self, column: i32, row: i32) -> [f64; 2] {
        let core = self.design.core;
        [f64::from(column - core.c0) * self.design.cell_mm, f64::from(row - core.r0) * self.design.cell_mm]
    }

    /// A cell's centre from the core's lower left corner.
    pub(super) fn centre(&self, column: i32, row: i32) -> [f64; 2] {
        let core = self.design.core;
        [
            (f64::from(column - core.c0) + 0.5) * self.design.cell_mm,
            (f64::from(row - core.r0) + 0.5) * self.design.cell_mm,
        ]
    }

    pub(super) fn cell(&self, column: i32, row: i32) -> Option<&Cell> {
        self.slot(column, row).and_then(|slot| self.cells[slot].as_ref())
    }

    fn slot(&self, column: i32, row: i32) -> Option<usize> {
        self.carried.contains(column, row).then(|| {
            (row - self.carried.r0) as usize * self.carried.columns() + (column - self.carried.c0) as usize
        })
    }

    fn prepare(&mut self, region: &Rect) -> Result<Vec<Option<Extent>>, Error> {
        let half = 0.5 * self.design.cell_mm;
        let reach = if self.design.seam == Seam::Stitched { 3.0 * half } else { half };
        let domain = Rect::square(reach);
        let design = self.design.clone();
        let taken: Vec<_> =
            design.cells.iter().filter_map(|cell| Some((self.slot(cell.column, cell.row)?, cell))).collect();
        let made: Vec<(usize, Cell, Option<Extent>)> = taken
            .par_iter()
            .map(|&(slot, cell)| {
                let (column, row) = (cell.column, cell.row);
                if cell.facets.is_empty() {
                    return Err(Error::NoFacets { column, row });
                }
                let numbers = cell.facets.iter().flat_map(|f| [f.gradient[0], f.gradient[1], f.offset_mm]);
                if !numbers.chain([cell.elevation_mm]).all(f64::is_finite) {
                    return Err(Error::CellNotFinite { column, row });
                }
                let centre = self.centre(column, row);
                let seen = domain.intersection(&region.moved([-centre[0], -centre[1]]));
                let elevation = self.sign * cell.elevation_mm;
                let mut extent: Option<Extent> = None;
                let (mut part, mut scratch) = (Vec::new(), Vec::new());
                let planes = Planes::new(&cell.facets, self.sign, &domain, |plane, polygon| {
                    let Some(seen) = &seen else { return };
                    part.clear();
                    part.extend_from_slice(polygon);
                    clip_to(&mut part, seen, &mut scratch);
                    for &p in &part {
                        let z = plane.at(p) + elevation;
                        let to = extent.get_or_insert(Extent { low: z, high: z, steepest: [0.0; 2] });
                        to.low = to.low.min(z);
                        to.high = to.high.max(z);
                        for axis in 0..2 {
                            to.steepest[axis] = to.steepest[axis].max(plane.gradient[axis].abs());
                        }
                    }
                });
                Ok((slot, Cell { planes, elevation }, extent))
            })
            .collect::<Result<_, Error>>()?;
        let slots = self.carried.columns() * self.carried.rows();
        self.cells = (0..slots).map(|_| None).collect();
        let mut extents: Vec<Option<Extent>> = (0..slots).map(|_| None).collect();
        for (slot, cell, extent) in made {
            self.cells[slot] = Some(cell);
            extents[slot] = extent;
        }
        Ok(extents)
    }

    /// Lowest point of a stitched bump. The surface lies nowhere below a cell's own function, whose
    /// lowest point is a corner; only cells that could go lower than what is found are opened.
    fn lowest_stitched(&self) -> f64 {
        let CellRange { c0, r0, c1, r1 } = self.material;
        let corners = Rect::square(0.5 * self.design.cell_mm).corners();
        let mut bounds = Vec::new();
        for row in r0..r1 {
            for column in c0..c1 {
                let Some(cell) = self.cell(column, row) else { continue };
                let low = cell
                    .planes
                    .all()
                    .iter()
                    .flat_map(|plane| corners.map(|corner| plane.at(corner)))
                    .fold(f64::INFINITY, f64::min);
                bounds.push((low + cell.elevation, column, row));
            }
        }
        bounds.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut lowest = f64::INFINITY;
        for (bound, column, row) in bounds {
            if bound >= lowest {
                break;
            }
            for face in self.faces(column, row) {
                for vertex in face.outline_mm {
                    lowest = lowest.min(self.sign * vertex[2]);
                }
            }
        }
        lowest
    }

    /// Column or row of cells (axis 0 or 1) of a point, and how it belongs there: see the type.
    fn cell_index(&self, position_mm: f64, axis: usize) -> i32 {
        let (core, end) = if axis == 0 {
            (self.design.core.c0, self.material.c1)
        } else {
            (self.design.core.r0, self.material.r1)
        };
        let place = position_mm / self.design.cell_mm + f64::from(core);
        let index = (place + ON_BORDER).floor();
        if index == f64::from(end) && place - index <= ON_BORDER { end - 1 } else { index as i32 }
    }

    /// Heights at the given x, rising by one step, for the rows of a window.
    fn sample(&self, mut xs: Vec<f64>, window: Window, datum_mm: f64) -> Heights {
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
            self.fill_strip(&xs, &runs, row, strip, datum_mm, scratch);
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

    fn fill_row(&self, xs: &[f64], y: f64, out: &mut [f32], datum_mm: f64, scratch: &mut Scratch) {
        let Scratch { shapes, pieces, own, best, .. } = scratch;
        let sign = self.sign;
        let Some((first, others)) = shapes.split_first() else { return };
        along_row(&first.planes, y - first.centre[1], pieces);
        if others.is_empty() {
            self.spans(pieces, xs, first.centre[0], |piece, from, to| {
                for (z, x) in out[from..to].iter_mut().zip(&xs[from..to]) {
                    let on = piece.slope * (x - first.centre[0]) + piece.intercept;
                    *z = (sign * (on + first.elevation) - datum_mm) as f32;
                }
            });
            return;
        }
        own.resize(xs.len(), 0.0);
        self.spans(pieces, xs, first.centre[0], |piece, from, to| {
            for (z, x) in own[from..to].iter_mut().zip(&xs[from..to]) {
                *z = piece.slope * (x - first.centre[0]) + piece.intercept + first.elevation;
            }
        });
        best.clone_from(own);
        for shape in others {
            along_row(&shape.planes, y - shape.centre[1], pieces);
            self.spans(pieces, xs, shape.centre[0], |piece, from, to| {
                let at = |x: f64| piece.slope * (x - shape.centre[0]) + piece.intercept + shape.elevation;
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
    fn spans(&self, pieces: &[Piece], xs: &[f64], centre: f64, mut each: impl FnMut(&Piece, usize, usize)) {
        let step = self.lattice.step_mm;
        let mut from = 0;
        for (index, piece) in pieces.iter().enumerate() {
            let to = match pieces.get(index + 1) {
                None => xs.len(),
                Some(next) => {
                    let guess = ((next.start + centre - xs[0]) / step).ceil();
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
                each(piece, from, to);
                from = to;
            }
            if from == xs.len() {
                return;
            }
        }
    }
}

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

impl Surface for Designed {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn top_mm(&self) -> f64 {
        self.top_mm
    }

    fn outlines(&self, low_mm: [f64; 2], high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        let half_mm = 0.5 * self.design.cell_mm;
        let sheet = self.sheet();
        let mut outlines = Vec::new();
        for row in self.material.r0..self.material.r1 {
            for column in self.material.c0..self.material.c1 {
                let centre = self.centre(column, row);
                let reaches = (0..2).all(|axis| {
                    let middle_mm = centre[axis] - self.origin_mm[axis];
                    middle_mm + half_mm >= low_mm[axis] && middle_mm - half_mm <= high_mm[axis]
                });
                if reaches {
                    let faces = self.faces_within(column, row, &sheet);
                    outlines.extend(faces.into_iter().map(|face| face.outline_mm));
                }
            }
        }
        outlines
    }

    fn bottom_mm(&self) -> f64 {
        self.bottom_mm
    }

    fn steepest(&self) -> [f64; 2] {
        self.steepest
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        Ok(self.sample(columns_mm(&self.lattice, &window), window, datum_mm))
    }

    fn heights_mirrored(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        Ok(reversed(self.sample(mirrored_columns_mm(&self.lattice, &window), window, datum_mm)))
    }

    fn levelled(&self) -> Result<Level, Error> {
        Level::of_design(self)
    }
}
