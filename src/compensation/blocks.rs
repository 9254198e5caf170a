use super::field::{Field, PAD};
use super::lanes::{LANES, LEAST, Vectors, groups};
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

/// The rises of a block; None where it has no data. Samples without data make them huge.
#[inline(always)]
pub(super) fn measure<V: Vectors>(field: &Field, block: Block) -> Option<Rises> {
    let i = PAD + block.first;
    let mut below = V::load(group(field.row(block.a - 1), i));
    let mut z = V::load(group(field.row(block.a), i));
    let mut x_next = V::splat(f32::MAX);
    let mut x_before = V::splat(f32::MIN);
    let (mut y_next, mut y_before) = (x_next, x_before);
    let (mut lowest, mut highest) = (x_next, x_before);
    let mut before = V::subtract(z, below);
    for r in 0..block.rows {
        let row = field.row(block.a + r as i64);
        let above = V::load(group(field.row(block.a + r as i64 + 1), i));
        x_next = V::less(x_next, V::subtract(V::load(group(row, i + 1)), z));
        x_before = V::greater(x_before, V::subtract(z, V::load(group(row, i - 1))));
        y_before = V::greater(y_before, before);
        before = V::subtract(above, z);
        y_next = V::less(y_next, before);
        lowest = V::less(lowest, z);
        highest = V::greater(highest, z);
        below = z;
        z = above;
    }
    let _ = below;
    if V::at_least(highest, V::splat(LEAST)) == 0 {
        return None;
    }
    let mut rises = Rises {
        x_next: V::least(x_next),
        x_before: V::most(x_before),
        y_next: V::least(y_next),
        y_before: V::most(y_before),
    };
    if V::at_least(lowest, V::splat(LEAST)) != u16::MAX {
        rises.x_next = f32::MIN;
    }
    Some(rises)
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
            if of[r] != 0 {
                held[r] = of[r]
                    & V::at_least(V::load(&self.x_next[r]), x_next)
                    & V::at_least(x_before, V::load(&self.x_before[r]))
                    & V::at_least(V::load(&self.y_next[r]), y_next)
                    & V::at_least(y_before, V::load(&self.y_before[r]));
            }
        }
        held
    }

    /// The samples among `of` which are on a plane, or in a valley, as far as their neighbours tell.
    #[inline(always)]
    pub fn level<V: Vectors>(&self, of: &[u16; ROWS], within_mm: f32) -> [u16; ROWS] {
        let within = V::splat(within_mm);
        let mut level = [0; ROWS];
        for r in 0..ROWS {
            if of[r] != 0 {
                let x = V::subtract(V::load(&self.x_before[r]), V::load(&self.x_next[r]));
                let y = V::subtract(V::load(&self.y_before[r]), V::load(&self.y_next[r]));
                level[r] = of[r] & V::at_least(within, V::greater(x, y));
            }
        }
        level
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
