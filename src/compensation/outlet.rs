//! Where targets go, and what is made of them on the way: what was just worked out is still in a core's cache.

use super::closing::{CAVITY_MM, left};
use super::field::{Sense, line};
use super::lanes::{LANES, LEAST, Portable, Vectors, groups, groups_mut};
use std::sync::atomic::{AtomicU32, Ordering};

/// Bytes of targets that a core's cache may well hold until they are looked at.
const CACHE: usize = 1 << 20;

/// Where a row of targets goes.
pub(super) struct Outlet<'b> {
    /// Nowhere, if it is empty and something is made of them beside.
    pub to: &'b mut [f32],
    pub beside: Option<Beside<'b>>,
}

/// What is found out beside it.
pub(super) struct Beside<'b> {
    /// The part's samples there.
    pub h: &'b [f32],
    /// Where that is told in numbers, until it is: a search that is given up has given some rows already.
    pub tally: Option<&'b RowTally>,
    /// What is made of a closing.
    pub closed: Option<Closed<'b>>,
}

/// What goes with a closing, which is no data where the part has none. Either may be empty: it is not wanted.
pub(super) struct Closed<'b> {
    pub residual: &'b mut [f32],
    /// Cutter locations, and where they go: no data where the part has none.
    pub cut: &'b [f32],
    pub cl: &'b mut [f32],
}

/// What several threads find out about one row.
#[derive(Debug, Default)]
pub(super) struct RowTally {
    samples: AtomicU32,
    cavities: AtomicU32,
    /// Bits of a height, which are ordered as heights that are not negative are.
    most_mm: AtomicU32,
}

/// A row, or a part of one, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tally {
    /// Samples with data, and those of them that a closing leaves more than [`CAVITY_MM`] on.
    pub samples: u32,
    pub cavities: u32,
    /// The most that is left on one.
    pub most_mm: f32,
}

impl Tally {
    /// Takes a sample of the part and what a closing leaves on it.
    #[inline(always)]
    pub fn see(&mut self, h_mm: f32, left_mm: f32) {
        self.samples += u32::from(!h_mm.is_nan());
        self.cavities += u32::from(left_mm > CAVITY_MM);
        self.most_mm = if left_mm > self.most_mm { left_mm } else { self.most_mm };
    }
}

impl RowTally {
    #[inline(always)]
    fn add(&self, tally: Tally) {
        self.samples.fetch_add(tally.samples, Ordering::Relaxed);
        if tally.cavities > 0 {
            self.cavities.fetch_add(tally.cavities, Ordering::Relaxed);
        }
        self.most_mm.fetch_max(tally.most_mm.to_bits(), Ordering::Relaxed);
    }

    /// What was found out since this was last asked.
    pub fn take(&mut self) -> Tally {
        let RowTally { samples, cavities, most_mm } = std::mem::take(self);
        Tally {
            samples: samples.into_inner(),
            cavities: cavities.into_inner(),
            most_mm: f32::from_bits(most_mm.into_inner()),
        }
    }
}

