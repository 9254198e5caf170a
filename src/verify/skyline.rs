//! The highest of each block of samples, which tells at a glance that nothing near a place is high.

use crate::grid::{Heights, Window};

/// Samples along the side of a block.
const BLOCK: i64 = 16;

/// Maxima of blocks of a heightfield, counted from its first row and column.
pub(super) struct Skyline {
    columns: usize,
    z_mm: Vec<f32>,
}

impl Skyline {
    pub(super) fn new(heights: &Heights) -> Skyline {
        let blocks = |samples: usize| samples.div_ceil(BLOCK as usize);
        let (columns, rows) = (blocks(heights.window.columns), blocks(heights.window.rows));
        let mut skyline = Skyline { columns, z_mm: vec![f32::NEG_INFINITY; columns * rows] };
        skyline.renew(heights, heights.window);
        skyline
    }

    /// Looks again at the blocks that meet `window`, a part of the heightfield's own.
    pub(super) fn renew(&mut self, heights: &Heights, window: Window) {
        let whole = heights.window;
        let Some([columns, rows]) = blocks(whole, window) else { return };
        for block_row in rows {
            for block_column in columns.clone() {
                let row_ends = (block_row * BLOCK, ((block_row + 1) * BLOCK).min(whole.rows as i64));
                let from = (block_column * BLOCK) as usize;
                let to = (from + BLOCK as usize).min(whole.columns);
                let mut highest = f32::NEG_INFINITY;
                for row in row_ends.0..row_ends.1 {
                    let row = &heights.z_mm[row as usize * whole.columns..][from..to];
                    highest = row.iter().fold(highest, |highest, &z| highest.max(z));
                }
                self.z_mm[block_row as usize * self.columns + block_column as usize] = highest;
            }
        }
    }

    /// No sample of `window`, a part of `whole`, is higher than this; not a number counts as nothing.
    pub(super) fn highest(&self, whole: Window, window: Window) -> f32 {
        let Some([columns, rows]) = blocks(whole, window) else { return f32::NEG_INFINITY };
        rows.flat_map(|row| {
            let start = row as usize * self.columns;
            &self.z_mm[start + *columns.start() as usize..=start + *columns.end() as usize]
        })
        .fold(f32::NEG_INFINITY, |highest, &z| highest.max(z))
    }
}

/// The columns and rows of blocks that meet a window.
fn blocks(whole: Window, window: Window) -> Option<[std::ops::RangeInclusive<i64>; 2]> {
    let span =
        |first: i64, count: usize| (count > 0).then(|| first / BLOCK..=(first + count as i64 - 1) / BLOCK);
    Some([span(window.column - whole.column, window.columns)?, span(window.row - whole.row, window.rows)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_of_blocks_is_never_below_that_of_samples_and_falls_as_they_fall() {
        let window = Window { column: -7, row: 5, columns: 53, rows: 37 };
        let z = |i: usize| if i.is_multiple_of(11) { f32::NAN } else { (i * 7919 % 1000) as f32 };
        let mut heights = Heights { window, z_mm: (0..window.samples()).map(z).collect() };
        let mut skyline = Skyline::new(&heights);
        let part = Window { column: 9, row: 21, columns: 16, rows: 16 };
        let highest = |heights: &Heights, part: Window| {
            heights.crop(part).z_mm.iter().fold(f32::NEG_INFINITY, |high, &z| high.max(z))
        };
        // The blocks begin at the corner, and this one is a block.
        assert_eq!(skyline.highest(window, part), highest(&heights, part));
        for (column, row, columns, rows) in [(-7, 5, 53, 37), (0, 6, 1, 1), (40, 30, 6, 12), (8, 20, 3, 2)] {
            let part = Window { column, row, columns, rows };
            assert!(skyline.highest(window, part) >= highest(&heights, part), "{part:?}");
        }
        for z in &mut heights.z_mm {
            *z = z.min(3.0);
        }
        skyline.renew(&heights, window);
        assert_eq!(skyline.highest(window, window), 3.0);
    }
}
