use super::blocks::Side;
use super::field::Field;
use super::lanes::{LANES, NONE};
use super::rolling::WIDE;
use super::slopes::Rises;
use super::sweep::Moderate;

/// Offsets d (sample less axis, in samples) at which samples can touch a ball: a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reachable {
    pub x: [f64; 2],
    pub y: [f64; 2],
}

impl Reachable {
    /// About how many lattice points lie in it.
    #[inline(always)]
    pub fn lattice_points(&self) -> f64 {
        (self.x[1] - self.x[0] + 0.5) * (self.y[1] - self.y[0] + 0.5)
    }

    /// About how many groups of lanes its rows take.
    #[inline(always)]
    pub fn groups(&self) -> f64 {
        (self.y[1] - self.y[0] + 0.5) * (1.0 + (self.x[1] - self.x[0]) / LANES as f64)
    }

    /// What lies in both.
    #[inline(always)]
    pub fn and(&self, other: &Reachable) -> Reachable {
        let both = |a: [f64; 2], b: [f64; 2]| [greater(a[0], b[0]), less(a[1], b[1])];
        Reachable { x: both(self.x, other.x), y: both(self.y, other.y) }
    }

    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.x[0] > self.x[1] || self.y[0] > self.y[1]
    }
}

/// How far off neighbours are looked at, in samples.
pub(super) const FARTHEST: usize = 24;

/// Room for the rounding of this file's own arithmetic, in samples.
const ROOM: f64 = 0.01;

/// The greater of two numbers; f64::max also looks for NaN, which costs a tenth of the whole search.
#[inline(always)]
pub(super) fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn less(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// A ball, and how exact its table is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// In samples.
    pub radius: f64,
    pub step_mm: f64,
    /// More than rounding can shift the difference of two entries of its table.
    pub slack_mm: f32,
}

/// Mean slopes to neighbours `m` samples off, widened by what rounding can do.
struct Slopes {
    m: f64,
    x_next: f64,
    x_before: f64,
    y_next: f64,
    y_before: f64,
}

impl Ball {
    /// The box for samples with these rises to their next neighbours; None where none can touch.
    ///
    /// With Z(d) = sqrt(R^2 - |d|^2) and a neighbour m samples on, s(d) - s(d + m e) =
    /// m (2 dx + m) / (Z(d) + Z(d + m e)), so the mean slope g to that neighbour gives
    /// dx >= g Zb - m/2 with Zb the mean of the two Z, and likewise from the one before. Zb is
    /// bounded from the box, which shrinks in a few sweeps.
    #[inline(always)]
    pub fn reachable(&self, rises: &Rises, moderate: Option<&Moderate>) -> Option<Reachable> {
        let slopes = self.slopes(rises, 1.0);
        let of = [slopes.x_next, slopes.x_before, slopes.y_next, slopes.y_before];
        let at = moderate.and_then(|moderate| moderate.around(of));
        self.narrowed(at.unwrap_or_else(|| self.start_of(&slopes)), &slopes)
    }

    /// As [`Ball::reachable`], of offsets within a box only.
    #[inline(always)]
    pub fn reachable_within(&self, rises: &Rises, within: &Reachable) -> Option<Reachable> {
        let slopes = self.slopes(rises, 1.0);
        let at = self.start_of(&slopes).and(within);
        if at.is_empty() { None } else { self.narrowed(at, &slopes) }
    }

    #[inline(always)]
    fn narrowed(&self, mut at: Reachable, slopes: &Slopes) -> Option<Reachable> {
        for _ in 0..6 {
            let before = at.lattice_points();
            at = self.sweep(at, slopes)?;
            let now = at.lattice_points();
            if now <= 2.6 || now > 0.75 * before {
                break;
            }
        }
        Some(at)
    }

