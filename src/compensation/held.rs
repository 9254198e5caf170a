//! Rows of samples that a search reads: all of a window, or the latest of a part.

use super::field::TILE;
use super::lanes::{LANES, Vectors};
use crate::grid::{Heights, Window};
use crate::memory::untouched;

/// Rows of samples, wherever they stand in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows<'a> {
    pub window: Window,
    z_mm: &'a [f32],
    /// Rows that there is memory for, and the one of them that the first row has: they go round.
    places: usize,
    first: usize,
}

impl<'a> Rows<'a> {
    /// The samples of one row, counted in part rows.
    #[inline(always)]
    pub fn row(&self, row: i64) -> &'a [f32] {
        let place = self.first + (row - self.window.row) as usize;
        let place = if place < self.places { place } else { place - self.places };
        &self.z_mm[place * self.window.columns..][..self.window.columns]
    }

    /// Asks for a tile of columns from `column` on, as far as there are any, of the rows `first .. end`: reading them
    /// from memory goes on beside what is done until they are taken.
    #[inline(always)]
    pub fn fetch<V: Vectors>(&self, [first, end]: [i64; 2], column: i64) {
        for row in first.max(self.window.row)..end.min(self.window.row_end()) {
            let z = self.row(row);
            for i in (0..TILE as i64).step_by(LANES) {
                if let Some(z) = z.get((column - self.window.column + i) as usize) {
                    V::fetch(z);
                }
            }
        }
    }
}

impl<'a> From<&'a Heights> for Rows<'a> {
    fn from(h: &'a Heights) -> Rows<'a> {
        Rows { window: h.window, z_mm: &h.z_mm, places: h.window.rows, first: 0 }
    }
}

/// Rows of samples that follow each other: each new one takes the memory of one that is no longer needed.
pub(super) struct Held {
    window: Window,
    z_mm: Vec<f32>,
    places: usize,
    first: usize,
}

impl Held {
    /// None yet, of so many at once; the first will be the row `window.row`.
    pub fn new(window: Window, most_rows: usize) -> Held {
        let mut z_mm = Vec::new();
        untouched(&mut z_mm, window.columns * most_rows);
        Held { window: Window { rows: 0, ..window }, z_mm, places: most_rows, first: 0 }
    }

    /// The row after the last one.
    pub fn end(&self) -> i64 {
        self.window.row_end()
    }

    pub fn rows(&self) -> Rows<'_> {
        Rows { window: self.window, z_mm: &self.z_mm, places: self.places, first: self.first }
    }

    /// Takes so many rows more, whose samples are to be written, in one piece or in two.
    ///
    /// # Panics
    /// If they are more than there is memory for.
    pub fn more(&mut self, rows: usize) -> [(Window, &mut [f32]); 2] {
        let Window { columns, rows: held, .. } = self.window;
        assert!(held + rows <= self.places, "{held} + {rows} of {} rows", self.places);
        let next = self.window.row_end();
        self.window.rows += rows;
        let place = self.first + held;
        let [place, before_end] = match place.checked_sub(self.places) {
            Some(place) => [place, rows],
            None => [place, rows.min(self.places - place)],
        };
        let (start, rest) = self.z_mm.split_at_mut(place * columns);
        let of = |row: i64, rows: usize| Window { row, rows, ..self.window };
        [
            (of(next, before_end), &mut rest[..before_end * columns]),
            (of(next + before_end as i64, rows - before_end), &mut start[..(rows - before_end) * columns]),
        ]
    }

    /// Lets the rows before this one go.
    pub fn keep_from(&mut self, row: i64) {
        let gone = (row - self.window.row).clamp(0, self.window.rows as i64) as usize;
        self.window.row += gone as i64;
        self.window.rows -= gone;
        self.first = if self.places == 0 { 0 } else { (self.first + gone) % self.places };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stay_what_they_are_while_others_come_and_go() {
        let window = Window { column: 0, row: -4, columns: 3, rows: 0 };
        let mut held = Held::new(window, 7);
        let mut next = -4i64;
        for (more, gone) in [(5, 2), (4, 4), (1, 0), (0, 3), (6, 6), (6, 7), (3, 1), (2, 0)] {
            for (window, z_mm) in held.more(more) {
                for z_mm in z_mm.chunks_exact_mut(3) {
                    z_mm.fill(next as f32);
                    next += 1;
                }
                assert_eq!(window.row_end(), next);
            }
            let rows = held.rows();
            assert_eq!(held.end(), next);
            for row in rows.window.row..next {
                assert_eq!(rows.row(row), [row as f32; 3]);
            }
            held.keep_from(rows.window.row + gone);
        }
    }
}
