//! Rectangles of samples that touch at the same few offsets, as those of a block on one facet do, on samples. Target rows
//! are taken in whole cache lines: what was just written is read again at the same places, which does not wait for the
//! write.

use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, Vectors, Work, groups, groups_mut};
use super::pairs::OnSamples;
use super::runs::{Offsets, raise_line};
use std::ops::Range;

/// Samples side by side in some rows.
#[derive(Clone, Copy)]
pub(super) struct Patch {
    /// First row of the field, and how many.
    pub a: i64,
    pub rows: usize,
    /// First column of data, and how many.
    pub first: usize,
    pub len: usize,
}

/// Raises the targets by a patch at the offsets of a box, and by samples beside it: any sample under the cutter may raise
/// a target.
#[inline(always)]
pub(super) fn raise_patch<V: Vectors>(
    field: &Field,
    on: &OnSamples,
    patch: Patch,
    at: &Offsets,
    out: &mut Targets,
) {
    V::apart(Raise { field, on, patch, at, out });
}

struct Raise<'a, 'b> {
    field: &'a Field,
    on: &'a OnSamples<'b>,
    patch: Patch,
    at: &'a Offsets,
    out: &'a mut Targets,
}

impl<V: Vectors> Work<V> for Raise<'_, '_> {
    type Done = ();

    #[inline(always)]
    fn run(self) {
        let Raise { field, on, patch, at, out } = self;
        if at.taps() == 0 {
            return;
        }
        let Some(small) = Small::of(field, on, patch, at, out) else {
            return by_rows::<V>(field, on, patch, at, out);
        };
        match (at.y[1] - at.y[0], at.x[1] - at.x[0]) {
            (0, 0) => small.raise::<V, 1, 1>(field, on, out),
            (0, 1) => small.raise::<V, 1, 2>(field, on, out),
            (0, 2) => small.raise::<V, 1, 3>(field, on, out),
            (1, 0) => small.raise::<V, 2, 1>(field, on, out),
            (1, 1) => small.raise::<V, 2, 2>(field, on, out),
            (1, 2) => small.raise::<V, 2, 3>(field, on, out),
            (2, 0) => small.raise::<V, 3, 1>(field, on, out),
            (2, 1) => small.raise::<V, 3, 2>(field, on, out),
            (2, 2) => small.raise::<V, 3, 3>(field, on, out),
            _ => by_rows::<V>(field, on, patch, at, out),
        }
    }
}

/// Columns of the targets that samples `first .. first + len` of the field reach at the offsets `lo ..= hi`: the first one,
/// at a cache line, and how many cache lines.
#[inline(always)]
fn lines(on: &OnSamples, patch: &Patch, [lo, hi]: [i32; 2], columns: usize) -> Option<[usize; 2]> {
    let origin = patch.first as i64 - on.shift;
    let start = (origin - i64::from(hi)).max(0) & -(LANES as i64);
    let end = (origin + patch.len as i64 - i64::from(lo)).min(columns as i64);
    (start < end).then(|| [start as usize, ((end - start) as usize).div_ceil(LANES)])
}

/// A patch at so few offsets that each target row is read and written once.
struct Small {
    /// Targets, and the row of the field that the first one's lowest offset takes.
    targets: Range<usize>,
    a: i64,
    /// Column of the targets, of the samples at the lowest offset, and how many groups of either.
    start: usize,
    from: usize,
    groups: usize,
    lowest: [i32; 2],
}

impl Small {
    /// None if some of these offsets are not under the cutter, if the rows beside the patch are not all in the field, or
    /// if it reaches no target.
    #[inline(always)]
    fn of(field: &Field, on: &OnSamples, patch: Patch, at: &Offsets, out: &Targets) -> Option<Small> {
        let ([lo, hi], [low, high]) = (at.x, at.y);
        let reach = on.reach as i32;
        let beside = i64::from(high - low);
        let last = patch.a + patch.rows as i64 - 1;
        if low < -reach || high > reach || patch.a - beside < -1 || last + beside > field.rows as i64 {
            return None;
        }
        let [one, other] = [low, high].map(|dy| on.stencil.arc_there(dy).arc);
        if lo < one.lo.max(other.lo) || hi > one.hi.min(other.hi) {
            return None;
        }
        let [start, groups] = lines(on, &patch, at.x, out.columns)?;
        let row = on.row(patch.a);
        let targets = on.targets_in([row - i64::from(high), on.row(last) - i64::from(low)]);
        Some(Small {
            a: patch.a + targets.start as i64 * on.every - row + i64::from(low),
            targets,
            start,
            from: (PAD as i64 + start as i64 + on.shift + i64::from(lo)) as usize,
            groups,
            lowest: [lo, low],
        })
    }

