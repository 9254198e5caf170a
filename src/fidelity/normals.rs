//! Errors of the cut surface's normals against the design's, sample by sample.

use std::f64::consts::{FRAC_PI_4, PI};
use std::ops::Range;

use super::histogram::Histogram;
use super::pixels::Line;
use super::tally::{Layers, TOGETHER};
use crate::grid::{Heights, Window};

/// Errors are counted in ten-thousandths of a degree.
const ANGLE_QUANTUM_DEG: f64 = 1e-4;

/// Angles between the normals of two surfaces, counted. What a normal is stands at [`super::Tally`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Normals {
    errors: Histogram,
}

impl Normals {
    /// Counts the errors of a row of `block`, and adds them in degrees to a line of a map; `keys` is as wide as the
    /// block.
    pub(super) fn add_row(
        &mut self,
        block: Window,
        row: i64,
        layers: &Layers,
        step_mm: f64,
        keys: &mut [f64],
        line: &mut Option<Line>,
    ) {
        let (Some(design), Some(machined)) =
            (Stencil::at(layers.design, block, row), Stencil::at(layers.machined, block, row))
        else {
            return;
        };
        let per_step = 1.0 / step_mm;
        keys.fill(f64::NAN);
        if let (Some(a), Some(b)) = (design.surrounded(block.columns), machined.surrounded(block.columns)) {
            let inner = a.start.max(b.start)..a.end.min(b.end);
            if inner.start < inner.end {
                let (design, machined) = (design.five(inner.clone()), machined.five(inner.clone()));
                angle_keys(design, machined, 0.5 * per_step, &mut keys[inner]);
            }
        }
        for (start, keys) in (0..).step_by(TOGETHER).zip(keys.chunks(TOGETHER)) {
            // The tangent is the angle to 1 % up to 10 degrees, and costs nothing.
            if keys.iter().all(|key| (0.0..SMALL * KEY_OF_45_DEG).contains(key)) {
                self.errors.add_all(keys);
                if let Some(line) = line {
                    let degrees: [f64; TOGETHER] =
                        std::array::from_fn(|k| keys.get(k).map_or(0.0, |key| key * ANGLE_QUANTUM_DEG));
                    let weights = &[1.0; TOGETHER][..keys.len()];
                    line.add_run(block.column + start as i64, weights, &degrees[..keys.len()]);
                }
                continue;
            }
            for (k, &key) in keys.iter().enumerate() {
                let quick = (0.0..KEY_OF_45_DEG).contains(&key);
                let careful = || careful_key(&design, &machined, start + k, per_step);
                let Some(key) = (if quick { Some(key) } else { careful() }) else { continue };
                self.errors.add(key);
                if let Some(line) = line {
                    let small = key < SMALL * KEY_OF_45_DEG;
                    let degrees = if small { key * ANGLE_QUANTUM_DEG } else { angle_of_key(key) };
                    line.add(block.column + (start + k) as i64, [1.0, degrees]);
                }
            }
        }
    }

    pub(super) fn merge(&mut self, other: &Normals) {
        self.errors.merge(&other.errors);
    }

    /// The error in degrees that at least this part of all samples do not exceed; None when nothing was counted.
    pub(super) fn percentile_deg(&self, fraction: f64) -> Option<f64> {
        self.errors.percentile(fraction).map(angle_of_key)
    }
}

/// Three rows of a surface, the middle one being judged.
struct Stencil<'a> {
    rows: [Option<&'a [f32]>; 3],
    offset: usize,
}

