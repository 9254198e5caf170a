use super::field::{Field, PAD};
use super::lanes::{LANES, LEAST, Vectors, groups};
use super::patches::Patch;
use super::slopes::Rises;

/// Rows of a block; it is [`LANES`] samples wide.
pub(super) const ROWS: usize = 8;

/// Samples that are looked at together.
#[derive(Clone, Copy)]
pub(super) struct Block {
    /// Row of the field.
    pub a: i64,
    /// First column of data.
    pub first: usize,
    pub rows: usize,
}

#[inline(always)]
fn group(row: &[f32], i: usize) -> &[f32; LANES] {
    &groups(&row[i..i + LANES])[0]
}

/// The rises of a block, lane by lane: the least and the greatest of its rows.
pub(super) struct Measured<V: Vectors> {
    x_next: V::Group,
    x_before: V::Group,
    y_next: V::Group,
    y_before: V::Group,
    /// Whether all samples of the first row have data; where others have none, rises are huge.
    starts_whole: bool,
}

/// The rows that side by side blocks are told by: one below them, theirs, and one above.
pub(super) struct Lines<'a>([&'a [f32]; ROWS + 2]);

impl<'a> Lines<'a> {
    #[inline(always)]
    pub fn of(field: &'a Field, a: i64, rows: usize) -> Lines<'a> {
        Lines(std::array::from_fn(|k| field.row(a + k.min(rows + 1) as i64 - 1)))
    }
}

/// The rises of a block; None where it has no data.
#[inline(always)]
pub(super) fn measure<V: Vectors>(lines: &Lines<'_>, block: Block) -> Option<Measured<V>> {
    let i = PAD + block.first;
    let Lines(lines) = lines;
    let lines = &lines[..block.rows + 2];
    let mut z = V::load(group(lines[1], i));
    let starts_whole = V::at_least(z, V::splat(LEAST)) == u16::MAX;
    let mut before = V::subtract(z, V::load(group(lines[0], i)));
    let mut x_next = V::splat(f32::MAX);
    let mut x_before = V::splat(f32::MIN);
    let (mut y_next, mut y_before) = (x_next, x_before);
    for pair in lines[1..].windows(2) {
        let (row, above) = (pair[0], V::load(group(pair[1], i)));
        x_next = V::less(x_next, V::subtract(V::load(group(row, i + 1)), z));
        x_before = V::greater(x_before, V::subtract(z, V::load(group(row, i - 1))));
        y_before = V::greater(y_before, before);
        before = V::subtract(above, z);
        y_next = V::less(y_next, before);
        z = above;
    }
    if !starts_whole && !has_data::<V>(&lines[1..=block.rows], i) {
        return None;
    }
    Some(Measured { x_next, x_before, y_next, y_before, starts_whole })
}

#[inline(always)]
fn has_data<V: Vectors>(lines: &[&[f32]], i: usize) -> bool {
    let least = V::splat(LEAST);
    lines.iter().any(|line| V::at_least(V::load(group(line, i)), least) != 0)
}

impl<V: Vectors> Measured<V> {
    /// Whether all of them are held by these rises.
    #[inline(always)]
    pub fn is_held(&self, by: &Rises) -> bool {
        let held = V::at_least(self.x_next, V::splat(by.x_next))
            & V::at_least(V::splat(by.x_before), self.x_before)
            & V::at_least(self.y_next, V::splat(by.y_next))
            & V::at_least(V::splat(by.y_before), self.y_before);
        self.starts_whole && held == u16::MAX
    }

    /// All of them together; samples without data make them huge.
    #[inline(always)]
    pub fn rises(&self) -> Rises {
        Rises {
            x_next: if self.starts_whole { V::least(self.x_next) } else { f32::MIN },
            x_before: V::most(self.x_before),
            y_next: V::least(self.y_next),
            y_before: V::most(self.y_before),
        }
    }
}

/// The rises of samples, lane by lane, in samples per sample: rows of a block, or samples put
/// together from them.
pub(super) struct Lanes {
    pub x_next: [[f32; LANES]; ROWS],
    pub x_before: [[f32; LANES]; ROWS],
    pub y_next: [[f32; LANES]; ROWS],
    pub y_before: [[f32; LANES]; ROWS],
    /// Samples that are there.
    pub data: [u16; ROWS],
}

impl Lanes {
    pub fn new() -> Lanes {
        let none = [[0.0; LANES]; ROWS];
        Lanes { x_next: none, x_before: none, y_next: none, y_before: none, data: [0; ROWS] }
    }

