//! Maps of a tile, handed over in strips and reduced where they would be too large.

use super::Error;

/// Maps hold at most this many samples a tile unless the job asks for all.
pub const FULL_SAMPLES: usize = 64_000_000;

/// Whole rows of a tile, lowest y first, each layer `rows * columns` samples in mm.
#[derive(Clone, Copy, Debug)]
pub struct Strip<'a> {
    pub design: &'a [f32],
    pub machined: &'a [f32],
    /// Empty where no cavities were looked for: the map is no data then.
    pub cavity: &'a [f32],
}

/// One row of every map, in mm; NaN is no data. Row 0 has the lowest y.
#[derive(Clone, Debug, PartialEq)]
pub struct MapRow {
    pub row: usize,
    pub design: Vec<f32>,
    pub machined: Vec<f32>,
    /// Machined - design.
    pub deviation: Vec<f32>,
    pub cavity: Vec<f32>,
}

impl MapRow {
    fn empty(row: usize, columns: usize) -> MapRow {
        let none = vec![f32::NAN; columns];
        MapRow { row, design: none.clone(), machined: none.clone(), deviation: none.clone(), cavity: none }
    }
}

/// Reduces full rows to map rows. A reduced sample stands for a block of factor x factor samples: design, machined
/// and deviation are those of the block's sample with the largest |deviation|, the first in row order on ties
/// (the first sample with a design where none has a deviation); cavity is the block's largest.
#[derive(Debug)]
pub struct Reducer {
    columns: usize,
    rows: usize,
    factor: usize,
    taken: usize,
    row: MapRow,
}

impl Reducer {
    /// The smallest whole factor that keeps the maps within `most_samples`.
    pub fn within(columns: usize, rows: usize, most_samples: usize) -> Reducer {
        let most = most_samples.max(1);
        let fits = |factor: &usize| columns.div_ceil(*factor).saturating_mul(rows.div_ceil(*factor)) <= most;
        let factor = (1..=columns.max(rows).max(1)).find(fits).unwrap_or(1);
        Reducer::by_factor(columns, rows, factor)
    }

    /// Reduces by this factor, 1 for none.
    pub fn by_factor(columns: usize, rows: usize, factor: usize) -> Reducer {
        let factor = factor.max(1);
        Reducer { columns, rows, factor, taken: 0, row: MapRow::empty(0, columns.div_ceil(factor)) }
    }

    /// Samples of the tile along each side of a map's sample.
    pub fn factor(&self) -> usize {
        self.factor
    }

    /// Columns of the maps.
    pub fn columns(&self) -> usize {
        self.columns.div_ceil(self.factor)
    }

    /// Rows of the maps.
    pub fn rows(&self) -> usize {
        self.rows.div_ceil(self.factor)
    }

    /// Takes the next rows of the tile and hands on each map row as soon as it is whole.
    pub fn push<E: From<Error>>(
        &mut self,
        strip: Strip,
        mut each: impl FnMut(&MapRow) -> Result<(), E>,
    ) -> Result<(), E> {
        let columns = self.columns;
        let rows = strip.design.len() / columns.max(1);
        let agree = strip.design.len() == rows * columns
            && strip.machined.len() == strip.design.len()
            && (strip.cavity.is_empty() || strip.cavity.len() == strip.design.len());
        let rows_left = self.rows - self.taken;
        if !agree || rows > rows_left {
            return Err(Error::Strip { samples: strip.design.len(), columns, rows_left }.into());
        }
        for row in 0..rows {
            let part =
                |layer: &'_ [f32]| if layer.is_empty() { 0..0 } else { row * columns..(row + 1) * columns };
            self.take(
                &strip.design[part(strip.design)],
                &strip.machined[part(strip.machined)],
                &strip.cavity[part(strip.cavity)],
            );
            self.taken += 1;
            if self.taken.is_multiple_of(self.factor) || self.taken == self.rows {
                each(&self.row)?;
                self.row = MapRow::empty(self.row.row + 1, self.columns());
            }
        }
        Ok(())
    }

    fn take(&mut self, design: &[f32], machined: &[f32], cavity: &[f32]) {
        let MapRow {
            design: out_design,
            machined: out_machined,
            deviation: out_deviation,
            cavity: out_cavity,
            ..
        } = &mut self.row;
        let held = out_design.iter_mut().zip(out_machined).zip(out_deviation);
        let blocks = design.chunks(self.factor).zip(machined.chunks(self.factor));
        for (((out_design, out_machined), out_deviation), (design, machined)) in held.zip(blocks) {
            let mut most = (*out_design, *out_machined, *out_deviation);
            // Which sample is the largest is as good as random: chosen without a jump.
            for (&design, &machined) in design.iter().zip(machined) {
                let deviation = (f64::from(machined) - f64::from(design)) as f32;
                let first = most.2.is_nan() & (!deviation.is_nan() | most.0.is_nan());
                let larger = first | (deviation.abs() > most.2.abs());
                let this = (design, machined, deviation);
                most = std::hint::select_unpredictable(larger, this, most);
            }
            (*out_design, *out_machined, *out_deviation) = most;
        }
        for (out, cavity) in out_cavity.iter_mut().zip(cavity.chunks(self.factor)) {
            // f32::max passes over NaN.
            *out = cavity.iter().fold(*out, |most, &depth| most.max(depth));
        }
    }
}
