//! Contacts only: of all samples under a cutter, those that can touch it.
//!
//! If sample y is the contact of the cutter at x, d = y - x, then for every neighbour u with
//! d + u under the cutter h(y) + s(d) >= h(y + u) + s(d + u), so s(d) - s(d + u) >= h(y + u) - h(y):
//! the known rise to a neighbour bounds d, because s is concave. A pair (y, d) that breaks the
//! inequality on the table's own values loses to its neighbour strictly, and the chain of such
//! losses ends at a pair that is kept, so the maximum over the kept pairs is the maximum over
//! all, to the bit. (The raster form of the contact-point search of Lou, Jiang and Scott,
//! Proc. R. Soc. A 469 (2013) 20130150.)

use super::Profile;
use super::ball::{Ball, Reachable};
use super::brute;
use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, Vectors, raise, whole_groups, widest};
use super::pairs::Pairs;
use super::slopes::{CELL, Rises, RowRises};
use super::stencil::ArcRef;
use std::marker::PhantomData;

/// Samples of a row that are first tried as one run.
const BLOCK: usize = 4 * CELL;

/// Groups of lanes that a run may cost before it is split.
const CHEAP: usize = 6;

/// What bounding one run and finding its rows costs, in groups of lanes.
const RUN_WORK: f64 = 60.0;

/// What looking at far neighbours costs, in groups of lanes.
const FAR_WORK: f64 = 400.0;

/// Groups of lanes from which a sample's box is worth tightening by far neighbours.
pub(super) const WIDE: f64 = 100.0;

widest! {
    /// Raises the targets by every sample of the field that can touch a cutter there, or sets
    /// `given_up` because taking every sample is less work on such a surface.
    fn contacts<P: Pairs>(field: &Field, pairs: &P, profile: &Profile, out: &mut Targets, given_up: &mut bool) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(
    field: &Field,
    pairs: &P,
    profile: &Profile,
    out: &mut Targets,
    given_up: &mut bool,
) {
    let with_y = pairs.is_lattice();
    let mut rises = RowRises::new(field);
    let ball = Ball { radius: profile.radius(), step_mm: profile.step_mm(), slack_mm: pairs.slack_mm() };
    let columns = rises.cells().len();
    let mut search = Search::<V, P> {
        field,
        pairs,
        ball,
        alike_mm: (0.4 * ball.step_mm / ball.radius) as f32,
        work: 0.0,
        starts: Vec::new(),
        known: vec![Known::default(); columns + 2],
        known_blocks: vec![Known::default(); columns.div_ceil(BLOCK / CELL)],
        vectors: PhantomData,
    };
    let every_tap = brute::work(profile, out);
    for a in 0..field.rows as i64 {
        let part = a as f64 / field.rows as f64;
        if part > 0.1 && search.work > part * every_tap {
            *given_up = true;
            return;
        }
        rises.measure(field, a, with_y);
        search.starts.clear();
        for (block, cells) in rises.cells().chunks(BLOCK / CELL).enumerate() {
            let all = cells.iter().fold(Rises::NO_SAMPLE, |all, cell| all.with(*cell));
            if all.is_no_sample() {
                continue;
            }
            let first = block * BLOCK;
            if with_y {
                search.boxed_block(a, first, cells, all, out);
            } else {
                search.unboxed_block(a, first, cells, all, out);
            }
        }
    }
}

/// The small box of some rises, kept because the next row is likely to lie on the same facet.
#[derive(Clone, Copy)]
struct Known {
    rises: Rises,
    at: Reachable,
}

impl Default for Known {
    fn default() -> Known {
        Known { rises: Rises::NO_SAMPLE, at: Reachable { x: [0.0, 0.0], y: [0.0, 0.0] } }
    }
}

struct Search<'a, V: Vectors, P: Pairs> {
    field: &'a Field,
    pairs: &'a P,
    ball: Ball,
    /// Rises that differ by less move a contact by less than a sample.
    alike_mm: f32,
    /// Done so far, in groups of lanes.
    work: f64,
    /// Where the last block's contacts lay, by target row: the next block's lie close by.
    starts: Vec<[i32; 2]>,
    /// By cell, from the rows before; the first and last are no cell's.
    known: Vec<Known>,
    known_blocks: Vec<Known>,
    vectors: PhantomData<V>,
}

