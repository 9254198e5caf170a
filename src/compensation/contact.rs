//! Contacts only: of all samples under a cutter, those that can touch it.
//!
//! If sample y is the contact of the cutter at x, d = y - x, then for every neighbour u with
//! d + u under the cutter h(y) + s(d) >= h(y + u) + s(d + u), so s(d) - s(d + u) >= h(y + u) - h(y):
//! the known rise to a neighbour bounds d, because s is concave. A pair (y, d) that breaks the
//! inequality on the table's own values loses to its neighbour strictly, and the chain of such
//! losses ends at a pair that is kept, so the maximum over the kept pairs is the maximum over
//! all, to the bit. (The raster form of the contact-point search of Lou, Jiang and Scott,
//! Proc. R. Soc. A 469 (2013) 20130150.)
//!
//! A block on one facet has one box of offsets, of an entry or two. Where a block has an edge in
//! it, its samples have their own; most fall into the two boxes of the facets beside, and those on
//! the edge are left, with boxes as long as the arc over which the ball rolls around it.

use super::Profile;
use super::ball::{Ball, Reachable};
use super::blocks::{Block, Lanes, ROWS, measure};
use super::boxes::Boxes;
use super::feed::Feed;
use super::field::{Field, PAD, Targets};
use super::interval::Beside;
use super::lanes::{LANES, Vectors, widest};
use super::pairs::Pairs;
use super::rim::RowBounds;
use super::runs::{BoxRows, Offsets, Run, Span, raise_narrow, raise_rows, raise_run, raise_spans, row_work};
use super::slopes::Rises;
use super::sweep::Moderate;
use super::unboxed;

/// What raising targets by blocks of one box costs besides, in groups of lanes.
const BLOCK_WORK: usize = 60;

/// What bounding a row of samples one by one costs.
const ROW_WORK: usize = 90;

/// What looking at far neighbours costs.
const FAR_WORK: usize = 800;

/// What a sample on its own costs, and each target row that it may raise.
const SINGLE_WORK: usize = 30;
const SINGLE_ROW_WORK: usize = 10;
const WIDE_ROW_WORK: usize = 22;

/// What narrowing up to [`LANES`] rows of a box costs.
const NARROW_WORK: usize = 70;

/// Part of the work of taking every sample that the first rows may take more than their share.
const ALLOWANCE: f64 = 0.01;

/// Groups of lanes from which a sample's box is worth tightening by far neighbours.
pub(super) const WIDE: f64 = 100.0;

/// Lattice points of a block's box, at most, for it to be used for all its samples.
const FEW: f64 = 9.0;

/// Samples of a block that share a box, at least, for it to be looked for.
const MANY: u32 = 12;

/// Samples of a block on a facet that is known already, at least, to be taken at once.
const SOME: u32 = 2;

/// Samples of a block from which boxes are shared by any that have nearly the same.
const MOST: u32 = 40;

/// Rows of a box from which each is narrowed by itself.
const TALL: f64 = 3.0;

