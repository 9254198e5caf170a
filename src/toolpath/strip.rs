//! A band of heights around some passes, and how high the surface stands near a place of it.

use super::Error;
use super::passes::{Axis, Layout};
use crate::compensation::Facets;
use crate::grid::{Heights, Window, raise_row};
use crate::surface::Surface;

/// Samples held at most by one band (4 bytes each).
const MOST_SAMPLES: usize = 1 << 28;

/// Samples a band aims at: large against its halo, small against the memory of a small machine.
const BAND_SAMPLES: usize = 1 << 23;

/// Rows whose maxima are kept, so that a pass need not look at all of its rows again.
const BLOCK: usize = 4;

/// Heights in the frame of the passes: columns along, rows across.
pub(super) struct Strip {
    pub(super) heights: Heights,
    /// The planar faces among them; none where there are only samples.
    pub(super) facets: Facets,
    step_mm: f64,
    /// How far a face may stand above its samples.
    pub(super) missed_mm: f64,
    /// Maximum over BLOCK rows of each column; -inf where there is no data.
    blocks: Vec<f32>,
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
        let start_mm = layout.start_mm();
        let end_mm = start_mm + layout.count as f64 * layout.pitch_mm();
        let low_mm = [start_mm - reach_mm, low_mm - reach_mm];
        Strip::around(surface, layout.along, low_mm, [end_mm + reach_mm, high_mm + reach_mm])
    }

    /// Reads a rectangle (along, across).
    pub(super) fn around(
        surface: &dyn Surface,
        along: Axis,
        low_mm: [f64; 2],
        high_mm: [f64; 2],
    ) -> Result<Strip, Error> {
        let step_mm = surface.lattice().step_mm;
        let [column, row] = low_mm.map(|mm| (mm / step_mm).floor() as i64 - 1);
        let [column_end, row_end] = high_mm.map(|mm| (mm / step_mm).ceil() as i64 + 1);
        let window =
            Window { column, row, columns: (column_end - column) as usize, rows: (row_end - row) as usize };
        if window.samples() > MOST_SAMPLES {
            return Err(Error::Band { samples: window.samples(), most: MOST_SAMPLES });
        }
        let heights = along.heights(surface, window)?;
        let facets = Facets::new(along.outlines(surface, window));
        let [steep_x, steep_y] = surface.steepest();
        let missed_mm = if facets.is_empty() { 0.0 } else { step_mm * steep_x.hypot(steep_y) };
        let columns = heights.window.columns;
        let mut blocks = vec![f32::NEG_INFINITY; columns * heights.window.rows.div_ceil(BLOCK)];
        for (rows, block) in heights.z_mm.chunks(BLOCK * columns).zip(blocks.chunks_exact_mut(columns)) {
            rows.chunks_exact(columns).for_each(|row| raise_row(block, row, 0.0));
        }
        Ok(Strip { heights, facets, step_mm, missed_mm, blocks })
    }

    /// For a pass at `across_mm`: the highest sample of the square `reach_mm` around each column.
    pub(super) fn ceiling(&self, across_mm: f64, reach_mm: f64) -> Ceiling {
        let window = self.heights.window;
        let row_of = |mm: f64| mm / self.step_mm - 0.5 - window.row as f64;
        let low = row_of(across_mm - reach_mm).floor().max(0.0) as usize;
        let end = (row_of(across_mm + reach_mm).ceil().max(0.0) as usize + 1).min(window.rows);
        let mut z_mm = vec![f32::NEG_INFINITY; window.columns];
        let mut row = low;
        while row < end {
            let (from, rows) = if row.is_multiple_of(BLOCK) && row + BLOCK <= end {
                (&self.blocks[row / BLOCK * window.columns..], BLOCK)
            } else {
                (&self.heights.z_mm[row * window.columns..], 1)
            };
            raise_row(&mut z_mm, &from[..window.columns], 0.0);
            row += rows;
        }
        let around = (reach_mm / self.step_mm).ceil() as usize + 1;
        Ceiling {
            // None is NaN: a row without data raises nothing.
            z_mm: sliding(&z_mm, around, |a, b| if b > a { b } else { a }),
            first: window.column,
            step_mm: self.step_mm,
            missed_mm: self.missed_mm,
        }
    }
}

/// An upper bound of the heights in reach along one pass.
pub(super) struct Ceiling {
    z_mm: Vec<f32>,
    first: i64,
    step_mm: f64,
    missed_mm: f64,
}

impl Ceiling {
    /// The highest point in reach of a place along the pass.
    pub(super) fn at(&self, along_mm: f64) -> f64 {
        f64::from(self.z_mm[self.index(along_mm)]) + self.missed_mm
    }

    /// The highest point in reach of any place between two along the pass.
    pub(super) fn highest(&self, first_mm: f64, last_mm: f64) -> f64 {
        let (first, last) = (self.index(first_mm), self.index(last_mm));
        let all = &self.z_mm[first..=last.max(first)];
        let most = all.iter().fold(f32::NEG_INFINITY, |most, &z| if z > most { z } else { most });
        f64::from(most) + self.missed_mm
    }

    fn index(&self, along_mm: f64) -> usize {
        let column = (along_mm / self.step_mm).floor() as i64 - self.first;
        column.clamp(0, self.z_mm.len() as i64 - 1) as usize
    }
}

/// The `pick` (minimum or maximum) of the values up to `reach` to either side: van Herk and Gil-Werman,
/// three picks a value.
fn sliding(values: &[f32], reach: usize, pick: impl Fn(f32, f32) -> f32 + Copy) -> Vec<f32> {
    let width = 2 * reach + 1;
    let count = values.len();
    let mut forward = values.to_vec();
    let mut backward = values.to_vec();
    for block in forward.chunks_mut(width) {
        let mut best = block[0];
        for z in block {
            best = pick(best, *z);
            *z = best;
        }
    }
    for block in backward.chunks_mut(width) {
        let mut best = block[block.len() - 1];
        for z in block.iter_mut().rev() {
            best = pick(best, *z);
            *z = best;
        }
    }
    // Cut off by an end, a window spans two blocks, or begins or ends one, or is all there is.
    let at_end = |i: usize| {
        let (low, high) = (i.saturating_sub(reach), (i + reach).min(count - 1));
        if low / width != high / width {
            pick(backward[low], forward[high])
        } else if low % width == 0 {
            forward[high]
        } else {
            values[low..=high].iter().fold(values[i], |best, &z| pick(best, z))
        }
    };
    let inside = reach.min(count)..count.saturating_sub(reach).max(reach.min(count));
    let mut out: Vec<f32> = (0..inside.start).map(at_end).collect();
    // Here low = i - reach and high = i + reach lie in different blocks, or are one block's ends.
    out.extend(inside.clone().map(|i| pick(backward[i - reach], forward[i + reach])));
    out.extend((inside.end..count).map(at_end));
    out
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
            *out = sliding(&rows, breadth, f32::min);
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
            *out = sliding(&all, breadth, f32::min);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sliding_picks_what_a_loop_picks() {
        let values: Vec<f32> = (0..97u32).map(|i| (i * 37 % 53) as f32).collect();
        for reach in [0, 1, 3, 20, 60, 200] {
            for count in [1, 2, 7, 50, 97] {
                let naive: Vec<f32> = (0..count)
                    .map(|i: usize| {
                        let near = &values[i.saturating_sub(reach)..(i + reach + 1).min(count)];
                        near.iter().copied().fold(f32::INFINITY, f32::min)
                    })
                    .collect();
                assert_eq!(sliding(&values[..count], reach, f32::min), naive, "{reach} {count}");
            }
        }
    }
}
