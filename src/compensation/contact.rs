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
use super::blocks::{Block, Lanes, ROWS, bend, measure};
use super::cones::Cones;
use super::feed::Feed;
use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, LEAST, Vectors, widest};
use super::listed::Listed;
use super::pairs::Pairs;
use super::rolling::Rolling;
use super::runs::Span;
use super::slopes::Rises;
use super::unboxed;
use std::marker::PhantomData;

/// What raising targets by blocks of one facet costs besides, in groups of lanes.
pub(super) const BLOCK_WORK: usize = 60;

/// What bounding a row of samples one by one costs.
pub(super) const ROW_WORK: usize = 90;

/// Part of the work of taking every sample that the first rows may take more than their share. Under rows of targets far
/// apart they come before the first target and take as much as the others.
const ALLOWANCE: f64 = 0.05;

/// Samples of a block that share offsets, at least, for these to be looked for.
pub(super) const MANY: u32 = 12;

/// How far the rises of samples on one facet may differ, in those that are alike, and those of each sample of a block
/// of an even bend.
const FACET: f32 = 4.0;
const EVEN: f32 = 8.0;

/// Samples of a block on a facet that is known already, at least, to be taken at once.
const SOME: u32 = 2;

/// How it is told where samples can touch one kind of cutter.
pub(super) trait Touch<V: Vectors, P: Pairs> {
    /// Offsets at which all samples with the same rises can touch.
    type At: Copy;

    /// How far the rises of a block that is taken at once may differ, in those that are alike, and where it has no edge.
    const SPREAD: f32;
    const EVEN_SPREAD: f32;

    fn nowhere(&self) -> Self::At;

    /// Those of samples with these rises, if they are few, and whether they are so few that samples share a facet. More
    /// are few where the surface bends evenly, for then all samples touch.
    fn few(&self, rises: &Rises, is_even: bool) -> Option<(Self::At, bool)>;

    /// Offsets along y, at least, at which samples with these rises can touch.
    fn rows(&self, rises: &Rises) -> [f64; 2];

    /// Raises the targets by samples of the rows from `a` on that share offsets; gives what work it was.
    fn raise(&mut self, on: On<'_, P>, a: i64, spans: &[Span], at: &Self::At, out: &mut Targets) -> usize;

    /// Raises the targets by a block that lies beside all of them; gives what work it was, and the samples that are
    /// left. None, and nothing done, if it does not lie there.
    fn beside(
        &mut self,
        _: &On<'_, P>,
        _: Block,
        _: &Rises,
        _: &mut Lanes,
        _: &mut Targets,
    ) -> Option<(usize, [u16; ROWS])> {
        None
    }

    /// Raises the targets by samples of a block that share nothing.
    fn rest(
        &mut self,
        on: On<'_, P>,
        block: Block,
        lanes: &Lanes,
        left: &[u16; ROWS],
        out: &mut Targets,
    ) -> usize;
}

/// Samples and what they are paired with.
pub(super) struct On<'a, P: Pairs> {
    pub field: &'a Field,
    pub pairs: &'a P,
}