    /// What of a box lies under the ball, or more.
    #[inline(always)]
    pub fn under(&self, at: &Reachable) -> Reachable {
        let half = |[low, high]: [f64; 2]| {
            let near = greater(greater(low, -high), 0.0);
            greater(self.radius * self.radius - near * near, 0.0).sqrt() + ROOM
        };
        let (x, y) = (half(at.y), half(at.x));
        at.and(&Reachable { x: [-x, x], y: [-y, y] })
    }

    /// A box for samples with these rises without sweeps: wide, and never empty.
    #[inline(always)]
    pub fn start(&self, rises: &Rises) -> Reachable {
        self.start_of(&self.slopes(rises, 1.0))
    }

    /// Where the neighbour lies outside the cutter it bounds nothing, and with nothing known of
    /// the other axis that may be so from a sample before the axis on.
    #[inline(always)]
    fn start_of(&self, slopes: &Slopes) -> Reachable {
        Reachable {
            x: self.start_along([slopes.x_next, slopes.x_before], [1.0, 1.0]),
            y: self.start_along([slopes.y_next, slopes.y_before], [1.0, 1.0]),
        }
    }

    /// Bounds along one axis by the mean slopes to the next neighbour and from the one before, so many samples off,
    /// with nothing known of the other axis.
    #[inline(always)]
    pub fn start_along(&self, [next, before]: [f64; 2], off: [f64; 2]) -> [f64; 2] {
        let low = less(next * self.radius, 0.0) - off[0] - ROOM;
        let high = greater(before * self.radius, 0.0) + off[1] + ROOM;
        [greater(low, -self.radius), less(high, self.radius)]
    }

    /// Room for the rounding of boxes in f32 and of the table's entries, in samples.
    pub fn room(&self) -> f64 {
        0.02 + self.radius * self.radius * 5e-7
    }

    /// Tightens the box of one sample (at padded column `i`) by neighbours further off: what tames
    /// noise, whose next neighbours bound little.
    pub fn far_neighbours(&self, field: &Field, a: i64, i: usize, mut at: Reachable) -> Option<Reachable> {
        let z = field.row(a)[i];
        let before = at.groups();
        let row = |a: i64| if a >= 0 && a < field.rows as i64 { field.row(a)[i] } else { NONE };
        let beside = |i: usize| field.row(a).get(i).copied().unwrap_or(NONE);
        for m in [2usize, 3, 4, 6, 8, 12, 16, FARTHEST] {
            if m as f64 >= self.radius {
                break;
            }
            let rises = Rises {
                x_next: beside(i + m) - z,
                x_before: z - beside(i - m),
                y_next: row(a + m as i64) - z,
                y_before: z - row(a - m as i64),
            };
            let slopes = self.slopes(&rises, m as f64);
            for _ in 0..2 {
                at = self.sweep(at, &slopes)?;
            }
            let now = at.groups();
            // On an edge between planes far neighbours say nothing new.
            if now < 0.3 * WIDE || (m == 4 && now > 0.7 * before) {
                break;
            }
        }
        Some(at)
    }

    /// How far off the sample stands that tells most of how far the ball rolls over an edge that drops off like this.
    #[inline(always)]
    pub fn looks_off(&self, rise_mm: f32) -> i64 {
        let scale = (1.0 / self.step_mm) as f32;
        let m = (-2.0 * rise_mm * scale * self.radius as f32).max(0.0).sqrt() as i64;
        m.clamp(2, FARTHEST as i64)
    }

    /// Tightens a box by the rise to the samples `m` further to a side.
    #[inline(always)]
    pub fn beyond(&self, mut at: Reachable, side: Side, m: f64, rise_mm: f32) -> Option<Reachable> {
        let none = [-1e30, 1e30];
        let [next, before] = self.mean_slopes([rise_mm, -rise_mm], m);
        let z = self.mean_z(&at, m);
        match side {
            Side::Right => at.x = self.bound(at.x, at.y, m, next, none[1], z),
            Side::Left => at.x = self.bound(at.x, at.y, m, none[0], before, z),
            Side::Up => at.y = self.bound(at.y, at.x, m, next, none[1], z),
            Side::Down => at.y = self.bound(at.y, at.x, m, none[0], before, z),
        }
        (!at.is_empty()).then_some(at)
    }

