use super::ball::{Ball, Reachable};
use super::field::{Field, PAD};
use super::lanes::{LANES, LEAST, Vectors, groups};
use super::runs::Offsets;
use super::slopes::Rises;
use std::marker::PhantomData;

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

#[inline(always)]
fn size<V: Vectors>(v: V::Group) -> V::Group {
    V::greater(v, V::subtract(V::splat(0.0), v))
}

/// The least size of what lies between.
#[inline(always)]
fn nearest<V: Vectors>(low: V::Group, high: V::Group) -> V::Group {
    let zero = V::splat(0.0);
    V::greater(V::greater(low, V::subtract(zero, high)), zero)
}

/// The greatest size of what lies between.
#[inline(always)]
fn farthest<V: Vectors>(low: V::Group, high: V::Group) -> V::Group {
    V::greater(high, V::subtract(V::splat(0.0), low))
}

#[inline(always)]
fn squares<V: Vectors>(x: V::Group, y: V::Group) -> V::Group {
    V::add(V::multiply(x, x), V::multiply(y, y))
}

/// slope Z for the slope that bounds from below.
#[inline(always)]
fn low<V: Vectors>(slope: V::Group, z_low: V::Group, z_high: V::Group) -> V::Group {
    V::less(V::multiply(slope, z_low), V::multiply(slope, z_high))
}

/// slope Z for the slope that bounds from above.
#[inline(always)]
fn high<V: Vectors>(slope: V::Group, z_low: V::Group, z_high: V::Group) -> V::Group {
    V::greater(V::multiply(slope, z_low), V::multiply(slope, z_high))
}

/// Boxes of a group of samples.
struct Sides<V: Vectors> {
    x_low: V::Group,
    x_high: V::Group,
    y_low: V::Group,
    y_high: V::Group,
}

impl<V: Vectors> Sides<V> {
    /// Without what lies between lattice points, if offsets are whole.
    #[inline(always)]
    fn rounded(&self, whole: bool) -> Sides<V> {
        if !whole {
            return Sides { ..*self };
        }
        Sides {
            x_low: V::ceil(self.x_low),
            x_high: V::floor(self.x_high),
            y_low: V::ceil(self.y_low),
            y_high: V::floor(self.y_high),
        }
    }

    /// The lanes in which the box is not empty.
    #[inline(always)]
    fn there(&self) -> u16 {
        V::at_least(self.x_high, self.x_low) & V::at_least(self.y_high, self.y_low)
    }
}

/// Boxes to sweep, whatever the slopes.
#[inline(always)]
fn steep_start<V: Vectors>(
    radius: V::Group,
    start: V::Group,
    [x_next, x_before, y_next, y_before]: [V::Group; 4],
) -> Sides<V> {
    let zero = V::splat(0.0);
    let low = |next| {
        let low = V::subtract(V::less(V::multiply(next, radius), zero), start);
        V::greater(low, V::subtract(zero, radius))
    };
    let high = |before| V::less(V::add(V::greater(V::multiply(before, radius), zero), start), radius);
    Sides { x_low: low(x_next), x_high: high(x_before), y_low: low(y_next), y_high: high(y_before) }
}

/// What sweeps take of a ball.
struct Sweeper<V: Vectors> {
    half: V::Group,
    start: V::Group,
    /// R^2, so that rounding makes no root larger or smaller than it may be.
    square_less: V::Group,
    square_more: V::Group,
}

impl<V: Vectors> Sweeper<V> {
    #[inline(always)]
    fn new(ball: &Ball) -> Sweeper<V> {
        let square = ball.radius * ball.radius;
        Sweeper {
            half: V::splat((0.5 + ball.room()) as f32),
            start: V::splat((1.0 + ball.room()) as f32),
            square_less: V::splat((square * (1.0 - 1e-6)) as f32),
            square_more: V::splat((square * (1.0 + 1e-6)) as f32),
        }
    }
}

/// One of the four bounds: the mean slope g of the surface to a neighbour.
struct Slope<V: Vectors> {
    rising: u16,
    /// g / sqrt(1 + g^2), on the safe side.
    sine: V::Group,
    /// (1 + g^2) / 4.
    quarter: V::Group,
}

