//! Where samples can touch a ball: boxes of offsets in closed form.

use super::ball::{Ball, Reachable};
use super::blocks::{Block, Lanes, ROWS, count, patch_of};
use super::boxes::Boxes;
use super::bundle::raise_bundle;
use super::contact::{BLOCK_WORK, MANY, On, ROW_WORK, Touch};
use super::edges::Edges;
use super::field::{Field, PAD, Targets};
use super::flank::Flank;
use super::interval::Beside;
use super::lanes::{LANES, Vectors};
use super::pairs::{OnSamples, Pairs};
use super::patches::{Patch, raise_patch};
use super::rim::RowBounds;
use super::runs::{BoxRows, Offsets, Run, raise_narrow, raise_rows, raise_run, row_work};
use super::slopes::Rises;
use super::sweep::Moderate;

/// What looking at far neighbours costs.
const FAR_WORK: usize = 800;

/// What a sample on its own costs, and each target row that it may raise.
const SINGLE_WORK: usize = 30;
const SINGLE_ROW_WORK: usize = 10;
pub(super) const WIDE_ROW_WORK: usize = 22;

/// What narrowing up to [`LANES`] rows of a box costs.
pub(super) const NARROW_WORK: usize = 70;

/// Groups of lanes from which a sample's box is worth tightening by far neighbours.
pub(super) const WIDE: f64 = 100.0;

/// Lattice points of a block's box, at most, for it to be used for all its samples.
const FEW: f64 = 9.0;

/// The same for a block with an edge in it to be taken at once: splitting it is about as much work.
const BLUNT: f64 = 80.0;

/// The same for a block of an even bend: all its samples can touch.
const EVEN: f64 = 250.0;

/// Offsets of a whole block, at most, for it to be taken as a patch; else it is a bundle.
const PATCH: usize = 9;

/// Columns of such a box at most: the padding of a field holds a tile and as much again.
const WIDEST: f64 = 2.0 * LANES as f64;

/// Samples of a block from which boxes are shared by any that have nearly the same.
const MOST: u32 = 40;

/// Rows of a box from which each is narrowed by itself.
const TALL: f64 = 3.0;

/// A ball that rolls over the samples.
pub(super) struct Rolling<V: Vectors> {
    pub(super) ball: Ball,
    pub(super) moderate: Option<Moderate>,
    packed: Lanes,
    /// Where the packed samples come from: row and lane.
    from: [[u8; 2]; ROWS * LANES],
    pub(super) boxes: Boxes<V>,
    pub(super) row_bounds: RowBounds,
    /// Whether all offsets are whole samples.
    pub(super) whole: bool,
}

impl<V: Vectors, P: Pairs> Touch<V, P> for Rolling<V> {
    type At = Reachable;
    const SPREAD: f32 = 24.0;
    const EVEN_SPREAD: f32 = 80.0;

    #[inline(always)]
    fn nowhere(&self) -> Reachable {
        Reachable { x: [1.0, 0.0], y: [1.0, 0.0] }
    }

    #[inline(always)]
    fn few(&self, rises: &Rises, is_even: bool) -> Option<(Reachable, bool)> {
        match self.ball.reachable(rises, self.moderate.as_ref()) {
            None => Some((Reachable { x: [1.0, 0.0], y: [1.0, 0.0] }, true)),
            Some(at) => {
                let points = at.lattice_points();
                let fits = points <= if is_even { EVEN } else { BLUNT } && at.x[1] - at.x[0] <= WIDEST;
                fits.then_some((at, points <= FEW))
            }
        }
    }

    #[inline(always)]
    fn rows(&self, rises: &Rises) -> [f64; 2] {
        self.ball.start(rises).y
    }

    #[inline(always)]
    fn raise(&mut self, on: On<'_, P>, patch: Patch, at: &Reachable, out: &mut Targets) -> usize {
        raise::<V, P>(&on, patch, at, out)
    }

