//! The cutter swept through the stock, block by block, exact on the samples.
//!
//! Every sample's height becomes the least of what it was and the lowest the cutter came over it. A
//! move is straight, so per sample that is one closed form (see [`super::contact`]). Of a chain of
//! moves each sample is taken only by those over which its height has a minimum: where one move
//! hands a sample on, still falling, to the next, the next will take it. That saves most of the
//! work, and makes a bite a property of the path, not of how the path was cut into blocks.

use rayon::prelude::*;

use super::contact::{Contact, Lean, with_contact};
use super::judged::{CHUNK, Class, Judged};
use crate::grid::{Heights, Window};

/// A sample at distance exactly R counts; the sum of coordinates that places it may be off by this.
const REACH_MM: f64 = 1e-10;
/// Both moves at a corner take the samples this near to the border between them.
const OVERLAP_MM: f64 = 1e-9;
/// Lateral moves shorter than this are vertical.
const SHORT_MM: f64 = 1e-6;
/// Rows per task; a constant, so that it is no part of how the answer comes about.
const BAND_ROWS: usize = 64;

/// The deepest layer that a sample lost at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bite {
    pub depth_mm: f64,
    /// The sample after the cut, in the frame of the part.
    pub at_mm: [f64; 3],
    /// Line of the program's text.
    pub line: u32,
    motion: usize,
    row: i64,
    column: i64,
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
    /// The deepest bite of any motion in mm, 0 if nothing was cut.
    pub fn deepest_bite_mm(&self) -> f64 {
        [self.cut, self.plunge, self.rapid].iter().flatten().fold(0.0, |most, b| b.depth_mm.max(most))
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

/// A block after all programs.
#[derive(Clone, Debug)]
pub struct Swept {
    /// Heights in the part frame less the datum, NaN beyond the blank.
    pub heights: Heights,
    /// One per program, in their order.
    pub programs: Vec<ProgramCut>,
}

/// Cuts the programs through a block of stock in their order.
///
/// `stock` holds heights in mm less `datum_mm`, NaN where there is none (see [`super::Blank::heights`]); its samples
/// stand at ((column + 1/2) step, (row + 1/2) step) of the part frame. Heights are computed in double and
/// stored as float: exact to the nanometre within 8 mm of the datum. The answer for a sample is the
/// same to the bit whatever the block and however many threads.
pub fn sweep(stock: Heights, step_mm: f64, datum_mm: f64, programs: &[Judged]) -> Swept {
    let mut heights = stock;
    let window = heights.window;
    let mut totals = vec![ProgramCut::default(); programs.len()];
    if window.samples() == 0 {
        return Swept { heights, programs: totals };
    }
    let x_mm: Vec<f64> = (0..window.columns).map(|c| (window.column + c as i64) as f64).collect();
    let x_mm: Vec<f64> = x_mm.iter().map(|c| (c + 0.5) * step_mm).collect();
    let bands: Vec<Vec<ProgramCut>> = heights
        .z_mm
        .par_chunks_mut(window.columns * BAND_ROWS)
        .enumerate()
        .map(|(index, z_mm)| {
            let row = window.row + (index * BAND_ROWS) as i64;
            let rows = z_mm.len() / window.columns;
            let y_mm = (0..rows).map(|r| ((row + r as i64) as f64 + 0.5) * step_mm).collect();
            let mut band = Band {
                z_mm,
                x_mm: &x_mm,
                y_mm,
                per_mm: step_mm.recip(),
                window: Window { row, rows, ..window },
                datum_mm,
            };
            programs
                .iter()
                .map(|judged| with_contact!(&judged.shape, contact => band.take(contact, judged)))
                .collect()
        })
        .collect();
    for band in &bands {
        for (total, part) in totals.iter_mut().zip(band) {
            total.merge(part);
        }
    }
    Swept { heights, programs: totals }
}

/// How a move lies to the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lie {
    /// All of it was taken with the move before.
    Nothing,
    /// Only its end counts.
    Point,
    /// Parallel to an axis: every line of samples along it is cut by a straight line.
    Along(usize),
    Oblique,
}

/// One move in the part frame, z less the datum.
#[derive(Clone, Copy)]
struct Leg {
    from: [f64; 3],
    to: [f64; 3],
    /// Unit vector in the plane.
    u: [f64; 2],
    length: f64,
    lean: Lean,
    lie: Lie,
    class: Class,
}

/// The deepest bite of one class so far.
#[derive(Clone, Copy)]
struct Watch {
    depth: f32,
    motion: usize,
    row: usize,
    column: usize,
    z: f32,
}