widest! {
    /// Raises the targets by every sample of the field that can touch a cutter there, or sets
    /// `given_up` because it is more work than `every_tap`, in groups of lanes.
    fn contacts<P: Pairs>(field: &mut Field, pairs: &P, profile: &Profile, out: &mut Targets, feed: Option<&mut Feed<'_, '_>>, every_tap: f64, given_up: &mut bool) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(
    field: &mut Field,
    pairs: &P,
    profile: &Profile,
    out: &mut Targets,
    mut feed: Option<&mut Feed<'_, '_>>,
    every_tap: f64,
    given_up: &mut bool,
) {
    let ball = Ball { radius: profile.radius(), step_mm: profile.step_mm(), slack_mm: pairs.slack_mm() };
    if !pairs.is_lattice() {
        *given_up = !unboxed::contacts::<V, P>(field, pairs, &ball, every_tap, out);
        return;
    }
    let known = vec![[Known::default(); 2]; field.columns.div_ceil(LANES) + 1];
    let mut search = Search::<V, P> {
        field,
        pairs,
        ball,
        moderate: Moderate::new(&ball),
        lanes: Lanes::new(),
        packed: Lanes::new(),
        from: [[0; 2]; ROWS * LANES],
        boxes: Boxes::new(),
        row_bounds: RowBounds::new(),
        whole: pairs.is_whole(),
        alike_mm: (0.4 * ball.step_mm / ball.radius) as f32,
        work: 0,
        most: 0.0,
        known,
    };
    let rows = search.field.rows;
    for a in (0..rows).step_by(ROWS) {
        let count = ROWS.min(rows - a);
        // Samples before the first target raise few.
        let part = (((a + count) as f64 - ball.radius) / (rows as f64 - 2.0 * ball.radius)).clamp(0.0, 1.0);
        search.most = (part + ALLOWANCE) * every_tap;
        if let Some(feed) = &mut feed {
            feed.before(a as i64, count, search.field, out);
        }
        search.rows(a as i64, count, out);
        if search.work as f64 > search.most {
            *given_up = true;
            return;
        }
        if let Some(feed) = &mut feed {
            feed.after((a + count) as i64, out);
        }
    }
    if let Some(feed) = &mut feed {
        feed.end(out);
    }
}

/// The small box of some rises, kept because the next block is likely to lie on the same facet.
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

/// Blocks side by side with one box.
struct Level {
    first: usize,
    len: usize,
    known: Known,
}

struct Search<'a, V: Vectors, P: Pairs> {
    field: &'a mut Field,
    pairs: &'a P,
    ball: Ball,
    moderate: Option<Moderate>,
    lanes: Lanes,
    packed: Lanes,
    /// Where the packed samples come from: row and lane.
    from: [[u8; 2]; ROWS * LANES],
    boxes: Boxes<V>,
    row_bounds: RowBounds,
    /// Whether all offsets are whole samples.
    whole: bool,
    /// Rises that differ by less move a contact by less than a sample.
    alike_mm: f32,
    /// Done so far, in groups of lanes.
    work: usize,
    /// At which looking for contacts is given up.
    most: f64,
    /// By column of blocks, from the rows before: the facets of most samples.
    known: Vec<[Known; 2]>,
}

