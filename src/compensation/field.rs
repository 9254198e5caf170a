use super::lanes::{LANES, LEAST, NONE};
use crate::grid::{Heights, Window};

/// Positions that the widest kernel takes at once.
pub(super) const TILE: usize = 4 * LANES;

/// Columns of no data on either side of a field, so that whole tiles never leave it.
pub(super) const PAD: usize = TILE;

/// Which way up the heights are taken: erosion is dilation upside down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sense {
    Raise,
    Lower,
}

impl Sense {
    /// A height as kernels hold it. Adding zero makes -0 into 0, so that no sum is ever -0 and
    /// the order of a maximum cannot show.
    #[inline(always)]
    pub fn take(self, z_mm: f32) -> f32 {
        match self {
            _ if !z_mm.is_finite() => NONE,
            Sense::Raise => z_mm + 0.0,
            Sense::Lower => 0.0 - z_mm,
        }
    }

    /// A kernel's height as callers see it.
    #[inline(always)]
    pub fn give(self, z: f32) -> f32 {
        match self {
            _ if z < LEAST => f32::NAN,
            Sense::Raise => z,
            Sense::Lower => 0.0 - z,
        }
    }
}

/// Rows of heights as kernels read them: padded, no data as [`NONE`], with a row of no data below
/// the first and above the last.
pub(super) struct Field {
    pub rows: usize,
    /// Columns of data; column 0 stands at PAD in a row.
    pub columns: usize,
    stride: usize,
    z: Vec<f32>,
}

impl Field {
    pub fn empty(columns: usize, rows: usize) -> Field {
        // An odd number of cache lines: rows a power of two apart would share cache sets.
        let stride = ((columns + 2 * PAD).div_ceil(LANES) | 1) * LANES;
        Field { rows, columns, stride, z: vec![NONE; stride * (rows + 2)] }
    }

    /// The samples of `window`, as far as `h` has them.
    pub fn of(h: &Heights, window: Window, sense: Sense) -> Field {
        let mut field = Field::empty(window.columns, window.rows);
        if let Some(shared) = h.window.intersection(&window) {
            for row in shared.row..shared.row_end() {
                let from = &h.row(row)[(shared.column - h.window.column) as usize..][..shared.columns];
                let to = &mut field.row_mut((row - window.row) as usize)
                    [PAD + (shared.column - window.column) as usize..][..shared.columns];
                for (to, from) in to.iter_mut().zip(from) {
                    *to = sense.take(*from);
                }
            }
        }
        field
    }

    /// Row `row`, from -1 to `rows`, with its padding.
    #[inline(always)]
    pub fn row(&self, row: i64) -> &[f32] {
        &self.z[(row + 1) as usize * self.stride..][..self.stride]
    }

    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        &mut self.z[(row + 1) * self.stride..][..self.stride]
    }
}

/// Cutter positions as kernels write them.
pub(super) struct Targets {
    pub columns: usize,
    pub rows: usize,
    stride: usize,
    z: Vec<f32>,
}

impl Targets {
    pub fn new(columns: usize, rows: usize) -> Targets {
        let stride = ((columns + TILE).div_ceil(LANES) | 1) * LANES;
        Targets { columns, rows, stride, z: vec![NONE; stride * rows] }
    }

    /// Row `row` with its padding: column 0 stands at 0.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[f32] {
        &self.z[row * self.stride..][..self.stride]
    }

    #[inline(always)]
    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        &mut self.z[row * self.stride..][..self.stride]
    }
}
