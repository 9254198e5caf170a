use super::ball::Reachable;
use super::field::{Field, PAD, Targets};
use super::interval::Beside;
use super::lanes::{LANES, Vectors, groups, groups_mut};
use super::pairs::Pairs;
use super::stencil::ArcRef;

/// Samples of a run that may be taken one by one: a stencil's padding covers so many.
const SINGLE: usize = 2 * LANES;

/// Some samples of one row of a field.
#[derive(Clone, Copy)]
pub(super) struct Run {
    /// Row of the field.
    pub a: i64,
    /// First column of data.
    pub first: usize,
    pub len: usize,
}

/// About what raising one target row by `len` samples at `taps` offsets takes, in groups.
#[inline(always)]
pub(super) fn row_work(len: usize, taps: usize) -> usize {
    (len + taps).div_ceil(LANES) * len.min(taps) + 6
}

/// Raises every target by the samples of a run at the offsets of a box, in each row only those
/// that `beside` leaves, and at some more: any sample under the cutter may raise it.
#[inline(always)]
pub(super) fn raise_run<V: Vectors, P: Pairs>(
    field: &Field,
    pairs: &P,
    run: Run,
    at: &Reachable,
    out: &mut Targets,
    beside: Option<&Beside>,
) {
    for b in pairs.targets(run.a, at.y[0], at.y[1]) {
        let Some(arc) = pairs.arc(run.a, b) else { continue };
        let fx = pairs.fx(run.a, b);
        let mut lo = ((at.x[0] - fx).ceil() as i32).max(arc.arc.lo);
        let mut hi = ((at.x[1] - fx).floor() as i32).min(arc.arc.hi);
        if lo > hi {
            continue;
        }
        if let Some(beside) = beside {
            let [first, last] = beside.interval(&arc);
            (lo, hi) = (lo.max(first), hi.min(last));
        }
        if lo <= hi {
            raise_row::<V, P>(field, pairs, run, b, &arc, [lo, hi], out);
        }
    }
}

/// Raises target row `b` by the samples of a run at offsets `lo ..= hi` of its arc.
///
/// The row is read once and written once: taking it up anew for each sample or each offset would
/// wait for its own last write.
#[inline(always)]
pub(super) fn raise_row<V: Vectors, P: Pairs>(
    field: &Field,
    pairs: &P,
    run: Run,
    b: usize,
    arc: &ArcRef,
    [lo, hi]: [i32; 2],
    out: &mut Targets,
) {
    let row = field.row(run.a);
    let shift = pairs.shift(b);
    let origin = run.first as i64 - shift;
    let start = (origin - i64::from(hi)).max(0);
    let end = (origin + run.len as i64 - i64::from(lo)).min(out.columns as i64);
    if start >= end {
        return;
    }
    let taps = (hi - lo + 1) as usize;
    let length = ((end - start) as usize).next_multiple_of(LANES);
    let to = groups_mut(&mut out.row_mut(b)[start as usize..][..length]);
    if taps <= run.len || run.len > SINGLE {
        // Offset by offset; s of the highest offset stands first.
        let s = &arc.values[arc.index(hi)..][..taps];
        let input = &row[(PAD as i64 + start + shift + i64::from(lo)) as usize..][..length + taps - 1];
        for (g, to) in to.iter_mut().enumerate() {
            let mut best = V::load(to);
            for (k, s) in s.iter().rev().enumerate() {
                let z = groups(&input[g * LANES + k..][..LANES]);
                best = V::greater(V::add(V::load(&z[0]), V::splat(*s)), best);
            }
            V::store(best, to);
        }
    } else {
        // Sample by sample, the last first.
        let z = &row[PAD + run.first..][..run.len];
        let s =
            &arc.values[arc.index((origin - start) as i32 + run.len as i32 - 1)..][..length + run.len - 1];
        for (g, to) in to.iter_mut().enumerate() {
            let mut best = V::load(to);
            for (k, z) in z.iter().rev().enumerate() {
                let s = groups(&s[g * LANES + k..][..LANES]);
                best = V::greater(V::add(V::load(&s[0]), V::splat(*z)), best);
            }
            V::store(best, to);
        }
    }
}
