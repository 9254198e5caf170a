//! What a cutter leaves at best.

use super::field::{Field, Sense, Targets};
use super::marked::{Marked, by_flat};
use super::tiles::on_samples_into;
use super::way::Way;
use super::{Profile, Tables};
use crate::grid::{Heights, Window};

/// What a closing leaves on a sample, in mm, from which that is out of the cutter's reach: more than rounding leaves.
pub const CAVITY_MM: f32 = 1e-5;

/// Closings one after the other, in memory that is kept from each to the next: memory taken anew, and given back,
/// costs about as much as what is done to a sample under a small cutter.
#[derive(Debug)]
pub struct Closings {
    cl: Heights,
    closed: Heights,
}

impl Closings {
    /// Without memory yet.
    pub fn new() -> Closings {
        let none = Window { column: 0, row: 0, columns: 0, rows: 0 };
        Closings { cl: Heights::empty(none), closed: Heights::empty(none) }
    }

    /// What the cutter leaves of `h` at best. Cutter positions are the samples of `out` grown by
    /// [`Profile::reach`], whether `h` has data there or not, so `h` should cover `out` grown by
    /// twice that as far as there is data.
    pub fn of(&mut self, h: &Heights, tables: &Tables, out: Window) -> &Heights {
        let Closings { cl, closed } = self;
        let around = out.grown(tables.profile().reach());
        on_samples_into(h, tables, around, 1, Sense::Raise, Way::Known, cl);
        on_samples_into(cl, tables, out, 1, Sense::Lower, Way::Known, closed);
        closed
    }

    /// [`Closings::of`] a flat at the marked samples of `out`, from positions in marked squares only; no data, or the
    /// closing, at the others.
    ///
    /// # Panics
    /// For another cutter than a flat.
    pub fn of_flat_at(
        &mut self,
        h: &Heights,
        tables: &Tables,
        out: Window,
        [positions, marked]: [&Marked; 2],
    ) -> &Heights {
        let profile = tables.profile();
        assert!(profile.plateau_mm() >= profile.radius_mm(), "{} is no flat", profile.shape());
        let Closings { cl, closed } = self;
        let mut scratch = (Field::empty(0, 0), Targets::new(0, 0));
        let around = out.grown(profile.reach());
        by_flat(h, tables, (around, positions), Sense::Raise, cl, &mut scratch);
        by_flat(cl, tables, (out, marked), Sense::Lower, closed, &mut scratch);
        closed
    }
}

impl Default for Closings {
    fn default() -> Closings {
        Closings::new()
    }
}

/// One closing by itself: [`Closings::of`].
pub fn closing(h: &Heights, profile: &Profile, out: Window) -> Heights {
    let mut closings = Closings::new();
    closings.of(h, &Tables::new(*profile), out);
    closings.closed
}

/// closing - h, never negative: rounding may put a closing one unit in the last place low. NaN
/// where either has no data. Both have the window of `closing`.
pub fn residual(closing: &Heights, h: &Heights) -> Heights {
    let cropped;
    let h = if h.window == closing.window {
        h
    } else {
        cropped = h.crop(closing.window);
        &cropped
    };
    let z_mm = closing.z_mm.iter().zip(&h.z_mm).map(|(c, h)| left(*c, *h)).collect();
    Heights { window: closing.window, z_mm }
}

/// What a closing leaves on a sample.
#[inline(always)]
pub(super) fn left(closing_mm: f32, h_mm: f32) -> f32 {
    let left_mm = closing_mm - h_mm;
    // Not below zero, and NaN where either is none.
    if left_mm < 0.0 { 0.0 } else { left_mm }
}