widest! {
    /// Raises the targets by every sample of the field that can touch a ball there, or sets
    /// `given_up` because it is more work than `most`, in groups of lanes.
    fn contacts<P: Pairs>(field: &mut Field, pairs: &P, profile: &Profile, out: &mut Targets, fed: Option<(&mut Feed<'_, '_>, &mut Progress<Reachable>)>, most: f64, given_up: &mut bool) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(
    field: &mut Field,
    pairs: &P,
    profile: &Profile,
    out: &mut Targets,
    fed: Option<(&mut Feed<'_, '_>, &mut Progress<Reachable>)>,
    most: f64,
    given_up: &mut bool,
) {
    let ball = Ball { radius: profile.radius(), step_mm: profile.step_mm(), slack_mm: pairs.slack_mm() };
    if !pairs.is_lattice() {
        *given_up = !unboxed::contacts::<V, P>(field, pairs, &ball, most, out);
        return;
    }
    let rolling = Rolling::<V>::new(ball, pairs.is_whole());
    // One call, for all of the search is compiled into it.
    let mut anew = Progress::new();
    let (feed, progress) = match fed {
        Some((feed, progress)) => (Some(feed), progress),
        None => (None, &mut anew),
    };
    *given_up = !search(rolling, profile, field, pairs, out, feed, progress, most);
    V::streamed();
}

widest! {
    /// As [`contacts`], of any cutter on samples, by a table; the samples under its flat bottom are left out.
    fn contacts_by_table<P: Pairs>(field: &mut Field, pairs: &P, cones: &Cones, out: &mut Targets, most: f64, given_up: &mut bool) = body_by_table
}

#[inline(always)]
pub(super) fn body_by_table<V: Vectors, P: Pairs>(
    field: &mut Field,
    pairs: &P,
    cones: &Cones,
    out: &mut Targets,
    most: f64,
    given_up: &mut bool,
) {
    let (listed, progress) = (Listed::<V>::new(cones), &mut Progress::new());
    *given_up = !search(listed, &cones.profile, field, pairs, out, None, progress, most);
}

/// False if it was given up; where it stands then tells nothing.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn search<V: Vectors, P: Pairs, T: Touch<V, P>>(
    touch: T,
    profile: &Profile,
    field: &mut Field,
    pairs: &P,
    out: &mut Targets,
    mut feed: Option<&mut Feed<'_, '_>>,
    progress: &mut Progress<T::At>,
    most: f64,
) -> bool {
    let mut known = std::mem::take(&mut progress.known);
    if known.is_empty() {
        let none = Known { rises: Rises::NO_SAMPLE, at: touch.nowhere(), is_facet: true };
        known.resize(field.columns.div_ceil(LANES) + 1, [none; 2]);
    }
    let radius = profile.radius();
    let mut search = Search::<V, P, T> {
        field,
        pairs,
        touch,
        lanes: Lanes::new(),
        alike_mm: (0.4 * profile.step_mm() / radius) as f32,
        work: 0,
        most: 0.0,
        known,
        vectors: PhantomData,
    };
    let rows = search.field.rows;
    let start = progress.next;
    let end = feed.as_ref().map_or(rows as i64, |feed| feed.end_row()) as f64 - start as f64;
    // Samples before the first target raise few.
    let lead = if start == 0 { radius } else { 0.0 };
    if let Some(feed) = &mut feed {
        feed.after::<V>(start as i64, out);
    }
    for a in (start..rows).step_by(ROWS) {
        if feed.as_ref().is_some_and(|feed| feed.is_done()) {
            *progress = Progress { next: a, known: search.known };
            return true;
        }
        let count = ROWS.min(rows - a);
        let part = (((a + count - start) as f64 - lead) / (end - 2.0 * lead)).clamp(0.0, 1.0);
        search.most = (part + ALLOWANCE) * most;
        if let Some(feed) = &mut feed {
            feed.before(a as i64, count, search.field, out);
        }
        search.rows(a as i64, count, out);
        if search.work as f64 > search.most {
            return false;
        }
        if let Some(feed) = &mut feed {
            feed.after::<V>((a + count) as i64, out);
        }
    }
    if let Some(feed) = &mut feed {
        feed.end::<V>(out);
    }
    *progress = Progress { next: rows, known: search.known };
    true
}

/// How far a field was looked through: the next row, and what is known from those before.
pub(super) struct Progress<At> {
    next: usize,
    known: Vec<[Known<At>; 2]>,
}

impl<At> Progress<At> {
    pub fn new() -> Progress<At> {
        Progress { next: 0, known: Vec::new() }
    }
}

/// The few offsets of some rises, kept because the next block is likely to lie on the same facet.
#[derive(Clone, Copy)]
struct Known<At> {
    rises: Rises,
    at: At,
    /// Of one facet; else of an edge that is blunt enough for its samples to be taken as one.
    is_facet: bool,
}

/// Blocks side by side with the same offsets.
struct Level<At> {
    first: usize,
    len: usize,
    known: Known<At>,
}

struct Search<'a, V: Vectors, P: Pairs, T: Touch<V, P>> {
    field: &'a mut Field,
    pairs: &'a P,
    touch: T,
    lanes: Lanes,
    /// Rises that differ by less move a contact by less than a sample.
    alike_mm: f32,
    /// Done so far, in groups of lanes.
    work: usize,
    /// At which looking for contacts is given up.
    most: f64,
    /// By column of blocks, from the rows before: the facets of most samples.
    known: Vec<[Known<T::At>; 2]>,
    vectors: PhantomData<V>,
}