struct Band<'a> {
    z_mm: &'a mut [f32],
    x_mm: &'a [f64],
    y_mm: Vec<f64>,
    /// Samples per mm.
    per_mm: f64,
    window: Window,
    datum_mm: f64,
}

impl Band<'_> {
    fn take<C: Contact>(&mut self, contact: C, judged: &Judged) -> ProgramCut {
        let mut watches = [Watch { depth: 0.0, motion: usize::MAX, row: 0, column: 0, z: 0.0 }; 3];
        let motions = &judged.reading.motions;
        let reach = contact.radius() + OVERLAP_MM;
        let (x, y) = (self.x_mm, &self.y_mm);
        let low = [x[0] - reach, y[0] - reach];
        let high = [x[x.len() - 1] + reach, y[y.len() - 1] + reach];
        let apart =
            |l: [f64; 2], h: [f64; 2]| h[0] < low[0] || l[0] > high[0] || h[1] < low[1] || l[1] > high[1];
        for (chunk, bounds) in judged.chunks.iter().enumerate() {
            if apart(bounds[0], bounds[1]) {
                continue;
            }
            let first = chunk * CHUNK;
            let last = (first + CHUNK).min(motions.len());
            let mut next = leg(&contact, judged, first, self.datum_mm);
            for index in first..last {
                let this = next;
                next = (index + 1 < motions.len())
                    .then(|| leg(&contact, judged, index + 1, self.datum_mm))
                    .flatten();
                let Some(this) = this else { continue };
                let l = [this.from[0].min(this.to[0]), this.from[1].min(this.to[1])];
                let h = [this.from[0].max(this.to[0]), this.from[1].max(this.to[1])];
                if apart(l, h) {
                    continue;
                }
                let watch = &mut watches[this.class as usize];
                match this.lie {
                    Lie::Nothing => {}
                    Lie::Point => self.disc(&contact, &this, index, watch),
                    Lie::Along(0) => self.along::<C, 0>(&contact, &this, next.as_ref(), index, watch),
                    Lie::Along(_) => self.along::<C, 1>(&contact, &this, next.as_ref(), index, watch),
                    Lie::Oblique => self.oblique(&contact, &this, next.as_ref(), index, watch),
                }
            }
        }
        let bite = |watch: &Watch| {
            (watch.motion != usize::MAX).then(|| Bite {
                depth_mm: f64::from(watch.depth),
                at_mm: [self.x_mm[watch.column], self.y_mm[watch.row], f64::from(watch.z) + self.datum_mm],
                line: motions[watch.motion].line,
                motion: watch.motion,
                row: self.window.row + watch.row as i64,
                column: self.window.column + watch.column as i64,
            })
        };
        let [cut, plunge, rapid] = watches;
        ProgramCut { cut: bite(&cut), plunge: bite(&plunge), rapid: bite(&rapid) }
    }

    /// First and one past the last index along an axis whose samples lie in low .. high mm.
    #[inline(always)]
    fn range(&self, axis: usize, low: f64, high: f64) -> (usize, usize) {
        let (start, count) = if axis == 0 {
            (self.window.column, self.window.columns)
        } else {
            (self.window.row, self.window.rows)
        };
        // Counted from the part's corner first, so that no block sees another range.
        let index = |mm: f64| ceil(mm * self.per_mm - 0.5).saturating_sub(start).clamp(0, count as i64);
        let first = index(low - OVERLAP_MM) as usize;
        let end = index(high + OVERLAP_MM) as usize;
        (first, end.max(first))
    }

    /// Samples of line `line` across `AXIS`, from `first` to `end` along it, lowered to `value` of their
    /// coordinate along `AXIS`.
    #[inline(always)]
    fn lower<const AXIS: usize>(
        &mut self,
        line: usize,
        (first, end): (usize, usize),
        motion: usize,
        watch: &mut Watch,
        value: impl Fn(f64) -> f64,
    ) {
        let columns = self.window.columns;
        if AXIS == 0 {
            let z = &mut self.z_mm[line * columns + first..line * columns + end];
            let x = &self.x_mm[first..end];
            let (wide, tail) = z.as_chunks_mut::<8>();
            let (x_wide, x_tail) = x.as_chunks::<8>();
            for (chunk, (z, x)) in wide.iter_mut().zip(x_wide).enumerate() {
                let before = *z;
                let mut most = 0.0f32;
                for i in 0..8 {
                    let new = value(x[i]) as f32;
                    let after = if new < before[i] { new } else { before[i] };
                    let cut = before[i] - after;
                    most = if cut > most { cut } else { most };
                    z[i] = after;
                }
                if watch.wants(most, motion) {
                    for i in 0..8 {
                        watch.see(before[i], z[i], motion, line, first + 8 * chunk + i);
                    }
                }
            }
            let done = first + 8 * wide.len();
            for (i, (z, x)) in tail.iter_mut().zip(x_tail).enumerate() {
                let new = value(*x) as f32;
                if new < *z {
                    watch.see(*z, new, motion, line, done + i);
                    *z = new;
                }
            }
        } else {
            for row in first..end {
                let z = &mut self.z_mm[row * columns + line];
                let new = value(self.y_mm[row]) as f32;
                if new < *z {
                    watch.see(*z, new, motion, row, line);
                    *z = new;
                }
            }
        }
    }

    /// The cutter standing at the move's end.
    fn disc<C: Contact>(&mut self, contact: &C, leg: &Leg, motion: usize, watch: &mut Watch) {
        let reach = contact.radius() + REACH_MM;
        let (first, end) = self.range(1, leg.to[1] - reach, leg.to[1] + reach);
        for row in first..end {
            let d = self.y_mm[row] - leg.to[1];
            let d2 = d * d;
            let q = (reach * reach - d2).max(0.0).sqrt();
            let columns = self.range(0, leg.to[0] - q, leg.to[0] + q);
            let [x, _, z] = leg.to;
            self.lower::<0>(row, columns, motion, watch, |at| z + contact.rise(d2 + (at - x) * (at - x)));
        }
    }

    fn along<C: Contact, const AXIS: usize>(
        &mut self,
        contact: &C,
        leg: &Leg,
        next: Option<&Leg>,
        motion: usize,
        watch: &mut Watch,
    ) {
        let across = 1 - AXIS;
        let reach = contact.radius() + REACH_MM;
        // A move begins where the last one ended, which took what is lowest there.
        let (from, to, length) = (leg.from, leg.to, leg.length);
        let sign = leg.u[AXIS].signum();
        let next = next.filter(|n| n.class == leg.class && n.lie == leg.lie && n.u[AXIS].signum() == sign);
        let (first, end) = self.range(across, from[across] - reach, from[across] + reach);
        let slope = leg.lean.m * sign;
        // Distances along the move to coordinates along the axis, in rising order.
        let interval = |low: f64, high: f64| {
            if sign > 0.0 {
                (from[AXIS] + low, from[AXIS] + high)
            } else {
                (from[AXIS] - high, from[AXIS] - low)
            }
        };
        for line in first..end {
            let at = if AXIS == 0 { self.y_mm[line] } else { self.x_mm[line] };
            let d = at - from[across];
            let d2 = d * d;
            let q = (reach * reach - d2).max(0.0).sqrt();
            let slide = contact.slide(d2, q, &leg.lean);
            let body = interval(-slide, length - slide);
            let body = self.range(AXIS, body.0, body.1);
            let level = from[2] + leg.lean.m * slide + contact.rise(d2 + slide * slide);
            let origin = from[AXIS];
            self.lower::<AXIS>(line, body, motion, watch, |x| level + slope * (x - origin));
            // What the next move goes on to lower, it takes.
            let ahead = next.map_or(q, |n| -contact.slide(d2, q, &n.lean));
            if ahead > -slide {
                let cap = interval(length - slide, length + ahead);
                let cap = self.range(AXIS, cap.0, cap.1);
                let (x_end, z_end) = (to[AXIS], to[2]);
                self.lower::<AXIS>(line, cap, motion, watch, |x| {
                    z_end + contact.rise(d2 + (x - x_end) * (x - x_end))
                });
            }
        }
    }

    fn oblique<C: Contact>(
        &mut self,
        contact: &C,
        leg: &Leg,
        next: Option<&Leg>,
        motion: usize,
        watch: &mut Watch,
    ) {
        let reach = contact.radius() + REACH_MM;
        let next = next.filter(|n| n.class == leg.class);
        let ([ux, uy], length, m) = (leg.u, leg.length, leg.lean.m);
        let low = leg.from[1].min(leg.to[1]) - reach;
        let high = leg.from[1].max(leg.to[1]) + reach;
        let (first, end) = self.range(1, low, high);
        // Uphill and level, nothing behind the start has its minimum on this move.
        let behind = if m >= 0.0 { 0.0 } else { reach };
        for row in first..end {
            let dy = self.y_mm[row] - leg.from[1];
            // |d| <= reach and -behind <= s <= length + reach, both linear in x.
            let (mut west, mut east) = (f64::NEG_INFINITY, f64::INFINITY);
            for (rate, offset, low, high) in
                [(-uy, ux * dy, -reach, reach), (ux, uy * dy, -behind, length + reach)]
            {
                if rate != 0.0 {
                    let (a, b) = ((low - offset) / rate, (high - offset) / rate);
                    west = west.max(a.min(b));
                    east = east.min(a.max(b));
                }
            }
            let (first, end) = self.range(0, leg.from[0] + west, leg.from[0] + east);
            for column in first..end {
                let (x, y) = (self.x_mm[column], self.y_mm[row]);
                let Some((s, d2, q, lowest)) = leg.lowest(contact, reach, x, y) else { continue };
                if lowest < -OVERLAP_MM {
                    continue;
                }
                let (enters, leaves) = ((s - q).max(0.0), (s + q).min(length));
                if enters > leaves {
                    continue;
                }
                if lowest > length
                    && let Some(next) = next
                    && next.takes(contact, reach, x, y)
                {
                    continue;
                }
                let t = lowest.clamp(enters, leaves);
                let new = (leg.from[2] + m * t + contact.rise(d2 + (t - s) * (t - s))) as f32;
                let z = &mut self.z_mm[row * self.window.columns + column];
                if new < *z {
                    watch.see(*z, new, motion, row, column);
                    *z = new;
                }
            }
        }
    }
}

