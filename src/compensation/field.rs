use super::held::Rows;
use super::lanes::{LANES, LEAST, NONE, Vectors, groups, groups_mut};
use crate::grid::Window;
use crate::memory::untouched;

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
    #[inline(always)]
    pub fn take_row(self, to: &mut [f32], from: &[f32]) {
        match self {
            Sense::Raise => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Raise.take(*z)),
            Sense::Lower => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Lower.take(*z)),
        }
    }

    /// [`Sense::give`] of a row.
    #[inline(always)]
    pub fn give_row(self, to: &mut [f32], from: &[f32]) {
        match self {
            Sense::Raise => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Raise.give(*z)),
            Sense::Lower => to.iter_mut().zip(from).for_each(|(to, z)| *to = Sense::Lower.give(*z)),
        }
    }
}

impl Sense {
    /// [`Sense::give_row`] past the caches.
    #[inline(always)]
    pub fn stream_row<V: Vectors>(self, to: &mut [f32], from: &[f32]) {
        let first = line(to).min(to.len());
        let (before, to) = to.split_at_mut(first);
        self.give_row(before, from);
        let from = &from[first..];
        let whole = to.len() / LANES * LANES;
        self.give_row(&mut to[whole..], &from[whole.min(from.len())..]);
        let (zero, none, least) = (V::splat(0.0), V::splat(f32::NAN), V::splat(LEAST));
        for (to, z) in groups_mut(to).iter_mut().zip(groups(from)) {
            let z = V::load(z);
            let z_mm = if self == Sense::Raise { z } else { V::subtract(zero, z) };
            V::stream(V::choose(V::at_least(z, least), z_mm, none), to);
        }
    }
}

/// Rows of heights as kernels read them: padded, no data as [`NONE`], with a row of no data below
/// the first and above the last. A field may hold only its latest rows.
pub(super) struct Field {
    pub rows: usize,
    /// Columns of data; column 0 stands at PAD in a row.
    pub columns: usize,
    stride: usize,
    /// Where the memory of the rows starts: at a cache line.
    origin: usize,
    /// Row -1 stands there; where not all rows are held, one less than their power of two.
    mask: usize,
    z: Vec<f32>,
}

impl Field {
    pub fn empty(columns: usize, rows: usize) -> Field {
        let mut field = Field { rows, columns, stride: 0, origin: 0, mask: usize::MAX, z: Vec::new() };
        field.hold(Window { column: 0, row: 0, columns, rows }, usize::MAX);
        field.z.fill(NONE);
        field
    }

    /// The samples of `window`, as far as `h` has them.
    pub fn of(h: Rows<'_>, window: Window, sense: Sense) -> Field {
        let mut field = Field::empty(0, 0);
        field.fill(h, window, sense);
        field
    }

    /// Becomes [`Field::of`] these, in the memory it has.
    pub fn fill(&mut self, h: Rows<'_>, window: Window, sense: Sense) {
        self.hold(window, usize::MAX);
        pulp::Arch::new().dispatch(move || {
            for row in -1..=window.rows as i64 {
                self.take(row, h, window, sense);
            }
        });
    }

    /// Becomes a field of this size that holds so many rows, at least, once they are taken.
    pub fn hold(&mut self, window: Window, held: usize) {
        self.rows = window.rows;
        self.columns = window.columns;
        self.stride = stride(window.columns);
        let all = window.rows + 2;
        let held = if held < all { held.next_power_of_two() } else { all };
        self.mask = if held < all { held - 1 } else { usize::MAX };
        untouched(&mut self.z, self.stride * held + LANES);
        self.origin = line(&self.z);
    }

