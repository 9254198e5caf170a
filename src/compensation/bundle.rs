use super::blocks::{Block, ROWS};
use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, Vectors, Work, groups, groups_mut};
use super::pairs::OnSamples;
use super::runs::Offsets;

/// Groups of lanes that a row of targets may take.
const MOST_GROUPS: usize = 8;

/// Groups of a target row that are held at once.
const AT_ONCE: usize = 3;

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
        let x = [at.x[0].max(-reach), at.x[1].min(reach)];
        if all == 0 || y[0] > y[1] || x[0] > x[1] {
            return true;
        }
        let first = block.first as i32 - on.shift as i32;
        let (low, high) = (all.trailing_zeros() as i32, LANES as i32 - 1 - all.leading_zeros() as i32);
        let start = (first + low - x[1]).max(0);
        let end = (first + high - x[0] + 1).min(out.columns as i32);
        if start >= end {
            return true;
        }
        let groups = ((end - start) as usize).div_ceil(LANES);
        if groups > MOST_GROUPS {
            return false;
        }
        let (values, origin, stride) = on.stencil.values();
        let mut bundle = Bundle {
            values,
            origin,
            stride,
            a: block.a,
            row: on.row(block.a) as i32,
            rows: [ROWS, 0],
            at: Offsets { x, y },
            ends: [0; ROWS + 1],
            samples: [(0.0, 0); ROWS * LANES],
        };
        let by_sample = sum <= full * (x[1] - x[0] + 1) as u32;
        let mut count = 0;
        for (r, &bits) in bits.iter().enumerate().take(block.rows) {
            if bits != 0 {
                bundle.rows = [bundle.rows[0].min(r), r];
                if by_sample {
                    let row = &field.row(block.a + r as i64)[PAD + block.first..][..LANES];
                    let back = r as i32 * stride - first;
                    let mut bits = bits;
                    while bits != 0 {
                        let lane = bits.trailing_zeros() as usize;
                        bits &= bits - 1;
                        bundle.samples[count] = (row[lane], back - lane as i32);
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
            if on.every == 1 {
                bundle.raise::<V, 2>(field, on, by_sample, [start, now], out);
            } else {
                bundle.raise::<V, 1>(field, on, by_sample, [start, now], out);
            }
            start += now * LANES;
            left -= now;
        }
        true
    }
}

/// Some samples of a block, of one box of offsets.
struct Bundle<'a> {
    /// The cutter: s(dx) of its row dy stands at `origin + dy stride - dx`.
    values: &'a [f32],
    origin: i32,
    stride: i32,
    /// Row of the field at the bundle's row 0, and the row of samples that it stands at, from the first target.
    a: i64,
    row: i32,
    /// Rows with samples, the last included.
    rows: [usize; 2],
    at: Offsets,
    /// Where the samples before each row end.
    ends: [usize; ROWS + 1],
    /// Height, and where s(0) for target column 0 would stand with dy = 0 at row 0, less the origin.
    samples: [(f32, i32); ROWS * LANES],
}

