use super::ball::{Ball, Reachable};
use super::lanes::{LANES, Vectors};
use super::slopes::Rises;
use super::sweep::{Slope, Sweeper, circle, root};

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