    /// Takes a row, from -1 to `rows`, of the samples of `window`.
    #[inline(always)]
    pub fn take(&mut self, row: i64, h: Rows<'_>, window: Window, sense: Sense) {
        let to = self.padded_mut(row);
        let row = window.row + row;
        match h.window.intersection(&window).filter(|shared| row >= shared.row && row < shared.row_end()) {
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

    /// Row `row`, from -1 to `rows`, with its padding.
    #[inline(always)]
    pub fn row(&self, row: i64) -> &[f32] {
        &self.z[self.origin + ((row + 1) as usize & self.mask) * self.stride..][..self.stride]
    }

    #[inline(always)]
    fn padded_mut(&mut self, row: i64) -> &mut [f32] {
        &mut self.z[self.origin + ((row + 1) as usize & self.mask) * self.stride..][..self.stride]
    }

    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        self.padded_mut(row as i64)
    }
}

/// The first of these that starts a cache line.
#[inline(always)]
pub(super) fn line(z: &[f32]) -> usize {
    z.as_ptr().align_offset(size_of::<[f32; LANES]>()).min(LANES)
}

/// An odd number of cache lines: rows a power of two apart would share cache sets.
fn stride(columns: usize) -> usize {
    ((columns + 2 * PAD).div_ceil(LANES) | 1) * LANES
}

/// Cutter positions as kernels write them, in whole cache lines; not all rows need be held at once. A row takes up memory
/// from when it is first raised until it is let go, and then the memory that was used last: the few rows that are being
/// raised stay in a core's cache.
pub(super) struct Targets {
    pub columns: usize,
    pub rows: usize,
    stride: usize,
    /// Rows that there is memory for, the first row that is held, and the one after the last.
    held: usize,
    first: usize,
    opened: usize,
    /// Where the rows from `first` on begin, by their number less `held` as often as it goes.
    starts: Vec<usize>,
    /// Memory that no row has.
    free: Vec<usize>,
    /// A row without data.
    none: Vec<f32>,
    z: Vec<f32>,
}

impl Targets {
    pub fn new(columns: usize, rows: usize) -> Targets {
        let (starts, free, none, z) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut targets =
            Targets { columns, rows, stride: 0, held: 0, first: 0, opened: 0, starts, free, none, z };
        targets.clear(columns, rows);
        targets
    }

    /// Becomes [`Targets::new`], in the memory it has.
    pub fn clear(&mut self, columns: usize, rows: usize) {
        self.hold(columns, rows, rows);
        self.open(rows);
    }

    /// Becomes rows of which so many are held at once, none of them open yet.
    pub fn hold(&mut self, columns: usize, rows: usize, held: usize) {
        self.columns = columns;
        self.rows = rows;
        self.stride = ((columns + TILE).div_ceil(LANES) | 1) * LANES;
        self.held = held.min(rows).next_power_of_two();
        (self.first, self.opened) = (0, 0);
        let held = held.min(rows);
        untouched(&mut self.z, self.stride * held + LANES);
        let origin = line(&self.z);
        self.starts.clear();
        self.starts.resize(self.held, 0);
        self.free.clear();
        self.free.extend((0..held).rev().map(|place| origin + place * self.stride));
        self.none.clear();
        self.none.resize(self.stride, NONE);
    }

    /// Makes the rows before `end` ready to be raised.
    #[inline(never)]
    pub fn open(&mut self, end: usize) {
        while self.opened < end {
            let start = self.free.pop().expect("no more rows at once than are held");
            self.z[start..][..self.stride].copy_from_slice(&self.none);
            let place = self.opened & (self.held - 1);
            self.starts[place] = start;
            self.opened += 1;
        }
    }

    /// Lets the first row go.
    #[inline(always)]
    pub fn close(&mut self) {
        self.free.push(self.starts[self.first & (self.held - 1)]);
        self.first += 1;
    }

    /// Row `row` with its padding, which is open: column 0 stands at 0.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[f32] {
        &self.z[self.starts[row & (self.held - 1)]..][..self.stride]
    }

    #[inline(always)]
    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        if row >= self.opened {
            self.open(row + 1);
        }
        &mut self.z[self.starts[row & (self.held - 1)]..][..self.stride]
    }
}
