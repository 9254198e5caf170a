use super::reading::Reading;
use super::travel::Travel;
use crate::cutter::Shape;
use crate::grid::{Heights, Window};

/// Motions under one bounding box.
pub(super) const CHUNK: usize = 64;

/// A program in its place: what it does, with which cutter, and where its zero lies in the frame of
/// the part.
pub struct Judged<'a> {
    pub reading: &'a Reading,
    pub shape: Shape,
    pub zero_mm: [f64; 3],
    pub(super) travel: Travel,
    /// Lowest and highest x and y of each chunk's path in the part frame, without the cutter.
    pub(super) chunks: Vec<[[f64; 2]; 2]>,
}

/// What a motion is to the stock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    Cut,
    Plunge,
    Rapid,
}

impl<'a> Judged<'a> {
    /// Indexes a program's motions by place.
    pub fn new(reading: &'a Reading, shape: Shape, zero_mm: [f64; 3]) -> Judged<'a> {
        let motions = &reading.motions;
        let mut chunks = Vec::with_capacity(motions.len().div_ceil(CHUNK));
        for first in (0..motions.len()).step_by(CHUNK) {
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for motion in &motions[first.saturating_sub(1)..(first + CHUNK).min(motions.len())] {
                for axis in 0..2 {
                    low[axis] = low[axis].min(motion.to_mm[axis] + zero_mm[axis]);
                    high[axis] = high[axis].max(motion.to_mm[axis] + zero_mm[axis]);
                }
            }
            chunks.push([low, high]);
        }
        Judged { reading, shape, zero_mm, travel: reading.travel(), chunks }
    }

    /// Whether motion `index` goes at the speed of travels, which metal does not bear.
    pub(super) fn rapid(&self, index: usize) -> bool {
        let motions = &self.reading.motions;
        let from_mm = index.checked_sub(1).map_or([f64::NAN; 3], |before| motions[before].to_mm);
        self.travel.fast(from_mm, &motions[index])
    }

    /// Lowest and highest x and y of the feed motions in the part frame, without the cutter; None if
    /// there are none.
    pub fn worked_mm(&self) -> Option<[[f64; 2]; 2]> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut last = [f64::NAN; 3];
        for (index, motion) in self.reading.motions.iter().enumerate() {
            if !self.rapid(index) {
                for axis in 0..2 {
                    let (from, to) =
                        (last[axis] + self.zero_mm[axis], motion.to_mm[axis] + self.zero_mm[axis]);
                    low[axis] = low[axis].min(from).min(to);
                    high[axis] = high[axis].max(from).max(to);
                }
            }
            last = motion.to_mm;
        }
        (low[0] <= high[0] && low[1] <= high[1]).then_some([low, high])
    }

    /// The rapid that moves in X or Y deepest below the blank's top while over or in the blank. A rapid
    /// to the machine's home counts with the place it leaves from.
    pub fn lateral_rapid(&self, blank: &Blank) -> Option<LateralRapid> {
        let reach = self.shape.radius_mm();
        let mut worst: Option<LateralRapid> = None;
        let mut last = [f64::NAN; 3];
        for (index, motion) in self.reading.motions.iter().enumerate() {
            let to: [f64; 3] = std::array::from_fn(|axis| motion.to_mm[axis] + self.zero_mm[axis]);
            // NaN differs from everything, so leaving for home counts as lateral.
            let lateral = last[0].is_finite() && (to[0] != last[0] || to[1] != last[1]);
            if lateral && self.rapid(index) && last[2].is_finite() {
                let low = last[2].min(to[2]);
                let over = (0..2).all(|axis| {
                    let (from, until) = (last[axis].min(to[axis]), last[axis].max(to[axis]));
                    from < blank.high_mm[axis] + reach && until > blank.low_mm[axis] - reach
                });
                let below_mm = blank.top_mm - low;
                if over && below_mm > 1e-6 && worst.is_none_or(|w| below_mm > w.below_mm) {
                    worst = Some(LateralRapid { below_mm, from_mm: last, to_mm: to, line: motion.line });
                }
            }
            last = to;
        }
        worst
    }
}

/// A rapid in X or Y that passes below the top of the blank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateralRapid {
    pub below_mm: f64,
    /// Part frame.
    pub from_mm: [f64; 3],
    pub to_mm: [f64; 3],
    pub line: u32,
}

/// The metal before the first cut: a box with a flat top, in the frame of the part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blank {
    pub low_mm: [f64; 2],
    pub high_mm: [f64; 2],
    pub top_mm: f64,
}

impl Blank {
    /// The blank's top at the samples of a window less `datum_mm`; NaN beyond the blank.
    pub fn heights(&self, window: Window, step_mm: f64, datum_mm: f64) -> Heights {
        let mut heights = Heights::empty(window);
        let top = (self.top_mm - datum_mm) as f32;
        let inside = |index: i64, axis: usize| {
            let at = (index as f64 + 0.5) * step_mm;
            (self.low_mm[axis] - 1e-9..=self.high_mm[axis] + 1e-9).contains(&at)
        };
        // Those inside are side by side.
        let first = (0..window.columns).position(|column| inside(window.column + column as i64, 0));
        let last = (0..window.columns).rposition(|column| inside(window.column + column as i64, 0));
        let (Some(first), Some(last)) = (first, last) else { return heights };
        for (row, z) in heights.z_mm.chunks_exact_mut(window.columns).enumerate() {
            if inside(window.row + row as i64, 1) {
                z[first..=last].fill(top);
            }
        }
        heights
    }
}
