//! At which offsets a sample with known neighbours can touch a cutter, for any profile, by table.
//!
//! A sample whose next neighbour along x stands `rise` above it touches at d only if
//! s(d) - s(d + x) >= rise, or if the neighbour lies outside the cutter; and so for the other three
//! neighbours. The tables keep, by row of the cutter and by rise, the outermost offsets of a row that
//! fulfil this. They are made from the values of the stencil itself, so they hold for every profile;
//! where its rows are concave little else lies between.

use super::Profile;
use super::lanes::{LANES, Vectors};
use super::runs::Offsets;
use super::slopes::Rises;
use super::stencil::Stencil;

/// Rises that are told apart on either side of level, evenly by their sine.
const SLOPES: usize = 128;

/// Room for the rounding of a rise's sine, as part of what tells two apart.
const ROOM: f32 = 1e-3;

/// Farther out than any offset.
const OUT: f32 = 1e9;

/// For one cutter on samples.
#[derive(Debug)]
pub(super) struct Cones {
    pub profile: Profile,
    /// Row dy of the cutter stands at dy + reach of each table's rows.
    pub reach: i32,
    stride: usize,
    per_step: f32,
    /// The least dx from which the neighbour along x may rise so.
    low: Vec<f32>,
    /// Where the neighbour above may rise so, and the one below: where it rises, from which |dx| on;
    /// where it falls, up to which.
    across: [Vec<f32>; 2],
    /// The least |dx| outside the flat bottom.
    rim: Vec<f32>,
    /// The least of `low` in rows no farther from the axis than this one, and no nearer.
    within: Vec<i16>,
    beyond: Vec<i16>,
}

/// Which rises of the tables are no more than those of some samples.
#[derive(Clone, Copy)]
pub(super) struct Slopes {
    next: usize,
    before: usize,
    above: usize,
    below: usize,
}

impl Cones {
    /// The samples under a flat bottom are left out if asked.
    pub fn new(profile: &Profile, stencil: &Stencil, skip_flat: bool) -> Cones {
        let (reach, step_mm) = (profile.reach() as i32, profile.step_mm());
        let rows = 2 * reach as usize + 1;
        let stride = rows.next_multiple_of(LANES) + LANES;
        let table = |value: f32| vec![value; 2 * SLOPES * stride];
        let (mut low, mut rim) = (table(OUT), vec![0.0; stride]);
        let (mut near, mut far) = (table(OUT), table(-1.0));
        for dy in -reach..=reach {
            let Some(arc) = stencil.arc(i64::from(dy)) else { continue };
            let i = (dy + reach) as usize;
            if skip_flat && arc.arc.flat_lo <= arc.arc.flat_hi {
                rim[i] = (arc.arc.flat_hi + 1) as f32;
            }
            let above = stencil.arc(i64::from(dy) + 1);
            for dx in arc.arc.lo..=arc.arc.hi {
                let falls = |next: Option<f32>| match next {
                    Some(next) => most_rise((f64::from(arc.s(dx)) - f64::from(next)) / step_mm),
                    None => 2 * SLOPES - 1,
                };
                let at = falls((dx < arc.arc.hi).then(|| arc.s(dx + 1))) * stride + i;
                low[at] = low[at].min(dx as f32);
                let above = above.filter(|above| above.arc.lo <= dx && dx <= above.arc.hi);
                let at = falls(above.map(|above| above.s(dx))) * stride + i;
                near[at] = near[at].min(dx.abs() as f32);
                far[at] = far[at].max(dx.abs() as f32);
            }
        }
        // What may rise more may rise less.
        for at in (0..(2 * SLOPES - 1) * stride).rev() {
            low[at] = low[at].min(low[at + stride]);
            near[at] = near[at].min(near[at + stride]);
            far[at] = far[at].max(far[at + stride]);
        }
        let mut above = near;
        above[..SLOPES * stride].copy_from_slice(&far[..SLOPES * stride]);
        let mut below = above.clone();
        for row in below.chunks_exact_mut(stride) {
            row[..rows].reverse();
        }
        let half = reach as usize + 1;
        let (mut within, mut beyond) = (Vec::new(), Vec::new());
        for row in low.chunks_exact(stride) {
            let of = &row[reach as usize..][..half];
            let least = |least: &mut f32, z: &f32| {
                *least = least.min(*z);
                Some(least.min(f32::from(i16::MAX)) as i16)
            };
            within.extend(of.iter().scan(OUT, least));
            let start = beyond.len();
            beyond.extend(of.iter().rev().scan(OUT, least));
            beyond[start..].reverse();
        }
        let per_step = (1.0 / step_mm) as f32;
        Cones { profile: *profile, reach, stride, per_step, low, across: [above, below], rim, within, beyond }
    }