    #[inline(always)]
    fn beside(
        &mut self,
        on: &On<'_, P>,
        block: Block,
        rises: &Rises,
        lanes: &mut Lanes,
        out: &mut Targets,
    ) -> Option<(usize, [u16; ROWS])> {
        let (field, on) = (on.field, on.pairs.on_samples()?);
        let within = on.within(block, out.columns)?;
        Some(V::apart(Flank { rolling: self, field, on, block, rises, within, lanes, out }))
    }

    #[inline(always)]
    fn rest(
        &mut self,
        on: On<'_, P>,
        block: Block,
        lanes: &Lanes,
        left: &[u16; ROWS],
        out: &mut Targets,
    ) -> usize {
        let mut work = 0;
        let mut left = *left;
        if let Some(samples) = on.pairs.on_samples() {
            let (field, left) = (on.field, &mut left);
            work += V::apart(Edges { rolling: self, field, on: samples, block, lanes, left, out });
        }
        let count_left = count(&left);
        if count_left == 0 {
            return work;
        }
        let left = &left;
        if count_left > MOST {
            self.boxes.bounded = 0;
            self.boxes.fill(lanes, left, &self.ball, &self.moderate, self.whole);
            work += self.boxes.bounded * ROW_WORK;
            work += self.shared(&on, block, out);
            for r in 0..block.rows {
                let mut bits = self.boxes.boxed[r];
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    work += self.single(&on, block, lanes, [r, lane], [r, lane], out);
                }
            }
        } else {
            self.packed.pack(lanes, left, &mut self.from);
            self.boxes.bounded = 0;
            let of = self.packed.data;
            self.boxes.fill(&self.packed, &of, &self.ball, &self.moderate, self.whole);
            work += self.boxes.bounded * ROW_WORK;
            for r in 0..(count_left as usize).div_ceil(LANES) {
                let mut bits = self.boxes.boxed[r];
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let [row, of_row] = self.from[r * LANES + lane];
                    work += self.single(&on, block, lanes, [row as usize, of_row as usize], [r, lane], out);
                }
            }
        }
        work
    }
}

/// Raises the targets by some samples of one box.
#[inline(always)]
fn raise<V: Vectors, P: Pairs>(on: &On<'_, P>, patch: Patch, at: &Reachable, out: &mut Targets) -> usize {
    if let Some(samples) = on.pairs.on_samples() {
        let offsets = Offsets::of(at);
        let taps = offsets.taps();
        if patch.len == LANES && taps > PATCH {
            let block = Block { a: patch.a, first: patch.first, rows: patch.rows };
            if raise_bundle::<V>(on.field, samples, block, &[u16::MAX; ROWS], &offsets, out) {
                return BLOCK_WORK.max(taps * patch.rows);
            }
        }
        raise_patch::<V>(on.field, samples, patch, &offsets, out);
        return BLOCK_WORK.max(taps * patch.rows * patch.len / LANES);
    }
    for a in patch.a..patch.a + patch.rows as i64 {
        let run = Run { a, first: patch.first, len: patch.len };
        raise_run::<V, P>(on.field, on.pairs, run, at, out, None);
    }
    BLOCK_WORK
}

impl<V: Vectors> Rolling<V> {
    /// `whole`: whether all offsets are whole samples.
    pub fn new(ball: Ball, whole: bool) -> Rolling<V> {
        Rolling {
            ball,
            moderate: Moderate::new(&ball),
            packed: Lanes::new(),
            from: [[0; 2]; ROWS * LANES],
            boxes: Boxes::new(),
            row_bounds: RowBounds::new(),
            whole,
        }
    }

    /// Takes samples whose boxes are small and nearly the same.
    #[inline(always)]
    fn shared<P: Pairs>(&mut self, on: &On<'_, P>, block: Block, out: &mut Targets) -> usize {
        let mut work = 0;
        let mut small = self.boxes.small(block.rows, if self.whole { 1.0 } else { 1.6 });
        let mut tries = 4;
        while tries > 0 && count(&small) >= MANY {
            tries -= 1;
            let mut r = 0;
            while small[r] == 0 {
                r += 1;
            }
            let lane = small[r].trailing_zeros() as usize;
            let seed = self.boxes.at(r, lane);
            let around =
                Reachable { x: [seed.x[0] - 1.0, seed.x[1] + 1.0], y: [seed.y[0] - 1.0, seed.y[1] + 1.0] };
            let these = self.boxes.within(&small, &around);
            if count(&these) < MANY {
                small[r] &= small[r] - 1;
                continue;
            }
            let hull = self.boxes.hull(&these);
            for (r, these) in these.iter().enumerate() {
                small[r] &= !these;
                self.boxes.boxed[r] &= !these;
            }
            work += raise::<V, P>(on, patch_of(block, &these), &hull, out);
        }
        work
    }

