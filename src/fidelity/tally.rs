//! Deviation of the machined surface from the design, counted block by block.

use std::f64::consts::{FRAC_PI_4, PI};
use std::ops::Range;

use super::Pixels;
use super::histogram::Histogram;
use super::pixels::{Line, total};
use crate::grid::{Heights, Window};

/// |deviation| is counted in nanometres.
const DEVIATION_QUANTUM_MM: f64 = 1e-6;
/// Normals' errors are counted in ten-thousandths of a degree.
const ANGLE_QUANTUM_DEG: f64 = 1e-4;
/// Sums are kept in whole 2^-40 mm, so that the order of adding cannot change them.
pub(super) const SUM_UNITS_PER_MM: f64 = (1u64 << 40) as f64;

/// What changes the answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Distance between samples in mm.
    pub step_mm: f64,
    /// The job's limit on |deviation| in mm, when it has one.
    pub limit_mm: Option<f64>,
}

/// The surfaces of one block, each in mm and in a window of its own that covers the block. `design` and
/// `machined` should reach one sample further on every side where the tile goes on (central differences).
#[derive(Clone, Copy, Debug)]
pub struct Layers<'a> {
    pub design: &'a Heights,
    /// Read back from the program text.
    pub machined: &'a Heights,
    /// Minimum over the job's cutters of the closing, less the design; never negative.
    pub cavity: Option<&'a Heights>,
    /// What the finishing passes leave before any rounding to the controller's grid.
    pub passes: Option<&'a Heights>,
}

/// A sample and its figure, e.g. the deepest gouge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    pub mm: f64,
    pub column: i64,
    pub row: i64,
}

impl Place {
    /// x and y of the sample in the part frame.
    pub fn where_mm(&self, step_mm: f64) -> [f64; 2] {
        [(self.column as f64 + 0.5) * step_mm, (self.row as f64 + 0.5) * step_mm]
    }

    /// The larger figure; on ties the lower row, then the lower column.
    fn larger(a: Option<Place>, b: Option<Place>) -> Option<Place> {
        match (a, b) {
            (Some(x), Some(y)) if y.mm > x.mm || (y.mm == x.mm && (y.row, y.column) < (x.row, x.column)) => b,
            (None, _) => b,
            _ => a,
        }
    }
}

/// Area means in mm that add up to the mean deviation, over the samples where every layer has data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByCause {
    /// Cavity. `None` when no cavity layer was given; then `scallop` holds it too.
    pub unreachable_mm: Option<f64>,
    /// Exact passes less the closing.
    pub scallop_mm: f64,
    /// Read-back less exact passes. `None` when no passes were given; then `scallop` holds it too.
    pub rounding_mm: Option<f64>,
}

/// The figures of a tile or a part. `None` where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// Samples with a design and a machined height.
    pub samples: u64,
    /// Samples with a design but no machined height: they are judged by nothing.
    pub unjudged: u64,
    /// The largest negative deviation as a positive number; 0 without one.
    pub gouge_max_mm: f64,
    pub gouge_where_mm: Option<[f64; 2]>,
    pub excess_max_mm: f64,
    pub excess_where_mm: Option<[f64; 2]>,
    pub deviation_mean_mm: Option<f64>,
    pub deviation_p50_mm: Option<f64>,
    pub deviation_p99_mm: Option<f64>,
    /// Part of the samples with |deviation| at most the limit, counted exactly; `None` without a limit.
    pub within_limit_fraction: Option<f64>,
    pub normal_p50_deg: Option<f64>,
    pub normal_p95_deg: Option<f64>,
    /// Part of the samples where a cavity of more than 1 um is left.
    pub cavity_area_fraction: Option<f64>,
    pub cavity_max_depth_mm: Option<f64>,
    pub by_cause: Option<ByCause>,
}

/// A sample counts as cavity above this depth in mm.
pub const CAVITY_THRESHOLD_MM: f64 = 0.001;

/// Everything counted so far. Tallies of any blocks merge in any order to the same bits.
///
/// Deviation = machined - design. Percentiles of |deviation| are read from a histogram of 1 nm up to 1.05 mm
/// and of one part in 500,000 above; those of the normals' error from 1e-4 degrees up. Gouge, excess and the part within the limit are exact. No data (NaN or infinite) in design or
/// machined leaves a sample out.
///
/// A normal is (-dz/dx, -dz/dy, 1) by central differences at the raster step. Where one neighbour has no data
/// in either surface (a tile's edge) both surfaces use the one-sided difference; a sample without a neighbour on
/// both sides of an axis has no normal.
#[derive(Clone, Debug, PartialEq)]
pub struct Tally {
    params: Params,
    samples: u64,
    unjudged: u64,
    within: u64,
    gouge: Option<Place>,
    excess: Option<Place>,
    deviation: Histogram,
    deviation_sum: i128,
    normals: Histogram,
    cavity_samples: u64,
    cavity_above: u64,
    cavity_max_mm: f64,
    cause_samples: u64,
    cause_sums: [i128; 3],
    has_cavity: bool,
    has_passes: bool,
}