impl<V: Vectors> Slope<V> {
    #[inline(always)]
    fn new(g: V::Group) -> Slope<V> {
        // Squares stay finite.
        let g = V::less(V::greater(g, V::splat(-1e15)), V::splat(1e15));
        let square = V::add(V::multiply(g, g), V::splat(1.0));
        let rising = V::at_least(g, V::splat(0.0));
        let safe =
            V::choose(rising, V::splat(1.0 - 2.0 * V::INVERSE_ERROR), V::splat(1.0 + 2.0 * V::INVERSE_ERROR));
        Slope {
            rising,
            sine: V::multiply(V::multiply(g, safe), V::inverse_root(square)),
            quarter: V::multiply(square, V::splat(0.25)),
        }
    }

    /// The least offset along the axis, where the circle that the ball is there has a squared
    /// radius within `low ..= high`: a chord from d to d + 1 of slope g on a circle of radius C
    /// has its middle at sin sqrt(C^2 - (1 + g^2) / 4).
    #[inline(always)]
    fn bound(&self, low: V::Group, high: V::Group, cap: V::Group, half: V::Group) -> V::Group {
        let square = V::choose(self.rising, V::subtract(low, self.quarter), high);
        let bound = V::subtract(V::multiply(self.sine, root::<V>(square)), half);
        // No chord is so steep.
        let never = self.rising & V::at_least(V::multiply(self.quarter, V::splat(0.9999)), high);
        let bound = V::choose(never, V::splat(1e9), bound);
        V::less(bound, cap)
    }
}

/// sqrt, relatively within the error of [`Vectors::inverse_root`]; 0 of what is negative.
#[inline(always)]
fn root<V: Vectors>(square: V::Group) -> V::Group {
    let square = V::greater(square, V::splat(1e-12));
    V::multiply(square, V::inverse_root(square))
}

struct Slopes<V: Vectors> {
    x_next: Slope<V>,
    x_before: Slope<V>,
    y_next: Slope<V>,
    y_before: Slope<V>,
}

impl<V: Vectors> Slopes<V> {
    #[inline(always)]
    fn new(x_next: V::Group, x_before: V::Group, y_next: V::Group, y_before: V::Group) -> Slopes<V> {
        let zero = V::splat(0.0);
        Slopes {
            x_next: Slope::new(x_next),
            x_before: Slope::new(V::subtract(zero, x_before)),
            y_next: Slope::new(y_next),
            y_before: Slope::new(V::subtract(zero, y_before)),
        }
    }

    /// Tightens boxes once, first in x by what they are in y.
    #[inline(always)]
    fn sweep(&self, at: &mut Sides<V>, of: &Sweeper<V>) {
        let zero = V::splat(0.0);
        let (low, high, cap) = circle::<V>(at.y_low, at.y_high, of);
        at.x_low = V::greater(at.x_low, self.x_next.bound(low, high, cap, of.half));
        at.x_high = V::less(at.x_high, V::subtract(zero, self.x_before.bound(low, high, cap, of.half)));
        let (low, high, cap) = circle::<V>(at.x_low, at.x_high, of);
        at.y_low = V::greater(at.y_low, self.y_next.bound(low, high, cap, of.half));
        at.y_high = V::less(at.y_high, V::subtract(zero, self.y_before.bound(low, high, cap, of.half)));
    }
}

/// The ball cut along one axis at offsets `low ..= high` of the other: bounds on the square of the
/// circle's radius, and the farthest offset at which the next sample is surely in the circle.
#[inline(always)]
fn circle<V: Vectors>(low: V::Group, high: V::Group, of: &Sweeper<V>) -> (V::Group, V::Group, V::Group) {
    let (far, near) = (farthest::<V>(low, high), nearest::<V>(low, high));
    let least = V::subtract(of.square_less, V::multiply(far, far));
    let most = V::subtract(of.square_more, V::multiply(near, near));
    let radius = V::multiply(root::<V>(least), V::splat(1.0 - V::INVERSE_ERROR));
    (least, most, V::subtract(radius, of.start))
}