    /// Takes one sample of a block, whose box stands `at`.
    #[inline(always)]
    fn single<P: Pairs>(
        &mut self,
        on: &On<'_, P>,
        block: Block,
        lanes: &Lanes,
        [r, lane]: [usize; 2],
        at: [usize; 2],
        out: &mut Targets,
    ) -> usize {
        let a = block.a + r as i64;
        let first = block.first + lane;
        if let Some(samples) = on.pairs.on_samples() {
            let offsets = self.boxes.offsets(at[0], at[1]);
            let rows = BoxRows::of(samples, a, &offsets);
            if rows.count == 0 {
                return SINGLE_WORK;
            }
            if offsets.x[1] - offsets.x[0] < LANES as i32 {
                raise_narrow::<V>(on.field, samples, [a, first as i64], rows, offsets.x, out);
                return SINGLE_WORK + SINGLE_ROW_WORK * rows.count;
            }
            let at = self.boxes.at(at[0], at[1]);
            let rises = lanes.at(r, lane);
            return SINGLE_WORK + self.wide(on.field, samples, &rises, [a, first as i64], at, rows, out);
        }
        let mut work = 0;
        let mut at = self.boxes.at(at[0], at[1]);
        let wide = at.x[1] - at.x[0];
        if wide > 4.0 && at.groups() > WIDE {
            work += FAR_WORK;
            match self.ball.far_neighbours(on.field, a, PAD + first, at) {
                None => return work,
                Some(tighter) => at = tighter,
            }
        }
        work += ((at.y[1] - at.y[0]) as usize + 1) * row_work(1, (at.x[1] - at.x[0]) as usize + 1);
        let narrowed = at.y[1] - at.y[0] > TALL && at.x[1] - at.x[0] > 1.0;
        let rises = lanes.at(r, lane);
        let beside = narrowed.then(|| Beside::new(&rises, self.ball.step_mm, self.ball.slack_mm));
        let run = Run { a, first, len: 1 };
        raise_run::<V, P>(on.field, on.pairs, run, &at, out, beside.as_ref());
        work
    }

    /// Takes one sample whose box is wide, row by row.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)]
    fn wide(
        &mut self,
        field: &Field,
        on: &OnSamples,
        rises: &Rises,
        [a, first]: [i64; 2],
        mut at: Reachable,
        mut rows: BoxRows,
        out: &mut Targets,
    ) -> usize {
        let mut work = 0;
        let every = on.every as i32;
        let of_rows = |rows: BoxRows| [rows.dy, every, rows.count as i32];
        let mut groups = self.row_bounds.fill::<V>(rises, &self.ball, &at, of_rows(rows));
        if groups as f64 > WIDE {
            work += FAR_WORK + NARROW_WORK * (1 + rows.count / LANES);
            match self.ball.far_neighbours(field, a, PAD + first as usize, at) {
                None => return work,
                Some(tighter) => at = tighter,
            }
            rows = BoxRows::of(on, a, &Offsets::of(&at));
            groups = self.row_bounds.fill::<V>(rises, &self.ball, &at, of_rows(rows));
        }
        work += groups + WIDE_ROW_WORK * rows.count + NARROW_WORK * (1 + rows.count / LANES);
        let of = &self.row_bounds;
        let bounds = |k: usize| [of.low[k / LANES][k % LANES] as i32, of.high[k / LANES][k % LANES] as i32];
        raise_rows::<V>(field, on, [a, first], rows, bounds, out);
        work
    }
}
