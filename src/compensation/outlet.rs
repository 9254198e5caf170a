//! Where targets go, and what is made of them on the way: what was just worked out is still in a core's cache.

use super::closing::left;
use super::field::{Sense, line};
use super::lanes::{LANES, LEAST, Portable, Vectors, groups, groups_mut};
use std::sync::atomic::{AtomicU32, Ordering};

/// Bytes of targets that a core's cache may well hold until they are looked at.
const CACHE: usize = 1 << 20;

/// Where a row of targets goes.
pub(super) struct Outlet<'b> {
    pub to: &'b mut [f32],
    pub beside: Option<Beside<'b>>,
}

/// What is found out beside it.
pub(super) struct Beside<'b> {
    /// The part's samples there.
    pub h: &'b [f32],
    /// Where those with data are counted, until they are: a search that is given up has given some rows already.
    pub samples: Option<&'b AtomicU32>,
    /// What is made of a closing.
    pub closed: Option<Closed<'b>>,
}

/// What goes with a closing, which is no data where the part has none.
pub(super) struct Closed<'b> {
    pub residual: &'b mut [f32],
    /// Cutter locations, and where they go: no data where the part has none.
    pub cut: &'b [f32],
    pub cl: &'b mut [f32],
}

impl<'b> Outlet<'b> {
    /// One of each of these rows.
    pub fn plain(z_mm: &'b mut [f32], columns: usize) -> Vec<Outlet<'b>> {
        z_mm.chunks_exact_mut(columns.max(1)).map(|to| Outlet { to, beside: None }).collect()
    }

    /// Whether these are too many for a core's cache.
    pub fn are_many(to: &[Outlet<'_>]) -> bool {
        to.iter().map(|row| size_of_val(&*row.to)).sum::<usize>() > CACHE
    }

    /// In pieces of so many columns, from the left.
    pub fn split(self, columns: usize) -> impl Iterator<Item = Outlet<'b>> {
        let mut left = Some(self);
        std::iter::from_fn(move || {
            let Outlet { to, beside } = left.take()?;
            if to.len() <= columns {
                return Some(Outlet { to, beside });
            }
            let (to, more) = to.split_at_mut(columns);
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
        self.beside.as_ref().is_some_and(|beside| beside.samples.is_some() && beside.closed.is_none())
    }

    /// Takes how many samples have data.
    #[inline(always)]
    pub fn counted(&mut self, count: u32) {
        if let Some(samples) = self.beside.as_mut().and_then(|beside| beside.samples.take()) {
            samples.fetch_add(count, Ordering::Relaxed);
        }
    }

    /// Takes a row of targets; past the caches, if they are many.
    #[inline(always)]
    pub fn give<V: Vectors>(&mut self, sense: Sense, from: &[f32], are_many: bool) {
        if let Some(Beside { h, samples, closed }) = &mut self.beside {
            if let Some(samples) = samples.take() {
                samples.fetch_add(with_data::<V>(h), Ordering::Relaxed);
            }
            if let Some(closed) = closed {
                closed.give::<V>(sense, self.to, from, h);
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
        let Beside { h, samples, closed } = self;
        let h = h.split_at(columns);
        let [closed, more_closed] = match closed {
            Some(Closed { residual, cut, cl }) => {
                let (residual, cut, cl) =
                    (residual.split_at_mut(columns), cut.split_at(columns), cl.split_at_mut(columns));
                [
                    Some(Closed { residual: residual.0, cut: cut.0, cl: cl.0 }),
                    Some(Closed { residual: residual.1, cut: cut.1, cl: cl.1 }),
                ]
            }
            None => [None, None],
        };
        [Beside { h: h.0, samples, closed }, Beside { h: h.1, samples, closed: more_closed }]
    }
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
    fn give<V: Vectors>(&mut self, sense: Sense, to: &mut [f32], from: &[f32], h: &[f32]) {
        let Closed { residual, cut, cl } = self;
        let columns = to.len();
        let first = line(to).min(columns);
        let whole = (columns - first) / LANES * LANES;
        let end = first + whole;
        for i in (0..first).chain(end..columns) {
            let there = !h[i].is_nan();
            to[i] = if there { sense.give(from[i]) } else { f32::NAN };
            residual[i] = left(to[i], h[i]);
            cl[i] = if there { cut[i] } else { f32::NAN };
        }
        // They begin their cache lines together, or else are stored as ever.
        let alike = [&**residual, &**cl].map(|z| line(&z[first..]) == 0);
        let (zero, none, least) = (V::splat(0.0), V::splat(f32::NAN), V::splat(LEAST));
        let lowest = V::splat(f32::NEG_INFINITY);
        let to = groups_mut(&mut to[first..end]).iter_mut();
        let residual = groups_mut(&mut residual[first..end]).iter_mut();
        let cl = groups_mut(&mut cl[first..end]).iter_mut();
        let read = groups(&from[first..end]).iter().zip(groups(&h[first..end])).zip(groups(&cut[first..end]));
        for (((to, residual), cl), ((z, h), cut)) in to.zip(residual).zip(cl).zip(read) {
            let (z, h) = (V::load(z), V::load(h));
            let there = V::at_least(h, lowest);
            let z_mm = if sense == Sense::Raise { z } else { V::subtract(zero, z) };
            let z_mm = V::choose(V::at_least(z, least) & there, z_mm, none);
            V::stream(z_mm, to);
            let left_mm = V::subtract(z_mm, h);
            let left_mm = V::choose(V::at_least(zero, left_mm), zero, left_mm);
            let cut_mm = V::choose(there, V::load(cut), none);
            if alike[0] {
                V::stream(left_mm, residual)
            } else {
                V::store(left_mm, residual)
            }
            if alike[1] { V::stream(cut_mm, cl) } else { V::store(cut_mm, cl) }
        }
    }
}
