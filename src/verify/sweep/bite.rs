//! The deepest layers that programs take at once.

use super::above::{Above, GROUP};

/// The deepest layer that a sample lost at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bite {
    pub depth_mm: f64,
    /// The sample after the cut, in the frame of the part.
    pub at_mm: [f64; 3],
    /// Line of the program's text.
    pub line: u32,
    pub(super) motion: usize,
    pub(super) row: i64,
    pub(super) column: i64,
}

impl Bite {
    fn before(&self, other: &Bite) -> bool {
        let key = |b: &Bite| (b.motion, b.row, b.column);
        self.depth_mm > other.depth_mm || (self.depth_mm == other.depth_mm && key(self) < key(other))
    }
}

/// What one program took from the stock of one block, or of several merged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProgramCut {
    /// By feed motions that are not straight down.
    pub cut: Option<Bite>,
    /// By feed motions straight down.
    pub plunge: Option<Bite>,
    /// By rapids: any is a collision.
    pub rapid: Option<Bite>,
}

impl ProgramCut {
    /// The deepest bite of any motion; None if nothing was cut.
    pub fn deepest(&self) -> Option<Bite> {
        let bites = [self.cut, self.plunge, self.rapid].into_iter().flatten();
        bites.reduce(|deepest, bite| if bite.before(&deepest) { bite } else { deepest })
    }

    /// Its depth in mm, 0 if nothing was cut.
    pub fn deepest_bite_mm(&self) -> f64 {
        self.deepest().map_or(0.0, |bite| bite.depth_mm)
    }

    /// Whether any sample was lowered.
    pub fn touched(&self) -> bool {
        self.cut.is_some() || self.plunge.is_some() || self.rapid.is_some()
    }

    /// Takes in what the same program took elsewhere; order does not matter.
    pub fn merge(&mut self, other: &ProgramCut) {
        let mine = [&mut self.cut, &mut self.plunge, &mut self.rapid];
        for (mine, theirs) in mine.into_iter().zip([other.cut, other.plunge, other.rapid]) {
            if let Some(bite) = theirs
                && mine.is_none_or(|m| bite.before(&m))
            {
                *mine = Some(bite);
            }
        }
    }
}

/// The deepest bite of one class of motions so far, in a band.
#[derive(Clone, Copy)]
pub(super) struct Watch {
    pub depth: f32,
    /// `usize::MAX` before the first.
    pub motion: usize,
    pub row: usize,
    pub column: usize,
    pub z: f32,
}

impl Watch {
    pub const NOTHING: Watch = Watch { depth: 0.0, motion: usize::MAX, row: 0, column: 0, z: 0.0 };

    #[inline(always)]
    pub fn wants(&self, depth: f32, motion: usize) -> bool {
        depth > self.depth || (depth == self.depth && motion == self.motion)
    }

    /// Keeps the first of equals by motion, row and column.
    #[inline(always)]
    pub fn see(&mut self, before: f32, after: f32, motion: usize, row: usize, column: usize) {
        let depth = before - after;
        if self.wants(depth, motion) && (depth > self.depth || (row, column) < (self.row, self.column)) {
            *self = Watch { depth, motion, row, column, z: after };
        }
    }

    /// [`Watch::see`] of a group along a row; `ordered` where a motion's samples come by rising row and column.
    #[inline(always)]
    pub fn group<V: Above>(
        &mut self,
        before: &[f32; GROUP],
        after: &[f32; GROUP],
        motion: usize,
        (row, column): (usize, usize),
        ordered: bool,
    ) {
        let ties = !ordered && motion == self.motion;
        let over = if ties { self.depth.next_down() } else { self.depth };
        let mut bits = V::above(before, after, over);
        while bits != 0 {
            let k = bits.trailing_zeros() as usize;
            self.see(before[k], after[k], motion, row, column + k);
            bits &= bits - 1;
        }
    }
}