impl<V: Vectors, P: Pairs> Search<'_, V, P> {
    /// The box of rises, from `known` if they lie within its own; a box of few points is kept
    /// there, made for rises somewhat wider.
    #[inline(always)]
    fn reachable(
        ball: &Ball,
        rises: &Rises,
        known: &mut Known,
        wider_mm: f32,
        few: f64,
    ) -> Option<Reachable> {
        if known.rises.holds(rises) {
            return Some(known.at);
        }
        let wider = rises.wider(wider_mm);
        let at = ball.reachable(&wider)?;
        if at.lattice_points() <= few {
            *known = Known { rises: wider, at };
        }
        Some(at)
    }

    #[inline(always)]
    fn boxed_block(&mut self, a: i64, first: usize, cells: &[Rises], all: Rises, out: &mut Targets) {
        let wider_mm = 0.25 * self.alike_mm;
        let known = &mut self.known_blocks[first / BLOCK];
        // Slopes this far apart make no small box; finding out by trying costs more.
        let promising = all.spread() <= 4.0 * self.alike_mm;
        if promising {
            match Self::reachable(&self.ball, &all, known, wider_mm, 4.5) {
                None => return,
                Some(at) if at.lattice_points() <= 4.5 => {
                    return self.boxed_run(a, first, cells.len() * CELL, all, at, out);
                }
                Some(_) => {}
            }
        }
        for (c, cell) in cells.iter().enumerate() {
            if cell.is_no_sample() {
                continue;
            }
            let first = first + c * CELL;
            if cell.spread() > 8.0 * self.alike_mm {
                self.samples(a, first, out);
                continue;
            }
            let known = &mut self.known[first / CELL + 1];
            match Self::reachable(&self.ball, cell, known, wider_mm, 6.5) {
                None => {}
                Some(at) if at.lattice_points() <= 6.5 => self.boxed_run(a, first, CELL, *cell, at, out),
                Some(_) => self.samples(a, first, out),
            }
        }
    }

    /// The samples of one cell, in runs of about the same slope.
    #[inline(always)]
    fn samples(&mut self, a: i64, first: usize, out: &mut Targets) {
        let mut i = 0;
        while i < CELL {
            let mut rises = Rises::of(self.field, a, PAD + first + i, true);
            if rises.is_no_sample() {
                i += 1;
                continue;
            }
            let mut end = i + 1;
            while end < CELL && rises.spread() <= self.alike_mm {
                let more = rises.with(Rises::of(self.field, a, PAD + first + end, true));
                if more.spread() > self.alike_mm {
                    break;
                }
                rises = more;
                end += 1;
            }
            // The facets left and right of an edge were known to the cells beside it.
            let cell = first / CELL + 1;
            let known = [cell - 1, cell, cell + 1].map(|at| self.known[at]);
            let at = match known.iter().find(|known| known.rises.holds(&rises)) {
                Some(known) => Some(known.at),
                None => self.ball.reachable(&rises),
            };
            if let Some(at) = at {
                self.boxed_run(a, first + i, end - i, rises, at, out);
            }
            i = end;
        }
    }

    /// One run whose contacts lie in a box.
    #[inline(always)]
    fn boxed_run(
        &mut self,
        a: i64,
        first: usize,
        len: usize,
        rises: Rises,
        at: Reachable,
        out: &mut Targets,
    ) {
        self.work += RUN_WORK + at.groups() * len as f64;
        let at = if len == 1 && at.groups() > WIDE {
            self.work += FAR_WORK;
            match self.ball.far_neighbours(self.field, a, PAD + first, at) {
                Some(at) => at,
                None => return,
            }
        } else {
            at
        };
        for b in self.pairs.targets(a, at.y[0], at.y[1]) {
            let Some(arc) = self.pairs.arc(a, b) else { continue };
            let fx = self.pairs.fx(a, b);
            let mut lo = ((at.x[0] - fx).ceil() as i32).max(arc.arc.lo);
            let mut hi = ((at.x[1] - fx).floor() as i32).min(arc.arc.hi);
            while lo <= hi && self.rises_right(&arc, lo, rises.x_next) {
                lo += 1;
            }
            while lo <= hi && self.falls_left(&arc, hi, rises.x_before) {
                hi -= 1;
            }
            let above = self.pairs.arc(a + 1, b);
            let below = self.pairs.arc(a - 1, b);
            let out_of_y = |dx: i32| {
                let beaten = |by: &Option<ArcRef>, rise: f32| {
                    by.as_ref().is_some_and(|by| {
                        dx >= by.arc.lo && dx <= by.arc.hi && rise - self.give(rise) > arc.s(dx) - by.s(dx)
                    })
                };
                beaten(&above, rises.y_next) || beaten(&below, -rises.y_before)
            };
            while lo <= hi && out_of_y(lo) {
                lo += 1;
            }
            while lo <= hi && out_of_y(hi) {
                hi -= 1;
            }
            if lo <= hi {
                self.touch(a, b, &arc, first, len, [lo, hi], out);
            }
        }
    }

    /// What a rise may be off by.
    #[inline(always)]
    fn give(&self, rise_mm: f32) -> f32 {
        self.ball.slack_mm + rise_mm.abs() * f32::EPSILON
    }

    /// Whether the next sample always beats this one at dx.
    #[inline(always)]
    fn rises_right(&self, arc: &ArcRef, dx: i32, rise: f32) -> bool {
        dx < arc.arc.hi && rise - self.give(rise) > arc.s(dx) - arc.s(dx + 1)
    }

    /// Whether the sample before always beats this one at dx.
    #[inline(always)]
    fn falls_left(&self, arc: &ArcRef, dx: i32, rise: f32) -> bool {
        dx > arc.arc.lo && rise + self.give(rise) < arc.s(dx - 1) - arc.s(dx)
    }

    /// The dx at which samples with these rises can touch: s along a row is concave, so they are
    /// an interval. `near` is where to look first.
    #[inline(always)]
    fn interval(&self, arc: &ArcRef, rises: &Rises, near: [i32; 2]) -> [i32; 2] {
        let mut lo = near[0].clamp(arc.arc.lo, arc.arc.hi);
        if self.rises_right(arc, lo, rises.x_next) {
            lo += 1;
            while self.rises_right(arc, lo, rises.x_next) {
                lo += 1;
            }
        } else {
            while lo > arc.arc.lo && !self.rises_right(arc, lo - 1, rises.x_next) {
                lo -= 1;
            }
        }
        let mut hi = near[1].clamp(arc.arc.lo, arc.arc.hi);
        if self.falls_left(arc, hi, rises.x_before) {
            hi -= 1;
            while self.falls_left(arc, hi, rises.x_before) {
                hi -= 1;
            }
        } else {
            while hi < arc.arc.hi && !self.falls_left(arc, hi + 1, rises.x_before) {
                hi += 1;
            }
        }
        [lo, hi]
    }

    /// A block of which only dx is bounded: every target row in reach.
    #[inline(always)]
    fn unboxed_block(&mut self, a: i64, first: usize, cells: &[Rises], all: Rises, out: &mut Targets) {
        let targets = self.pairs.targets(a, -self.ball.radius - 1.0, self.ball.radius + 1.0);
        if self.starts.len() < targets.len() {
            self.starts.resize(targets.len(), [0, 0]);
        }
        let from = targets.start;
        for b in targets {
            let Some(arc) = self.pairs.arc(a, b) else { continue };
            let near = self.interval(&arc, &all, self.starts[b - from]);
            self.starts[b - from] = near;
            let [lo, hi] = near;
            if lo > hi {
                continue;
            }
            let groups = (hi - lo + 1) as usize * (BLOCK / LANES);
            if groups <= 2 * CHEAP {
                self.touch(a, b, &arc, first, cells.len() * CELL, near, out);
                continue;
            }
            for (c, cell) in cells.iter().enumerate() {
                if cell.is_no_sample() {
                    continue;
                }
                let [lo, hi] = self.interval(&arc, cell, near);
                if lo > hi {
                    continue;
                }
                let first = first + c * CELL;
                if (hi - lo) as usize <= CHEAP {
                    self.touch(a, b, &arc, first, CELL, [lo, hi], out);
                    continue;
                }
                for i in first..first + CELL {
                    let rises = Rises::of(self.field, a, PAD + i, false);
                    if !rises.is_no_sample() {
                        let [lo, hi] = self.interval(&arc, &rises, [lo, hi]);
                        if lo <= hi {
                            self.touch(a, b, &arc, i, 1, [lo, hi], out);
                        }
                    }
                }
            }
        }
    }

    /// Samples `first .. first + len` of row `a` at offsets `lo ..= hi`: raises row `b`.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn touch(
        &self,
        a: i64,
        b: usize,
        arc: &ArcRef,
        first: usize,
        len: usize,
        [lo, hi]: [i32; 2],
        out: &mut Targets,
    ) {
        let shift = self.pairs.shift(b);
        let columns = out.columns as i64;
        let row = self.field.row(a);
        let to = out.row_mut(b);
        let width = (hi - lo + 1) as usize;
        if width * len.div_ceil(LANES) <= len * width.div_ceil(LANES) {
            for dx in lo..=hi {
                let origin = first as i64 - shift - dx as i64;
                let start = origin.max(0);
                let end = (origin + len as i64).min(columns);
                if start < end {
                    let n = whole_groups((end - start) as usize);
                    let from = &row[(PAD as i64 + start + shift + dx as i64) as usize..][..n];
                    raise::<V>(&mut to[start as usize..][..n], from, arc.s(dx));
                }
            }
        } else {
            for i in first..first + len {
                let origin = i as i64 - shift;
                let start = (origin - hi as i64).max(0);
                let end = (origin - lo as i64 + 1).min(columns);
                if start < end {
                    let n = whole_groups((end - start) as usize);
                    let from = &arc.values[arc.index((origin - start) as i32)..][..n];
                    raise::<V>(&mut to[start as usize..][..n], from, row[PAD + i]);
                }
            }
        }
    }
}