impl<V: Vectors, P: Pairs> Search<'_, V, P> {
    /// All blocks of some rows.
    #[inline(always)]
    fn rows(&mut self, a: i64, rows: usize, out: &mut Targets) {
        let mut level = Level { first: 0, len: 0, known: Known::default() };
        for column in 0..self.known.len() - 1 {
            let block = Block { a, first: column * LANES, rows };
            let Some(all) = measure::<V>(self.field, block) else {
                self.raise_level(a, rows, &mut level, out);
                continue;
            };
            if level.len > 0 && level.known.rises.holds(&all) {
                level.len += LANES;
                self.known[column][0] = level.known;
                continue;
            }
            let [one, other] = self.known[column];
            let known = if one.rises.holds(&all) {
                Some(one)
            } else if other.rises.holds(&all) {
                Some(other)
            } else {
                self.one_box(&all)
            };
            self.raise_level(a, rows, &mut level, out);
            match known {
                Some(known) => {
                    self.known[column][0] = known;
                    level = Level { first: block.first, len: LANES, known };
                }
                None => {
                    if self.in_reach(block, &all) {
                        self.split(block, out);
                        if self.work as f64 > self.most {
                            return;
                        }
                    }
                }
            }
        }
        self.raise_level(a, rows, &mut level, out);
    }

    /// The box of a block, if it is small.
    #[inline(always)]
    fn one_box(&self, all: &Rises) -> Option<Known> {
        if all.spread() > 4.0 * self.alike_mm {
            return None;
        }
        let rises = all.wider(0.12 * self.alike_mm);
        match self.ball.reachable(&rises) {
            None => Some(Known { rises, at: Reachable { x: [1.0, 0.0], y: [1.0, 0.0] } }),
            Some(at) if at.lattice_points() <= FEW => Some(Known { rises, at }),
            Some(_) => None,
        }
    }

    /// Whether samples of this block may reach any target.
    #[inline(always)]
    fn in_reach(&self, block: Block, all: &Rises) -> bool {
        let [low, high] = self.ball.start(all).y;
        let last = block.a + block.rows as i64 - 1;
        let (first, last) = (self.pairs.targets(block.a, low, high), self.pairs.targets(last, low, high));
        first.start < last.end || !first.is_empty()
    }

    #[inline(always)]
    fn raise_level(&mut self, a: i64, rows: usize, level: &mut Level, out: &mut Targets) {
        if level.len > 0 {
            let spans = [[level.first, level.len]; ROWS];
            self.raise(a, &spans[..rows], &level.known.at, out);
            level.len = 0;
        }
    }

    /// Raises the targets by some samples of one box.
    #[inline(always)]
    fn raise(&mut self, a: i64, spans: &[Span], at: &Reachable, out: &mut Targets) {
        self.work += BLOCK_WORK;
        if let Some(on) = self.pairs.on_samples() {
            raise_spans::<V>(self.field, on, a, spans, &Offsets::of(at), out);
            return;
        }
        for (r, &[first, len]) in spans.iter().enumerate() {
            if len > 0 {
                let run = Run { a: a + r as i64, first, len };
                raise_run::<V, P>(self.field, self.pairs, run, at, out, None);
            }
        }
    }

    /// Raises the targets by some samples of a block, which share a box.
    #[inline(always)]
    fn raise_some(&mut self, block: Block, bits: &[u16; ROWS], at: &Reachable, out: &mut Targets) {
        let spans = bits.map(|bits| {
            let first = bits.trailing_zeros() as usize;
            let end = LANES - bits.leading_zeros() as usize;
            [block.first + first, end.saturating_sub(first)]
        });
        self.raise(block.a, &spans[..block.rows], at, out);
    }

    /// A block with more than one box.
    #[inline(always)]
    fn split(&mut self, block: Block, out: &mut Targets) {
        self.work += ROW_WORK;
        self.lanes.fill::<V>(self.field, block);
        let mut left = self.lanes.data;
        self.facets(block, &mut left, out);
        let count_left = count(&left);
        if count_left > MOST {
            self.boxes.bounded = 0;
            self.boxes.fill(&self.lanes, &left, &self.ball, &self.moderate, self.whole);
            self.work += self.boxes.bounded * ROW_WORK;
            self.shared(block, out);
            for r in 0..block.rows {
                let mut bits = self.boxes.boxed[r];
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    self.single(block, [r, lane], [r, lane], out);
                }
            }
        } else if count_left > 0 {
            self.packed.pack(&self.lanes, &left, &mut self.from);
            self.boxes.bounded = 0;
            let of = self.packed.data;
            self.boxes.fill(&self.packed, &of, &self.ball, &self.moderate, self.whole);
            self.work += self.boxes.bounded * ROW_WORK;
            for r in 0..(count_left as usize).div_ceil(LANES) {
                let mut bits = self.boxes.boxed[r];
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let [row, of_row] = self.from[r * LANES + lane];
                    self.single(block, [row as usize, of_row as usize], [r, lane], out);
                }
            }
        }
    }

    /// Takes the samples of a block that lie on facets: on those of the blocks before it and of
    /// those below, and on others that show themselves.
    #[inline(always)]
    fn facets(&mut self, block: Block, left: &mut [u16; ROWS], out: &mut Targets) {
        let column = block.first / LANES;
        let before = self.known[column.saturating_sub(1)];
        let after = self.known[column + 1];
        let [one, other] = self.known[column];
        let candidates = [before[0], one, other, before[1], after[0]];
        let mut kept = [Known::default(); 2];
        let mut most = [0; 2];
        let mut keep = |known: Known, count: u32| {
            if count > most[0] {
                (kept[1], most[1]) = (kept[0], most[0]);
                (kept[0], most[0]) = (known, count);
            } else if count > most[1] {
                (kept[1], most[1]) = (known, count);
            }
        };
        for (k, known) in candidates.iter().enumerate() {
            if candidates[..k].iter().any(|other| other.rises.x_next == known.rises.x_next) {
                continue;
            }
            let held = self.lanes.held::<V>(left, &known.rises);
            let count = count(&held);
            if count >= SOME {
                keep(*known, count);
                for (left, held) in left.iter_mut().zip(&held) {
                    *left &= !held;
                }
                self.raise_some(block, &held, &known.at, out);
            }
        }
        for _ in 0..3 {
            let level = self.lanes.level::<V>(left, 0.1 * self.alike_mm);
            if count(&level) < MANY {
                break;
            }
            let (r, bits) = level.iter().enumerate().fold((0, 0), |most: (usize, u16), (r, &bits)| {
                if bits.count_ones() > most.1.count_ones() { (r, bits) } else { most }
            });
            // The middle one of them.
            let mut bits = bits;
            for _ in 0..bits.count_ones() / 2 {
                bits &= bits - 1;
            }
            let seed = self.lanes.at(r, bits.trailing_zeros() as usize);
            let Some(known) = self.one_box(&seed) else { break };
            let held = self.lanes.held::<V>(left, &known.rises);
            let count = count(&held);
            for (left, held) in left.iter_mut().zip(&held) {
                *left &= !held;
            }
            self.raise_some(block, &held, &known.at, out);
            if count < MANY {
                break;
            }
            keep(known, count);
        }
        if most[0] > 0 {
            self.known[column][0] = kept[0];
        }
        if most[1] > 0 {
            self.known[column][1] = kept[1];
        }
    }

    /// Takes samples whose boxes are small and nearly the same.
    #[inline(always)]
    fn shared(&mut self, block: Block, out: &mut Targets) {
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
            self.raise_some(block, &these, &hull, out);
        }
    }

    /// Takes one sample of a block, whose box stands `at`.
    #[inline(always)]
    fn single(&mut self, block: Block, [r, lane]: [usize; 2], at: [usize; 2], out: &mut Targets) {
        let a = block.a + r as i64;
        let first = block.first + lane;
        if let Some(on) = self.pairs.on_samples() {
            let offsets = self.boxes.offsets(at[0], at[1]);
            let rows = BoxRows::of(on, a, &offsets);
            self.work += SINGLE_WORK;
            if rows.count > 0 {
                let wide = offsets.x[1] - offsets.x[0];
                if wide < LANES as i32 {
                    self.work += SINGLE_ROW_WORK * rows.count;
                    raise_narrow::<V>(self.field, on, [a, first as i64], rows, offsets.x, out);
                } else {
                    let at = self.boxes.at(at[0], at[1]);
                    self.wide([r, lane], [a, first as i64], at, rows, out);
                }
            }
            return;
        }
        let mut at = self.boxes.at(at[0], at[1]);
        let wide = at.x[1] - at.x[0];
        if wide > 4.0 && at.groups() > WIDE {
            self.work += FAR_WORK;
            match self.ball.far_neighbours(self.field, a, PAD + first, at) {
                None => return,
                Some(tighter) => at = tighter,
            }
        }
        self.work += ((at.y[1] - at.y[0]) as usize + 1) * row_work(1, (at.x[1] - at.x[0]) as usize + 1);
        let narrowed = at.y[1] - at.y[0] > TALL && at.x[1] - at.x[0] > 1.0;
        let rises = self.lanes.at(r, lane);
        let beside = narrowed.then(|| Beside::new(&rises, self.ball.step_mm, self.ball.slack_mm));
        let run = Run { a, first, len: 1 };
        raise_run::<V, P>(self.field, self.pairs, run, &at, out, beside.as_ref());
    }

    /// Takes one sample whose box is wide, row by row.
    #[inline(always)]
    fn wide(
        &mut self,
        [r, lane]: [usize; 2],
        [a, first]: [i64; 2],
        mut at: Reachable,
        mut rows: BoxRows,
        out: &mut Targets,
    ) {
        let Some(on) = self.pairs.on_samples() else { return };
        let rises = self.lanes.at(r, lane);
        let every = on.every as i32;
        let of_rows = |rows: BoxRows| [rows.dy, every, rows.count as i32];
        let mut groups = self.row_bounds.fill::<V>(&rises, &self.ball, &at, of_rows(rows));
        if groups as f64 > WIDE {
            self.work += FAR_WORK + NARROW_WORK * (1 + rows.count / LANES);
            match self.ball.far_neighbours(self.field, a, PAD + first as usize, at) {
                None => return,
                Some(tighter) => at = tighter,
            }
            rows = BoxRows::of(on, a, &Offsets::of(&at));
            groups = self.row_bounds.fill::<V>(&rises, &self.ball, &at, of_rows(rows));
        }
        self.work += groups + WIDE_ROW_WORK * rows.count + NARROW_WORK * (1 + rows.count / LANES);
        let of = &self.row_bounds;
        let bounds = |k: usize| [of.low[k / LANES][k % LANES] as i32, of.high[k / LANES][k % LANES] as i32];
        raise_rows::<V>(self.field, on, [a, first], rows, bounds, out);
    }
}

#[inline(always)]
fn count(bits: &[u16; ROWS]) -> u32 {
    let mut sum = 0;
    for bits in bits {
        sum += bits.count_ones();
    }
    sum
}
