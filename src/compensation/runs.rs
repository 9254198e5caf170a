use super::ball::Reachable;
use super::field::{Field, PAD, Targets};
use super::interval::Beside;
use super::lanes::{LANES, Vectors, groups, groups_mut};
use super::pairs::{OnSamples, Pairs};
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
    let to = &mut out.row_mut(b)[start as usize..][..length];
    if taps <= run.len || run.len > SINGLE {
        // Offset by offset.
        let s = &arc.values[arc.index(hi)..][..taps];
        let input = &row[(PAD as i64 + start + shift + i64::from(lo)) as usize..][..length + taps - 1];
        raise_line::<V>(to, input, s);
    } else {
        let to = groups_mut(to);
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

/// Offsets in whole samples.
#[derive(Clone, Copy)]
pub(super) struct Offsets {
    pub x: [i32; 2],
    pub y: [i32; 2],
}

impl Offsets {
    #[inline(always)]
    pub fn of(at: &Reachable) -> Offsets {
        let whole = |[low, high]: [f64; 2]| [low.ceil() as i32, high.floor() as i32];
        Offsets { x: whole(at.x), y: whole(at.y) }
    }

    /// How many they are.
    #[inline(always)]
    pub fn taps(&self) -> usize {
        let count = |[low, high]: [i32; 2]| (high - low + 1).max(0) as usize;
        count(self.x) * count(self.y)
    }
}

/// to = max(to, input shifted + s), s of the highest offset first.
#[inline(always)]
pub(super) fn raise_line<V: Vectors>(to: &mut [f32], input: &[f32], s: &[f32]) {
    let to = groups_mut(to);
    match *s {
        [s] => {
            let s = V::splat(s);
            for (to, z) in to.iter_mut().zip(groups(input)) {
                V::store(V::greater(V::add(V::load(z), s), V::load(to)), to);
            }
        }
        [t, s] => {
            let (s, t) = (V::splat(s), V::splat(t));
            let next = groups(&input[1..]);
            for ((to, z), next) in to.iter_mut().zip(groups(input)).zip(next) {
                let best = V::greater(V::add(V::load(z), s), V::load(to));
                V::store(V::greater(V::add(V::load(next), t), best), to);
            }
        }
        _ => {
            for (g, to) in to.iter_mut().enumerate() {
                let mut best = V::load(to);
                for (k, s) in s.iter().rev().enumerate() {
                    let z = groups(&input[g * LANES + k..][..LANES]);
                    best = V::greater(V::add(V::load(&z[0]), V::splat(*s)), best);
                }
                V::store(best, to);
            }
        }
    }
}

/// The rows of a box in which one sample can touch targets, on samples: each has its arc.
#[derive(Clone, Copy)]
pub(super) struct BoxRows {
    /// First target, and how many.
    pub first: usize,
    pub count: usize,
    /// dy of the first; the others are `every` less each.
    pub dy: i32,
}

impl BoxRows {
    #[inline(always)]
    pub fn of(on: &OnSamples, a: i64, at: &Offsets) -> BoxRows {
        let row = on.row(a);
        let [low, high] = at.y.map(i64::from);
        let targets = on.targets_in([row - high.min(on.reach), row - low.max(-on.reach)]);
        let dy = (row - targets.start as i64 * on.every) as i32;
        BoxRows { first: targets.start, count: targets.len(), dy }
    }
}

/// [`raise_run`] of one sample, on samples, with a box of at most [`LANES`] columns: one cache line
/// of each target row holds it, or two.
#[inline(always)]
pub(super) fn raise_narrow<V: Vectors>(
    field: &Field,
    on: &OnSamples,
    [a, first]: [i64; 2],
    rows: BoxRows,
    x: [i32; 2],
    out: &mut Targets,
) {
    let origin = (first - on.shift) as i32;
    let start = (origin - x[1]).max(0) & -(LANES as i32);
    if start > (origin - x[0]).min(out.columns as i32 - 1) {
        return;
    }
    let z = V::splat(field.row(a)[PAD + first as usize]);
    // What is not under the cutter is no data.
    let (values, axis, stride) = on.stencil.values();
    let mut at = axis + rows.dy * stride - (origin - start);
    let down = on.every as i32 * stride;
    if origin - x[0] - start < LANES as i32 {
        for b in rows.first..rows.first + rows.count {
            let s = groups(&values[at as usize..][..LANES]);
            let to = groups_mut(&mut out.row_mut(b)[start as usize..][..LANES]);
            V::store(V::greater(V::add(V::load(&s[0]), z), V::load(&to[0])), &mut to[0]);
            at -= down;
        }
    } else {
        for b in rows.first..rows.first + rows.count {
            let s = groups(&values[at as usize..][..2 * LANES]);
            let to = groups_mut(&mut out.row_mut(b)[start as usize..][..2 * LANES]);
            let near = V::greater(V::add(V::load(&s[0]), z), V::load(&to[0]));
            let far = V::greater(V::add(V::load(&s[1]), z), V::load(&to[1]));
            V::store(near, &mut to[0]);
            V::store(far, &mut to[1]);
            at -= down;
        }
    }
}

/// [`raise_run`] of one sample, on samples, at the offsets along x that are given row by row.
#[inline(always)]
pub(super) fn raise_rows<V: Vectors>(
    field: &Field,
    on: &OnSamples,
    [a, first]: [i64; 2],
    rows: BoxRows,
    bounds: impl Fn(usize) -> [i32; 2],
    out: &mut Targets,
) {
    let one = One::of::<V>(field, on, [a, first]);
    let mut dy = rows.dy;
    for k in 0..rows.count {
        one.raise::<V>(on, rows.first + k, dy, bounds(k), out);
        dy -= on.every as i32;
    }
}

/// One sample, on samples.
pub(super) struct One<G> {
    /// Column of the target that it stands under.
    origin: i32,
    z: G,
}

impl<G: Copy> One<G> {
    #[inline(always)]
    pub fn of<V: Vectors<Group = G>>(field: &Field, on: &OnSamples, [a, first]: [i64; 2]) -> One<G> {
        One { origin: (first - on.shift) as i32, z: V::splat(field.row(a)[PAD + first as usize]) }
    }

    /// Raises the target row `b` by it at the offsets `low ..= high` of the cutter's row `dy`.
    #[inline(always)]
    pub fn raise<V: Vectors<Group = G>>(
        &self,
        on: &OnSamples,
        b: usize,
        dy: i32,
        [low, high]: [i32; 2],
        out: &mut Targets,
    ) {
        let arc = on.stencil.arc_there(dy);
        let (lo, hi) = (low.max(arc.arc.lo), high.min(arc.arc.hi));
        let start = (self.origin - hi).max(0) & -(LANES as i32);
        let end = (self.origin - lo + 1).min(out.columns as i32);
        if lo <= hi && start < end {
            let length = ((end - start) as usize).next_multiple_of(LANES);
            let s = &arc.values[arc.index(self.origin - start)..][..length];
            let to = &mut out.row_mut(b)[start as usize..][..length];
            for (to, s) in groups_mut(to).iter_mut().zip(groups(s)) {
                V::store(V::greater(V::add(V::load(s), self.z), V::load(to)), to);
            }
        }
    }
}