/// What is the same for all samples of moderate slope under one ball.
///
/// Where all slopes are at most `steepest`, the offset d of a contact has |dx| <= R sin + 1 (the
/// neighbour towards the axis stands above it otherwise), so |d| <= rho = sqrt 2 (R sin + 1), and
/// one sample further the ball's own slope q = d / Z is at most P = rho' / sqrt(R^2 - rho'^2) and
/// changes by at most D = (1 + P^2)^1.5 / R a sample. The mean slope to a neighbour thus tells q
/// within 1.5 D at d and at its neighbours, and Z = R / sqrt(1 + q^2) there.
#[derive(Clone, Copy)]
pub(super) struct Moderate {
    /// Greatest slope for which this holds.
    pub steepest: f32,
    /// 1.5 D.
    spread: f32,
    radius: f32,
    /// Half a sample, and room for rounding.
    half: f32,
    /// How often boxes are tightened; the spread of small balls is wide.
    sweeps: usize,
}

/// The widest slope that is called moderate.
const STEEPEST: f64 = 0.6;

impl Moderate {
    /// None where no slope is moderate: a ball of a few samples.
    pub fn new(ball: &Ball) -> Option<Moderate> {
        let radius = ball.radius;
        let rho = 0.75 * radius;
        let sine = (rho / 2f64.sqrt() - 2.0) / radius;
        if sine < 0.2 {
            return None;
        }
        let steepest = (sine / (1.0 - sine * sine).sqrt()).min(STEEPEST);
        let sine = steepest / (1.0 + steepest * steepest).sqrt();
        let rho = 2f64.sqrt() * (radius * sine + 2.0);
        let squared = rho * rho / (radius * radius - rho * rho);
        let spread = 1.5 * (1.0 + squared).powf(1.5) / radius;
        Some(Moderate {
            steepest: steepest as f32,
            spread: spread as f32,
            radius: radius as f32,
            half: (0.5 + ball.room()) as f32,
            sweeps: if radius < 60.0 { 2 } else { 1 },
        })
    }

