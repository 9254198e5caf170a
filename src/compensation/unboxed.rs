//! Contacts of rows that stand at any distance from each other, such as the passes of a finished
//! part: only the neighbours beside a sample bound where it can touch.

use super::ball::Ball;
use super::field::{Field, PAD, Targets};
use super::interval::Beside;
use super::lanes::Vectors;
use super::pairs::Pairs;
use super::runs::{Run, raise_row, row_work};
use super::slopes::{CELL, Rises, RowRises};

/// Samples of a row that are first tried as one run.
const BLOCK: usize = 4 * CELL;

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
        rises.measure(field, a, false);
        let targets = pairs.targets(a, -ball.radius - 1.0, ball.radius + 1.0);
        for (block, cells) in rises.cells().chunks(BLOCK / CELL).enumerate() {
            let all = cells.iter().fold(Rises::NO_SAMPLE, |all, cell| all.with(*cell));
            if all.is_no_sample() {
                continue;
            }
            let first = block * BLOCK;
            let beside = |rises: &Rises| Beside::new(rises, ball.step_mm, ball.slack_mm);
            let whole = beside(&all);
            let mut parts = [whole; BLOCK / CELL];
            for (part, cell) in parts.iter_mut().zip(cells) {
                *part = beside(cell);
            }
            for b in targets.clone() {
                let Some(arc) = pairs.arc(a, b) else { continue };
                let [lo, hi] = whole.interval(&arc);
                if lo > hi {
                    continue;
                }
                if hi - lo < CHEAP {
                    work += row_work(BLOCK, (hi - lo + 1) as usize);
                    let run = Run { a, first, len: cells.len() * CELL };
                    raise_row::<V, P>(field, pairs, run, b, &arc, [lo, hi], out);
                    continue;
                }
                for (c, (part, cell)) in parts.iter().zip(cells).enumerate() {
                    if cell.is_no_sample() {
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
                    for i in first..first + CELL {
                        let rises = Rises::of(field, a, PAD + i, false);
                        if !rises.is_no_sample() {
                            let [lo, hi] = beside(&rises).interval(&arc);
                            if lo <= hi {
                                work += row_work(1, (hi - lo + 1) as usize);
                                let run = Run { a, first: i, len: 1 };
                                raise_row::<V, P>(field, pairs, run, b, &arc, [lo, hi], out);
                            }
                        }
                    }
                }
            }
        }
    }
    true
}
