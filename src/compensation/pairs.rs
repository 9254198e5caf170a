use super::ball::Reachable;
use super::blocks::Block;
use super::lanes::LANES;
use super::stencil::{ArcRef, Stencil};
use std::ops::Range;
use std::sync::Arc;

/// Which input row touches which row of cutter positions, and with what arc. Input row `a` and
/// target row `b` are counted from 0 in their field; sample `i` of row `a` lies under position
/// `i - shift(b) - dx` of row `b` for every dx of their arc.
pub(super) trait Pairs: Sync {
    /// The arc of a pair; None where the rows are out of reach.
    fn arc(&self, a: i64, b: usize) -> Option<ArcRef<'_>>;

    /// The column offset of a target row.
    fn shift(&self, b: usize) -> i64;

    /// (x of a sample less x of a position) in samples, less its dx.
    fn fx(&self, a: i64, b: usize) -> f64;

    /// The y of an input row in samples, from anywhere; for rows that are no lattice.
    fn y(&self, a: i64) -> f64 {
        a as f64
    }

    /// The targets whose row lies y_a - high ..= y_a - low, distances in samples; may give more.
    fn targets(&self, a: i64, low: f64, high: f64) -> Range<usize>;

    /// The input rows that can reach target `b`; may give more.
    fn inputs(&self, b: usize) -> Range<i64>;

    /// Whether input rows are one sample apart and aligned, so that a sample's neighbours above
    /// and below bound its contacts too.
    fn is_lattice(&self) -> bool;

    /// Whether offsets are whole samples.
    fn is_whole(&self) -> bool {
        false
    }

    /// These pairs, if positions are samples.
    fn on_samples(&self) -> Option<&OnSamples<'_>> {
        None
    }

    /// A bound on the rounding of two table entries, in mm.
    fn slack_mm(&self) -> f32;
}

/// Positions on the samples' own lattice: every `every`-th row from `target_row`.
pub(super) struct OnSamples<'a> {
    pub stencil: &'a Stencil,
    pub reach: i64,
    pub input_rows: i64,
    pub input_row: i64,
    pub target_row: i64,
    pub target_rows: usize,
    pub every: i64,
    pub shift: i64,
}

impl OnSamples<'_> {
    /// The row of a target.
    #[inline(always)]
    pub fn target(&self, b: usize) -> i64 {
        self.target_row + b as i64 * self.every
    }

    /// A row of the field, counted from that of target 0.
    #[inline(always)]
    pub fn row(&self, a: i64) -> i64 {
        self.input_row + a - self.target_row
    }

    /// The targets whose rows lie in `low ..= high`, counted from that of target 0.
    #[inline(always)]
    pub fn targets_in(&self, [low, high]: [i64; 2]) -> Range<usize> {
        if high < low.max(0) {
            return 0..0;
        }
        let (low, end) = (low.max(0) as u32, (high + 1) as u32);
        let every = self.every as u32;
        let [first, end] = [low, end].map(|row| if every == 1 { row } else { row.div_ceil(every) } as usize);
        first..end.min(self.target_rows)
    }

    /// The offsets at which samples of a block reach targets of so many columns, if it lies beside all of them.
    #[inline(always)]
    pub fn within(&self, block: Block, columns: usize) -> Option<Reachable> {
        let column = block.first as i64 - self.shift;
        let row = self.row(block.a);
        let (last_column, last_row) = (column + LANES as i64 - 1, row + block.rows as i64 - 1);
        let (right, top) = (columns as i64 - 1, (self.target_rows as i64 - 1) * self.every);
        let is_beside = last_column < 0 || column > right || last_row < 0 || row > top;
        let range = |low: i64, high: i64| [low as f64, high as f64];
        is_beside.then(|| Reachable { x: range(column - right, last_column), y: range(row - top, last_row) })
    }
}

impl Pairs for OnSamples<'_> {
    #[inline(always)]
    fn arc(&self, a: i64, b: usize) -> Option<ArcRef<'_>> {
        self.stencil.arc(self.input_row + a - self.target(b))
    }

    #[inline(always)]
    fn shift(&self, _: usize) -> i64 {
        self.shift
    }

    #[inline(always)]
    fn fx(&self, _: i64, _: usize) -> f64 {
        self.stencil.fx
    }

    #[inline(always)]
    fn targets(&self, a: i64, low: f64, high: f64) -> Range<usize> {
        let row = self.row(a);
        self.targets_in([row - high.floor() as i64, row - low.ceil() as i64])
    }

    fn inputs(&self, b: usize) -> Range<i64> {
        let centre = self.target(b) - self.input_row;
        (centre - self.reach).clamp(0, self.input_rows)..(centre + self.reach + 1).clamp(0, self.input_rows)
    }

    fn is_lattice(&self) -> bool {
        true
    }

    fn is_whole(&self) -> bool {
        true
    }

    #[inline(always)]
    fn on_samples(&self) -> Option<&OnSamples<'_>> {
        Some(self)
    }

    fn slack_mm(&self) -> f32 {
        self.stencil.slack_mm
    }
}