    /// Which rise of the tables is no more than this one.
    #[inline(always)]
    fn slope(&self, rise_mm: f32) -> usize {
        let g = (rise_mm * self.per_step).clamp(-1e6, 1e6);
        let sine = g / (1.0 + g * g).sqrt();
        let k = ((sine + 1.0) * SLOPES as f32 - ROOM).max(0.0) as usize;
        // Level stands in the tables as it is.
        if g >= 0.0 { k.max(SLOPES) } else { k }
    }

    #[inline(always)]
    pub fn slopes(&self, rises: &Rises) -> Slopes {
        Slopes {
            next: self.slope(rises.x_next),
            before: self.slope(0.0 - rises.x_before),
            above: self.slope(rises.y_next),
            below: self.slope(0.0 - rises.y_before),
        }
    }

    /// The least offset along an axis, with the other within a range.
    #[inline(always)]
    fn least(&self, slope: usize, [low, high]: [i32; 2]) -> i32 {
        let far = high.max(-low).min(self.reach) as usize;
        let near = low.max(-high).clamp(0, self.reach) as usize;
        let start = slope * (self.reach as usize + 1);
        i32::from(self.within[start + far].max(self.beyond[start + near]))
    }

    /// A box of offsets at which samples with these rises can touch; None where none can.
    #[inline(always)]
    pub fn around(&self, of: &Slopes) -> Option<Offsets> {
        let all = [-self.reach, self.reach];
        let (mut x, mut y) = (all, all);
        let mut size = i32::MAX / 8;
        for _ in 0..6 {
            y = [y[0].max(self.least(of.above, x)), y[1].min(-self.least(of.below, x))];
            if y[0] > y[1] {
                return None;
            }
            x = [x[0].max(self.least(of.next, y)), x[1].min(-self.least(of.before, y))];
            if x[0] > x[1] {
                return None;
            }
            let now = x[1] - x[0] + y[1] - y[0];
            if now < 4 || 8 * now > 7 * size {
                break;
            }
            size = now;
        }
        Some(Offsets { x, y })
    }

    /// The tables' rows for samples with these rises.
    #[inline(always)]
    pub fn of(&self, slopes: &Slopes) -> OfRises<'_> {
        let row = |k: usize| k * self.stride..(k + 1) * self.stride;
        OfRises {
            next: &self.low[row(slopes.next)],
            before: &self.low[row(slopes.before)],
            across: [&self.across[0][row(slopes.above)], &self.across[1][row(slopes.below)]],
            rising: [slopes.above >= SLOPES, slopes.below >= SLOPES],
            rim: &self.rim,
        }
    }
}

/// The greatest rise of the tables that is no more than `fall`, in samples a sample.
fn most_rise(fall: f64) -> usize {
    let sine = fall / (1.0 + fall * fall).sqrt();
    (((sine + 1.0) * SLOPES as f64 + 1e-9) as usize).min(2 * SLOPES - 1)
}

/// What bounds samples of the same rises, row by row of the cutter.
pub(super) struct OfRises<'a> {
    next: &'a [f32],
    before: &'a [f32],
    across: [&'a [f32]; 2],
    rising: [bool; 2],
    rim: &'a [f32],
}

/// Offsets along x of a group of rows: those after the axis, and those before it.
pub(super) struct Beside<V: Vectors> {
    pub after: [V::Group; 2],
    pub before: [V::Group; 2],
    /// Rows that have any.
    pub is_after: u16,
    pub is_before: u16,
}

impl OfRises<'_> {
    /// Of the rows from index `i` on.
    #[inline(always)]
    pub fn beside<V: Vectors>(&self, i: usize) -> Beside<V> {
        let load = |table: &[f32]| {
            let group: &[f32; LANES] = table[i..].first_chunk().unwrap_or(&[OUT; LANES]);
            V::load(group)
        };
        let zero = V::splat(0.0);
        let (mut near, mut far) = (load(self.rim), V::splat(OUT));
        for (table, rising) in self.across.into_iter().zip(self.rising) {
            if rising {
                near = V::greater(near, load(table));
            } else {
                far = V::less(far, load(table));
            }
        }
        let low = V::greater(load(self.next), V::subtract(zero, far));
        let high = V::less(V::subtract(zero, load(self.before)), far);
        // Where nothing is left out around the axis there is one stretch.
        let apart = V::at_least(near, V::splat(1.0));
        let after = V::choose(apart, V::greater(low, near), low);
        let before = V::less(high, V::subtract(zero, near));
        Beside {
            is_after: V::at_least(high, after),
            is_before: V::at_least(before, low) & apart,
            after: [after, high],
            before: [low, before],
        }
    }
}