    #[inline(always)]
    fn slopes(&self, rises: &Rises, m: f64) -> Slopes {
        let [x_next, x_before] = self.mean_slopes([rises.x_next, rises.x_before], m);
        let [y_next, y_before] = self.mean_slopes([rises.y_next, rises.y_before], m);
        Slopes { m, x_next, x_before, y_next, y_before }
    }

    /// The mean slopes of rises to the next neighbour and from the one before, `m` samples off, widened by what
    /// rounding can do.
    #[inline(always)]
    pub fn mean_slopes(&self, [next, before]: [f32; 2], m: f64) -> [f64; 2] {
        let scale = 1.0 / (m * self.step_mm);
        let give = |rise: f32| self.slack_mm as f64 + rise.abs() as f64 * f32::EPSILON as f64;
        [(next as f64 - give(next)) * scale, (before as f64 + give(before)) * scale]
    }

    /// One sweep over both axes.
    #[inline(always)]
    fn sweep(&self, at: Reachable, slopes: &Slopes) -> Option<Reachable> {
        let z = self.mean_z(&at, slopes.m);
        let x = self.bound(at.x, at.y, slopes.m, slopes.x_next, slopes.x_before, z);
        let y = self.bound(at.y, at.x, slopes.m, slopes.y_next, slopes.y_before, z);
        let at = Reachable { x, y };
        (!at.is_empty()).then_some(at)
    }

    /// Bounds on the mean of Z at a point of the box and at its neighbour. Z is concave, so the
    /// mean is at most Z in the middle, and less by no more than m^2 R^2 / (6 Z^3) while the rim
    /// is far.
    #[inline(always)]
    pub fn mean_z(&self, at: &Reachable, m: f64) -> [f64; 2] {
        let half = 0.5 * m;
        let near = |[low, high]: [f64; 2]| greater(greater(low, -high) - half, 0.0);
        let far = |[low, high]: [f64; 2]| greater(high, -low) + half;
        let rr = self.radius * self.radius;
        let (near_x, near_y, far_x, far_y) = (near(at.x), near(at.y), far(at.x), far(at.y));
        let high = greater(rr - near_x * near_x - near_y * near_y, 0.0).sqrt();
        let middle = greater(rr - far_x * far_x - far_y * far_y, 0.0).sqrt();
        let low = if middle <= 0.5 * self.radius + m {
            0.0
        } else if m == 1.0 {
            // R^2 / Z^3 < 8 / R here.
            middle - 4.0 / (3.0 * self.radius)
        } else {
            middle - m * m * rr / (6.0 * middle * middle * middle)
        };
        [low, high]
    }

    /// Bounds along an axis, within `axis` and with the other within `other`, by the mean slopes to neighbours `m`
    /// samples off.
    #[inline(always)]
    pub fn bound(
        &self,
        axis: [f64; 2],
        other: [f64; 2],
        m: f64,
        next: f64,
        before: f64,
        [z_low, z_high]: [f64; 2],
    ) -> [f64; 2] {
        let most = greater(other[1], -other[0]);
        let chord_squared = greater(self.radius * self.radius - most * most, 0.0);
        // A neighbour outside the cutter bounds nothing.
        let within_chord = |bound: f64| {
            let outer = bound + m + ROOM;
            if outer <= 0.0 || outer * outer <= chord_squared {
                bound
            } else {
                chord_squared.sqrt() - m - ROOM
            }
        };
        let z_next = if next >= 0.0 { z_low } else { z_high };
        let z_before = if before >= 0.0 { z_high } else { z_low };
        let low = next * z_next - 0.5 * m - ROOM;
        let high = before * z_before + 0.5 * m + ROOM;
        [greater(axis[0], within_chord(low)), less(axis[1], -within_chord(-high))]
    }
}