    #[inline(always)]
    fn raise<V: Vectors, const ROWS: usize, const COLUMNS: usize>(
        &self,
        field: &Field,
        on: &OnSamples,
        out: &mut Targets,
    ) {
        let [lo, low] = self.lowest;
        let s: [[V::Group; COLUMNS]; ROWS] = std::array::from_fn(|j| {
            let arc = on.stencil.arc_there(low + j as i32);
            std::array::from_fn(|i| V::splat(arc.s(lo + i as i32)))
        });
        let mut a = self.a;
        for b in self.targets.clone() {
            let input: [[&[[f32; LANES]]; COLUMNS]; ROWS] = std::array::from_fn(|j| {
                let row = &field.row(a + j as i64)[self.from..][..self.groups * LANES + COLUMNS - 1];
                std::array::from_fn(|i| &groups(&row[i..])[..self.groups])
            });
            let to = &mut groups_mut(&mut out.row_mut(b)[self.start..])[..self.groups];
            for (g, to) in to.iter_mut().enumerate() {
                let mut best = V::load(to);
                for (input, s) in input.iter().zip(&s) {
                    let mut of_row = V::add(V::load(&input[0][g]), s[0]);
                    for (input, s) in input.iter().zip(s).skip(1) {
                        of_row = V::greater(V::add(V::load(&input[g]), *s), of_row);
                    }
                    best = V::greater(of_row, best);
                }
                V::store(best, to);
            }
            a += on.every;
        }
    }
}

/// [`raise_patch`] row by row of the cutter.
#[inline(always)]
fn by_rows<V: Vectors>(field: &Field, on: &OnSamples, patch: Patch, at: &Offsets, out: &mut Targets) {
    let [low, high] = [patch.a, patch.a + patch.rows as i64 - 1].map(|a| on.row(a));
    for dy in at.y[0]..=at.y[1] {
        let Some(arc) = on.stencil.arc(i64::from(dy)) else { continue };
        let (lo, hi) = (at.x[0].max(arc.arc.lo), at.x[1].min(arc.arc.hi));
        if lo > hi {
            continue;
        }
        let Some([start, groups]) = lines(on, &patch, [lo, hi], out.columns) else { continue };
        let s = &arc.values[arc.index(hi)..][..(hi - lo + 1) as usize];
        let length = groups * LANES;
        let from = (PAD as i64 + start as i64 + on.shift + i64::from(lo)) as usize;
        let dy = i64::from(dy);
        for b in on.targets_in([low - dy, high - dy]) {
            let a = patch.a + b as i64 * on.every + dy - low;
            let input = &field.row(a)[from..][..length + s.len() - 1];
            raise_line::<V>(&mut out.row_mut(b)[start..][..length], input, s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::brute;
    use super::super::field::Sense;
    use super::super::lanes::Portable;
    use super::super::tiles::{OnTile, surfaces};
    use super::super::{Profile, Tables, Way};
    use super::*;
    use crate::grid::Window;

    #[test]
    fn a_patch_raises_no_less_than_its_box_and_no_more_than_all_samples() {
        let mut random = surfaces::Random(5);
        let h = surfaces::from(90, 30, |_, _| 40.0 * random.next());
        let whole = |random: &mut surfaces::Random, low: i32, high: i32| {
            low + (random.next() * f64::from(high - low + 1)) as i32
        };
        for (cutter, every) in [("ball:0.14", 1), ("ball:0.14", 3), ("flat:0.1", 1)] {
            let profile = Profile::new(cutter.parse().expect("a cutter"), 0.01, 0.0).expect("a profile");
            let tables = Tables::new(profile);
            let of = OnTile::new((&h).into(), &tables, every, Sense::Raise, Way::EveryTap);
            let rows = h.window.rows.div_ceil(every);
            let (input, on) = of.pairs(Window { rows, ..h.window });
            let field = Field::of((&h).into(), input, Sense::Raise);
            let mut all = Targets::new(h.window.columns, rows);
            brute::every_tap(&field, &on, false, &mut all);
            let reach = on.reach as i32;
            for _ in 0..4000 {
                let random = &mut random;
                let patch_rows = whole(random, 1, 8);
                let len = whole(random, 1, 40);
                let patch = Patch {
                    a: whole(random, 0, field.rows as i32 - patch_rows).into(),
                    rows: patch_rows as usize,
                    first: whole(random, 0, field.columns as i32 - len) as usize,
                    len: len as usize,
                };
                let [x, y] = [0; 2].map(|_| {
                    let low = whole(random, -reach - 1, reach);
                    [low, low + whole(random, 0, 3)]
                });
                let mut raised = Targets::new(h.window.columns, rows);
                raise_patch::<Portable>(&field, &on, patch, &Offsets { x, y }, &mut raised);
                let mut least = Targets::new(h.window.columns, rows);
                for a in patch.a..patch.a + patch.rows as i64 {
                    for b in 0..rows {
                        let dy = on.row(a) - b as i64 * on.every;
                        let Some(arc) = on.stencil.arc(dy) else { continue };
                        if dy < y[0].into() || dy > y[1].into() {
                            continue;
                        }
                        for i in patch.first..patch.first + patch.len {
                            for dx in x[0].max(arc.arc.lo)..=x[1].min(arc.arc.hi) {
                                let column = i as i64 - on.shift - i64::from(dx);
                                if (0..h.window.columns as i64).contains(&column) {
                                    let z = field.row(a)[PAD + i] + arc.s(dx);
                                    let to = &mut least.row_mut(b)[column as usize];
                                    *to = to.max(z);
                                }
                            }
                        }
                    }
                }
                for b in 0..rows {
                    for column in 0..h.window.columns {
                        let [least, z, most] = [&least, &raised, &all].map(|of| of.row(b)[column]);
                        assert!(
                            least <= z && z <= most,
                            "{cutter}, every {every}: {x:?} {y:?}, {z} at {column}, {b}"
                        );
                    }
                }
            }
        }
    }
}
