//! A band of heights around some passes, and how high the surface stands near a place of it.

use super::Error;
use super::passes::{Axis, Layout};
use crate::grid::{Heights, Window};
use crate::surface::Surface;

/// Samples held at most by one band (4 bytes each).
const MOST_SAMPLES: usize = 1 << 28;

/// Samples a band aims at: large against its halo, small against the memory of a small machine.
const BAND_SAMPLES: usize = 1 << 23;

const BLOCK: usize = 8;

/// Heights in the frame of the passes: columns along, rows across.
pub(super) struct Strip {
    pub(super) heights: Heights,
    pub(super) step_mm: f64,
    /// Maximum of each BLOCK x BLOCK samples.
    blocks: Vec<f32>,
    block_columns: usize,
    block_rows: usize,
}

/// How many passes from `first` on fit one band.
pub(super) fn band_length(layout: &Layout, first: usize, step_mm: f64, reach_mm: f64) -> usize {
    let width = (layout.count as f64 * layout.pitch_mm() + 2.0 * reach_mm) / step_mm;
    let wanted_mm = (BAND_SAMPLES as f64 / width * step_mm - 2.0 * reach_mm).max(6.0 * reach_mm);
    let start_mm = layout.across_mm(first);
    (first..layout.passes.len()).take_while(|&k| layout.across_mm(k) - start_mm <= wanted_mm).count().max(1)
}

impl Strip {
    /// Reads what a cutter of `reach_mm` sees from passes between `low_mm` and `high_mm` across.
    pub(super) fn read(
        surface: &dyn Surface,
        layout: &Layout,
        low_mm: f64,
        high_mm: f64,
        reach_mm: f64,
    ) -> Result<Strip, Error> {
        let step_mm = surface.lattice().step_mm;
        let column = ((layout.start_mm() - reach_mm) / step_mm).floor() as i64 - 1;
        let end_mm = layout.start_mm() + layout.count as f64 * layout.pitch_mm();
        let column_end = ((end_mm + reach_mm) / step_mm).ceil() as i64 + 1;
        let row = ((low_mm - reach_mm) / step_mm).floor() as i64 - 1;
        let row_end = ((high_mm + reach_mm) / step_mm).ceil() as i64 + 1;
        let window =
            Window { column, row, columns: (column_end - column) as usize, rows: (row_end - row) as usize };
        if window.samples() > MOST_SAMPLES {
            return Err(Error::Band { samples: window.samples(), most: MOST_SAMPLES });
        }
        Ok(Strip::new(layout.along.heights(surface, window)?, step_mm))
    }

    pub(super) fn new(heights: Heights, step_mm: f64) -> Strip {
        let window = heights.window;
        let block_columns = window.columns.div_ceil(BLOCK);
        let block_rows = window.rows.div_ceil(BLOCK);
        let mut blocks = vec![f32::NEG_INFINITY; block_columns * block_rows];
        for (r, row) in heights.z_mm.chunks_exact(window.columns).enumerate() {
            let out = &mut blocks[r / BLOCK * block_columns..][..block_columns];
            for (block, samples) in out.iter_mut().zip(row.chunks(BLOCK)) {
                for &z in samples {
                    *block = if z > *block { z } else { *block };
                }
            }
        }
        Strip { heights, step_mm, blocks, block_columns, block_rows }
    }

    /// For a pass at `across_mm`: the highest sample within `reach_mm` of each block column, at least.
    pub(super) fn ceiling(&self, across_mm: f64, reach_mm: f64) -> Ceiling {
        let window = self.heights.window;
        let row_of = |mm: f64| mm / self.step_mm - 0.5 - window.row as f64;
        let last = self.block_rows as i64 - 1;
        let low = ((row_of(across_mm - reach_mm).floor() as i64).div_euclid(BLOCK as i64)).clamp(0, last);
        let high = ((row_of(across_mm + reach_mm).ceil() as i64).div_euclid(BLOCK as i64)).clamp(0, last);
        let mut columns = vec![f32::NEG_INFINITY; self.block_columns];
        for row in low..=high {
            let blocks = &self.blocks[row as usize * self.block_columns..][..self.block_columns];
            for (column, &z) in columns.iter_mut().zip(blocks) {
                *column = column.max(z);
            }
        }
        let around = (reach_mm / self.step_mm / BLOCK as f64).ceil() as usize + 1;
        let spread = (0..columns.len())
            .map(|c| {
                let from = c.saturating_sub(around);
                let to = (c + around + 1).min(columns.len());
                columns[from..to].iter().copied().fold(f32::NEG_INFINITY, f32::max)
            })
            .collect();
        Ceiling {
            z_mm: spread,
            scale: 1.0 / (self.step_mm * BLOCK as f64),
            first: window.column as f64 + 0.5,
            step_mm: self.step_mm,
        }
    }
}

