//! Where samples can touch any cutter: offsets row by row of the cutter, by its table.

use super::blocks::{Block, Lanes, ROWS};
use super::cones::Cones;
use super::contact::{BLOCK_WORK, On, Touch};
use super::field::Targets;
use super::lanes::{LANES, Vectors};
use super::pairs::{OnSamples, Pairs};
use super::patches::{Patch, raise_patch};
use super::runs::{BoxRows, Offsets, One, raise_narrow};
use super::slopes::Rises;

/// Rows of offsets that samples of one facet may have, at most, to be taken together.
const FEW: usize = 24;

/// What a sample on its own costs, each group of rows of the cutter that is looked at, and each that it may raise.
const SINGLE_WORK: usize = 30;
const GROUP_WORK: usize = 40;
const ROW_WORK: usize = 6;

/// Rows of a box up to which it is not narrowed row by row.
const NARROW: i32 = 6;
const NARROW_WORK: usize = 10;

/// Offsets dx in `low ..= high` of a row of the cutter.
#[derive(Clone, Copy)]
struct Stretch {
    dy: i16,
    low: i16,
    high: i16,
}

/// The offsets of a facet.
#[derive(Clone, Copy)]
pub(super) struct Spots {
    count: usize,
    stretches: [Stretch; FEW],
}

const NOWHERE: Spots = Spots { count: 0, stretches: [Stretch { dy: 0, low: 1, high: 0 }; FEW] };

/// Of groups of rows from a cut row on, those that are cut.
#[inline(always)]
fn cut_rows(every: i32) -> impl Iterator<Item = u16> {
    let mut next = 0;
    std::iter::repeat_with(move || {
        if every == 1 {
            return u16::MAX;
        }
        let mut bits = 0;
        while next < LANES as i32 {
            bits |= 1 << next;
            next += every;
        }
        next -= LANES as i32;
        bits
    })
}

/// The lanes of the first so many.
#[inline(always)]
fn in_first(count: usize) -> u16 {
    ((1u32 << count.min(LANES)) - 1) as u16
}

/// A cutter and its table.
pub(super) struct Listed<'a, V: Vectors> {
    cones: &'a Cones,
    vectors: std::marker::PhantomData<V>,
}

impl<'a, V: Vectors> Listed<'a, V> {
    pub fn new(cones: &'a Cones) -> Listed<'a, V> {
        Listed { cones, vectors: std::marker::PhantomData }
    }

    /// Takes one sample.
    #[inline(always)]
    fn single<P: Pairs>(
        &mut self,
        on: &On<'_, P>,
        samples: &OnSamples,
        rises: &Rises,
        [a, first]: [i64; 2],
        out: &mut Targets,
    ) -> usize {
        let slopes = self.cones.slopes(rises);
        let Some(around) = self.cones.around(&slopes) else { return SINGLE_WORK };
        let rows = BoxRows::of(samples, a, &around);
        if rows.count == 0 {
            return SINGLE_WORK;
        }
        if around.y[1] - around.y[0] < NARROW && around.x[1] - around.x[0] < LANES as i32 {
            raise_narrow::<V>(on.field, samples, [a, first], rows, around.x, out);
            return SINGLE_WORK + NARROW_WORK * rows.count;
        }
        let of = self.cones.of(&slopes);
        // Index 0 stands for the lowest row of these.
        let every = samples.every as i32;
        let lowest = rows.dy - (rows.count as i32 - 1) * every;
        let start = (lowest + self.cones.reach) as usize;
        let count = (rows.dy - lowest + 1) as usize;
        let one = One::of::<V>(on.field, samples, [a, first]);
        let mut work = SINGLE_WORK + GROUP_WORK * count.div_ceil(LANES);
        for (g, cut) in cut_rows(every).take(count.div_ceil(LANES)).enumerate() {
            let at = of.beside::<V>(start + g * LANES);
            let cut = cut & in_first(count - g * LANES);
            for (is_there, [from, to]) in [(at.is_after, at.after), (at.is_before, at.before)] {
                let mut bits = is_there & cut;
                if bits == 0 {
                    continue;
                }
                work += ROW_WORK * bits.count_ones() as usize;
                let (mut low, mut high) = ([0.0; LANES], [0.0; LANES]);
                V::store(from, &mut low);
                V::store(to, &mut high);
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let dy = lowest + (g * LANES + lane) as i32;
                    let b = rows.first + ((rows.dy - dy) / every) as usize;
                    one.raise::<V>(samples, b, dy, [low[lane] as i32, high[lane] as i32], out);
                }
            }
        }
        work
    }
}

impl<V: Vectors, P: Pairs> Touch<V, P> for Listed<'_, V> {
    type At = Spots;
    const SPREAD: f32 = 35.0;
    const EVEN_SPREAD: f32 = 35.0;

    #[inline(always)]
    fn nowhere(&self) -> Spots {
        NOWHERE
    }

    #[inline(always)]
    fn few(&self, rises: &Rises, _: bool) -> Option<(Spots, bool)> {
        let mut spots = NOWHERE;
        let slopes = self.cones.slopes(rises);
        let Some(around) = self.cones.around(&slopes) else { return Some((spots, true)) };
        let of = self.cones.of(&slopes);
        let [mut first, high] = around.y;
        while first <= high {
            let at = of.beside::<V>((first + self.cones.reach) as usize);
            for (is_there, [from, to]) in [(at.is_after, at.after), (at.is_before, at.before)] {
                if is_there == 0 {
                    continue;
                }
                let (mut lows, mut highs) = ([0.0; LANES], [0.0; LANES]);
                V::store(from, &mut lows);
                V::store(to, &mut highs);
                let mut bits = is_there;
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let dy = first + lane as i32;
                    if dy > high {
                        break;
                    }
                    if spots.count == FEW || highs[lane] - lows[lane] > LANES as f32 {
                        return None;
                    }
                    spots.stretches[spots.count] =
                        Stretch { dy: dy as i16, low: lows[lane] as i16, high: highs[lane] as i16 };
                    spots.count += 1;
                }
            }
            first += LANES as i32;
        }
        Some((spots, true))
    }

    #[inline(always)]
    fn rows(&self, rises: &Rises) -> [f64; 2] {
        let around = self.cones.around(&self.cones.slopes(rises));
        around.map_or([1.0, 0.0], |around| around.y.map(f64::from))
    }

    #[inline(always)]
    fn raise(&mut self, on: On<'_, P>, patch: Patch, at: &Spots, out: &mut Targets) -> usize {
        let Some(samples) = on.pairs.on_samples() else { return 0 };
        for stretch in &at.stretches[..at.count] {
            let [dy, low, high] = [stretch.dy, stretch.low, stretch.high].map(i32::from);
            let offsets = Offsets { x: [low, high], y: [dy, dy] };
            raise_patch::<V>(on.field, samples, patch, &offsets, out);
        }
        BLOCK_WORK * at.count
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
        let Some(samples) = on.pairs.on_samples() else { return 0 };
        let mut work = 0;
        for (r, &bits) in left.iter().enumerate() {
            let mut bits = bits;
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let at = [block.a + r as i64, (block.first + lane) as i64];
                work += self.single(&on, samples, &lanes.at(r, lane), at, out);
            }
        }
        work
    }
}