impl Tally {
    /// Nothing counted yet.
    pub fn new(params: Params) -> Tally {
        Tally {
            params,
            samples: 0,
            unjudged: 0,
            within: 0,
            gouge: None,
            excess: None,
            deviation: Histogram::default(),
            deviation_sum: 0,
            normals: Histogram::default(),
            cavity_samples: 0,
            cavity_above: 0,
            cavity_max_mm: 0.0,
            cause_samples: 0,
            cause_sums: [0; 3],
            has_cavity: false,
            has_passes: false,
        }
    }

    /// Counts the samples of `block`, whose columns and rows are the part's.
    pub fn add(&mut self, block: Window, layers: Layers) -> Result<(), super::Error> {
        self.add_with(block, layers, None)
    }

    /// Counts as [`Tally::add`] does, and adds the normals' errors in degrees to a map of the part or of the block.
    pub fn add_with(
        &mut self,
        block: Window,
        layers: Layers,
        mut normals: Option<&mut Pixels>,
    ) -> Result<(), super::Error> {
        covers("design", layers.design, block)?;
        covers("machined", layers.machined, block)?;
        layers.cavity.map_or(Ok(()), |cavity| covers("cavity", cavity, block))?;
        layers.passes.map_or(Ok(()), |passes| covers("passes", passes, block))?;
        self.has_cavity |= layers.cavity.is_some();
        self.has_passes |= layers.passes.is_some();
        let mut keys = vec![0.0; block.columns];
        for row in block.row..block.row_end() {
            self.add_row(block, row, &layers);
            let mut line = normals.as_deref().map(|map| map.line(block));
            self.add_normals(block, row, &layers, &mut keys, &mut line);
            if let (Some(map), Some(line)) = (normals.as_deref_mut(), &line) {
                map.add(row, line);
            }
        }
        Ok(())
    }

    fn add_row(&mut self, block: Window, row: i64, layers: &Layers) {
        let design = part_of_row(layers.design, block, row);
        let machined = part_of_row(layers.machined, block, row);
        let cavity = layers.cavity.map(|heights| part_of_row(heights, block, row));
        let passes = layers.passes.map(|heights| part_of_row(heights, block, row));
        for first in (0..block.columns).step_by(TOGETHER) {
            let part = first..(first + TOGETHER).min(block.columns);
            let samples = Samples {
                first: Place { mm: 0.0, column: block.column + first as i64, row },
                design: &design[part.clone()],
                machined: &machined[part.clone()],
                cavity: cavity.map(|cavity| &cavity[part.clone()]),
                passes: passes.map(|passes| &passes[part]),
            };
            if !self.add_together(&samples) {
                (0..samples.design.len()).for_each(|k| self.add_sample(&samples, k));
            }
        }
    }

    /// Counts samples that all have data and small figures; false, and nothing counted, if some have not.
    fn add_together(&mut self, samples: &Samples) -> bool {
        let count = samples.design.len();
        let nothing = [0.0; TOGETHER];
        let (mut deviation_mm, mut quanta, mut units) = (nothing, nothing, nothing);
        let (mut unreachable, mut rounding) = (nothing, nothing);
        let mut far = nothing;
        for k in 0..count {
            let mm = f64::from(samples.machined[k]) - f64::from(samples.design[k]);
            deviation_mm[k] = mm;
            quanta[k] = mm.abs() / DEVIATION_QUANTUM_MM;
            units[k] = whole(mm * SUM_UNITS_PER_MM);
            far[k] = mm.abs();
        }
        let mut above = 0;
        let mut deepest_mm = 0.0f32;
        if let Some(cavity) = samples.cavity {
            for k in 0..count {
                let mm = f64::from(cavity[k]);
                unreachable[k] = whole(mm * SUM_UNITS_PER_MM);
                far[k] += mm.abs();
                above += u64::from(mm > CAVITY_THRESHOLD_MM);
                deepest_mm = if cavity[k] > deepest_mm { cavity[k] } else { deepest_mm };
            }
        }
        if let Some(passes) = samples.passes {
            for k in 0..count {
                let mm = f64::from(samples.machined[k]) - f64::from(passes[k]);
                rounding[k] = whole(mm * SUM_UNITS_PER_MM);
                far[k] += mm.abs();
            }
        }
        // False where one of them is not a number; below this every sum of units is exact.
        if !far[..count].iter().all(|mm| *mm < TOGETHER_MM) {
            return false;
        }
        if samples.cavity.is_some() {
            self.cavity_samples += count as u64;
            self.cavity_above += above;
            self.cavity_max_mm = self.cavity_max_mm.max(f64::from(deepest_mm));
        }
        self.samples += count as u64;
        self.deviation.add_all(&quanta[..count]);
        if let Some(limit) = self.params.limit_mm {
            let within = deviation_mm[..count].iter().map(|mm| u64::from(mm.abs() <= limit)).sum::<u64>();
            self.within += within;
        }
        let [gouge_mm, excess_mm] =
            [self.gouge, self.excess].map(|place| place.map_or(0.0, |place| place.mm));
        let extremes = deviation_mm[..count]
            .iter()
            .fold(0u32, |sum, mm| sum + u32::from(*mm <= -gouge_mm) + u32::from(*mm >= excess_mm));
        if extremes > 0 {
            (0..count).for_each(|k| self.look_at(samples.place(k), deviation_mm[k]));
        }
        let [all, unreachable, rounding] =
            [units, unreachable, rounding].map(|units| i128::from(total(&units) as i64));
        self.deviation_sum += all;
        self.cause_samples += count as u64;
        self.cause_sums[0] += unreachable;
        self.cause_sums[1] += all - unreachable - rounding;
        self.cause_sums[2] += rounding;
        true
    }

