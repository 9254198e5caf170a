//! The surface of designed cells: exact planes at the samples, without triangles between.

use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use lru::LruCache;
use rayon::prelude::*;

use super::envelope::{Planes, Rect, clip_to};
use super::{Error, Level, Surface, columns_mm, covering, mirrored_columns_mm, reversed};
use crate::grid::{Heights, Lattice, Window};
use crate::screen::{CellRange, Design, Seam};

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
    /// The outlines of the cells that were asked for last.
    outlined: Mutex<LruCache<(i32, i32), Outlines>>,
}

/// Of the facets of one cell.
type Outlines = Arc<Vec<Vec<[f64; 3]>>>;

/// Rows of cells whose outlines are kept: a band of passes meets two or three, and all but one of them again in the next
/// band. 150 cells of 200 facets a row are 6 MB.
const OUTLINED_ROWS: usize = 4;

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
        let outlined = OUTLINED_ROWS * material.columns().max(material.rows());
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
            outlined: Mutex::new(LruCache::new(NonZeroUsize::new(outlined).unwrap_or(NonZeroUsize::MIN))),
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

    fn outlines_of(&self, cell: (i32, i32), sheet: &Rect) -> Outlines {
        let outlined = || self.outlined.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = outlined().get(&cell) {
            return Arc::clone(known);
        }
        let faces = self.faces_within(cell.0, cell.1, sheet).into_iter();
        let made = Arc::new(faces.map(|face| face.outline_mm).collect());
        outlined().put(cell, Arc::clone(&made));
        made
    }

    /// Column or row of cells (axis 0 or 1) of a point, and how it belongs there: see the type.
    pub(super) fn cell_index(&self, position_mm: f64, axis: usize) -> i32 {
        let (core, end) = if axis == 0 {
            (self.design.core.c0, self.material.c1)
        } else {
            (self.design.core.r0, self.material.r1)
        };
        let place = position_mm / self.design.cell_mm + f64::from(core);
        let index = (place + ON_BORDER).floor();
        if index == f64::from(end) && place - index <= ON_BORDER { end - 1 } else { index as i32 }
    }
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
        let CellRange { c0, r0, c1, r1 } = self.material;
        let reaches = |centre_mm: [f64; 2]| {
            (0..2).all(|axis| {
                let middle_mm = centre_mm[axis] - self.origin_mm[axis];
                middle_mm + half_mm >= low_mm[axis] && middle_mm - half_mm <= high_mm[axis]
            })
        };
        let all = (r0..r1).flat_map(|row| (c0..c1).map(move |column| (column, row)));
        let cells: Vec<(i32, i32)> = all.filter(|&(column, row)| reaches(self.centre(column, row))).collect();
        let sheet = self.sheet();
        let outlines: Vec<Outlines> = cells.par_iter().map(|&cell| self.outlines_of(cell, &sheet)).collect();
        outlines.iter().flat_map(|outlines| outlines.iter().cloned()).collect()
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
