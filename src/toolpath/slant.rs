//! Bounds of passes that run at an angle to the samples.
//!
//! They are asked for once for all controllers of a job, as the coarsest grid among them needs them. Where it meets the
//! lines, heights are those of a line; the cutter is allowed to stray sideways by the little that is missing. Otherwise
//! heights to both sides are needed too, and `track.rs` makes of them the curve that all of the controllers follow.

use std::ops::Range;

use rayon::prelude::*;

use super::envelope::{Cutter, Envelope, RINGS};
use super::passes::{Layout, tip_radius_mm};
use super::strip::Strip;
use super::{Error, Site};
use crate::compensation::{self, Faces, Places};
use crate::cutter::Shape;

/// Positions of a pass whose surroundings are held at once.
const BLOCK: usize = 512;

/// Most positions that share what is known of the heights around them.
const GROUP: usize = 8;

/// Length of such a group in parts of the cutter's radius: what lies that much farther counts as in reach, so that a
/// small ball on a steep face would be lifted for it.
const GROUP_RADII: f64 = 0.1;

/// Passes that are planned together.
const BAND: usize = 64;

/// How far beside the line heights are known, in units of the coarsest grid.
pub(super) const SIDES: [f64; 4] = [-1.0, -0.5, 0.5, 1.0];

/// Heights of places a unit to both sides that bend by less than this part of one lie in line with what is between.
const FLAT: f64 = 0.0002;

/// What is known beside one position of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beside {
    /// Exact locations at [`SIDES`] in mm.
    pub(super) cl_mm: [f64; 4],
    /// What these and the line's own must be raised by for what lies between positions, in mm.
    pub(super) lift_mm: f64,
    /// Whether on one side or the other that does not do.
    pub(super) steep: bool,
    /// At the grid points before and after the line of a steep place: the exact and the widened cutter's locations in mm.
    pub(super) points_mm: [[f64; 2]; 2],
    /// From each of these points to each of the next position's what has to be added to exact locations, in mm, if that
    /// is known; the widened cutter's do, too.
    pub(super) lifts_mm: [[Option<f64>; 2]; 2],
}

impl Beside {
    const UNKNOWN: Beside = Beside {
        cl_mm: [f64::NAN; 4],
        lift_mm: 0.0,
        steep: false,
        points_mm: [[f64::NAN; 2]; 2],
        lifts_mm: [[Some(0.0); 2]; 2],
    };
}

/// Whether the passes of a cutter are laid between grid points beside their lines. Without a round tip only a widened
/// cutter tells what lies between two positions, so each would be a vertex: it is widened by half a unit more instead.
fn tracks(shape: &Shape, common: &Layout) -> bool {
    tip_radius_mm(shape) > 0.0 && !common.on_grid()
}

/// The cutter of an operation, for passes on the coarsest grid of the job. Moves between grid points beside a line are
/// longer than along it.
pub(super) fn cutter(shape: Shape, common: &Layout, site: &Site) -> Result<Cutter, compensation::Error> {
    let step_mm = site.surface.lattice().step_mm;
    if !tracks(&shape, common) {
        return Cutter::new(shape, step_mm, common.length_mm(), common.aside_mm(), site.tightest);
    }
    // A unit more or less across than the line; and half a unit is between two of the heights beside it where they bend.
    let across_mm = common.pitch_mm() * common.slope.abs() + common.unit_mm;
    let longest_mm = common.pitch_mm().hypot(across_mm).hypot(0.5 * common.unit_mm);
    Cutter::new(shape, step_mm, longest_mm, 0.0, site.tightest)
}

/// How many passes from `first` on make a band.
pub(super) fn band_length(layout: &Layout, first: usize) -> usize {
    BAND.min(layout.passes.len() - first)
}

