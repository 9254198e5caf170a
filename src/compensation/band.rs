//! A band of a part, and how what a cutter makes of it is put together.

use super::closing::left;
use super::held::Rows;
use super::outlet::{Beside, Closed, Outlet, RowTally, Tally};
use super::{Profile, RowPass, machined_by_rows};
use crate::grid::{Lattice, Window};
use crate::memory::untouched;
use rayon::prelude::*;

/// Rows that one thread masks at once.
const ROWS: usize = 16;

/// What is to be made of a part, one of these at least; what is not wanted is not written to memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// Cutter locations.
    pub cl: bool,
    /// What the cutter leaves.
    pub closing: bool,
    /// closing less part.
    pub residual: bool,
    /// What is out of the cutter's reach, in numbers: [`Band::out_of_reach`]. Comes with the two before, too.
    pub out_of_reach: bool,
}

impl Wanted {
    /// Whether it takes a closing.
    pub fn closes(&self) -> bool {
        self.closing || self.residual || self.out_of_reach
    }
}

/// What a cutter leaves on a part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OutOfReach {
    /// The most on one sample, in mm.
    pub most_mm: f32,
    /// Samples with more than [`super::CAVITY_MM`].
    pub samples: u64,
}

/// Rows of one band of a whole part, and what a cutter makes of them.
#[derive(Clone, Debug, Default)]
pub struct Band {
    /// First row of the part, and how many.
    pub row: usize,
    pub rows: usize,
    /// Samples of these rows with data.
    pub samples: u64,
    pub out_of_reach: OutOfReach,
    /// Cutter locations at the rows of this band that are cut, if they are wanted; no data where the part has none.
    pub cl: Vec<f32>,
    /// What the cutter leaves, if it is wanted; no data where the part has none.
    pub closing: Vec<f32>,
    /// closing less part, if it is wanted.
    pub residual: Vec<f32>,
}

/// Where the closings of a band go, what they leave, and the locations within the part.
pub(super) fn closed<'b>(
    h: Rows<'b>,
    cut: Rows<'b>,
    tallies: &'b [RowTally],
    wanted: Wanted,
    band: &'b mut Band,
) -> Vec<Outlet<'b>> {
    let columns = h.window.columns;
    let Band { row, rows, cl, closing, residual, .. } = band;
    let beside = (h.window.column - cut.window.column) as usize;
    let mut rows_of =
        [(cl, wanted.cl), (closing, wanted.closing), (residual, wanted.residual)].map(|(z_mm, wanted)| {
            untouched(z_mm, if wanted { *rows * columns } else { 0 });
            z_mm.chunks_exact_mut(columns)
        });
    let rows = tallies.iter().zip(*row as i64..);
    rows.map(|(tally, row)| {
        let [cl, to, residual] = rows_of.each_mut().map(|rows| rows.next().unwrap_or_default());
        let cut = &cut.row(row)[beside..][..columns];
        let closed = Some(Closed { residual, cut, cl });
        Outlet { to, beside: Some(Beside { h: h.row(row), tally: Some(tally), closed }) }
    })
    .collect()
}

/// The locations at the band's rows that are cut, over the part's columns.
pub(super) fn of_part(cut: Rows<'_>, every: usize, part: &Window, band: &mut Band) {
    let columns = part.columns;
    untouched(&mut band.cl, band.rows.div_ceil(every) * columns);
    let first = (band.row / every) as i64;
    let beside = (part.column - cut.window.column) as usize;
    band.cl.par_chunks_mut(ROWS * columns).enumerate().for_each(|(chunk, cl)| {
        for (k, cl) in cl.chunks_exact_mut(columns).enumerate() {
            let row = first + (chunk * ROWS + k) as i64;
            cl.copy_from_slice(&cut.row(row)[beside..][..columns]);
        }
    });
}

/// What rows `every` apart leave.
pub(super) fn under_rows(cut: Rows<'_>, every: usize, lattice: &Lattice, profile: &Profile, band: &mut Band) {
    let passes: Vec<RowPass> = (cut.window.row..cut.window.row_end())
        .map(|row| RowPass {
            x0_mm: lattice.x_mm(cut.window.column),
            y_mm: lattice.y_mm(row * every as i64),
            z_mm: cut.row(row),
        })
        .collect();
    let window = Window { row: band.row as i64, rows: band.rows, ..lattice.window() };
    band.closing = machined_by_rows(&passes, profile, window).z_mm;
}

/// No data where the part has none, what is left, and how many samples there are, as far as it is not found out on the
/// way: rows that are cut `every` samples apart do not come by all samples.
pub(super) fn finish(h: Rows<'_>, every: usize, wanted: Wanted, tallies: &mut [RowTally], band: &mut Band) {
    let columns = h.window.columns;
    let first = band.row;
    let row_of = |k: usize| h.row((first + k) as i64);
    let mut of_rows: Vec<Tally> = tallies.iter_mut().map(RowTally::take).collect();
    if every > 1 && wanted.closes() {
        untouched(&mut band.residual, band.rows * columns);
        let rows =
            band.closing.par_chunks_exact_mut(columns).zip(band.residual.par_chunks_exact_mut(columns));
        rows.zip(&mut of_rows).enumerate().with_min_len(ROWS).for_each(
            |(k, ((closing, residual), tally))| {
                *tally = close(closing, residual, row_of(k));
            },
        );
        for (z_mm, wanted) in [(&mut band.closing, wanted.closing), (&mut band.residual, wanted.residual)] {
            if !wanted {
                z_mm.clear();
            }
        }
    } else if every > 1 {
        of_rows.par_iter_mut().enumerate().with_min_len(ROWS).for_each(|(k, tally)| {
            tally.samples = row_of(k).iter().map(|z| u32::from(!z.is_nan())).sum();
        });
    }
    band.samples = of_rows.iter().map(|tally| u64::from(tally.samples)).sum();
    band.out_of_reach = OutOfReach {
        most_mm: of_rows.iter().fold(0.0, |most, tally| most.max(tally.most_mm)),
        samples: of_rows.iter().map(|tally| u64::from(tally.cavities)).sum(),
    };
    if every == 1 && wanted.closes() {
        return;
    }
    let is_whole = |k: usize| of_rows[k].samples as usize == columns;
    band.cl.par_chunks_mut(ROWS * columns).enumerate().for_each(|(chunk, cl)| {
        for (k, cl) in cl.chunks_exact_mut(columns).enumerate() {
            let k = (chunk * ROWS + k) * every;
            if !is_whole(k) {
                mask(cl, row_of(k));
            }
        }
    });
}

/// Masks a row of a closing, and makes and tells what is left of the part.
fn close(closing: &mut [f32], residual: &mut [f32], h: &[f32]) -> Tally {
    let mut tally = Tally::default();
    for ((closing, residual), h) in closing.iter_mut().zip(residual).zip(h) {
        *closing = if h.is_nan() { f32::NAN } else { *closing };
        let left_mm = left(*closing, *h);
        *residual = left_mm;
        tally.see(*h, left_mm);
    }
    tally
}

/// No data where the part has none.
fn mask(z_mm: &mut [f32], part: &[f32]) {
    for (z_mm, part) in z_mm.iter_mut().zip(part) {
        *z_mm = if part.is_nan() { f32::NAN } else { *z_mm };
    }
}