    fn add_sample(&mut self, samples: &Samples, k: usize) {
        let cavity_mm = samples.cavity.map_or(0.0, |cavity| f64::from(cavity[k]));
        if samples.cavity.is_some() && cavity_mm.is_finite() {
            self.cavity_samples += 1;
            self.cavity_above += u64::from(cavity_mm > CAVITY_THRESHOLD_MM);
            self.cavity_max_mm = self.cavity_max_mm.max(cavity_mm);
        }
        let (design_mm, machined_mm) = (f64::from(samples.design[k]), f64::from(samples.machined[k]));
        let deviation_mm = machined_mm - design_mm;
        if !deviation_mm.is_finite() {
            self.unjudged += u64::from(design_mm.is_finite());
            return;
        }
        let sum = to_sum(deviation_mm);
        self.samples += 1;
        self.deviation_sum += i128::from(sum);
        self.deviation.add(deviation_mm.abs() / DEVIATION_QUANTUM_MM);
        self.within += u64::from(self.params.limit_mm.is_some_and(|limit| deviation_mm.abs() <= limit));
        self.look_at(samples.place(k), deviation_mm);
        let rounding_mm = samples.passes.map_or(0.0, |passes| machined_mm - f64::from(passes[k]));
        if cavity_mm.is_finite() && rounding_mm.is_finite() {
            let (unreachable, rounding) = (to_sum(cavity_mm), to_sum(rounding_mm));
            self.cause_samples += 1;
            self.cause_sums[0] += i128::from(unreachable);
            // What the other two leave, so that the three add up to the bit.
            self.cause_sums[1] += i128::from(sum - unreachable - rounding);
            self.cause_sums[2] += i128::from(rounding);
        }
    }

    /// Keeps the deepest gouge and the largest excess.
    #[inline(always)]
    fn look_at(&mut self, place: Place, deviation_mm: f64) {
        let known = |place: Option<Place>| place.map_or(0.0, |place| place.mm);
        if deviation_mm <= -known(self.gouge) || deviation_mm >= known(self.excess) {
            self.extreme(Place { mm: deviation_mm.abs(), ..place }, deviation_mm);
        }
    }

    fn extreme(&mut self, place: Place, deviation_mm: f64) {
        if deviation_mm < 0.0 {
            self.gouge = Place::larger(self.gouge, Some(place));
        } else if deviation_mm > 0.0 {
            self.excess = Place::larger(self.excess, Some(place));
        }
    }

