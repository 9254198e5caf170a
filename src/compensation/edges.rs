//! Samples on the edges of facets and of walls, under a ball: those of a block that have a box of offsets in common.

use super::ball::Reachable;
use super::blocks::{Block, Lanes, ROWS, Side, count, least_rise};
use super::bundle::raise_bundle;
use super::field::{Field, Targets};
use super::lanes::{LANES, Vectors, Work};
use super::pairs::OnSamples;
use super::rolling::{NARROW_WORK, Rolling, WIDE_ROW_WORK};
use super::runs::{BoxRows, Offsets, One, Run, raise_row};
use super::slopes::Rises;

/// Offsets of samples that are taken at once, at most, and what looking at them costs.
pub(super) const BUNDLED: usize = 600;
const BUNDLE_WORK: usize = 40;

/// Samples of a block, at most, that are sorted by the side to which the surface drops off.
const MOST_DROPPING: u32 = 48;

/// Samples of a row, at least, that are raised together where their box is large.
const TOGETHER: u32 = 4;

/// The samples of a block that are left to bound.
pub(super) struct Edges<'a, 'b, V: Vectors> {
    pub rolling: &'a mut Rolling<V>,
    pub field: &'a Field,
    pub on: &'a OnSamples<'b>,
    pub block: Block,
    pub lanes: &'a Lanes,
    pub left: &'a mut [u16; ROWS],
    pub out: &'a mut Targets,
}

impl<V: Vectors> Work<V> for Edges<'_, '_, V> {
    type Done = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let Edges { rolling, field, on, block, lanes, left, out } = self;
        rolling.bundled(field, on, block, lanes, left, out)
    }
}

impl<V: Vectors> Rolling<V> {
    /// Takes the samples of a block at once that have a box in common: those on edges, and those from which the surface
    /// drops off to the same side.
    #[inline(always)]
    fn bundled(
        &mut self,
        field: &Field,
        on: &OnSamples,
        block: Block,
        lanes: &Lanes,
        left: &mut [u16; ROWS],
        out: &mut Targets,
    ) -> usize {
        let Some(moderate) = &self.moderate else { return 0 };
        let most_mm = moderate.steepest * self.ball.step_mm as f32;
        let within_mm = moderate.spread * self.ball.step_mm as f32 + 4.0 * self.ball.slack_mm;
        let mut work = BUNDLE_WORK;
        let gentle = lanes.gentle::<V>(left, most_mm);
        // The other gentle ones are in valleys: no ball reaches them.
        let mut these = lanes.no_valley::<V>(&gentle, within_mm);
        let mut drop = None;
        let mut sides = Side::ALL.into_iter();
        let mut taken = gentle;
        loop {
            let mut is_taken = true;
            let mut wide = None;
            if these != [0; ROWS] {
                let rises = lanes.around::<V>(&these);
                if let Some(at) = self.common(field, block, &rises, &these, drop) {
                    let offsets = Offsets::of(&at);
                    is_taken = offsets.taps() <= BUNDLED
                        && raise_bundle::<V>(field, on, block, &these, &offsets, out);
                    work += if is_taken { offsets.taps() * 2 } else { 0 };
                    if !is_taken && drop.is_some() {
                        wide = Some((at, rises));
                    }
                }
            }
            if let Some((at, rises)) = wide {
                work += self.along(field, on, block, &these, &rises, &at, out);
                is_taken = true;
            }
            if is_taken {
                for (left, taken) in left.iter_mut().zip(&taken) {
                    *left &= !taken;
                }
            }
            if *left == [0; ROWS] {
                return work;
            }
            if drop.is_none() && count(left) > MOST_DROPPING {
                return work;
            }
            drop = sides.next();
            let Some(side) = drop else { return work };
            these = lanes.dropping::<V>(left, side, most_mm);
            taken = these;
        }
    }

    /// The box of some samples of a block, from which the surface drops off to a side.
    #[inline(always)]
    fn common(
        &self,
        field: &Field,
        block: Block,
        rises: &Rises,
        these: &[u16; ROWS],
        drop: Option<Side>,
    ) -> Option<Reachable> {
        let at = self.ball.reachable(rises, self.moderate.as_ref())?;
        let Some(side) = drop else { return Some(at) };
        let rise_mm = match side {
            Side::Right => rises.x_next,
            Side::Left => -rises.x_before,
            Side::Up => rises.y_next,
            Side::Down => -rises.y_before,
        };
        let m = self.ball.looks_off(rise_mm);
        if m as f64 >= self.ball.radius {
            return Some(at);
        }
        self.ball.beyond(at, side, m as f64, least_rise::<V>(field, block, these, side, m))
    }

    /// Takes some samples of a block whose common box is large, row by row of the cutter.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn along(
        &mut self,
        field: &Field,
        on: &OnSamples,
        block: Block,
        these: &[u16; ROWS],
        rises: &Rises,
        at: &Reachable,
        out: &mut Targets,
    ) -> usize {
        let mut offsets = Offsets::of(at);
        let reach = on.reach as i32;
        offsets.y = [offsets.y[0].max(-reach), offsets.y[1].min(reach)];
        let [low, high] = offsets.y;
        let groups = self.row_bounds.fill::<V>(rises, &self.ball, at, [high, 1, high - low + 1]);
        let mut work = NARROW_WORK * (1 + (high - low) as usize / LANES);
        for (r, &bits) in these.iter().enumerate() {
            let a = block.a + r as i64;
            let rows = BoxRows::of(on, a, &offsets);
            if bits == 0 || rows.count == 0 {
                continue;
            }
            let of = &self.row_bounds;
            let bounds = |dy: i32| {
                let k = (high - dy) as usize;
                [of.low[k / LANES][k % LANES] as i32, of.high[k / LANES][k % LANES] as i32]
            };
            let [first, len] = [
                block.first + bits.trailing_zeros() as usize,
                LANES - (bits.leading_zeros() + bits.trailing_zeros()) as usize,
            ];
            if bits.count_ones() >= TOGETHER {
                let mut dy = rows.dy;
                for b in rows.first..rows.first + rows.count {
                    let arc = on.stencil.arc_there(dy);
                    let [lo, hi] = bounds(dy);
                    let (lo, hi) = (lo.max(arc.arc.lo), hi.min(arc.arc.hi));
                    if lo <= hi {
                        raise_row::<V, OnSamples>(field, on, Run { a, first, len }, b, &arc, [lo, hi], out);
                    }
                    dy -= on.every as i32;
                }
                work += WIDE_ROW_WORK * rows.count;
                continue;
            }
            let mut bits = bits;
            while bits != 0 {
                let first = block.first + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let one = One::of::<V>(field, on, [a, first as i64]);
                let mut dy = rows.dy;
                for b in rows.first..rows.first + rows.count {
                    one.raise::<V>(on, b, dy, bounds(dy), out);
                    dy -= on.every as i32;
                }
                work += groups + WIDE_ROW_WORK * rows.count;
            }
        }
        work
    }
}
