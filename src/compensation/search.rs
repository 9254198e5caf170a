//! The search for contacts, block by block: what is known from one block helps with the next.

use super::Profile;
use super::blocks::{Block, Lanes, Lines, ROWS, bend, count, measure, patch_of};
use super::contact::{MANY, On, ROW_WORK, Touch};
use super::feed::{Ahead, Feed};
use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, LEAST, Vectors, Work};
use super::pairs::Pairs;
use super::patches::Patch;
use super::slopes::Rises;
use std::marker::PhantomData;

/// Part of the work of taking every sample that the first rows may take more than their share. Under rows of targets far
/// apart they come before the first target and take as much as the others.
const ALLOWANCE: f64 = 0.05;

/// How far the rises of samples on one facet may differ, in those that are alike, and those of each sample of a block
/// of an even bend.
const FACET: f32 = 4.0;
const EVEN: f32 = 8.0;

/// Samples of a block on a facet that is known already, at least, to be taken at once.
const SOME: u32 = 2;

/// Raises the targets by all samples that can touch; false if it was given up: where it stands then tells nothing.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub(super) fn search<V: Vectors, P: Pairs, T: Touch<V, P>>(
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
        touch,
        lanes: Lanes::new(),
        alike_mm: (0.4 * profile.step_mm() / radius) as f32,
        work: 0,
        most: 0.0,
        known,
        of: PhantomData,
    };
    let rows = field.rows;
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
            feed.before::<V>(a as i64, count, field);
        }
        let ahead = feed.as_ref().map(|feed| feed.ahead());
        search.rows(On { field, pairs }, a as i64, count, ahead, out);
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

struct Search<V: Vectors, P: Pairs, T: Touch<V, P>> {
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
    of: PhantomData<(V, P)>,
}

impl<V: Vectors, P: Pairs, T: Touch<V, P>> Search<V, P, T> {
    /// All blocks of some rows.
    #[inline(always)]
    fn rows(&mut self, on: On<'_, P>, a: i64, rows: usize, ahead: Option<Ahead<'_>>, out: &mut Targets) {
        let lines = Lines::of(on.field, a, rows);
        let none = Known { rises: Rises::NO_SAMPLE, at: self.touch.nowhere(), is_facet: true };
        let mut level = Level { first: 0, len: 0, known: none };
        for column in 0..self.known.len() - 1 {
            let block = Block { a, first: column * LANES, rows };
            if let Some(ahead) = &ahead {
                ahead.fetch::<V>(block.first);
            }
            let Some(measured) = measure::<V>(&lines, block) else {
                self.raise_level(on, a, rows, &mut level, out);
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
                let (all, grain_mm) = (measured.rises(), grain_mm(on.field, block));
                of_edge = Some((all, grain_mm));
                self.facet(Some((on.field, block)), &all, grain_mm)
            };
            self.raise_level(on, a, rows, &mut level, out);
            match known {
                Some(known) => {
                    if known.is_facet {
                        self.known[column][0] = known;
                    }
                    level = Level { first: block.first, len: LANES, known };
                }
                None => {
                    let Some((all, grain_mm)) = of_edge else { continue };
                    if self.in_reach(on, block, &all) {
                        V::apart(Split { search: self, on, block, all: &all, grain_mm, out });
                        if self.work as f64 > self.most {
                            return;
                        }
                    }
                }
            }
        }
        self.raise_level(on, a, rows, &mut level, out);
    }

    /// The offsets of samples with these rises, if they are few; `of` a block, if they are all those of one.
    #[inline(always)]
    fn facet(&self, of: Option<(&Field, Block)>, all: &Rises, grain_mm: f32) -> Option<Known<T::At>> {
        let spread = all.spread();
        if spread > T::EVEN_SPREAD * self.alike_mm {
            return None;
        }
        let is_even = spread > T::SPREAD * self.alike_mm;
        if is_even
            && !of.is_some_and(|(field, block)| {
                bend::<V>(field, block) <= EVEN * self.alike_mm + 4.0 * grain_mm
            })
        {
            return None;
        }
        let rises = all.wider(greater(0.12 * self.alike_mm, grain_mm));
        let alike = spread <= FACET * self.alike_mm;
        self.touch.few(&rises, is_even).map(|(at, few)| Known { rises, at, is_facet: few && alike })
    }

    /// Whether samples of this block may reach any target.
    #[inline(always)]
    fn in_reach(&self, on: On<'_, P>, block: Block, all: &Rises) -> bool {
        let [low, high] = self.touch.rows(all);
        let last = block.a + block.rows as i64 - 1;
        let (first, last) = (on.pairs.targets(block.a, low, high), on.pairs.targets(last, low, high));
        first.start < last.end || !first.is_empty()
    }

    #[inline(always)]
    fn raise_level(
        &mut self,
        on: On<'_, P>,
        a: i64,
        rows: usize,
        level: &mut Level<T::At>,
        out: &mut Targets,
    ) {
        if level.len > 0 {
            let patch = Patch { a, rows, first: level.first, len: level.len };
            self.work += self.touch.raise(on, patch, &level.known.at, out);
            level.len = 0;
        }
    }

    /// Raises the targets by some samples of a block, which share offsets.
    #[inline(always)]
    fn raise_some(&mut self, on: On<'_, P>, block: Block, bits: &[u16; ROWS], at: &T::At, out: &mut Targets) {
        self.work += self.touch.raise(on, patch_of(block, bits), at, out);
    }

    /// A block of more than one facet.
    #[inline(always)]
    fn split(&mut self, on: On<'_, P>, block: Block, all: &Rises, grain_mm: f32, out: &mut Targets) {
        self.work += ROW_WORK;
        let left = match self.touch.beside(&on, block, all, &mut self.lanes, out) {
            Some((work, left)) => {
                self.work += work;
                left
            }
            None => {
                self.lanes.fill::<V>(on.field, block);
                let mut left = self.lanes.data;
                self.facets(on, block, grain_mm, &mut left, out);
                left
            }
        };
        if left != [0; ROWS] {
            self.work += self.touch.rest(on, block, &self.lanes, &left, out);
        }
    }

    /// Takes the samples of a block that lie on facets: on those of the blocks before it and of
    /// those below, and on others that show themselves.
    #[inline(always)]
    fn facets(
        &mut self,
        on: On<'_, P>,
        block: Block,
        grain_mm: f32,
        left: &mut [u16; ROWS],
        out: &mut Targets,
    ) {
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
                self.raise_some(on, block, &held, &known.at, out);
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
            self.raise_some(on, block, &held, &known.at, out);
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

/// [`Search::split`] in a function of its own.
struct Split<'a, 'b, V: Vectors, P: Pairs, T: Touch<V, P>> {
    search: &'a mut Search<V, P, T>,
    on: On<'b, P>,
    block: Block,
    all: &'a Rises,
    grain_mm: f32,
    out: &'a mut Targets,
}

impl<V: Vectors, P: Pairs, T: Touch<V, P>> Work<V> for Split<'_, '_, V, P, T> {
    type Done = ();

    #[inline(always)]
    fn run(self) {
        self.search.split(self.on, self.block, self.all, self.grain_mm, self.out);
    }
}

/// About by how much the rises of one plane differ because its heights are rounded.
#[inline(always)]
fn grain_mm(field: &Field, block: Block) -> f32 {
    let size = field.row(block.a)[PAD + block.first].abs();
    if size < -LEAST { size * f32::EPSILON } else { 0.0 }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