    fn add_normals(
        &mut self,
        block: Window,
        row: i64,
        layers: &Layers,
        keys: &mut [f64],
        line: &mut Option<Line>,
    ) {
        let (Some(design), Some(machined)) =
            (Stencil::at(layers.design, block, row), Stencil::at(layers.machined, block, row))
        else {
            return;
        };
        let per_step = 1.0 / self.params.step_mm;
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
                self.normals.add_all(keys);
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
                self.normals.add(key);
                if let Some(line) = line {
                    let small = key < SMALL * KEY_OF_45_DEG;
                    let degrees = if small { key * ANGLE_QUANTUM_DEG } else { angle_of_key(key) };
                    line.add(block.column + (start + k) as i64, [1.0, degrees]);
                }
            }
        }
    }

    /// Takes over everything another tally counted with the same parameters.
    pub fn merge(&mut self, other: &Tally) {
        debug_assert_eq!(self.params, other.params);
        self.samples += other.samples;
        self.unjudged += other.unjudged;
        self.within += other.within;
        self.gouge = Place::larger(self.gouge, other.gouge);
        self.excess = Place::larger(self.excess, other.excess);
        self.deviation.merge(&other.deviation);
        self.deviation_sum += other.deviation_sum;
        self.normals.merge(&other.normals);
        self.cavity_samples += other.cavity_samples;
        self.cavity_above += other.cavity_above;
        self.cavity_max_mm = self.cavity_max_mm.max(other.cavity_max_mm);
        self.cause_samples += other.cause_samples;
        for (mine, theirs) in self.cause_sums.iter_mut().zip(other.cause_sums) {
            *mine += theirs;
        }
        self.has_cavity |= other.has_cavity;
        self.has_passes |= other.has_passes;
    }

    /// What was counted, as figures.
    pub fn figures(&self) -> Figures {
        let step_mm = self.params.step_mm;
        let fraction = |part: u64, of: u64| (of > 0).then(|| part as f64 / of as f64);
        let mean = |sum: i128, of: u64| (of > 0).then(|| sum as f64 / SUM_UNITS_PER_MM / of as f64);
        let percentile = |p: f64| self.deviation.percentile(p).map(|quanta| quanta * DEVIATION_QUANTUM_MM);
        let normal = |p: f64| self.normals.percentile(p).map(angle_of_key);
        let cause = |index: usize| mean(self.cause_sums[index], self.cause_samples);
        Figures {
            samples: self.samples,
            unjudged: self.unjudged,
            gouge_max_mm: self.gouge.map_or(0.0, |place| place.mm),
            gouge_where_mm: self.gouge.map(|place| place.where_mm(step_mm)),
            excess_max_mm: self.excess.map_or(0.0, |place| place.mm),
            excess_where_mm: self.excess.map(|place| place.where_mm(step_mm)),
            deviation_mean_mm: mean(self.deviation_sum, self.samples),
            deviation_p50_mm: percentile(0.50),
            deviation_p99_mm: percentile(0.99),
            within_limit_fraction: self.params.limit_mm.and_then(|_| fraction(self.within, self.samples)),
            normal_p50_deg: normal(0.50),
            normal_p95_deg: normal(0.95),
            cavity_area_fraction: fraction(self.cavity_above, self.cavity_samples),
            cavity_max_depth_mm: (self.cavity_samples > 0).then_some(self.cavity_max_mm),
            by_cause: cause(1).map(|scallop_mm| ByCause {
                unreachable_mm: cause(0).filter(|_| self.has_cavity),
                scallop_mm,
                rounding_mm: cause(2).filter(|_| self.has_passes),
            }),
        }
    }
}

/// Samples side by side in every layer.
struct Samples<'a> {
    first: Place,
    design: &'a [f32],
    machined: &'a [f32],
    cavity: Option<&'a [f32]>,
    passes: Option<&'a [f32]>,
}

impl Samples<'_> {
    fn place(&self, k: usize) -> Place {
        Place { column: self.first.column + k as i64, ..self.first }
    }
}

/// Samples that are counted together.
const TOGETHER: usize = 128;

/// Sums of so many figures below this, in the sums' units, are exact in a double.
const TOGETHER_MM: f64 = 16.0;

/// The nearest whole number, the even one of two, up to 2^51: plain x86-64 has no instruction for it.
fn whole(units: f64) -> f64 {
    const SHIFT: f64 = (3u64 << 51) as f64;
    (units + SHIFT) - SHIFT
}

/// Rounded to the sums' unit; differences of real surfaces are far below the 8 km at which this saturates.
pub(super) fn to_sum(mm: f64) -> i64 {
    let units = mm * SUM_UNITS_PER_MM;
    // Past 2^51 units, 2 m, what is left of one does not matter.
    if units.abs() < (1u64 << 51) as f64 { whole(units) as i64 } else { units as i64 }
}

pub(super) fn covers(layer: &'static str, heights: &Heights, block: Window) -> Result<(), super::Error> {
    if heights.window.intersection(&block) == Some(block) {
        return Ok(());
    }
    Err(super::Error::Uncovered { layer, has: heights.window, needs: block })
}

/// The block's samples of one row.
pub(super) fn part_of_row(heights: &Heights, block: Window, row: i64) -> &[f32] {
    &heights.row(row)[(block.column - heights.window.column) as usize..][..block.columns]
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
    for i in 0..count {
        let slope = |low: f32, high: f32| (f64::from(high) - f64::from(low)) * per_rise;
        let a = [slope(dl[i], dr[i]), slope(db[i], da[i])];
        let b = [slope(ml[i], mr[i]), slope(mb[i], ma[i])];
        let (cross, dot) = cross_and_dot(a, b);
        // NaN where the sample itself has no data.
        let held = 0.0 * (f64::from(dc[i]) - f64::from(mc[i]));
        keys[i] = cross / dot * KEY_OF_45_DEG + held;
    }
}

/// Of the normals (-ax, -ay, 1) and (-bx, -by, 1).
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