    /// Becomes those of a block, in mm.
    #[inline(always)]
    pub fn fill<V: Vectors>(&mut self, field: &Field, block: Block) {
        let i = PAD + block.first;
        let mut z = V::load(group(field.row(block.a), i));
        let mut from_below = V::subtract(z, V::load(group(field.row(block.a - 1), i)));
        self.data = [0; ROWS];
        for r in 0..block.rows {
            let row = field.row(block.a + r as i64);
            let above = V::load(group(field.row(block.a + r as i64 + 1), i));
            let to_above = V::subtract(above, z);
            V::store(V::subtract(V::load(group(row, i + 1)), z), &mut self.x_next[r]);
            V::store(V::subtract(z, V::load(group(row, i - 1))), &mut self.x_before[r]);
            V::store(to_above, &mut self.y_next[r]);
            V::store(from_below, &mut self.y_before[r]);
            self.data[r] = V::at_least(z, V::splat(LEAST));
            z = above;
            from_below = to_above;
        }
    }

    /// The samples among `of` whose rises are held by these.
    #[inline(always)]
    pub fn held<V: Vectors>(&self, of: &[u16; ROWS], by: &Rises) -> [u16; ROWS] {
        let (x_next, x_before) = (V::splat(by.x_next), V::splat(by.x_before));
        let (y_next, y_before) = (V::splat(by.y_next), V::splat(by.y_before));
        let mut held = [0; ROWS];
        for r in 0..ROWS {
            held[r] = of[r]
                & V::at_least(V::load(&self.x_next[r]), x_next)
                & V::at_least(x_before, V::load(&self.x_before[r]))
                & V::at_least(V::load(&self.y_next[r]), y_next)
                & V::at_least(y_before, V::load(&self.y_before[r]));
        }
        held
    }

    /// The samples among `of` which are on a plane, or in a valley, as far as their neighbours tell.
    #[inline(always)]
    pub fn level<V: Vectors>(&self, of: &[u16; ROWS], within_mm: f32) -> [u16; ROWS] {
        let within = V::splat(within_mm);
        let mut level = [0; ROWS];
        for r in 0..ROWS {
            let x = V::subtract(V::load(&self.x_before[r]), V::load(&self.x_next[r]));
            let y = V::subtract(V::load(&self.y_before[r]), V::load(&self.y_next[r]));
            level[r] = of[r] & V::at_least(within, V::greater(x, y));
        }
        level
    }

    /// The samples among `of` from which the surface drops off by `most_mm` a sample at most.
    #[inline(always)]
    pub fn gentle<V: Vectors>(&self, of: &[u16; ROWS], most_mm: f32) -> [u16; ROWS] {
        let (most, least) = (V::splat(most_mm), V::splat(-most_mm));
        let mut gentle = [0; ROWS];
        for r in 0..ROWS {
            let lowest = V::less(V::load(&self.x_next[r]), V::load(&self.y_next[r]));
            let highest = V::greater(V::load(&self.x_before[r]), V::load(&self.y_before[r]));
            gentle[r] = of[r] & V::at_least(most, highest) & V::at_least(lowest, least);
        }
        gentle
    }

    /// The samples among `of` whose surface rises by no more than `within_mm` more to the next sample than from the
    /// one before.
    #[inline(always)]
    pub fn no_valley<V: Vectors>(&self, of: &[u16; ROWS], within_mm: f32) -> [u16; ROWS] {
        let within = V::splat(within_mm);
        let mut these = [0; ROWS];
        for r in 0..ROWS {
            let x = V::subtract(V::load(&self.x_next[r]), V::load(&self.x_before[r]));
            let y = V::subtract(V::load(&self.y_next[r]), V::load(&self.y_before[r]));
            these[r] = of[r] & V::at_least(within, V::greater(x, y));
        }
        these
    }

    /// The samples among `of` from which the surface drops off by more than `most_mm` towards one side.
    #[inline(always)]
    pub fn dropping<V: Vectors>(&self, of: &[u16; ROWS], side: Side, most_mm: f32) -> [u16; ROWS] {
        let (most, least) = (V::splat(most_mm), V::splat(-most_mm));
        let mut these = [0; ROWS];
        for r in 0..ROWS {
            let kept = match side {
                Side::Right => V::at_least(V::load(&self.x_next[r]), least),
                Side::Left => V::at_least(most, V::load(&self.x_before[r])),
                Side::Up => V::at_least(V::load(&self.y_next[r]), least),
                Side::Down => V::at_least(most, V::load(&self.y_before[r])),
            };
            these[r] = of[r] & !kept;
        }
        these
    }

    /// The rises of some samples together.
    #[inline(always)]
    pub fn around<V: Vectors>(&self, of: &[u16; ROWS]) -> Rises {
        let (mut x_next, mut x_before) = (V::splat(f32::MAX), V::splat(f32::MIN));
        let (mut y_next, mut y_before) = (x_next, x_before);
        for (r, &bits) in of.iter().enumerate() {
            if bits != 0 {
                x_next = V::choose(bits, V::less(x_next, V::load(&self.x_next[r])), x_next);
                x_before = V::choose(bits, V::greater(x_before, V::load(&self.x_before[r])), x_before);
                y_next = V::choose(bits, V::less(y_next, V::load(&self.y_next[r])), y_next);
                y_before = V::choose(bits, V::greater(y_before, V::load(&self.y_before[r])), y_before);
            }
        }
        Rises {
            x_next: V::least(x_next),
            x_before: V::most(x_before),
            y_next: V::least(y_next),
            y_before: V::most(y_before),
        }
    }