impl<V: Vectors, P: Pairs, T: Touch<V, P>> Search<'_, V, P, T> {
    /// All blocks of some rows.
    #[inline(always)]
    fn rows(&mut self, a: i64, rows: usize, out: &mut Targets) {
        let none = Known { rises: Rises::NO_SAMPLE, at: self.touch.nowhere(), is_facet: true };
        let mut level = Level { first: 0, len: 0, known: none };
        for column in 0..self.known.len() - 1 {
            let block = Block { a, first: column * LANES, rows };
            let Some(measured) = measure::<V>(self.field, block) else {
                self.raise_level(a, rows, &mut level, out);
                continue;
            };
            if level.len > 0 && level.known.is_facet && measured.is_held(&level.known.rises) {
                level.len += LANES;
                self.known[column][0] = level.known;
                continue;
            }
            let [one, other] = self.known[column];
            let mut of_edge = None;
            let known = if measured.is_held(&one.rises) {
                Some(one)
            } else if measured.is_held(&other.rises) {
                Some(other)
            } else {
                let (all, grain_mm) = (measured.rises(), self.grain_mm(block));
                of_edge = Some((all, grain_mm));
                self.facet(Some(block), &all, grain_mm)
            };
            self.raise_level(a, rows, &mut level, out);
            match known {
                Some(known) => {
                    if known.is_facet {
                        self.known[column][0] = known;
                    }
                    level = Level { first: block.first, len: LANES, known };
                }
                None => {
                    let Some((all, grain_mm)) = of_edge else { continue };
                    if self.in_reach(block, &all) {
                        self.split(block, &all, grain_mm, out);
                        if self.work as f64 > self.most {
                            return;
                        }
                    }
                }
            }
        }
        self.raise_level(a, rows, &mut level, out);
    }

    /// About by how much the rises of one plane differ because its heights are rounded.
    #[inline(always)]
    fn grain_mm(&self, block: Block) -> f32 {
        let size = self.field.row(block.a)[PAD + block.first].abs();
        if size < -LEAST { size * f32::EPSILON } else { 0.0 }
    }

    /// The offsets of samples with these rises, if they are few; `of` a block, if they are all those of one.
    #[inline(always)]
    fn facet(&self, of: Option<Block>, all: &Rises, grain_mm: f32) -> Option<Known<T::At>> {
        let spread = all.spread();
        if spread > T::EVEN_SPREAD * self.alike_mm {
            return None;
        }
        let is_even = spread > T::SPREAD * self.alike_mm;
        if is_even
            && !of.is_some_and(|block| bend::<V>(self.field, block) <= EVEN * self.alike_mm + 4.0 * grain_mm)
        {
            return None;
        }
        let rises = all.wider(greater(0.12 * self.alike_mm, grain_mm));
        let alike = spread <= FACET * self.alike_mm;
        self.touch.few(&rises, is_even).map(|(at, few)| Known { rises, at, is_facet: few && alike })
    }

    /// Whether samples of this block may reach any target.
    #[inline(always)]
    fn in_reach(&self, block: Block, all: &Rises) -> bool {
        let [low, high] = self.touch.rows(all);
        let last = block.a + block.rows as i64 - 1;
        let (first, last) = (self.pairs.targets(block.a, low, high), self.pairs.targets(last, low, high));
        first.start < last.end || !first.is_empty()
    }

    #[inline(always)]
    fn raise_level(&mut self, a: i64, rows: usize, level: &mut Level<T::At>, out: &mut Targets) {
        if level.len > 0 {
            let spans = [[level.first, level.len]; ROWS];
            let on = On { field: self.field, pairs: self.pairs };
            self.work += self.touch.raise(on, a, &spans[..rows], &level.known.at, out);
            level.len = 0;
        }
    }

    /// Raises the targets by some samples of a block, which share offsets.
    #[inline(always)]
    fn raise_some(&mut self, block: Block, bits: &[u16; ROWS], at: &T::At, out: &mut Targets) {
        let spans = spans_of(block, bits);
        let on = On { field: self.field, pairs: self.pairs };
        self.work += self.touch.raise(on, block.a, &spans[..block.rows], at, out);
    }

    /// A block of more than one facet.
    #[inline(always)]
    fn split(&mut self, block: Block, all: &Rises, grain_mm: f32, out: &mut Targets) {
        self.work += ROW_WORK;
        let on = On { field: self.field, pairs: self.pairs };
        let left = match self.touch.beside(&on, block, all, &mut self.lanes, out) {
            Some((work, left)) => {
                self.work += work;
                left
            }
            None => {
                self.lanes.fill::<V>(self.field, block);
                let mut left = self.lanes.data;
                self.facets(block, grain_mm, &mut left, out);
                left
            }
        };
        if left != [0; ROWS] {
            let on = On { field: self.field, pairs: self.pairs };
            self.work += self.touch.rest(on, block, &self.lanes, &left, out);
        }
    }

    /// Takes the samples of a block that lie on facets: on those of the blocks before it and of
    /// those below, and on others that show themselves.
    #[inline(always)]
    fn facets(&mut self, block: Block, grain_mm: f32, left: &mut [u16; ROWS], out: &mut Targets) {
        let column = block.first / LANES;
        let before = self.known[column.saturating_sub(1)];
        let after = self.known[column + 1];
        let [one, other] = self.known[column];
        let candidates = [before[0], one, other, before[1], after[0]];
        let mut kept = [one; 2];
        let mut most = [0; 2];
        let mut keep = |known: Known<T::At>, count: u32| {
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
            let within_mm = greater(0.1 * self.alike_mm, grain_mm);
            let level = self.lanes.level::<V>(left, within_mm);
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
            let Some(known) = self.facet(None, &seed, grain_mm).filter(|known| known.is_facet) else { break };
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
}

/// From the first to the last of these samples of a block, row by row.
#[inline(always)]
pub(super) fn spans_of(block: Block, bits: &[u16; ROWS]) -> [Span; ROWS] {
    let mut spans = [[0; 2]; ROWS];
    for (span, &bits) in spans.iter_mut().zip(bits) {
        let first = bits.trailing_zeros() as usize;
        let end = LANES - bits.leading_zeros() as usize;
        *span = [block.first + first, end.saturating_sub(first)];
    }
    spans
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(super) fn count(bits: &[u16; ROWS]) -> u32 {
    let mut sum = 0;
    for bits in bits {
        sum += bits.count_ones();
    }
    sum
}