impl Leg {
    /// For a point within reach of the move's line: its place along the move, its squared distance
    /// across, its half chord, and where on the line the cutter is lowest over it.
    #[inline(always)]
    fn lowest<C: Contact>(&self, contact: &C, reach: f64, x: f64, y: f64) -> Option<(f64, f64, f64, f64)> {
        let (dx, dy) = (x - self.from[0], y - self.from[1]);
        let s = self.u[0] * dx + self.u[1] * dy;
        let d = self.u[0] * dy - self.u[1] * dx;
        let d2 = d * d;
        let left = reach * reach - d2;
        if left < 0.0 {
            return None;
        }
        let q = left.sqrt();
        Some((s, d2, q, s + contact.slide(d2, q, &self.lean)))
    }

    /// Whether this move goes on to lower a point that the cutter covers at its start.
    #[inline(always)]
    fn takes<C: Contact>(&self, contact: &C, reach: f64, x: f64, y: f64) -> bool {
        let moves = matches!(self.lie, Lie::Along(_) | Lie::Oblique);
        moves && self.lowest(contact, reach, x, y).is_some_and(|(.., lowest)| lowest > OVERLAP_MM)
    }
}

impl Watch {
    #[inline(always)]
    fn wants(&self, depth: f32, motion: usize) -> bool {
        depth > self.depth || (depth == self.depth && motion == self.motion)
    }

