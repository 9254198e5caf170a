use super::blocks::{Block, ROWS};
use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, Vectors, Work, groups, groups_mut};
use super::pairs::OnSamples;
use super::runs::Offsets;

/// Groups of lanes that a row of targets may take, and rows of the cutter.
const MOST_GROUPS: usize = 8;
const MOST_ROWS: usize = 128;

/// Groups of a target row that are held at once.
const AT_ONCE: usize = 3;

/// How far past the rim of a cutter's row a bundle's offsets may lie: a stencil's padding covers what groups of lanes
/// run over.
const PAST_RIM: i32 = LANES as i32;

/// Raises the targets by these samples of a block at the offsets of a box. Each target row is read once and written
/// once, by all rows of samples that reach it. False, and nothing done, if the box is too large for that.
#[inline(always)]
pub(super) fn raise_bundle<V: Vectors>(
    field: &Field,
    on: &OnSamples,
    block: Block,
    bits: &[u16; ROWS],
    at: &Offsets,
    out: &mut Targets,
) -> bool {
    V::apart(Raise { field, on, block, bits, at, out })
}

struct Raise<'a, 'b> {
    field: &'a Field,
    on: &'a OnSamples<'b>,
    block: Block,
    bits: &'a [u16; ROWS],
    at: &'a Offsets,
    out: &'a mut Targets,
}

impl<V: Vectors> Work<V> for Raise<'_, '_> {
    type Done = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Raise { field, on, block, bits, at, out } = self;
        let (mut all, mut sum, mut full) = (0, 0, 0);
        for &bits in bits.iter().take(block.rows) {
            all |= bits;
            sum += bits.count_ones();
            full += u32::from(bits != 0);
        }
        let reach = on.reach as i32;
        let y = [at.y[0].max(-reach), at.y[1].min(reach)];
        if all == 0 || y[0] > y[1] || at.x[0] > at.x[1] {
            return true;
        }
        let first = block.first as i32 - on.shift as i32;
        let (low, high) = (all.trailing_zeros() as i32, LANES as i32 - 1 - all.leading_zeros() as i32);
        let start = (first + low - at.x[1]).max(0) & -(LANES as i32);
        let end = (first + high - at.x[0] + 1).min(out.columns as i32);
        if start >= end {
            return true;
        }
        let groups = ((end - start) as usize).div_ceil(LANES);
        let shortest = on.stencil.arc_there(if -y[0] > y[1] { y[0] } else { y[1] }).arc;
        if groups > MOST_GROUPS || (y[1] - y[0]) as usize >= MOST_ROWS {
            return false;
        }
        let is_padded = at.x[1] <= shortest.hi + PAST_RIM && at.x[0] >= shortest.lo - PAST_RIM;
        let mut bundle = Bundle {
            a: block.a,
            row: (on.input_row + block.a - on.target_row) as i32,
            rows: [ROWS, 0],
            at: Offsets { x: at.x, y },
            ends: [0; ROWS + 1],
            samples: [(0.0, 0, 0); ROWS * LANES],
            cuts: [Cut { base: 0, lo: 1, hi: 0 }; MOST_ROWS],
        };
        for (cut, dy) in bundle.cuts.iter_mut().zip(y[0]..=y[1]) {
            let arc = on.stencil.arc_there(dy);
            let base = arc.index(0) as i32;
            *cut = if is_padded {
                // All alike, for the processor foretells how often a loop is gone through.
                Cut { base, lo: at.x[0], hi: at.x[1] }
            } else {
                Cut { base, lo: at.x[0].max(arc.arc.lo), hi: at.x[1].min(arc.arc.hi) }
            };
        }
        let by_sample = is_padded && sum <= full * (at.x[1] - at.x[0] + 1) as u32;
        let mut count = 0;
        for (r, &bits) in bits.iter().enumerate().take(block.rows) {
            if bits != 0 {
                bundle.rows = [bundle.rows[0].min(r), r];
                if by_sample {
                    let row = &field.row(block.a + r as i64)[PAD + block.first..][..LANES];
                    let mut bits = bits;
                    while bits != 0 {
                        let lane = bits.trailing_zeros() as usize;
                        bits &= bits - 1;
                        bundle.samples[count] = (row[lane], first + lane as i32, r as i32);
                        count += 1;
                    }
                } else {
                    count += 1;
                }
            }
            bundle.ends[r + 1] = count;
        }
        let (mut start, mut left) = (start as usize, groups);
        while left > 0 {
            let now = if left == AT_ONCE + 1 { 2 } else { left.min(AT_ONCE) };
            match (now, by_sample) {
                (1, true) => bundle.by_samples::<V, 1>(on, start, out),
                (2, true) => bundle.by_samples::<V, 2>(on, start, out),
                (_, true) => bundle.by_samples::<V, AT_ONCE>(on, start, out),
                (1, false) => bundle.by_offsets::<V, 1>(field, on, start, out),
                (2, false) => bundle.by_offsets::<V, 2>(field, on, start, out),
                (_, false) => bundle.by_offsets::<V, AT_ONCE>(field, on, start, out),
            }
            start += now * LANES;
            left -= now;
        }
        true
    }
}

