//! Boxes of sixteen samples at once, tightened in turns along both axes.

use super::ball::{Ball, Reachable, greater};
use super::lanes::Vectors;

#[inline(always)]
pub(super) fn size<V: Vectors>(v: V::Group) -> V::Group {
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
pub(super) struct Sides<V: Vectors> {
    pub x_low: V::Group,
    pub x_high: V::Group,
    pub y_low: V::Group,
    pub y_high: V::Group,
}

impl<V: Vectors> Sides<V> {
    /// Without what lies between lattice points, if offsets are whole.
    #[inline(always)]
    pub fn rounded(&self, whole: bool) -> Sides<V> {
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
    pub fn there(&self) -> u16 {
        V::at_least(self.x_high, self.x_low) & V::at_least(self.y_high, self.y_low)
    }
}

/// Boxes to sweep, whatever the slopes.
#[inline(always)]
pub(super) fn steep_start<V: Vectors>(
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
pub(super) struct Sweeper<V: Vectors> {
    pub half: V::Group,
    pub start: V::Group,
    /// R^2, so that rounding makes no root larger or smaller than it may be.
    pub square_less: V::Group,
    pub square_more: V::Group,
}

impl<V: Vectors> Sweeper<V> {
    #[inline(always)]
    pub fn new(ball: &Ball) -> Sweeper<V> {
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
pub(super) struct Slope<V: Vectors> {
    rising: u16,
    /// g / sqrt(1 + g^2), on the safe side.
    sine: V::Group,
    /// (1 + g^2) / 4.
    quarter: V::Group,
}

impl<V: Vectors> Slope<V> {
    #[inline(always)]
    pub fn new(g: V::Group) -> Slope<V> {
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
    pub fn bound(&self, low: V::Group, high: V::Group, cap: V::Group, half: V::Group) -> V::Group {
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
pub(super) fn root<V: Vectors>(square: V::Group) -> V::Group {
    let square = V::greater(square, V::splat(1e-12));
    V::multiply(square, V::inverse_root(square))
}

pub(super) struct Slopes<V: Vectors> {
    x_next: Slope<V>,
    x_before: Slope<V>,
    y_next: Slope<V>,
    y_before: Slope<V>,
}

impl<V: Vectors> Slopes<V> {
    #[inline(always)]
    pub fn new(x_next: V::Group, x_before: V::Group, y_next: V::Group, y_before: V::Group) -> Slopes<V> {
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
    pub fn sweep(&self, at: &mut Sides<V>, of: &Sweeper<V>) {
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
pub(super) fn circle<V: Vectors>(
    low: V::Group,
    high: V::Group,
    of: &Sweeper<V>,
) -> (V::Group, V::Group, V::Group) {
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
    pub spread: f32,
    radius: f32,
    /// Half a sample, and room for rounding.
    half: f32,
    /// How often boxes are tightened; the spread of small balls is wide.
    pub sweeps: usize,
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

    /// A box to sweep, of samples whose mean slopes to their next neighbours are not less than these, and from those
    /// before not more: along x next and before, along y. None where they are steeper.
    #[inline(always)]
    pub fn around(&self, [x_next, x_before, y_next, y_before]: [f64; 4]) -> Option<Reachable> {
        let (steepest, spread) = (f64::from(self.steepest), f64::from(self.spread));
        if !(x_next >= -steepest && x_before <= steepest && y_next >= -steepest && y_before <= steepest) {
            return None;
        }
        let nearest = |next: f64, before: f64| greater(greater(next, -before) - spread, 0.0);
        let farthest = |next: f64, before: f64| greater(before, -next) + spread;
        let z = |x: f64, y: f64| f64::from(self.radius) / (1.0 + x * x + y * y).sqrt();
        let z_low = z(farthest(x_next, x_before), farthest(y_next, y_before));
        let z_high = z(nearest(x_next, x_before), nearest(y_next, y_before));
        let half = f64::from(self.half);
        let low = |next: f64| next * if next >= 0.0 { z_low } else { z_high } - half;
        let high = |before: f64| before * if before >= 0.0 { z_high } else { z_low } + half;
        Some(Reachable { x: [low(x_next), high(x_before)], y: [low(y_next), high(y_before)] })
    }

    /// Boxes to sweep.
    #[inline(always)]
    pub fn start<V: Vectors>(
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
