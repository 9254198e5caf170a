//! The highest and the lowest over all places within a cutter, each less or more its rise there, for small maps of
//! blocks.

use crate::cutter::Shape;
use crate::grid::{Heights, Window, lower_row, raise_row};

/// More than the rounding of heights as floats, in mm; a flat's are not rounded at all.
const ROUNDED_MM: f64 = 1e-5;

/// Places of a row that stay in registers while all offsets are looked at.
const HELD: usize = 64;

/// How far apart two places are, by column and row, and a rise in mm.
pub(super) type Offset = ([i64; 2], f32);

/// Every offset between blocks within the cutter, and the cutter's rise there, less or more its rounding; `samples`
/// gives the distance along an axis that counts for blocks so far apart.
pub(super) fn offsets(shape: &Shape, step_mm: f64, reach: i64, samples: impl Fn(i64) -> i64) -> Vec<Offset> {
    // Of the samples' distances the nearest counts with the lower rise, the farthest with the higher.
    let nearest = samples(0) == 0;
    let rounded = if matches!(shape, Shape::Flat { .. }) { 0.0 } else { ROUNDED_MM };
    let mut out = Vec::new();
    for up in -reach..=reach {
        for across in -reach..=reach {
            let [x, y] = [across, up].map(|blocks| samples(blocks.abs()) as f64 * step_mm);
            let r_mm = x.hypot(y);
            let inside = if nearest { r_mm - 1e-9 } else { r_mm + 1e-9 };
            let Some(rise) = shape.height_mm(inside.max(0.0)) else { continue };
            out.push(([across, up], (if nearest { rise - rounded } else { rise + rounded }) as f32));
        }
    }
    out
}

/// Raises each place of `to` to the highest of `from` less its rise, over all offsets.
pub(super) fn raise_over(to: &mut Heights, from: &Heights, offsets: &[Offset]) {
    let higher = |z: f32, from: f32, rise: f32| {
        let raised = from - rise;
        if raised > z { raised } else { z }
    };
    over(to, from, offsets, higher, raise_row);
}

/// Lowers each place of `to` to the lowest of `from` with its rise, over all offsets.
pub(super) fn lower_over(to: &mut Heights, from: &Heights, offsets: &[Offset]) {
    let lower = |z: f32, from: f32, rise: f32| {
        let lowered = from + rise;
        if lowered < z { lowered } else { z }
    };
    over(to, from, offsets, lower, lower_row);
}

/// `one` for single places, `all` for whole rows.
fn over(
    to: &mut Heights,
    from: &Heights,
    offsets: &[Offset],
    one: impl Fn(f32, f32, f32) -> f32 + Copy,
    all: impl Fn(&mut [f32], &[f32], f32),
) {
    // A flat's offsets are runs in which all rise alike.
    if offsets.iter().all(|(_, rise)| *rise == 0.0) {
        return over_runs(to, from, offsets, all);
    }
    let Window { columns, .. } = to.window;
    let places: Vec<(i64, f32)> = offsets
        .iter()
        .map(|([across, up], rise)| (up * from.window.columns as i64 + across, *rise))
        .collect();
    for row in to.window.row..to.window.row_end() {
        let start = (row - to.window.row) as usize * columns;
        let first = place(from.window, row, to.window.column) as i64;
        let to = &mut to.z_mm[start..start + columns];
        if columns < HELD {
            for (place, rise) in &places {
                all(to, &from.z_mm[(first + place) as usize..][..columns], *rise);
            }
        }
        for at in (0..columns).step_by(HELD).filter(|_| columns >= HELD) {
            // The last ones are looked at once more with those before them.
            let at = at.min(columns - HELD);
            if let Some(to) = to[at..].first_chunk_mut() {
                hold(to, &from.z_mm, first + at as i64, &places, one);
            }
        }
    }
}

fn hold(
    to: &mut [f32; HELD],
    from: &[f32],
    first: i64,
    places: &[(i64, f32)],
    one: impl Fn(f32, f32, f32) -> f32,
) {
    pulp::Arch::new().dispatch(|| {
        let mut held = *to;
        for (place, rise) in places {
            let Some(from) = from[(first + place) as usize..].first_chunk::<HELD>() else { continue };
            for (z, from) in held.iter_mut().zip(from) {
                *z = one(*z, *from, *rise);
            }
        }
        *to = held;
    });
}

/// What a run holds is what two runs of a power of two hold.
fn over_runs(to: &mut Heights, from: &Heights, offsets: &[Offset], all: impl Fn(&mut [f32], &[f32], f32)) {
    let window = to.window;
    let runs: Vec<(i64, i64)> =
        offsets.chunk_by(|a, b| a.0[1] == b.0[1]).map(|run| (run[0].0[1], 1 - 2 * run[0].0[0])).collect();
    let longest = runs.iter().map(|(_, length)| *length).max().unwrap_or(1);
    let mut doubled = vec![from.z_mm.clone()];
    for level in 0..longest.ilog2() as usize {
        let mut next = doubled[level].clone();
        let by = 1 << level;
        let count = next.len().saturating_sub(by);
        // Runs past the end of a row are not looked at.
        all(&mut next[..count], &doubled[level][by..], 0.0);
        doubled.push(next);
    }
    for row in window.row..window.row_end() {
        let start = (row - window.row) as usize * window.columns;
        let to = &mut to.z_mm[start..start + window.columns];
        for &(up, length) in &runs {
            let level = length.ilog2() as usize;
            let first = window.column - (length - 1) / 2;
            for first in [first, first + length - (1 << level)] {
                let from = &doubled[level][place(from.window, row + up, first)..];
                all(to, &from[..window.columns], 0.0);
            }
        }
    }
}

fn place(window: Window, row: i64, column: i64) -> usize {
    (row - window.row) as usize * window.columns + (column - window.column) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_of_any_width_are_as_defined() {
        for (cutter, columns) in [("ball:1", 37), ("ball:1", 64), ("vee:90:0.1:1", 150), ("flat:1", 70)] {
            let shape: Shape = cutter.parse().expect("a cutter");
            let offsets = offsets(&shape, 0.01, 7, |blocks| (8 * blocks - 7).max(0));
            let out = Window { column: -5, row: 3, columns, rows: 9 };
            let around = out.grown(7);
            let z_mm = (0..around.samples()).map(|k| (k * k % 7919) as f32 * 1e-3).collect();
            let from = Heights { window: around, z_mm };
            let [mut most, mut least] = [f32::NEG_INFINITY, f32::INFINITY]
                .map(|z| Heights { window: out, z_mm: vec![z; out.samples()] });
            raise_over(&mut most, &from, &offsets);
            lower_over(&mut least, &from, &offsets);
            for row in out.row..out.row_end() {
                for column in out.column..out.column_end() {
                    let near = |([across, up], rise): &Offset| {
                        (from.z_mm[place(around, row + up, column + across)], *rise)
                    };
                    let at = place(out, row, column);
                    let highest =
                        offsets.iter().map(near).map(|(z, rise)| z - rise).fold(f32::NEG_INFINITY, f32::max);
                    let lowest =
                        offsets.iter().map(near).map(|(z, rise)| z + rise).fold(f32::INFINITY, f32::min);
                    assert_eq!((most.z_mm[at], least.z_mm[at]), (highest, lowest), "{cutter} {columns}");
                }
            }
        }
    }
}