    /// Those of one sample.
    #[inline(always)]
    pub fn at(&self, r: usize, lane: usize) -> Rises {
        Rises {
            x_next: self.x_next[r][lane],
            x_before: self.x_before[r][lane],
            y_next: self.y_next[r][lane],
            y_before: self.y_before[r][lane],
        }
    }

    /// Puts the samples `bits` of `of` together, in order, and tells where each comes from: row
    /// and lane.
    #[inline(always)]
    pub fn pack(&mut self, of: &Lanes, bits: &[u16; ROWS], from: &mut [[u8; 2]; ROWS * LANES]) {
        let mut count = 0;
        for (r, &bits) in bits.iter().enumerate() {
            let mut bits = bits;
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                let (row, to) = (count / LANES, count % LANES);
                self.x_next[row][to] = of.x_next[r][lane];
                self.x_before[row][to] = of.x_before[r][lane];
                self.y_next[row][to] = of.y_next[r][lane];
                self.y_before[row][to] = of.y_before[r][lane];
                from[count] = [r as u8, lane as u8];
                count += 1;
            }
        }
        for (row, data) in self.data.iter_mut().enumerate() {
            let lanes = count.saturating_sub(row * LANES).min(LANES);
            *data = ((1u32 << lanes) - 1) as u16;
        }
    }
}

/// The most by which the rises to and from any sample of a block differ along an axis, where it bends downwards.
#[inline(always)]
pub(super) fn bend<V: Vectors>(field: &Field, block: Block) -> f32 {
    let i = PAD + block.first;
    let mut z = V::load(group(field.row(block.a), i));
    let mut from_below = V::subtract(z, V::load(group(field.row(block.a - 1), i)));
    let mut most = V::splat(f32::MIN);
    for r in 0..block.rows {
        let row = field.row(block.a + r as i64);
        let above = V::load(group(field.row(block.a + r as i64 + 1), i));
        let to_above = V::subtract(above, z);
        let x_next = V::subtract(V::load(group(row, i + 1)), z);
        let x_before = V::subtract(z, V::load(group(row, i - 1)));
        let bends = V::greater(V::subtract(x_before, x_next), V::subtract(from_below, to_above));
        most = V::greater(most, bends);
        z = above;
        from_below = to_above;
    }
    V::most(most)
}

/// Where a neighbour lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Right,
    Left,
    Up,
    Down,
}

impl Side {
    pub const ALL: [Side; 4] = [Side::Right, Side::Left, Side::Up, Side::Down];
}

/// The least rise from some samples of a block to those `m` further to a side.
#[inline(always)]
pub(super) fn least_rise<V: Vectors>(
    field: &Field,
    block: Block,
    of: &[u16; ROWS],
    side: Side,
    m: i64,
) -> f32 {
    let i = PAD + block.first;
    let mut least = V::splat(f32::MAX);
    for (r, &bits) in of.iter().enumerate() {
        if bits != 0 {
            let a = block.a + r as i64;
            let z = V::load(group(field.row(a), i));
            let (of, i) = match side {
                Side::Right => (a, i + m as usize),
                Side::Left => (a, i - m as usize),
                Side::Up => (a + m, i),
                Side::Down => (a - m, i),
            };
            if of < 0 || of >= field.rows as i64 {
                return f32::MIN;
            }
            let there = V::load(group(field.row(of), i));
            least = V::choose(bits, V::less(least, V::subtract(there, z)), least);
        }
    }
    V::least(least)
}

/// The least patch around these samples of a block.
#[inline(always)]
pub(super) fn patch_of(block: Block, bits: &[u16; ROWS]) -> Patch {
    let (mut all, mut rows) = (0, 0u32);
    for (r, &bits) in bits.iter().enumerate() {
        all |= bits;
        rows |= u32::from(bits != 0) << r;
    }
    let low = rows.trailing_zeros().min(ROWS as u32);
    let left = all.trailing_zeros();
    Patch {
        a: block.a + i64::from(low),
        rows: (u32::BITS - rows.leading_zeros()).saturating_sub(low) as usize,
        first: block.first + left as usize,
        len: (LANES as u32 - all.leading_zeros()).saturating_sub(left) as usize,
    }
}

/// How many samples of a block these are.
#[inline(always)]
pub(super) fn count(bits: &[u16; ROWS]) -> u32 {
    let mut sum = 0;
    for bits in bits {
        sum += bits.count_ones();
    }
    sum
}