/// The bounds of some passes on the coarsest grid of the job, block by block along them; where only some positions are
/// kept, of these only.
pub(super) fn envelopes(
    site: &Site,
    shape: &Shape,
    cutter: &Cutter,
    layout: &Layout,
    passes: Range<usize>,
    kept: Option<&[Vec<bool>]>,
) -> Result<Vec<Envelope>, Error> {
    let track = tracks(shape, layout);
    let nothing = || Envelope {
        bound_mm: vec![f64::NEG_INFINITY; layout.count],
        cl_mm: vec![f32::NAN; layout.count],
        beside: if track { vec![Beside::UNKNOWN; layout.count] } else { Vec::new() },
    };
    let beside_mm = if track { layout.unit_mm } else { 0.0 };
    let mut out: Vec<Envelope> = passes.clone().map(|_| nothing()).collect();
    let end = layout.count.saturating_sub(1);
    for from in (0..end).step_by(BLOCK) {
        let to = (from + BLOCK).min(end);
        if kept.is_some_and(|kept| kept.iter().all(|kept| !kept[from..=to].contains(&true))) {
            continue;
        }
        let Some((low_mm, high_mm)) = layout.surroundings(&passes, from, to) else { continue };
        let reach_mm = cutter.reach_mm + beside_mm;
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
            beside_mm,
            places: Places::new(&strip.heights, site.surface.lattice().step_mm),
            missed_mm: strip.missed_mm,
        };
        out.par_iter_mut().zip(passes.clone()).for_each(|(envelope, k)| {
            block.bound(k, from, to, kept.map(|kept| &kept[k - passes.start][..]), envelope);
        });
    }
    Ok(out)
}

struct Block<'a> {
    cutter: &'a Cutter,
    layout: &'a Layout,
    exact: Faces<'a>,
    wide: Faces<'a>,
    /// How far to both sides heights may be needed.
    beside_mm: f64,
    places: Places<'a>,
    missed_mm: f64,
}

