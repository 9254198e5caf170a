//! Contacts of rows that stand at any distance from each other, such as the passes of a finished
//! part: the neighbours beside a sample bound where along a row it can touch, and those of the rows
//! before and after in which rows.

use std::ops::Range;

use super::ball::{Ball, Reachable};
use super::field::{Field, PAD, Targets};
use super::interval::Beside;
use super::lanes::Vectors;
use super::pairs::Pairs;
use super::runs::{Run, raise_row, row_work};
use super::slopes::{CELL, Rises, RowRises};

/// Cells of a row that are first tried as one run.
const CELLS: usize = 4;

/// What bounds samples along their row, and the targets that they can touch.
type Bounded = (Beside, Range<usize>);

/// Offsets up to which a run is not split.
const CHEAP: i32 = 6;

/// Raises the targets by every sample that can touch there; false where taking every sample would
/// be less work than `every_tap`, in groups.
#[inline(always)]
pub(super) fn contacts<V: Vectors, P: Pairs>(
    field: &Field,
    pairs: &P,
    ball: &Ball,
    every_tap: f64,
    out: &mut Targets,
) -> bool {
    let mut rises = RowRises::new(field);
    let mut work = 0usize;
    for a in 0..field.rows as i64 {
        let part = a as f64 / field.rows as f64;
        if part > 0.1 && work as f64 > part * every_tap {
            return false;
        }
        rises.measure(field, a, true);
        let rows = Rows { ball, before: apart(field, pairs, a - 1), next: apart(field, pairs, a) };
        let targets = |rises: &Rises| match rows.reachable(rises) {
            Some([low, high]) => pairs.targets(a, low, high),
            None => 0..0,
        };
        for (block, cells) in rises.cells().chunks(CELLS).enumerate() {
            let all = cells.iter().fold(Rises::NO_SAMPLE, |all, cell| all.with(*cell));
            if all.is_no_sample() {
                continue;
            }
            let near = targets(&all);
            if near.is_empty() {
                continue;
            }
            let first = block * CELLS * CELL;
            let beside = |rises: &Rises| Beside::new(rises, ball.step_mm, ball.slack_mm);
            let whole = beside(&all);
            let mut parts: Option<[Bounded; CELLS]> = None;
            let mut singles: [Option<[Bounded; CELL]>; CELLS] = Default::default();
            for b in near {
                let Some(arc) = pairs.arc(a, b) else { continue };
                let [lo, hi] = whole.interval(&arc);
                if lo > hi {
                    continue;
                }
                if hi - lo < CHEAP {
                    work += row_work(CELLS * CELL, (hi - lo + 1) as usize);
                    let run = Run { a, first, len: cells.len() * CELL };
                    raise_row::<V, P>(field, pairs, run, b, &arc, [lo, hi], out);
                    continue;
                }
                let parts = parts.get_or_insert_with(|| {
                    std::array::from_fn(|c| match cells.get(c).filter(|cell| !cell.is_no_sample()) {
                        Some(cell) => (beside(cell), targets(cell)),
                        None => (whole, 0..0),
                    })
                });
                for (c, (part, near)) in parts.iter().enumerate() {
                    if !near.contains(&b) {
                        continue;
                    }
                    let [lo, hi] = part.interval(&arc);
                    if lo > hi {
                        continue;
                    }
                    let first = first + c * CELL;
                    if hi - lo < CHEAP {
                        work += row_work(CELL, (hi - lo + 1) as usize);
                        raise_row::<V, P>(field, pairs, Run { a, first, len: CELL }, b, &arc, [lo, hi], out);
                        continue;
                    }
                    let singles = singles[c].get_or_insert_with(|| {
                        std::array::from_fn(|i| {
                            let rises = Rises::of(field, a, PAD + first + i, true);
                            let near = if rises.is_no_sample() { 0..0 } else { targets(&rises) };
                            (beside(&rises), near)
                        })
                    });
                    for (i, (one, near)) in singles.iter().enumerate() {
                        if !near.contains(&b) {
                            continue;
                        }
                        let [lo, hi] = one.interval(&arc);
                        if lo <= hi {
                            work += row_work(1, (hi - lo + 1) as usize);
                            let run = Run { a, first: first + i, len: 1 };
                            raise_row::<V, P>(field, pairs, run, b, &arc, [lo, hi], out);
                        }
                    }
                }
            }
        }
    }
    true
}

/// How far the row after `a` lies from it, in samples; None where its samples do not stand above those of `a`.
fn apart<P: Pairs>(field: &Field, pairs: &P, a: i64) -> Option<f64> {
    if a < 0 || a + 1 >= field.rows as i64 || pairs.fx(a, 0) != pairs.fx(a + 1, 0) {
        return None;
    }
    let apart = pairs.y(a + 1) - pairs.y(a);
    (apart > 0.01).then_some(apart)
}

/// A row among its neighbours.
struct Rows<'a> {
    ball: &'a Ball,
    before: Option<f64>,
    next: Option<f64>,
}

impl Rows<'_> {
    /// Offsets across the rows at which samples with these rises can touch; None where none can. As
    /// [`Ball::reachable`], with rows farther apart than samples.
    #[inline(always)]
    fn reachable(&self, rises: &Rises) -> Option<[f64; 2]> {
        let Ball { radius, .. } = *self.ball;
        let (next, before) = (self.next.unwrap_or(radius), self.before.unwrap_or(radius));
        let [x_next, x_before] = self.ball.mean_slopes([rises.x_next, rises.x_before], 1.0);
        let [y_next, _] = self.ball.mean_slopes([rises.y_next, rises.y_before], next);
        let [_, y_before] = self.ball.mean_slopes([rises.y_next, rises.y_before], before);
        let mut at = Reachable {
            x: self.ball.start_along([x_next, x_before], [1.0, 1.0]),
            y: self.ball.start_along([y_next, y_before], [next, before]),
        };
        // Where a neighbouring row says nothing its end stays.
        let [low, high] = [self.next, self.before];
        if low.is_none() {
            at.y[0] = -radius;
        }
        if high.is_none() {
            at.y[1] = radius;
        }
        let mut size = at.y[1] - at.y[0];
        for _ in 0..4 {
            let z = self.ball.mean_z(&at, 1.0);
            let x = self.ball.bound(at.x, at.y, 1.0, x_next, x_before, z);
            let mut y = at.y;
            if low.is_some() {
                let z = self.ball.mean_z(&at, next);
                y[0] = self.ball.bound(at.y, at.x, next, y_next, y_before, z)[0];
            }
            if high.is_some() {
                let z = self.ball.mean_z(&at, before);
                y[1] = self.ball.bound(at.y, at.x, before, y_next, y_before, z)[1];
            }
            at = Reachable { x, y };
            if x[0] > x[1] || y[0] > y[1] {
                return None;
            }
            let now = y[1] - y[0];
            if now > 0.9 * size {
                break;
            }
            size = now;
        }
        Some(at.y)
    }
}