/// Rows at any y and x offset over lattice samples: a planner's passes on its controller's grid.
pub(super) struct OverSamples<'a> {
    pub stencils: &'a [Arc<Stencil>],
    pub rows: &'a [TargetRow],
    pub reach: i64,
    pub input_rows: i64,
    pub input_row: i64,
    pub slack_mm: f32,
}

/// One such row, `fy` pitches below the samples of row `row`.
pub(super) struct TargetRow {
    pub stencil: usize,
    pub row: i64,
    pub shift: i64,
    /// In rows of samples.
    pub y: f64,
}

impl Pairs for OverSamples<'_> {
    #[inline(always)]
    fn arc(&self, a: i64, b: usize) -> Option<ArcRef<'_>> {
        let target = &self.rows[b];
        self.stencils[target.stencil].arc(self.input_row + a - target.row)
    }

    #[inline(always)]
    fn shift(&self, b: usize) -> i64 {
        self.rows[b].shift
    }

    #[inline(always)]
    fn fx(&self, _: i64, b: usize) -> f64 {
        self.stencils[self.rows[b].stencil].fx
    }

    fn targets(&self, a: i64, low: f64, high: f64) -> Range<usize> {
        let y = (self.input_row + a) as f64;
        let first = self.rows.partition_point(|t| t.y < y - high - 1e-6);
        let end = self.rows.partition_point(|t| t.y <= y - low + 1e-6);
        first..end.max(first)
    }

    fn inputs(&self, b: usize) -> Range<i64> {
        let centre = self.rows[b].row - self.input_row;
        (centre - self.reach - 1).clamp(0, self.input_rows)
            ..(centre + self.reach + 2).clamp(0, self.input_rows)
    }

    fn is_lattice(&self) -> bool {
        true
    }

    fn slack_mm(&self) -> f32 {
        self.slack_mm
    }
}

/// Lattice samples under passes: the passes are the input and the samples the targets; profiles
/// are round, so which of the two stands on the axis is all one.
pub(super) struct UnderPasses<'a> {
    pub stencils: &'a [Arc<Stencil>],
    pub passes: &'a [PassRow],
    pub reach: i64,
    pub target_row: i64,
    pub target_rows: usize,
    pub slack_mm: f32,
    pub shift: i64,
}

/// One pass: its y is (row + fy) rows of samples.
pub(super) struct PassRow {
    pub stencil: usize,
    pub row: i64,
}

impl Pairs for UnderPasses<'_> {
    #[inline(always)]
    fn arc(&self, a: i64, b: usize) -> Option<ArcRef<'_>> {
        let pass = &self.passes[a as usize];
        self.stencils[pass.stencil].arc(pass.row - self.target_row - b as i64)
    }

    #[inline(always)]
    fn shift(&self, _: usize) -> i64 {
        self.shift
    }

    #[inline(always)]
    fn fx(&self, a: i64, _: usize) -> f64 {
        self.stencils[self.passes[a as usize].stencil].fx
    }

    #[inline(always)]
    fn y(&self, a: i64) -> f64 {
        let pass = &self.passes[a as usize];
        pass.row as f64 + self.stencils[pass.stencil].fy
    }

    fn targets(&self, a: i64, low: f64, high: f64) -> Range<usize> {
        let pass = &self.passes[a as usize];
        let y = (pass.row - self.target_row) as f64 + self.stencils[pass.stencil].fy;
        let first = ((y - high).floor().max(0.0) as usize).min(self.target_rows);
        let end = ((y - low).ceil() + 1.0).max(0.0) as usize;
        first..end.min(self.target_rows).max(first)
    }

    fn inputs(&self, b: usize) -> Range<i64> {
        let row = self.target_row + b as i64;
        let first = self.passes.partition_point(|p| p.row < row - self.reach - 1);
        let end = self.passes.partition_point(|p| p.row <= row + self.reach + 1);
        first as i64..end.max(first) as i64
    }

    fn is_lattice(&self) -> bool {
        false
    }

    fn slack_mm(&self) -> f32 {
        self.slack_mm
    }
}
