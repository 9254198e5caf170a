//! Deviation of the machined surface from the design, counted block by block.

use super::Pixels;
use super::histogram::Histogram;
use super::normals::Normals;
use super::pixels::total;
use super::rounding::whole;
use crate::grid::{Heights, Window};

/// |deviation| is counted in nanometres.
const DEVIATION_QUANTUM_MM: f64 = 1e-6;
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
    normals: Normals,
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
            normals: Normals::default(),
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
            self.normals.add_row(block, row, &layers, self.params.step_mm, &mut keys, &mut line);
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
            if !pulp::Arch::new().dispatch(|| self.add_together(&samples)) {
                (0..samples.design.len()).for_each(|k| self.add_sample(&samples, k));
            }
        }
    }

    /// Counts samples that all have data and small figures; false, and nothing counted, if some have not.
    #[inline(always)]
    fn add_together(&mut self, samples: &Samples) -> bool {
        // Copied, so that no row that is read can be what is written.
        let Samples { design, machined, cavity, passes, .. } = *samples;
        let count = design.len();
        let (design, machined) = (&design[..count], &machined[..count]);
        let nothing = [0.0; TOGETHER];
        let (mut deviation_mm, mut quanta, mut units) = (nothing, nothing, nothing);
        let (mut unreachable, mut rounding) = (nothing, nothing);
        let mut far = nothing;
        for k in 0..count {
            let mm = f64::from(machined[k]) - f64::from(design[k]);
            deviation_mm[k] = mm;
            quanta[k] = mm.abs() / DEVIATION_QUANTUM_MM;
            units[k] = whole(mm * SUM_UNITS_PER_MM);
            far[k] = mm.abs();
        }
        let mut above = 0;
        let mut deepest_mm = 0.0f32;
        if let Some(cavity) = cavity {
            let cavity = &cavity[..count];
            for k in 0..count {
                let mm = f64::from(cavity[k]);
                unreachable[k] = whole(mm * SUM_UNITS_PER_MM);
                far[k] += mm.abs();
                above += u64::from(mm > CAVITY_THRESHOLD_MM);
                deepest_mm = if cavity[k] > deepest_mm { cavity[k] } else { deepest_mm };
            }
        }
        if let Some(passes) = passes {
            let passes = &passes[..count];
            for k in 0..count {
                let mm = f64::from(machined[k]) - f64::from(passes[k]);
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
            normal_p50_deg: self.normals.percentile_deg(0.50),
            normal_p95_deg: self.normals.percentile_deg(0.95),
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
pub(super) const TOGETHER: usize = 128;

/// Sums of so many figures below this, in the sums' units, are exact in a double.
const TOGETHER_MM: f64 = 16.0;

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