impl<'a> Stencil<'a> {
    fn at(heights: &'a Heights, block: Window, row: i64) -> Option<Stencil<'a>> {
        let held = |row: i64| {
            (row >= heights.window.row && row < heights.window.row_end()).then(|| heights.row(row))
        };
        let rows = [held(row - 1), held(row), held(row + 1)];
        rows[1].map(|_| Stencil { rows, offset: (block.column - heights.window.column) as usize })
    }

    fn sample(&self, row: usize, column: Option<usize>) -> f64 {
        self.rows[row].and_then(|row| row.get(column?)).map_or(f64::NAN, |&z| f64::from(z))
    }

    fn centre(&self, i: usize) -> f64 {
        self.sample(1, Some(self.offset + i))
    }

    /// The samples, of `columns` to be judged, that have columns on both sides and rows below and above.
    fn surrounded(&self, columns: usize) -> Option<Range<usize>> {
        let width = self.rows[0].and(self.rows[2]).and(self.rows[1])?.len();
        Some(usize::from(self.offset == 0)..columns.min(width - 1 - self.offset))
    }

    /// Left, right, below, above and centre of surrounded samples, as rows.
    fn five(&self, inner: Range<usize>) -> [&'a [f32]; 5] {
        let [below, centre, above] = self.rows.map(Option::unwrap_or_default);
        let (start, end) = (self.offset + inner.start, self.offset + inner.end);
        [
            &centre[start - 1..end - 1],
            &centre[start + 1..end + 1],
            &below[start..end],
            &above[start..end],
            &centre[start..end],
        ]
    }

    /// Left, right, below, above; NaN where there is none.
    fn around(&self, i: usize) -> [f64; 4] {
        let column = self.offset + i;
        [
            self.sample(1, column.checked_sub(1)),
            self.sample(1, Some(column + 1)),
            self.sample(0, Some(column)),
            self.sample(2, Some(column)),
        ]
    }
}

/// Rise per step along one axis, by the neighbours `low` and `low + 1` that both surfaces have.
fn difference(mine: &[f64; 4], theirs: &[f64; 4], low: usize, centre: f64) -> Option<f64> {
    let usable = |index: usize| mine[index].is_finite() && theirs[index].is_finite();
    match (usable(low), usable(low + 1)) {
        (true, true) => Some(0.5 * (mine[low + 1] - mine[low])),
        (true, false) => Some(centre - mine[low]),
        (false, true) => Some(mine[low + 1] - centre),
        (false, false) => None,
    }
}

/// The angle between the normals of one sample where a neighbour is missing or the angle large; `None` where
/// there is none.
fn careful_key(design: &Stencil, machined: &Stencil, i: usize, per_step: f64) -> Option<f64> {
    if !(design.centre(i) - machined.centre(i)).is_finite() {
        return None;
    }
    let (design_around, machined_around) = (design.around(i), machined.around(i));
    let slopes = |low: usize| {
        let a = difference(&design_around, &machined_around, low, design.centre(i))?;
        let b = difference(&machined_around, &design_around, low, machined.centre(i))?;
        Some((a * per_step, b * per_step))
    };
    let ((ax, bx), (ay, by)) = (slopes(0)?, slopes(2)?);
    let (cross, dot) = cross_and_dot([ax, ay], [bx, by]);
    let key = if cross < dot { cross / dot } else { 1.0 + (cross.atan2(dot) - FRAC_PI_4) };
    Some(key * KEY_OF_45_DEG)
}

/// [`careful_key`] of surrounded samples with angles below 45 degrees, in one sweep the compiler can vectorise;
/// NaN, infinite, negative or at least [`KEY_OF_45_DEG`] for the others.
fn angle_keys(design: [&[f32]; 5], machined: [&[f32]; 5], per_rise: f64, keys: &mut [f64]) {
    let count = keys.len();
    let [dl, dr, db, da, dc] = design.map(|row| &row[..count]);
    let [ml, mr, mb, ma, mc] = machined.map(|row| &row[..count]);
    // Moved, so that nothing that is read can be what is written.
    pulp::Arch::new().dispatch(move || {
        for i in 0..count {
            let slope = |low: f32, high: f32| (f64::from(high) - f64::from(low)) * per_rise;
            let a = [slope(dl[i], dr[i]), slope(db[i], da[i])];
            let b = [slope(ml[i], mr[i]), slope(mb[i], ma[i])];
            let (cross, dot) = cross_and_dot(a, b);
            // NaN where the sample itself has no data.
            let held = 0.0 * (f64::from(dc[i]) - f64::from(mc[i]));
            keys[i] = cross / dot * KEY_OF_45_DEG + held;
        }
    });
}

/// Of the normals (-ax, -ay, 1) and (-bx, -by, 1).
#[inline(always)]
fn cross_and_dot([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> (f64, f64) {
    let (u, v, w) = (ax - bx, ay - by, ax * by - ay * bx);
    ((u * u + v * v + w * w).sqrt(), ax * bx + ay * by + 1.0)
}

/// Tangent up to which it stands for the angle in a picture.
const SMALL: f64 = 0.17;

/// Below 45 degrees a key is the tangent in units of the angle's quantum, which needs no arc tangent; above, it
/// grows by the rest of the angle.
const KEY_OF_45_DEG: f64 = 1.0 / (ANGLE_QUANTUM_DEG * (PI / 180.0));

/// The angle in degrees of a key.
fn angle_of_key(quanta: f64) -> f64 {
    let key = quanta / KEY_OF_45_DEG;
    if key < 1.0 { key.atan().to_degrees() } else { (FRAC_PI_4 + key - 1.0).to_degrees() }
}