/// An upper bound of the heights in reach along one pass.
pub(super) struct Ceiling {
    z_mm: Vec<f32>,
    scale: f64,
    first: f64,
    step_mm: f64,
}

impl Ceiling {
    /// The highest sample in reach of a place along the pass, at least.
    pub(super) fn at(&self, along_mm: f64) -> f64 {
        let block = ((along_mm - self.first * self.step_mm) * self.scale).floor();
        let last = self.z_mm.len() - 1;
        f64::from(self.z_mm[(block.max(0.0) as usize).min(last)])
    }
}

/// Lowest height near each sample of the tile's borders.
pub(super) struct Border {
    /// Over the rows across, at the low and the high end along.
    ends: [Vec<f32>; 2],
    /// Over the columns along, at the low and the high side across.
    sides: [Vec<f32>; 2],
    step_mm: f64,
}

impl Border {
    /// Reads a frame `breadth_mm` broad around the tile's inside.
    pub(super) fn read(surface: &dyn Surface, along: Axis, breadth_mm: f64) -> Result<Border, Error> {
        let lattice = surface.lattice();
        let (columns, rows) = along.split([lattice.columns, lattice.rows]);
        let breadth = ((breadth_mm / lattice.step_mm).ceil() as usize).max(1);
        let lowest = |values: &mut dyn Iterator<Item = f32>| values.fold(f32::INFINITY, f32::min);
        let mut ends = [Vec::new(), Vec::new()];
        for (end, out) in ends.iter_mut().enumerate() {
            let broad = breadth.min(columns);
            let column = if end == 0 { 0 } else { columns - broad };
            let window = Window { column: column as i64, row: 0, columns: broad, rows };
            let heights = along.heights(surface, window)?;
            let rows: Vec<f32> =
                heights.z_mm.chunks_exact(broad).map(|row| lowest(&mut row.iter().copied())).collect();
            *out = sliding_minimum(&rows, breadth);
        }
        let mut sides = [Vec::new(), Vec::new()];
        for (side, out) in sides.iter_mut().enumerate() {
            let broad = breadth.min(rows);
            let row = if side == 0 { 0 } else { rows - broad };
            let window = Window { column: 0, row: row as i64, columns, rows: broad };
            let heights = along.heights(surface, window)?;
            let mut all = vec![f32::INFINITY; columns];
            for row in heights.z_mm.chunks_exact(columns) {
                for (low, &z) in all.iter_mut().zip(row) {
                    *low = low.min(z);
                }
            }
            *out = sliding_minimum(&all, breadth);
        }
        Ok(Border { ends, sides, step_mm: lattice.step_mm })
    }

    /// Lowest height of the tile near a place outside it; None inside. Infinite where the border is no data.
    pub(super) fn floor_mm(&self, along_mm: f64, across_mm: f64, size_mm: (f64, f64)) -> Option<f64> {
        let end = outside(along_mm, size_mm.0);
        let side = outside(across_mm, size_mm.1);
        let pick = |values: &[f32], at_mm: f64| {
            let i = (at_mm / self.step_mm).floor().max(0.0) as usize;
            f64::from(values[i.min(values.len() - 1)])
        };
        match (end, side) {
            (None, None) => None,
            (Some(e), None) => Some(pick(&self.ends[e], across_mm)),
            (None, Some(s)) => Some(pick(&self.sides[s], along_mm)),
            (Some(e), Some(s)) => Some(pick(&self.ends[e], across_mm).min(pick(&self.sides[s], along_mm))),
        }
    }
}

/// Which end of 0 .. length a place lies beyond.
fn outside(at_mm: f64, length_mm: f64) -> Option<usize> {
    if at_mm < 0.0 {
        Some(0)
    } else if at_mm > length_mm {
        Some(1)
    } else {
        None
    }
}

fn sliding_minimum(values: &[f32], reach: usize) -> Vec<f32> {
    (0..values.len())
        .map(|i| {
            let window = &values[i.saturating_sub(reach)..(i + reach + 1).min(values.len())];
            window.iter().copied().fold(f32::INFINITY, f32::min)
        })
        .collect()
}