impl<'b> Outlet<'b> {
    /// One of each of these rows.
    pub fn plain(z_mm: &'b mut [f32], columns: usize) -> Vec<Outlet<'b>> {
        z_mm.chunks_exact_mut(columns.max(1)).map(|to| Outlet { to, beside: None }).collect()
    }

    /// Whether these are too many for a core's cache.
    pub fn are_many(to: &[Outlet<'_>]) -> bool {
        to.iter().map(|row| size_of::<f32>() * row.columns()).sum::<usize>() > CACHE
    }

    /// How many targets it takes.
    #[inline(always)]
    pub fn columns(&self) -> usize {
        self.beside.as_ref().map_or(self.to.len(), |beside| beside.h.len())
    }

    /// In pieces of so many columns, from the left.
    pub fn split(self, columns: usize) -> impl Iterator<Item = Outlet<'b>> {
        let mut left = Some(self);
        std::iter::from_fn(move || {
            let outlet = left.take()?;
            if outlet.columns() <= columns {
                return Some(outlet);
            }
            let Outlet { to, beside } = outlet;
            let (to, more) = split_mut(to, columns);
            let [beside, more_beside] = match beside {
                Some(beside) => beside.split(columns).map(Some),
                None => [None, None],
            };
            left = Some(Outlet { to: more, beside: more_beside });
            Some(Outlet { to, beside })
        })
    }

    /// Whether samples are counted and nothing else is looked at beside.
    pub fn counts_samples(&self) -> bool {
        self.beside.as_ref().is_some_and(|beside| beside.tally.is_some() && beside.closed.is_none())
    }

    /// Takes how many samples have data.
    #[inline(always)]
    pub fn counted(&mut self, samples: u32) {
        if let Some(tally) = self.beside.as_mut().and_then(|beside| beside.tally.take()) {
            tally.add(Tally { samples, ..Tally::default() });
        }
    }

    /// Takes a row of targets; past the caches, if they are many.
    #[inline(always)]
    pub fn give<V: Vectors>(&mut self, sense: Sense, from: &[f32], are_many: bool) {
        if let Some(Beside { h, tally, closed }) = &mut self.beside {
            let found = match closed {
                Some(closed) => closed.give::<V>(sense, self.to, from, h),
                None if tally.is_some() => Tally { samples: with_data::<V>(h), ..Tally::default() },
                None => Tally::default(),
            };
            if let Some(tally) = tally.take() {
                tally.add(found);
            }
            if closed.is_some() {
                return;
            }
        }
        if are_many {
            sense.stream_row::<V>(self.to, from);
        } else {
            sense.give_row(self.to, from);
        }
    }

    /// [`Outlet::give`] for the few that come from outside of code for the processor at hand.
    pub fn give_portable(&mut self, sense: Sense, from: &[f32]) {
        self.give::<Portable>(sense, from, false);
    }
}

impl<'b> Beside<'b> {
    fn split(self, columns: usize) -> [Beside<'b>; 2] {
        let Beside { h, tally, closed } = self;
        let h = h.split_at(columns);
        let [closed, more_closed] = match closed {
            Some(Closed { residual, cut, cl }) => {
                let (residual, cut, cl) =
                    (split_mut(residual, columns), cut.split_at(columns), split_mut(cl, columns));
                [
                    Some(Closed { residual: residual.0, cut: cut.0, cl: cl.0 }),
                    Some(Closed { residual: residual.1, cut: cut.1, cl: cl.1 }),
                ]
            }
            None => [None, None],
        };
        [Beside { h: h.0, tally, closed }, Beside { h: h.1, tally, closed: more_closed }]
    }
}

/// The first columns of a row and the others; of one that is not wanted, neither.
fn split_mut(z_mm: &mut [f32], columns: usize) -> (&mut [f32], &mut [f32]) {
    z_mm.split_at_mut(columns.min(z_mm.len()))
}

/// How many samples have data.
#[inline(always)]
pub(super) fn with_data<V: Vectors>(h: &[f32]) -> u32 {
    let lowest = V::splat(f32::NEG_INFINITY);
    let mut samples = 0;
    let whole = groups(h);
    for h in whole {
        samples += V::at_least(V::load(h), lowest).count_ones();
    }
    for h in &h[whole.len() * LANES..] {
        samples += u32::from(!h.is_nan());
    }
    samples
}

impl Closed<'_> {
    /// Takes a row of a closing, past the caches.
    #[inline(always)]
    fn give<V: Vectors>(&mut self, sense: Sense, to: &mut [f32], from: &[f32], h: &[f32]) -> Tally {
        let Closed { residual, cut, cl } = self;
        let mut tally = Tally::default();
        let columns = h.len();
        // As far as the first cache line of one of these that is wanted.
        let first =
            [&*to, &**residual, &**cl].into_iter().find(|z| !z.is_empty()).map_or(0, line).min(columns);
        let end = first + (columns - first) / LANES * LANES;
        for i in (0..first).chain(end..columns) {
            let there = !h[i].is_nan();
            let z_mm = if there { sense.give(from[i]) } else { f32::NAN };
            let left_mm = left(z_mm, h[i]);
            tally.see(h[i], left_mm);
            let made = [z_mm, left_mm, if there { cut[i] } else { f32::NAN }];
            for (to, made) in [&mut *to, &mut **residual, &mut **cl].into_iter().zip(made) {
                if let Some(to) = to.get_mut(i) {
                    *to = made;
                }
            }
        }
        let mut wanted =
            [Filled::of(to, first..end), Filled::of(residual, first..end), Filled::of(cl, first..end)];
        let (zero, none, least) = (V::splat(0.0), V::splat(f32::NAN), V::splat(LEAST));
        let (lowest, cavity) = (V::splat(f32::NEG_INFINITY), V::splat(CAVITY_MM.next_up()));
        let mut most = zero;
        let read = groups(&from[first..end]).iter().zip(groups(&h[first..end])).zip(groups(&cut[first..end]));
        for (g, ((z, h), cut)) in read.enumerate() {
            let (z, h) = (V::load(z), V::load(h));
            let there = V::at_least(h, lowest);
            let z_mm = if sense == Sense::Raise { z } else { V::subtract(zero, z) };
            let z_mm = V::choose(V::at_least(z, least) & there, z_mm, none);
            let left_mm = V::subtract(z_mm, h);
            let left_mm = V::choose(V::at_least(zero, left_mm), zero, left_mm);
            tally.samples += there.count_ones();
            tally.cavities += V::at_least(left_mm, cavity).count_ones();
            most = V::greater(left_mm, most);
            let [to, residual, cl] = &mut wanted;
            to.put::<V>(g, || z_mm);
            residual.put::<V>(g, || left_mm);
            cl.put::<V>(g, || V::choose(there, V::load(cut), none));
        }
        tally.most_mm = tally.most_mm.max(V::most(most));
        tally
    }
}

/// Whole groups of a row that something is put into, if it is wanted.
struct Filled<'a> {
    groups: &'a mut [[f32; LANES]],
    /// Whether they begin cache lines, and so can go past the caches.
    is_aligned: bool,
}

impl<'a> Filled<'a> {
    #[inline(always)]
    fn of(z_mm: &'a mut [f32], columns: std::ops::Range<usize>) -> Filled<'a> {
        let z_mm = if z_mm.is_empty() { z_mm } else { &mut z_mm[columns] };
        Filled { is_aligned: line(z_mm) == 0, groups: groups_mut(z_mm) }
    }

    #[inline(always)]
    fn put<V: Vectors>(&mut self, g: usize, made: impl FnOnce() -> V::Group) {
        if let Some(to) = self.groups.get_mut(g) {
            if self.is_aligned { V::stream(made(), to) } else { V::store(made(), to) }
        }
    }
}