    /// Boxes to sweep.
    #[inline(always)]
    fn start<V: Vectors>(
        &self,
        x_next: V::Group,
        x_before: V::Group,
        y_next: V::Group,
        y_before: V::Group,
    ) -> Sides<V> {
        let spread = V::splat(self.spread);
        let one = V::splat(1.0);
        let half = V::splat(self.half);
        let x_near = nearest::<V>(V::subtract(x_next, spread), V::add(x_before, spread));
        let y_near = nearest::<V>(V::subtract(y_next, spread), V::add(y_before, spread));
        let x_far = farthest::<V>(V::subtract(x_next, spread), V::add(x_before, spread));
        let y_far = farthest::<V>(V::subtract(y_next, spread), V::add(y_before, spread));
        let q_most = V::add(squares::<V>(x_far, y_far), one);
        let q_least = V::add(squares::<V>(x_near, y_near), one);
        let z_low = V::multiply(V::splat(self.radius * (1.0 - V::INVERSE_ERROR)), V::inverse_root(q_most));
        let z_high = V::multiply(V::splat(self.radius * (1.0 + V::INVERSE_ERROR)), V::inverse_root(q_least));
        Sides {
            x_low: V::subtract(low::<V>(x_next, z_low, z_high), half),
            x_high: V::add(high::<V>(x_before, z_low, z_high), half),
            y_low: V::subtract(low::<V>(y_next, z_low, z_high), half),
            y_high: V::add(high::<V>(y_before, z_low, z_high), half),
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

/// The offsets along x at which one sample can touch in each row of its box, in the order of the
/// target rows.
pub(super) struct RowBounds {
    pub low: Vec<[f32; LANES]>,
    pub high: Vec<[f32; LANES]>,
}

impl RowBounds {
    pub fn new() -> RowBounds {
        RowBounds { low: Vec::new(), high: Vec::new() }
    }

    /// Of the `count` rows at `dy`, `dy - every`, ...; gives about how many groups of lanes they
    /// take. An edge that drops off to one side leaves a box as large as the ball, of which an
    /// arc is possible: in x by the slopes along x, and at each dy only where the ball falls along
    /// y as the surface does.
    #[inline(always)]
    pub fn fill<V: Vectors>(
        &mut self,
        rises: &Rises,
        ball: &Ball,
        at: &Reachable,
        [dy, every, count]: [i32; 3],
    ) -> usize {
        let sweeper = Sweeper::<V>::new(ball);
        let zero = V::splat(0.0);
        let scale = (1.0 / ball.step_mm) as f32;
        let slope = |rise: f32| Slope::<V>::new(V::splat(rise * scale));
        let (x_next, x_before) = (slope(rises.x_next), slope(0.0 - rises.x_before));
        // Along y as if rising, from where each bounds.
        let rising = [rises.y_next * scale, 0.0 - rises.y_before * scale];
        let mut steps = [0.0; LANES];
        for (k, step) in steps.iter_mut().enumerate() {
            *step = (k as i32 * every) as f32;
        }
        let steps = V::load(&steps);
        let (x_low, x_high) = (V::splat(at.x[0] as f32), V::splat(at.x[1] as f32));
        let mut groups = 0;
        self.low.clear();
        self.high.clear();
        for first in (0..count).step_by(LANES) {
            let y = V::subtract(V::splat((dy - first * every) as f32), steps);
            let (low, high, cap) = circle::<V>(y, y, &sweeper);
            let mut lo = V::greater(x_low, x_next.bound(low, high, cap, sweeper.half));
            let mut hi = V::less(x_high, V::subtract(zero, x_before.bound(low, high, cap, sweeper.half)));
            for (k, g) in rising.into_iter().enumerate() {
                // The chord to the neighbour ahead is level with y + 1/2 >= sin sqrt(C^2 - quarter).
                let ahead = if k == 0 { y } else { V::subtract(zero, y) };
                let ahead = V::add(ahead, sweeper.half);
                let Some([near, far]) = at_slope::<V>(g, ahead, &sweeper) else { continue };
                // What lies nearer the axis than `near` or farther from it than `far` is out.
                hi = V::less(hi, far);
                lo = V::greater(lo, V::subtract(zero, far));
                if at.x[0] >= 0.0 {
                    lo = V::greater(lo, near);
                } else if at.x[1] <= 0.0 {
                    hi = V::less(hi, V::subtract(zero, near));
                }
            }
            let (lo, hi) = (V::ceil(lo), V::floor(hi));
            let (mut lows, mut highs) = ([0.0; LANES], [0.0; LANES]);
            V::store(lo, &mut lows);
            V::store(hi, &mut highs);
            for (low, high) in lows.iter().zip(&highs).take((count - first) as usize) {
                if low <= high {
                    groups += 1 + (high - low) as usize / LANES;
                }
            }
            self.low.push(lows);
            self.high.push(highs);
        }
        groups
    }
}

/// How near the axis and how far from it a sample can be that stands `ahead` - 1/2 from it along
/// the other axis, and whose neighbour there rises by the slope `g`, or falls. None where this
/// tells nothing.
#[inline(always)]
fn at_slope<V: Vectors>(g: f32, ahead: V::Group, of: &Sweeper<V>) -> Option<[V::Group; 2]> {
    // Steeper slopes may have their neighbour outside the ball.
    if !(0.02..2.0).contains(&g.abs()) {
        return None;
    }
    let quarter = 0.25 * (1.0 + g * g);
    // 1 / sin^2, on the safe side.
    let cosecant = 1.0 + 1.0 / (g * g);
    let zero = V::splat(0.0);
    let square = V::multiply(ahead, ahead);
    if g > 0.0 {
        // C^2 <= (ahead / sin)^2 + quarter, where ahead is positive, and never else.
        let most = V::add(V::multiply(square, V::splat(cosecant * 1.00001)), V::splat(quarter * 1.00001));
        let near = V::greater(V::subtract(of.square_less, most), zero);
        let near = V::multiply(root::<V>(near), V::splat(1.0 - V::INVERSE_ERROR));
        let none = V::at_least(zero, ahead);
        Some([V::choose(none, V::splat(1e9), V::subtract(near, V::splat(1e-3))), V::splat(1e9)])
    } else {
        // C^2 >= (ahead / sin)^2 where ahead is negative; a quarter more but for the last samples.
        let least = V::multiply(square, V::splat(cosecant * 0.99999));
        let far = V::subtract(of.square_more, least);
        let none = V::at_least(zero, far);
        let far = V::multiply(root::<V>(far), V::splat(1.0 + V::INVERSE_ERROR));
        let far = V::choose(none, V::splat(-1.0), V::add(far, V::splat(1e-3)));
        let falls = V::at_least(zero, ahead);
        Some([zero, V::choose(falls, far, V::splat(1e9))])
    }
}

/// The boxes of samples, lane by lane: offsets at which each can touch.
pub(super) struct Boxes<V: Vectors> {
    pub x_low: [[f32; LANES]; ROWS],
    pub x_high: [[f32; LANES]; ROWS],
    pub y_low: [[f32; LANES]; ROWS],
    pub y_high: [[f32; LANES]; ROWS],
    /// Samples with a box.
    pub boxed: [u16; ROWS],
    /// Rows whose samples are bounded one by one, counted since it was last asked.
    pub bounded: usize,
    vectors: PhantomData<V>,
}

impl<V: Vectors> Boxes<V> {
    pub fn new() -> Boxes<V> {
        let none = [[0.0; LANES]; ROWS];
        Boxes {
            x_low: none,
            x_high: none,
            y_low: none,
            y_high: none,
            boxed: [0; ROWS],
            bounded: 0,
            vectors: PhantomData,
        }
    }

    /// Those of the samples `of` these lanes; `whole` rounds boxes to the lattice inwards.
    #[inline(always)]
    pub fn fill(
        &mut self,
        lanes: &Lanes,
        of: &[u16; ROWS],
        ball: &Ball,
        moderate: &Option<Moderate>,
        whole: bool,
    ) {
        let scale = V::splat((1.0 / ball.step_mm) as f32);
        let sweeper = Sweeper::<V>::new(ball);
        // Nothing is steeper than what moderate slopes are, without any.
        let steepest = V::splat(moderate.as_ref().map_or(-1.0, |moderate| moderate.steepest));
        for r in 0..ROWS {
            self.boxed[r] = 0;
            if of[r] == 0 {
                continue;
            }
            self.bounded += 1;
            let x_next = V::multiply(V::load(&lanes.x_next[r]), scale);
            let x_before = V::multiply(V::load(&lanes.x_before[r]), scale);
            let y_next = V::multiply(V::load(&lanes.y_next[r]), scale);
            let y_before = V::multiply(V::load(&lanes.y_before[r]), scale);
            let x_size = V::greater(size::<V>(x_next), size::<V>(x_before));
            let y_size = V::greater(size::<V>(y_next), size::<V>(y_before));
            let of_moderate = of[r] & V::at_least(steepest, V::greater(x_size, y_size));
            let steep = of[r] & !of_moderate;
            if let Some(moderate) = moderate
                && of_moderate != 0
            {
                let mut at = moderate.start::<V>(x_next, x_before, y_next, y_before);
                let around = at.rounded(whole);
                if of_moderate & around.there() != 0 {
                    let slopes = Slopes::<V>::new(x_next, x_before, y_next, y_before);
                    for _ in 0..moderate.sweeps {
                        slopes.sweep(&mut at, &sweeper);
                    }
                    self.put(r, of_moderate, &at.rounded(whole));
                }
            }
            if steep != 0 {
                self.bounded += 1;
                let radius = V::splat(ball.radius as f32);
                let start = V::splat((1.0 + ball.room()) as f32);
                let mut at = steep_start::<V>(radius, start, [x_next, x_before, y_next, y_before]);
                let slopes = Slopes::<V>::new(x_next, x_before, y_next, y_before);
                for _ in 0..4 {
                    slopes.sweep(&mut at, &sweeper);
                }
                self.put(r, steep, &at.rounded(whole));
            }
        }
    }

    /// Takes the boxes of some samples of a row.
    #[inline(always)]
    fn put(&mut self, r: usize, bits: u16, at: &Sides<V>) {
        self.boxed[r] |= bits & at.there();
        V::store(V::choose(bits, at.x_low, V::load(&self.x_low[r])), &mut self.x_low[r]);
        V::store(V::choose(bits, at.x_high, V::load(&self.x_high[r])), &mut self.x_high[r]);
        V::store(V::choose(bits, at.y_low, V::load(&self.y_low[r])), &mut self.y_low[r]);
        V::store(V::choose(bits, at.y_high, V::load(&self.y_high[r])), &mut self.y_high[r]);
    }

    /// The box of one sample.
    #[inline(always)]
    pub fn at(&self, r: usize, lane: usize) -> Reachable {
        Reachable {
            x: [f64::from(self.x_low[r][lane]), f64::from(self.x_high[r][lane])],
            y: [f64::from(self.y_low[r][lane]), f64::from(self.y_high[r][lane])],
        }
    }

    /// The box of one sample, whose offsets are whole.
    #[inline(always)]
    pub fn offsets(&self, r: usize, lane: usize) -> Offsets {
        Offsets {
            x: [self.x_low[r][lane] as i32, self.x_high[r][lane] as i32],
            y: [self.y_low[r][lane] as i32, self.y_high[r][lane] as i32],
        }
    }

    /// The samples of small boxes.
    #[inline(always)]
    pub fn small(&self, rows: usize, most: f32) -> [u16; ROWS] {
        let most = V::splat(most);
        let mut small = [0; ROWS];
        for (r, small) in small.iter_mut().enumerate().take(rows) {
            if self.boxed[r] != 0 {
                let width = V::subtract(V::load(&self.x_high[r]), V::load(&self.x_low[r]));
                let height = V::subtract(V::load(&self.y_high[r]), V::load(&self.y_low[r]));
                *small = self.boxed[r] & V::at_least(most, V::greater(width, height));
            }
        }
        small
    }

    /// The samples among `of` whose boxes lie within `around`.
    #[inline(always)]
    pub fn within(&self, of: &[u16; ROWS], around: &Reachable) -> [u16; ROWS] {
        let (x_low, x_high) = (V::splat(around.x[0] as f32), V::splat(around.x[1] as f32));
        let (y_low, y_high) = (V::splat(around.y[0] as f32), V::splat(around.y[1] as f32));
        let mut within = [0; ROWS];
        for r in 0..ROWS {
            if of[r] != 0 {
                within[r] = of[r]
                    & V::at_least(V::load(&self.x_low[r]), x_low)
                    & V::at_least(x_high, V::load(&self.x_high[r]))
                    & V::at_least(V::load(&self.y_low[r]), y_low)
                    & V::at_least(y_high, V::load(&self.y_high[r]));
            }
        }
        within
    }

    /// The box around those of some samples.
    #[inline(always)]
    pub fn hull(&self, of: &[u16; ROWS]) -> Reachable {
        let (mut x_low, mut x_high) = (V::splat(f32::MAX), V::splat(f32::MIN));
        let (mut y_low, mut y_high) = (x_low, x_high);
        for (r, &bits) in of.iter().enumerate() {
            if bits != 0 {
                x_low = V::choose(bits, V::less(x_low, V::load(&self.x_low[r])), x_low);
                x_high = V::choose(bits, V::greater(x_high, V::load(&self.x_high[r])), x_high);
                y_low = V::choose(bits, V::less(y_low, V::load(&self.y_low[r])), y_low);
                y_high = V::choose(bits, V::greater(y_high, V::load(&self.y_high[r])), y_high);
            }
        }
        Reachable {
            x: [f64::from(V::least(x_low)), f64::from(V::most(x_high))],
            y: [f64::from(V::least(y_low)), f64::from(V::most(y_high))],
        }
    }
}