impl Bundle<'_> {
    /// Raises so many groups of each target row from `start` on, so many target rows at once.
    #[inline(always)]
    fn raise<V: Vectors, const TARGETS: usize>(
        &self,
        field: &Field,
        on: &OnSamples,
        by_sample: bool,
        [start, groups]: [usize; 2],
        out: &mut Targets,
    ) {
        match (groups, by_sample) {
            (1, true) => self.by_samples::<V, 1, TARGETS>(on, start, out),
            (2, true) => self.by_samples::<V, 2, TARGETS>(on, start, out),
            (_, true) => self.by_samples::<V, AT_ONCE, TARGETS>(on, start, out),
            (1, false) => self.by_offsets::<V, 1, TARGETS>(field, on, start, out),
            (2, false) => self.by_offsets::<V, 2, TARGETS>(field, on, start, out),
            (_, false) => self.by_offsets::<V, AT_ONCE, TARGETS>(field, on, start, out),
        }
    }

    /// So many target rows at once with the groups from `start` on: each is to be raised by the bundle's rows from a first
    /// to a last one, at a dy that is so much more than the row. The processor waits for a maximum before it takes the next
    /// of it: some of them side by side keep it at work.
    #[inline(always)]
    fn targets<V: Vectors, const GROUPS: usize, const TARGETS: usize>(
        &self,
        on: &OnSamples,
        start: usize,
        out: &mut Targets,
        raise: impl Fn(&mut [[V::Group; GROUPS]; TARGETS], [i32; TARGETS], [i32; 2]),
    ) {
        let [low, high] = self.at.y;
        let [first, last] = self.rows.map(|r| i64::from(self.row) + r as i64);
        let of = on.targets_in([first - i64::from(high), last - i64::from(low)]);
        for first in of.clone().step_by(TARGETS) {
            // Past the last one it is taken again.
            let b: [usize; TARGETS] = std::array::from_fn(|k| (first + k).min(of.end - 1));
            let level = b.map(|b| self.row - b as i32 * on.every as i32);
            // Those of either: a row past a target's own lies under the cutter too, or stands in the stencil as no data.
            let rows = [
                (low - level[0]).max(self.rows[0] as i32),
                (high - level[TARGETS - 1]).min(self.rows[1] as i32),
            ];
            if rows[0] > rows[1] {
                continue;
            }
            let mut best = [[V::splat(0.0); GROUPS]; TARGETS];
            for (best, b) in best.iter_mut().zip(b) {
                let line = groups(&out.row_mut(b)[start..][..GROUPS * LANES]);
                for (best, line) in best.iter_mut().zip(line) {
                    *best = V::load(line);
                }
            }
            raise(&mut best, level, rows);
            for (best, b) in best.iter().zip(b) {
                let line = groups_mut(&mut out.row_mut(b)[start..][..GROUPS * LANES]);
                for (best, line) in best.iter().zip(line) {
                    V::store(*best, line);
                }
            }
        }
    }

    #[inline(always)]
    fn by_samples<V: Vectors, const GROUPS: usize, const TARGETS: usize>(
        &self,
        on: &OnSamples,
        start: usize,
        out: &mut Targets,
    ) {
        self.targets::<V, GROUPS, TARGETS>(on, start, out, |best, level, [from, to]| {
            let samples = &self.samples[self.ends[from as usize]..self.ends[to as usize + 1]];
            let at = level.map(|level| self.origin + level * self.stride + start as i32);
            for &(z, back) in samples {
                let z = V::splat(z);
                for (best, at) in best.iter_mut().zip(at) {
                    let s = &self.values[(back + at) as usize..][..GROUPS * LANES];
                    for (best, s) in best.iter_mut().zip(groups(s)) {
                        *best = V::greater(V::add(V::load(s), z), *best);
                    }
                }
            }
        });
    }

    #[inline(always)]
    fn by_offsets<V: Vectors, const GROUPS: usize, const TARGETS: usize>(
        &self,
        field: &Field,
        on: &OnSamples,
        start: usize,
        out: &mut Targets,
    ) {
        let [low, high] = self.at.x;
        let taps = (high - low + 1) as usize;
        let column = (PAD as i32 + start as i32 + on.shift as i32 + low) as usize;
        self.targets::<V, GROUPS, TARGETS>(on, start, out, |best, level, [from, to]| {
            for r in from..=to {
                if self.ends[r as usize] == self.ends[r as usize + 1] {
                    continue;
                }
                let [one, other] = [level[0], level[TARGETS - 1]].map(|level| {
                    let at = self.origin + (level + r) * self.stride - high;
                    &self.values[at as usize..][..taps]
                });
                let z = field.row(self.a + i64::from(r))[column..][..GROUPS * LANES + taps - 1]
                    .windows(GROUPS * LANES);
                for (z, (s, t)) in z.zip(one.iter().zip(other).rev()) {
                    let (s, t) = (V::splat(*s), V::splat(*t));
                    for (g, z) in groups(z).iter().enumerate() {
                        let z = V::load(z);
                        best[0][g] = V::greater(V::add(z, s), best[0][g]);
                        if TARGETS > 1 {
                            best[TARGETS - 1][g] = V::greater(V::add(z, t), best[TARGETS - 1][g]);
                        }
                    }
                }
            }
        });
    }
}