    /// Keeps the first of equals by motion, row and column.
    #[inline(always)]
    fn see(&mut self, before: f32, after: f32, motion: usize, row: usize, column: usize) {
        let depth = before - after;
        if self.wants(depth, motion) && (depth > self.depth || (row, column) < (self.row, self.column)) {
            *self = Watch { depth, motion, row, column, z: after };
        }
    }
}

#[inline(always)]
fn ceil(value: f64) -> i64 {
    let whole = value as i64;
    whole + i64::from(value > whole as f64)
}

/// Motion `index` as a move, or None where its end is not known.
fn leg<C: Contact>(contact: &C, judged: &Judged, index: usize, datum_mm: f64) -> Option<Leg> {
    let motions = &judged.reading.motions;
    let motion = &motions[index];
    if !motion.known() {
        return None;
    }
    let zero = [judged.zero_mm[0], judged.zero_mm[1], judged.zero_mm[2] - datum_mm];
    let place = |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| p[axis] + zero[axis]) };
    let to = place(motion.to_mm);
    let known = index.checked_sub(1).map(|i| &motions[i]).filter(|m| m.known());
    let from = known.map_or(to, |m| place(m.to_mm));
    let delta: [f64; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
    let length = delta[0].hypot(delta[1]);
    let rapid = judged.rapid(motion);
    let vertical = length < SHORT_MM;
    let class = match (rapid, vertical && delta[2] < 0.0) {
        (true, _) => Class::Rapid,
        (false, true) => Class::Plunge,
        (false, false) => Class::Cut,
    };
    let lie = if vertical {
        if known.is_some() && delta[2] >= 0.0 && length == 0.0 { Lie::Nothing } else { Lie::Point }
    } else if delta[1] == 0.0 {
        Lie::Along(0)
    } else if delta[0] == 0.0 {
        Lie::Along(1)
    } else {
        Lie::Oblique
    };
    let (u, m) =
        if vertical { ([0.0; 2], 0.0) } else { ([delta[0] / length, delta[1] / length], delta[2] / length) };
    Some(Leg { from, to, u, length, lean: contact.lean(m), lie, class })
}