/// Some samples of a block, of one box of offsets.
struct Bundle {
    /// Row of the field at the bundle's row 0, and the row of samples that it stands at, from the first target.
    a: i64,
    row: i32,
    /// Rows with samples, the last included.
    rows: [usize; 2],
    at: Offsets,
    /// Where the samples before each row end.
    ends: [usize; ROWS + 1],
    /// Height, target column at dx = 0 and row.
    samples: [(f32, i32, i32); ROWS * LANES],
    /// The cutter in each row of the box.
    cuts: [Cut; MOST_ROWS],
}

/// One row of a box.
#[derive(Clone, Copy)]
struct Cut {
    /// Where s(0) would stand in the stencil's values.
    base: i32,
    /// Offsets along the row.
    lo: i32,
    hi: i32,
}

impl Bundle {
    /// The target rows that it may raise.
    #[inline(always)]
    fn target_rows(&self, every: i32, rows: usize) -> std::ops::Range<i32> {
        let first = self.row + self.rows[0] as i32 - self.at.y[1];
        let last = self.row + self.rows[1] as i32 - self.at.y[0];
        if every == 1 {
            return first.max(0)..(last + 1).min(rows as i32);
        }
        let first = if first <= 0 { 0 } else { (first + every - 1) / every };
        let end = if last < 0 { 0 } else { last / every + 1 };
        first..end.min(rows as i32)
    }

    /// The rows of it that may raise a target row; dy of a row is `level` more than the row.
    #[inline(always)]
    fn rows_at(&self, level: i32) -> [i32; 2] {
        let [low, high] = self.at.y;
        [(low - level).max(self.rows[0] as i32), (high - level).min(self.rows[1] as i32)]
    }

    /// Each target row with the groups from `start` on, and the rows of the bundle that may raise it.
    #[inline(always)]
    fn targets<V: Vectors, const GROUPS: usize>(
        &self,
        every: i32,
        start: usize,
        out: &mut Targets,
        raise: impl Fn(&mut [V::Group; GROUPS], i32, [i32; 2]),
    ) {
        for b in self.target_rows(every, out.rows) {
            let level = self.row - b * every;
            let rows = self.rows_at(level);
            if rows[0] > rows[1] {
                continue;
            }
            let line = groups_mut(&mut out.row_mut(b as usize)[start..][..GROUPS * LANES]);
            let mut best = [V::splat(0.0); GROUPS];
            for (best, line) in best.iter_mut().zip(line.iter()) {
                *best = V::load(line);
            }
            raise(&mut best, level - self.at.y[0], rows);
            for (best, line) in best.into_iter().zip(line) {
                V::store(best, line);
            }
        }
    }

    #[inline(always)]
    fn by_samples<V: Vectors, const GROUPS: usize>(&self, on: &OnSamples, start: usize, out: &mut Targets) {
        let values = on.stencil.values();
        self.targets::<V, GROUPS>(on.every as i32, start, out, |best, skip, [from, to]| {
            let samples = &self.samples[self.ends[from as usize]..self.ends[to as usize + 1]];
            for &(z, column, r) in samples {
                let base = self.cuts[(skip + r) as usize & (MOST_ROWS - 1)].base;
                let s = &values[(base - column + start as i32) as usize..][..GROUPS * LANES];
                let z = V::splat(z);
                for (best, s) in best.iter_mut().zip(groups(s)) {
                    *best = V::greater(V::add(V::load(s), z), *best);
                }
            }
        });
    }

    #[inline(always)]
    fn by_offsets<V: Vectors, const GROUPS: usize>(
        &self,
        field: &Field,
        on: &OnSamples,
        start: usize,
        out: &mut Targets,
    ) {
        let values = on.stencil.values();
        let from_column = PAD as i32 + start as i32 + on.shift as i32;
        self.targets::<V, GROUPS>(on.every as i32, start, out, |best, skip, [from, to]| {
            for r in from..=to {
                let Cut { base, lo, hi } = self.cuts[(skip + r) as usize & (MOST_ROWS - 1)];
                if lo > hi || self.ends[r as usize] == self.ends[r as usize + 1] {
                    continue;
                }
                let s = &values[(base - hi) as usize..][..(hi - lo + 1) as usize];
                let row = &field.row(self.a + i64::from(r))[(from_column + lo) as usize..];
                let row = &row[..GROUPS * LANES + s.len() - 1];
                for (k, s) in s.iter().rev().enumerate() {
                    let s = V::splat(*s);
                    for (best, z) in best.iter_mut().zip(groups(&row[k..][..GROUPS * LANES])) {
                        *best = V::greater(V::add(V::load(z), s), *best);
                    }
                }
            }
        });
    }
}
