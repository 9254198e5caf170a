use super::lanes::{LANES, LEAST, NONE};
use super::memory::large_pages;
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
    /// Heights as kernels hold them. Adding zero makes -0 into 0, so that no sum is ever -0 and the
    /// order of a maximum cannot show.
    #[inline(always)]
    pub fn take(self, z_mm: f32) -> f32 {
        let z = if self == Sense::Raise { z_mm + 0.0 } else { 0.0 - z_mm };
        if z_mm.abs() < f32::INFINITY { z } else { NONE }
    }

    /// A kernel's height as callers see it.
    #[inline(always)]
    pub fn give(self, z: f32) -> f32 {
        let z_mm = if self == Sense::Raise { z } else { 0.0 - z };
        if z < LEAST { f32::NAN } else { z_mm }
    }

    /// [`Sense::take`] of a row. One loop a sense, without a branch in it: the compiler makes
    /// vectors of these.
    pub fn take_row(self, to: &mut [f32], from: &[f32]) {
        match self {
            Sense::Raise => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Raise.take(*z)),
            Sense::Lower => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Lower.take(*z)),
        }
    }

    /// [`Sense::give`] of a row.
    pub fn give_row(self, to: &mut [f32], from: &[f32]) {
        match self {
            Sense::Raise => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Raise.give(*z)),
            Sense::Lower => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Lower.give(*z)),
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
        let stride = stride(columns);
        Field { rows, columns, stride, z: vec![NONE; stride * (rows + 2)] }
    }

    /// The samples of `window`, as far as `h` has them.
    pub fn of(h: &Heights, window: Window, sense: Sense) -> Field {
        let mut field = Field { rows: 0, columns: 0, stride: 0, z: Vec::new() };
        field.fill(h, window, sense);
        field
    }

    /// Becomes [`Field::of`] these, in the memory it has.
    pub fn fill(&mut self, h: &Heights, window: Window, sense: Sense) {
        self.rows = window.rows;
        self.columns = window.columns;
        self.stride = stride(window.columns);
        resize(&mut self.z, self.stride * (window.rows + 2));
        let shared = h.window.intersection(&window);
        for (k, to) in self.z.chunks_exact_mut(self.stride).enumerate() {
            let row = window.row + k as i64 - 1;
            match shared.filter(|shared| row >= shared.row && row < shared.row_end()) {
                None => to.fill(NONE),
                Some(shared) => {
                    let from = &h.row(row)[(shared.column - h.window.column) as usize..][..shared.columns];
                    let (before, to) = to.split_at_mut(PAD + (shared.column - window.column) as usize);
                    let (to, after) = to.split_at_mut(shared.columns);
                    before.fill(NONE);
                    after.fill(NONE);
                    sense.take_row(to, from);
                }
            }
        }
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

/// Takes what is missing as no data.
fn resize(z: &mut Vec<f32>, len: usize) {
    if z.capacity() < len {
        *z = vec![0.0; len];
        large_pages(z);
        z.clear();
    }
    z.resize(len, NONE);
}

/// An odd number of cache lines: rows a power of two apart would share cache sets.
fn stride(columns: usize) -> usize {
    ((columns + 2 * PAD).div_ceil(LANES) | 1) * LANES
}

/// Cutter positions as kernels write them, in whole cache lines.
pub(super) struct Targets {
    pub columns: usize,
    pub rows: usize,
    stride: usize,
    /// Where the first row starts.
    origin: usize,
    z: Vec<f32>,
}

impl Targets {
    pub fn new(columns: usize, rows: usize) -> Targets {
        let mut targets = Targets { columns: 0, rows: 0, stride: 0, origin: 0, z: Vec::new() };
        targets.clear(columns, rows);
        targets
    }

    /// Becomes [`Targets::new`], in the memory it has.
    pub fn clear(&mut self, columns: usize, rows: usize) {
        self.columns = columns;
        self.rows = rows;
        self.stride = ((columns + TILE).div_ceil(LANES) | 1) * LANES;
        self.z.clear();
        resize(&mut self.z, self.stride * rows + LANES);
        self.origin = self.z.as_ptr().align_offset(size_of::<[f32; LANES]>()).min(LANES);
    }

    /// Row `row` with its padding: column 0 stands at 0.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[f32] {
        &self.z[self.origin + row * self.stride..][..self.stride]
    }

    #[inline(always)]
    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        &mut self.z[self.origin + row * self.stride..][..self.stride]
    }
}
