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
use super::blocks::{Block, Boxes, Moderate, ROWS, measure};
use super::field::{Field, PAD, Targets};
use super::interval::Beside;
use super::lanes::{LANES, Vectors, widest};
use super::pairs::Pairs;
use super::runs::{Run, raise_run, row_work};
use super::slopes::Rises;
use super::unboxed;

/// What raising targets by blocks of one box costs besides, in groups of lanes.
const BLOCK_WORK: usize = 60;

/// What bounding the samples of a block costs, and once more if some are steep.
const SPLIT_WORK: usize = 600;

/// What looking at far neighbours costs.
const FAR_WORK: usize = 900;

/// Groups of lanes from which a sample's box is worth tightening by far neighbours.
pub(super) const WIDE: f64 = 100.0;

/// Lattice points of a block's box, at most, for it to be used for all its samples.
const FEW: f64 = 9.0;

/// Samples of a block that share a box, at least, for it to be used for all of them.
const MANY: u32 = 20;

/// Rows of a box from which each is narrowed by itself.
const TALL: f64 = 3.0;

widest! {
    /// Raises the targets by every sample of the field that can touch a cutter there, or sets
    /// `given_up` because it is more work than `every_tap`, in groups of lanes.
    fn contacts<P: Pairs>(field: &Field, pairs: &P, profile: &Profile, out: &mut Targets, every_tap: f64, given_up: &mut bool) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(
    field: &Field,
    pairs: &P,
    profile: &Profile,
    out: &mut Targets,
    every_tap: f64,
    given_up: &mut bool,
) {
    let ball = Ball { radius: profile.radius(), step_mm: profile.step_mm(), slack_mm: pairs.slack_mm() };
    if !pairs.is_lattice() {
        *given_up = !unboxed::contacts::<V, P>(field, pairs, &ball, every_tap, out);
        return;
    }
    let mut search = Search::<V, P> {
        field,
        pairs,
        ball,
        moderate: Moderate::new(&ball),
        boxes: Boxes::new(),
        whole: pairs.is_whole(),
        alike_mm: (0.4 * ball.step_mm / ball.radius) as f32,
        work: 0,
        known: vec![Known::default(); field.columns.div_ceil(LANES)],
    };
    for a in (0..field.rows).step_by(ROWS) {
        let part = a as f64 / field.rows as f64;
        if part > 0.015 && search.work as f64 > part * every_tap {
            *given_up = true;
            return;
        }
        search.rows(a as i64, ROWS.min(field.rows - a), out);
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
    field: &'a Field,
    pairs: &'a P,
    ball: Ball,
    moderate: Option<Moderate>,
    boxes: Boxes<V>,
    /// Whether all offsets are whole samples.
    whole: bool,
    /// Rises that differ by less move a contact by less than a sample.
    alike_mm: f32,
    /// Done so far, in groups of lanes.
    work: usize,
    /// By column of blocks, from the rows before.
    known: Vec<Known>,
}

impl<V: Vectors, P: Pairs> Search<'_, V, P> {
    /// All blocks of some rows.
    #[inline(always)]
    fn rows(&mut self, a: i64, rows: usize, out: &mut Targets) {
        let mut level = Level { first: 0, len: 0, known: Known::default() };
        for column in 0..self.known.len() {
            let block = Block { a, first: column * LANES, rows };
            let Some(all) = measure::<V>(self.field, block) else {
                self.raise_level(a, rows, &mut level, out);
                continue;
            };
            if level.len > 0 && level.known.rises.holds(&all) {
                level.len += LANES;
                continue;
            }
            let known = self.known[column];
            let known = if known.rises.holds(&all) { Some(known) } else { self.one_box(&all) };
            match known {
                Some(known) => {
                    self.known[column] = known;
                    self.raise_level(a, rows, &mut level, out);
                    level = Level { first: block.first, len: LANES, known };
                }
                None => {
                    self.raise_level(a, rows, &mut level, out);
                    if self.in_reach(block, &all) {
                        self.split(block, out);
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
        let rises = all.wider(0.25 * self.alike_mm);
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
            let at = level.known.at;
            self.work += BLOCK_WORK;
            for r in 0..rows as i64 {
                let run = Run { a: a + r, first: level.first, len: level.len };
                raise_run::<V, P>(self.field, self.pairs, run, &at, out, None);
            }
            level.len = 0;
        }
    }

    /// A block whose samples have boxes of their own.
    #[inline(always)]
    fn split(&mut self, block: Block, out: &mut Targets) {
        self.work += SPLIT_WORK;
        match &self.moderate {
            Some(moderate) => self.boxes.fill(self.field, block, &self.ball, moderate, self.whole),
            None => self.boxes.all_steep(self.field, block),
        }
        if self.boxes.any_steep != 0 {
            self.work += SPLIT_WORK;
            self.boxes.fill_steep(self.field, block, &self.ball, self.whole);
        }
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
                if *these != 0 {
                    small[r] &= !these;
                    self.boxes.boxed[r] &= !these;
                    let first = block.first + these.trailing_zeros() as usize;
                    let len = block.first + LANES - these.leading_zeros() as usize - first;
                    let run = Run { a: block.a + r as i64, first, len };
                    raise_run::<V, P>(self.field, self.pairs, run, &hull, out, None);
                }
            }
        }
        for r in 0..block.rows {
            if self.boxes.boxed[r] != 0 {
                self.singles(block, r, out);
            }
        }
    }

    /// The samples of a row of a block that are left, in runs of nearly one box.
    #[inline(always)]
    fn singles(&mut self, block: Block, r: usize, out: &mut Targets) {
        let a = block.a + r as i64;
        let mut bits = self.boxes.boxed[r];
        let mut open: Option<Group> = None;
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let first = block.first + lane;
            let rises = Rises::of(self.field, a, PAD + first, true);
            let mut at = Some(self.boxes.at(r, lane));
            if let Some(wide) = at
                && wide.x[1] - wide.x[0] > 4.0
                && wide.groups() > WIDE
            {
                self.work += FAR_WORK;
                at = self.ball.far_neighbours(self.field, a, PAD + first, wide);
            }
            let Some(at) = at else { continue };
            let one = Group::new(first, rises, at);
            open = match open {
                None => Some(one),
                Some(group) => {
                    let both = group.with(&one);
                    if both.work <= group.work + one.work {
                        Some(both)
                    } else {
                        self.raise_group(a, &group, out);
                        Some(one)
                    }
                }
            };
        }
        if let Some(group) = open {
            self.raise_group(a, &group, out);
        }
    }

    #[inline(always)]
    fn raise_group(&mut self, a: i64, group: &Group, out: &mut Targets) {
        self.work += group.work;
        let run = Run { a, first: group.first, len: group.len };
        let at = &group.at;
        if at.y[1] - at.y[0] > TALL && at.x[1] - at.x[0] > 1.0 {
            let beside = Beside::new(&group.rises, self.ball.step_mm, self.ball.slack_mm);
            raise_run::<V, P>(self.field, self.pairs, run, at, out, Some(&beside));
        } else {
            raise_run::<V, P>(self.field, self.pairs, run, at, out, None);
        }
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

/// Samples of a row that are taken together.
struct Group {
    first: usize,
    len: usize,
    rises: Rises,
    at: Reachable,
    work: usize,
}

impl Group {
    #[inline(always)]
    fn new(first: usize, rises: Rises, at: Reachable) -> Group {
        Group { first, len: 1, rises, at, work: Group::work(1, &at) }
    }

    #[inline(always)]
    fn work(len: usize, at: &Reachable) -> usize {
        ((at.y[1] - at.y[0]) as usize + 1) * row_work(len, (at.x[1] - at.x[0]) as usize + 1)
    }

    #[inline(always)]
    fn with(&self, other: &Group) -> Group {
        let at = self.at.hull(&other.at);
        let len = other.first + other.len - self.first;
        Group { first: self.first, len, rises: self.rises.with(other.rises), at, work: Group::work(len, &at) }
    }
}
