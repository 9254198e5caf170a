use super::ball::{Ball, Reachable};
use super::field::{Field, PAD};
use super::lanes::{LANES, LEAST, Vectors, groups};
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
    per_step: f32,
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
            per_step: (1.0 / ball.step_mm) as f32,
            sweeps: if radius < 60.0 { 2 } else { 1 },
        })
    }
}

/// The boxes of a block's samples, lane by lane: offsets at which each can touch.
pub(super) struct Boxes<V: Vectors> {
    pub x_low: [[f32; LANES]; ROWS],
    pub x_high: [[f32; LANES]; ROWS],
    pub y_low: [[f32; LANES]; ROWS],
    pub y_high: [[f32; LANES]; ROWS],
    /// Samples with a box.
    pub boxed: [u16; ROWS],
    /// Samples that are too steep to have one here.
    pub steep: [u16; ROWS],
    /// Of all rows.
    pub any_steep: u16,
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
            steep: [0; ROWS],
            any_steep: 0,
            vectors: PhantomData,
        }
    }

    /// Fills in the block's; `whole` rounds boxes to the lattice inwards.
    #[inline(always)]
    pub fn fill(&mut self, field: &Field, block: Block, ball: &Ball, of: &Moderate, whole: bool) {
        let i = PAD + block.first;
        self.any_steep = 0;
        let scale = V::splat(of.per_step);
        let steepest = V::splat(of.steepest);
        let spread = V::splat(of.spread);
        let one = V::splat(1.0);
        let half = V::splat(of.half);
        let sweeper = Sweeper::<V>::new(ball);
        let lower = V::splat(of.radius * (1.0 - V::INVERSE_ERROR));
        let upper = V::splat(of.radius * (1.0 + V::INVERSE_ERROR));
        let mut z = V::load(group(field.row(block.a), i));
        let mut from_below = V::subtract(z, V::load(group(field.row(block.a - 1), i)));
        for r in 0..block.rows {
            let row = field.row(block.a + r as i64);
            let above = V::load(group(field.row(block.a + r as i64 + 1), i));
            let to_above = V::subtract(above, z);
            let x_next = V::multiply(V::subtract(V::load(group(row, i + 1)), z), scale);
            let x_before = V::multiply(V::subtract(z, V::load(group(row, i - 1))), scale);
            let y_next = V::multiply(to_above, scale);
            let y_before = V::multiply(from_below, scale);
            let data = V::at_least(z, V::splat(LEAST));
            z = above;
            from_below = to_above;
            let x_size = V::greater(size::<V>(x_next), size::<V>(x_before));
            let y_size = V::greater(size::<V>(y_next), size::<V>(y_before));
            let moderate = V::at_least(steepest, V::greater(x_size, y_size));
            self.steep[r] = data & !moderate;
            self.any_steep |= self.steep[r];
            if data & moderate == 0 {
                self.boxed[r] = 0;
                continue;
            }
            let x_near = nearest::<V>(V::subtract(x_next, spread), V::add(x_before, spread));
            let y_near = nearest::<V>(V::subtract(y_next, spread), V::add(y_before, spread));
            let x_far = farthest::<V>(V::subtract(x_next, spread), V::add(x_before, spread));
            let y_far = farthest::<V>(V::subtract(y_next, spread), V::add(y_before, spread));
            let q_most = V::add(squares::<V>(x_far, y_far), one);
            let q_least = V::add(squares::<V>(x_near, y_near), one);
            let z_low = V::multiply(lower, V::inverse_root(q_most));
            let z_high = V::multiply(upper, V::inverse_root(q_least));
            let mut at = Sides::<V> {
                x_low: V::subtract(low::<V>(x_next, z_low, z_high), half),
                x_high: V::add(high::<V>(x_before, z_low, z_high), half),
                y_low: V::subtract(low::<V>(y_next, z_low, z_high), half),
                y_high: V::add(high::<V>(y_before, z_low, z_high), half),
            };
            let slopes = Slopes::<V>::new(x_next, x_before, y_next, y_before);
            for _ in 0..of.sweeps {
                slopes.sweep(&mut at, &sweeper);
            }
            let Sides { mut x_low, mut x_high, mut y_low, mut y_high } = at;
            if whole {
                (x_low, x_high) = (V::ceil(x_low), V::floor(x_high));
                (y_low, y_high) = (V::ceil(y_low), V::floor(y_high));
            }
            self.boxed[r] = data & moderate & V::at_least(x_high, x_low) & V::at_least(y_high, y_low);
            V::store(x_low, &mut self.x_low[r]);
            V::store(x_high, &mut self.x_high[r]);
            V::store(y_low, &mut self.y_low[r]);
            V::store(y_high, &mut self.y_high[r]);
        }
    }

    /// Takes all samples with data for too steep.
    #[inline(always)]
    pub fn all_steep(&mut self, field: &Field, block: Block) {
        for r in 0..block.rows {
            let row = field.row(block.a + r as i64);
            self.steep[r] = V::at_least(V::load(group(row, PAD + block.first)), V::splat(LEAST));
            self.boxed[r] = 0;
        }
        self.any_steep = u16::MAX;
    }

    /// Boxes of the samples that are too steep, by the sweeps of [`Ball::reachable`], lane by lane.
    #[inline(always)]
    pub fn fill_steep(&mut self, field: &Field, block: Block, ball: &Ball, whole: bool) {
        let i = PAD + block.first;
        let scale = V::splat((1.0 / ball.step_mm) as f32);
        let zero = V::splat(0.0);
        let radius = V::splat(ball.radius as f32);
        let start = V::splat((1.0 + ball.room()) as f32);
        let sweeper = Sweeper::<V>::new(ball);
        for r in 0..block.rows {
            if self.steep[r] == 0 {
                continue;
            }
            let row = field.row(block.a + r as i64);
            let z = V::load(group(row, i));
            let x_next = V::multiply(V::subtract(V::load(group(row, i + 1)), z), scale);
            let x_before = V::multiply(V::subtract(z, V::load(group(row, i - 1))), scale);
            let above = V::load(group(field.row(block.a + r as i64 + 1), i));
            let below = V::load(group(field.row(block.a + r as i64 - 1), i));
            let y_next = V::multiply(V::subtract(above, z), scale);
            let y_before = V::multiply(V::subtract(z, below), scale);
            let low = V::subtract(V::less(V::multiply(x_next, radius), zero), start);
            let x_low = V::greater(low, V::subtract(zero, radius));
            let high = V::add(V::greater(V::multiply(x_before, radius), zero), start);
            let x_high = V::less(high, radius);
            let low = V::subtract(V::less(V::multiply(y_next, radius), zero), start);
            let y_low = V::greater(low, V::subtract(zero, radius));
            let high = V::add(V::greater(V::multiply(y_before, radius), zero), start);
            let y_high = V::less(high, radius);
            let mut at = Sides::<V> { x_low, x_high, y_low, y_high };
            let slopes = Slopes::<V>::new(x_next, x_before, y_next, y_before);
            for _ in 0..4 {
                slopes.sweep(&mut at, &sweeper);
            }
            let Sides { mut x_low, mut x_high, mut y_low, mut y_high } = at;
            if whole {
                (x_low, x_high) = (V::ceil(x_low), V::floor(x_high));
                (y_low, y_high) = (V::ceil(y_low), V::floor(y_high));
            }
            let bits = self.steep[r];
            self.boxed[r] |= bits & V::at_least(x_high, x_low) & V::at_least(y_high, y_low);
            V::store(V::choose(bits, x_low, V::load(&self.x_low[r])), &mut self.x_low[r]);
            V::store(V::choose(bits, x_high, V::load(&self.x_high[r])), &mut self.x_high[r]);
            V::store(V::choose(bits, y_low, V::load(&self.y_low[r])), &mut self.y_low[r]);
            V::store(V::choose(bits, y_high, V::load(&self.y_high[r])), &mut self.y_high[r]);
        }
    }

    /// The box of one sample.
    #[inline(always)]
    pub fn at(&self, r: usize, lane: usize) -> Reachable {
        Reachable {
            x: [f64::from(self.x_low[r][lane]), f64::from(self.x_high[r][lane])],
            y: [f64::from(self.y_low[r][lane]), f64::from(self.y_high[r][lane])],
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
