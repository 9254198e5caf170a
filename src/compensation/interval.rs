use super::slopes::Rises;
use super::stencil::ArcRef;

/// What bounds the columns at which samples can touch in one row: their rises to the samples
/// beside them, against the table's own values.
#[derive(Clone, Copy)]
pub(super) struct Beside {
    pub x_next: f32,
    pub x_before: f32,
    /// Sine of the angle of either, for where to look first.
    sines: [f32; 2],
    slack_mm: f32,
}

impl Beside {
    /// `slack_mm` is more than rounding can shift the difference of two entries of the table.
    #[inline(always)]
    pub fn new(rises: &Rises, step_mm: f64, slack_mm: f32) -> Beside {
        let sine = |rise_mm: f32| {
            let slope = rise_mm * (1.0 / step_mm as f32);
            slope / (1.0 + (slope * slope).min(1e30)).sqrt()
        };
        let sines =
            [sine(rises.x_next.max(-1e12)).clamp(-1.0, 1.0), sine(rises.x_before.min(1e12)).clamp(-1.0, 1.0)];
        Beside { x_next: rises.x_next, x_before: rises.x_before, sines, slack_mm }
    }

    /// What a rise may be off by.
    #[inline(always)]
    fn give(&self, rise_mm: f32) -> f32 {
        self.slack_mm + rise_mm.abs() * f32::EPSILON
    }

    /// Whether the next sample always beats one of these at dx.
    #[inline(always)]
    fn rises_right(&self, arc: &ArcRef, dx: i32) -> bool {
        dx < arc.arc.hi && self.x_next - self.give(self.x_next) > arc.s(dx) - arc.s(dx + 1)
    }

    /// Whether the sample before always beats one of these at dx.
    #[inline(always)]
    fn falls_left(&self, arc: &ArcRef, dx: i32) -> bool {
        dx > arc.arc.lo && self.x_before + self.give(self.x_before) < arc.s(dx - 1) - arc.s(dx)
    }

    /// The dx of an arc at which these samples can touch: s along a row is concave, so they are
    /// an interval, and on a ball they lie where the arc, a circle, has their slopes.
    #[inline(always)]
    pub fn interval(&self, arc: &ArcRef) -> [i32; 2] {
        let [first, last] = [arc.arc.lo, arc.arc.hi];
        let middle = 0.5 * (first + last) as f32;
        let half = 0.5 * (last - first + 1) as f32;
        let mut lo = ((middle + half * self.sines[0]) as i32).clamp(first, last);
        if self.rises_right(arc, lo) {
            lo += 1;
            while self.rises_right(arc, lo) {
                lo += 1;
            }
        } else {
            while lo > first && !self.rises_right(arc, lo - 1) {
                lo -= 1;
            }
        }
        let mut hi = ((middle + half * self.sines[1]) as i32).clamp(first, last);
        if self.falls_left(arc, hi) {
            hi -= 1;
            while self.falls_left(arc, hi) {
                hi -= 1;
            }
        } else {
            while hi < last && !self.falls_left(arc, hi + 1) {
                hi += 1;
            }
        }
        [lo, hi]
    }
}
