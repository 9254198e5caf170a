//! A flat's maxima at some places only.

use super::Tables;
use super::chord::flat_bottom;
use super::field::{Field, Sense, Targets};
use super::lanes::LANES;
use super::tiles::OnTile;
use super::way::Way;
use crate::grid::{Heights, Window};
use crate::memory::untouched;
use std::ops::Range;

/// Squares of samples, some of them marked.
#[derive(Clone, Debug)]
pub struct Marked {
    /// Samples along the side of a square.
    side: i64,
    /// In squares, counted from the part's corner.
    squares: Window,
    /// By row.
    marked: Vec<bool>,
}

impl Marked {
    /// `squares` counts squares of `side` samples from the part's corner; `marked` has one entry for each, by row.
    pub fn new(side: usize, squares: Window, marked: Vec<bool>) -> Marked {
        assert_eq!(marked.len(), squares.samples(), "one mark a square");
        Marked { side: side.max(1) as i64, squares, marked }
    }

    /// The smallest window that holds all marked samples of another.
    fn hull(&self, of: Window) -> Option<Window> {
        let square = |column: i64, row: i64| {
            let side = self.side as usize;
            Window { column: column * self.side, row: row * self.side, columns: side, rows: side }
        };
        let columns = self.squares.columns.max(1);
        let rows = (self.squares.row..).zip(self.marked.chunks(columns));
        rows.filter_map(|(row, marked)| {
            let first = marked.iter().position(|marked| *marked)? as i64;
            let last = marked.iter().rposition(|marked| *marked)? as i64;
            let ends = [first, last].map(|at| square(self.squares.column + at, row));
            ends[0].hull(&ends[1]).intersection(&of)
        })
        .reduce(|all, row| all.hull(&row))
    }

    /// The marked samples of a row of a window, in groups of lanes from its first column.
    fn groups(&self, window: Window, row: i64) -> Vec<Range<usize>> {
        let mut found: Vec<Range<usize>> = Vec::new();
        let row = row.div_euclid(self.side) - self.squares.row;
        if !(0..self.squares.rows as i64).contains(&row) {
            return found;
        }
        let columns = self.squares.columns;
        let marked = &self.marked[row as usize * columns..][..columns];
        for (square, _) in (self.squares.column..).zip(marked).filter(|(_, marked)| **marked) {
            let start = square * self.side - window.column;
            let end = (start + self.side).min(window.columns as i64);
            if end <= 0 || start >= end {
                continue;
            }
            let groups = start.max(0) as usize / LANES..(end as usize).div_ceil(LANES);
            match found.last_mut() {
                Some(last) if groups.start <= last.end => last.end = groups.end,
                _ => found.push(groups),
            }
        }
        found
    }
}

/// Dilation, or erosion, by a flat at the marked samples of `out`; others may be no data.
pub(super) fn by_flat(
    h: &Heights,
    tables: &Tables,
    (out, marked): (Window, &Marked),
    sense: Sense,
    done: &mut Heights,
    (field, targets): &mut (Field, Targets),
) {
    let profile = tables.profile();
    done.window = out;
    untouched(&mut done.z_mm, out.samples());
    done.z_mm.fill(f32::NAN);
    let Some(tile) = marked.hull(out) else { return };
    let wanted: Vec<Vec<Range<usize>>> =
        (tile.row..tile.row_end()).map(|row| marked.groups(tile, row)).collect();
    let of = OnTile::new(h.into(), tables, 1, sense, Way::Known);
    let (input, pairs) = of.pairs(tile);
    field.fill(h.into(), input, sense);
    targets.clear(tile.columns, tile.rows);
    flat_bottom(field, &pairs, targets, profile.plateau_mm() / profile.step_mm() + 1.0, Some(&wanted));
    let column = (tile.column - out.column) as usize;
    for (k, groups) in wanted.iter().enumerate() {
        let start = ((tile.row - out.row) as usize + k) * out.columns + column;
        for groups in groups {
            let part = groups.start * LANES..(groups.end * LANES).min(tile.columns);
            sense.give_row(&mut done.z_mm[start..][part.clone()], &targets.row(k)[part]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Closings, Profile};
    use super::*;

    #[test]
    fn what_is_marked_is_what_all_of_it_is() {
        let around = Window { column: -60, row: -30, columns: 400, rows: 300 };
        let z_mm = (0..around.samples() as u64).map(|k| (k.wrapping_mul(k) % 7919) as f32 * 1e-3).collect();
        let h = Heights { window: around, z_mm };
        let tables =
            Tables::new(Profile::new("flat:1.1".parse().expect("a cutter"), 0.02, 0.0).expect("a profile"));
        let out = Window { column: 3, row: 29, columns: 271, rows: 170 };
        let all = |window: Window| Window {
            column: window.column.div_euclid(8),
            row: window.row.div_euclid(8),
            columns: window.columns / 8 + 2,
            rows: window.rows / 8 + 2,
        };
        let [standing, wanted] = [out.grown(tables.profile().reach()), out].map(all);
        let whole = Closings::new().of(&h, &tables, out).clone();
        let every = Marked::new(8, standing, vec![true; standing.samples()]);
        for share in [1, 2, 7, 40, usize::MAX] {
            let some: Vec<bool> = (0..wanted.samples()).map(|k| (k + 3).is_multiple_of(share)).collect();
            let marks = Marked::new(8, wanted, some.clone());
            let mut closings = Closings::new();
            let part = closings.of_flat_at(&h, &tables, out, [&every, &marks]);
            for row in out.row..out.row_end() {
                for (k, (part, whole)) in part.row(row).iter().zip(whole.row(row)).enumerate() {
                    let column = out.column + k as i64;
                    let square = (row.div_euclid(8) - wanted.row) as usize * wanted.columns
                        + (column.div_euclid(8) - wanted.column) as usize;
                    let same = part.to_bits() == whole.to_bits();
                    assert!(
                        same || (!some[square] && part.is_nan()),
                        "{share} at {column}, {row}: {part} {whole}"
                    );
                }
            }
        }
    }
}
