use super::contact::Search;
use super::field::{Field, PAD};
use super::lanes::{LEAST, NONE};
use super::slopes::Rises;

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

    #[inline(always)]
    fn is_empty(&self) -> bool {
        self.x[0] > self.x[1] || self.y[0] > self.y[1]
    }
}

/// Room for the rounding of this file's own arithmetic, in samples.
const ROOM: f64 = 0.01;

/// Rises that stand for a missing neighbour are beyond this.
const VOID: f64 = 1e28;

/// The box for samples with these rises to their next neighbours; None where none can touch.
///
/// With Z(d) = sqrt(R^2 - |d|^2) and a neighbour m samples on, s(d) - s(d + m e) =
/// m (2 dx + m) / (Z(d) + Z(d + m e)), so the mean slope g to that neighbour gives
/// dx >= g Zb - m/2 with Zb the mean of the two Z, and likewise from the one before. Zb is bounded
/// from the box, which shrinks in a few sweeps.
#[inline(always)]
pub(super) fn reachable(radius: f64, step_mm: f64, slack_mm: f32, rises: Rises) -> Option<Reachable> {
    let slopes = Slopes::of(rises, 1.0, step_mm, slack_mm);
    // Z <= sqrt(R^2 - t^2) at the middle t of a sample and its neighbour, so |t| <= g R / sqrt(1 + g^2).
    let far = |g: f64| {
        if g.abs() > VOID { radius } else { g.abs() * radius / (1.0 + g * g).sqrt() + 0.5 + ROOM }
    };
    // Where the neighbour lies outside the cutter it bounds nothing, and with nothing known of the
    // other axis that may be so from a sample before the axis on.
    let start = |next: f64, before: f64| {
        let low = if next >= 0.0 { -0.5 } else { -far(next) };
        let high = if before <= 0.0 { 0.5 } else { far(before) };
        [low.min(-1.0 - ROOM).max(-radius), high.max(1.0 + ROOM).min(radius)]
    };
    let mut at =
        Reachable { x: start(slopes.x_next, slopes.x_before), y: start(slopes.y_next, slopes.y_before) };
    for _ in 0..6 {
        let before = at.lattice_points();
        at = sweep(at, radius, 1.0, &slopes)?;
        let now = at.lattice_points();
        if now <= 2.6 || now > 0.9 * before {
            break;
        }
    }
    Some(at)
}

/// Mean slopes to neighbours, widened by what rounding can do.
struct Slopes {
    x_next: f64,
    x_before: f64,
    y_next: f64,
    y_before: f64,
}

impl Slopes {
    #[inline(always)]
    fn of(rises: Rises, m: f64, step_mm: f64, slack_mm: f32) -> Slopes {
        let scale = 1.0 / (m * step_mm);
        let give = |rise: f32| slack_mm as f64 + rise.abs() as f64 * f32::EPSILON as f64;
        Slopes {
            x_next: (rises.x_next as f64 - give(rises.x_next)) * scale,
            x_before: (rises.x_before as f64 + give(rises.x_before)) * scale,
            y_next: (rises.y_next as f64 - give(rises.y_next)) * scale,
            y_before: (rises.y_before as f64 + give(rises.y_before)) * scale,
        }
    }
}

/// One sweep over both axes with neighbours `m` samples off.
#[inline(always)]
fn sweep(at: Reachable, radius: f64, m: f64, slopes: &Slopes) -> Option<Reachable> {
    let (z_low, z_high) = mean_z(&at, radius, m);
    let x = bound(at.x, at.y, radius, m, slopes.x_next, slopes.x_before, z_low, z_high);
    let y = bound(at.y, at.x, radius, m, slopes.y_next, slopes.y_before, z_low, z_high);
    let at = Reachable { x, y };
    (!at.is_empty()).then_some(at)
}

/// Bounds on the mean of Z at a point of the box and at its neighbour.
#[inline(always)]
fn mean_z(at: &Reachable, radius: f64, m: f64) -> (f64, f64) {
    let nearest = |[low, high]: [f64; 2]| {
        if low > 0.0 {
            low
        } else if high < 0.0 {
            -high
        } else {
            0.0
        }
    };
    let farthest = |[low, high]: [f64; 2]| low.abs().max(high.abs());
    let rr = radius * radius;
    let (nx, ny) = (nearest(at.x), nearest(at.y));
    let (fx, fy) = (farthest(at.x), farthest(at.y));
    let near = ((nx * nx + ny * ny).sqrt() - 0.5 * m).max(0.0);
    let far = (fx * fx + fy * fy).sqrt() + 0.5 * m;
    let z_high = (rr - near * near).max(0.0).sqrt();
    let z_mid = (rr - far * far).max(0.0).sqrt();
    // Z is concave: the mean of two is below the middle, by at most this while the rim is far.
    let z_low =
        if z_mid > 0.5 * radius + m { z_mid - m * m * rr / (6.0 * z_mid * z_mid * z_mid) } else { 0.0 };
    (z_low, z_high)
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn bound(
    axis: [f64; 2],
    other: [f64; 2],
    radius: f64,
    m: f64,
    next: f64,
    before: f64,
    z_low: f64,
    z_high: f64,
) -> [f64; 2] {
    let most = other[0].abs().max(other[1].abs()).min(radius);
    let cap = (radius * radius - most * most).sqrt() - m - ROOM;
    let low = if next >= 0.0 { next * z_low } else { next * z_high } - 0.5 * m - ROOM;
    let high = if before >= 0.0 { before * z_high } else { before * z_low } + 0.5 * m + ROOM;
    [axis[0].max(low.min(cap)), axis[1].min(high.max(-cap))]
}

/// Tightens the box of one sample (at padded column `i`) by neighbours further off: what tames
/// noise, whose next neighbours bound little.
pub(super) fn far_neighbours(
    field: &Field,
    a: i64,
    i: usize,
    search: &Search,
    slack_mm: f32,
    mut at: Reachable,
) -> Option<Reachable> {
    let z = field.row(a)[i];
    for m in [2usize, 3, 4, 6, 8, 12, 16, 24, 32] {
        if m as f64 >= search.radius {
            break;
        }
        let row = |a: i64| (a >= 0 && a < field.rows as i64).then(|| field.row(a)[i]).unwrap_or(NONE);
        let beside = |i: usize| field.row(a).get(i).copied().unwrap_or(NONE);
        let rises = Rises {
            x_next: beside(i + m) - z,
            x_before: z - beside(i - m),
            y_next: row(a + m as i64) - z,
            y_before: z - row(a - m as i64),
        };
        debug_assert!(z > LEAST && i >= PAD);
        let slopes = Slopes::of(rises, m as f64, search.step_mm, slack_mm);
        for _ in 0..2 {
            at = sweep(at, search.radius, m as f64, &slopes)?;
        }
        if at.lattice_points() < 24.0 {
            break;
        }
    }
    Some(at)
}
