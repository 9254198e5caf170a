//! Bounds of passes that run at an angle to the samples.
//!
//! Heights are those of a line. A slanted pass stands on the grid points next to it, half a unit from it at most, and
//! so does a move between two of them; by that much more the cutter is allowed to stray sideways here.

use std::ops::Range;

use rayon::prelude::*;

use super::envelope::{Cutter, Envelope, RINGS};
use super::passes::Layout;
use super::strip::Strip;
use super::{Error, Site};
use crate::compensation::{Faces, Places};

/// Positions of a pass whose surroundings are held at once.
const BLOCK: usize = 512;

/// Most positions that share what is known of the heights around them.
const GROUP: usize = 8;

/// Length of such a group in parts of the cutter's radius: what lies that much farther counts as in reach, so that a
/// small ball on a steep face would be lifted for it.
const GROUP_RADII: f64 = 0.1;

/// Passes that are planned together.
const BAND: usize = 64;

/// How many passes from `first` on make a band.
pub(super) fn band_length(layout: &Layout, first: usize) -> usize {
    BAND.min(layout.passes.len() - first)
}

/// The bounds of some passes, block by block along them.
pub(super) fn envelopes(
    site: &Site,
    cutter: &Cutter,
    layout: &Layout,
    passes: Range<usize>,
) -> Result<Vec<Envelope>, Error> {
    let nothing =
        || Envelope { bound_mm: vec![f64::NEG_INFINITY; layout.count], cl_mm: vec![f32::NAN; layout.count] };
    let mut out: Vec<Envelope> = passes.clone().map(|_| nothing()).collect();
    let end = layout.count.saturating_sub(1);
    for from in (0..end).step_by(BLOCK) {
        let to = (from + BLOCK).min(end);
        let Some((low_mm, high_mm)) = layout.surroundings(&passes, from, to) else { continue };
        let reach_mm = cutter.reach_mm;
        let strip = Strip::around(
            site.surface,
            layout.along,
            low_mm.map(|mm| mm - reach_mm),
            high_mm.map(|mm| mm + reach_mm),
        )?;
        let block = Block {
            cutter,
            layout,
            exact: Faces::new(&strip.facets, cutter.exact.profile()),
            wide: cutter.faces(&strip),
            places: Places::new(&strip.heights, site.surface.lattice().step_mm),
            missed_mm: strip.missed_mm,
        };
        out.par_iter_mut().zip(passes.clone()).for_each(|(envelope, k)| {
            block.bound(k, from, to, envelope);
        });
    }
    Ok(out)
}

struct Block<'a> {
    cutter: &'a Cutter,
    layout: &'a Layout,
    exact: Faces<'a>,
    wide: Faces<'a>,
    places: Places<'a>,
    missed_mm: f64,
}

impl Block<'_> {
    /// Raises an envelope over the positions `from ..= to` of pass `k`.
    fn bound(&self, k: usize, from: usize, to: usize, envelope: &mut Envelope) {
        let mut near = None;
        let mut beside_mm: Vec<f64> = vec![f64::NEG_INFINITY; to + 1 - from];
        for i in from..=to {
            if !self.layout.covers(k, i) {
                continue;
            }
            let [along, across] = self.layout.turned_mm(k, i);
            let mut drop_mm = |place: [f64; 2]| {
                let sampled = self.places.drop_mm(self.cutter.exact.profile(), place, &mut near);
                self.exact.lift_point(place, sampled)
            };
            let z_mm = drop_mm([along, across]);
            if z_mm.is_finite() {
                envelope.cl_mm[i] = z_mm as f32;
                envelope.bound_mm[i] = envelope.bound_mm[i].max(z_mm);
                let sides = self.cutter.beside_mm().map(|aside_mm| [across - aside_mm, across + aside_mm]);
                beside_mm[i - from] =
                    sides.into_iter().flatten().map(|across| drop_mm([along, across])).fold(z_mm, f64::max);
            }
        }
        let mut wide: Option<(usize, f64)> = None;
        let group = ((GROUP_RADII * self.cutter.radius_mm / self.cutter.pitch_mm) as usize).clamp(1, GROUP);
        for first in (from..to).step_by(group) {
            let end = (first + group).min(to);
            let middle = self.layout.turned_mm(k, first.midpoint(end));
            let around_mm = 0.5 * (group + 1) as f64 * self.cutter.pitch_mm + self.cutter.strays_mm();
            let mut ceilings = [None; RINGS.len()];
            for i in first..end {
                let [left, right] = [i, i + 1].map(|i| f64::from(envelope.cl_mm[i]));
                if left.is_nan() || right.is_nan() {
                    continue;
                }
                let contact = self.cutter.contact_mm(left.min(right), |ring| {
                    *ceilings[ring].get_or_insert_with(|| {
                        let reach_mm = RINGS[ring] * self.cutter.radius_mm + around_mm;
                        self.places.ceiling_mm(middle, reach_mm) + self.missed_mm
                    })
                });
                let (left, right) = match contact.and_then(|t| self.cutter.lift_mm(t)) {
                    Some(lift_mm) => (beside_mm[i - from] + lift_mm, beside_mm[i + 1 - from] + lift_mm),
                    None => {
                        let before = wide.filter(|w| w.0 == i).map(|w| w.1);
                        let a = before.unwrap_or_else(|| self.widened(k, i, &mut near));
                        let b = self.widened(k, i + 1, &mut near);
                        wide = Some((i + 1, b));
                        self.cutter.steep_ends(a, b)
                    }
                };
                envelope.bound_mm[i] = envelope.bound_mm[i].max(left);
                envelope.bound_mm[i + 1] = envelope.bound_mm[i + 1].max(right);
            }
        }
    }

    fn widened(&self, k: usize, i: usize, near: &mut Option<[usize; 2]>) -> f64 {
        let place = self.layout.turned_mm(k, i);
        self.wide.lift_point(place, self.places.drop_mm(self.cutter.wide.profile(), place, near))
    }
}