impl Block<'_> {
    /// Raises an envelope over the positions `from ..= to` of pass `k`, as far as they are kept.
    fn bound(&self, k: usize, from: usize, to: usize, kept: Option<&[bool]>, envelope: &mut Envelope) {
        let mut near = None;
        // The intervals on both sides of a position bound it.
        let needed = |i: usize| {
            kept.is_none_or(|kept| kept[i.saturating_sub(1)..(i + 2).min(kept.len())].contains(&true))
        };
        for i in (from..=to).filter(|&i| self.layout.covers(k, i) && needed(i)) {
            let [along, across] = self.layout.turned_mm(k, i);
            let mut drop_mm = |place: [f64; 2]| {
                let sampled = self.places.drop_mm(self.cutter.exact.profile(), place, &mut near);
                self.exact.lift_point(place, sampled)
            };
            let z_mm = drop_mm([along, across]);
            if !z_mm.is_finite() {
                continue;
            }
            envelope.cl_mm[i] = z_mm as f32;
            envelope.bound_mm[i] = envelope.bound_mm[i].max(z_mm);
            // The last position of a block is the first of the next one.
            if let Some(beside) = envelope.beside.get_mut(i).filter(|beside| beside.cl_mm[0].is_nan()) {
                let mut side_mm = |side: f64| {
                    let cl_mm = drop_mm([along, across + side * self.layout.unit_mm]);
                    // Out of reach of everything there is no bound; none is higher than the next one inwards.
                    if cl_mm.is_finite() { cl_mm } else { z_mm }
                };
                let (before, after) = (side_mm(-1.0), side_mm(1.0));
                let bend_mm = (before + after - 2.0 * z_mm).abs();
                let halves = if bend_mm < FLAT * self.layout.unit_mm {
                    [before, after].map(|side_mm| 0.5 * (side_mm + z_mm))
                } else {
                    [-0.5, 0.5].map(side_mm)
                };
                beside.cl_mm = [before, halves[0], halves[1], after];
            }
        }
        let mut wide: Option<(usize, f64)> = None;
        let group = ((GROUP_RADII * self.cutter.radius_mm / self.cutter.pitch_mm) as usize).clamp(1, GROUP);
        for first in (from..to).step_by(group) {
            let end = (first + group).min(to);
            let middle = self.layout.turned_mm(k, first.midpoint(end));
            let around_mm =
                0.5 * (group + 1) as f64 * self.cutter.pitch_mm + self.cutter.strays_mm() + self.beside_mm;
            let mut ceilings = [None; RINGS.len()];
            let mut ceiling = |ring: usize| {
                *ceilings[ring].get_or_insert_with(|| {
                    let reach_mm = RINGS[ring] * self.cutter.radius_mm + around_mm;
                    self.places.ceiling_mm(middle, reach_mm) + self.missed_mm
                })
            };
            for i in first..end {
                let [left, right] = [i, i + 1].map(|i| f64::from(envelope.cl_mm[i]));
                if left.is_nan() || right.is_nan() {
                    continue;
                }
                let lowest_mm = left.min(right);
                if let Some([a, b]) =
                    envelope.beside.get_mut(i..).and_then(|rest| rest.first_chunk_mut::<2>())
                {
                    self.beside(k, i, lowest_mm, [a, b], &mut ceiling, &mut near);
                    continue;
                }
                let contact = self.cutter.contact_mm(lowest_mm, &mut ceiling);
                let (left, right) = match contact.and_then(|t| self.cutter.lift_mm(t)) {
                    Some(lift_mm) => (left + lift_mm, right + lift_mm),
                    None => {
                        let before = wide.filter(|w| w.0 == i).map(|w| w.1);
                        let a = before.unwrap_or_else(|| self.widened(k, i, 0.0, &mut near));
                        let b = self.widened(k, i + 1, 0.0, &mut near);
                        wide = Some((i + 1, b));
                        self.cutter.steep_ends(a, b)
                    }
                };
                envelope.bound_mm[i] = envelope.bound_mm[i].max(left);
                envelope.bound_mm[i + 1] = envelope.bound_mm[i + 1].max(right);
            }
        }
    }

    /// What an interval asks for beside its line, which is at `lowest_mm` at its lower end.
    fn beside(
        &self,
        k: usize,
        i: usize,
        lowest_mm: f64,
        [a, b]: [&mut Beside; 2],
        ceiling: &mut dyn FnMut(usize) -> f64,
        near: &mut Option<[usize; 2]>,
    ) {
        let lowest_mm = a.cl_mm.iter().chain(&b.cl_mm).fold(lowest_mm, |low, &z| low.min(z));
        let contact = self.cutter.contact_mm(lowest_mm, &mut *ceiling);
        if let Some(lift_mm) = contact.and_then(|t| self.cutter.lift_mm(t)) {
            a.lift_mm = a.lift_mm.max(lift_mm);
            b.lift_mm = b.lift_mm.max(lift_mm);
            return;
        }
        for (beside, i) in [(&mut *a, i), (&mut *b, i + 1)] {
            if !beside.steep {
                beside.steep = true;
                beside.points_mm = self.points(k, i, near);
            }
        }
        a.lifts_mm = a.points_mm.map(|from| {
            b.points_mm.map(|to| {
                let contact = self.cutter.contact_mm(from[0].min(to[0]), &mut *ceiling);
                contact.and_then(|t| self.cutter.curved_lift_mm(t, f64::INFINITY))
            })
        });
    }

    /// Exact and widened locations at the grid points next to a position.
    fn points(&self, k: usize, i: usize, near: &mut Option<[usize; 2]>) -> [[f64; 2]; 2] {
        let [along, across] = self.layout.turned_mm(k, i);
        self.layout.points(k, i).map(|(_, off)| {
            let place = [along, across + off * self.layout.unit_mm];
            let sampled = self.places.drop_mm(self.cutter.exact.profile(), place, near);
            let cl_mm = self.exact.lift_point(place, sampled);
            let wide_mm = self.widened(k, i, off, near);
            [cl_mm, wide_mm].map(|z_mm| if z_mm.is_finite() { z_mm } else { f64::NEG_INFINITY })
        })
    }

    /// The widened cutter's location, so many units beside the line.
    fn widened(&self, k: usize, i: usize, off: f64, near: &mut Option<[usize; 2]>) -> f64 {
        let [along, across] = self.layout.turned_mm(k, i);
        let place = [along, across + off * self.layout.unit_mm];
        self.wide.lift_point(place, self.places.drop_mm(self.cutter.wide.profile(), place, near))
    }
}
