//! One straight move as the sweep needs it.

use super::super::contact::{Contact, Lean};
use super::super::judged::{Class, Judged};
use super::OVERLAP_MM;

/// Lateral moves shorter than this are vertical.
const SHORT_MM: f64 = 1e-6;

/// How a move lies to the samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lie {
    /// All of it was taken with the move before.
    Nothing,
    /// Only its end counts.
    Point,
    /// Parallel to an axis: every line of samples along it is cut by a straight line.
    Along(usize),
    Oblique,
}

/// One move in the part frame, z less the datum.
#[derive(Clone, Copy)]
pub(super) struct Leg {
    pub from: [f64; 3],
    pub to: [f64; 3],
    /// Unit vector in the plane.
    pub u: [f64; 2],
    pub length: f64,
    pub lean: Lean,
    pub lie: Lie,
    pub class: Class,
}

impl Leg {
    /// Motion `index` as a move, or None where its end is not known.
    pub fn of<C: Contact>(contact: &C, judged: &Judged, index: usize, datum_mm: f64) -> Option<Leg> {
        let motions = &judged.reading.motions;
        let motion = &motions[index];
        if !motion.known() {
            return None;
        }
        let zero = [judged.zero_mm[0], judged.zero_mm[1], judged.zero_mm[2] - datum_mm];
        let place = |p: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| p[axis] + zero[axis]) };
        let to = place(motion.to_mm);
        let known = index.checked_sub(1).map(|i| &motions[i]).filter(|m| m.known());
        let from = known.map_or(to, |m| place(m.to_mm));
        let delta: [f64; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
        // Along an axis, as most moves are, the root of a square is the number itself.
        let length = match delta {
            [x, 0.0, _] => x.abs(),
            [0.0, y, _] => y.abs(),
            [x, y, _] => x.hypot(y),
        };
        let rapid = judged.rapid(index);
        let vertical = length < SHORT_MM;
        let class = match (rapid, vertical && delta[2] < 0.0) {
            (true, _) => Class::Rapid,
            (false, true) => Class::Plunge,
            (false, false) => Class::Cut,
        };
        let lie = if vertical {
            if known.is_some() && delta[2] >= 0.0 && length == 0.0 { Lie::Nothing } else { Lie::Point }
        } else if delta[1] == 0.0 {
            Lie::Along(0)
        } else if delta[0] == 0.0 {
            Lie::Along(1)
        } else {
            Lie::Oblique
        };
        let (u, m) = if vertical {
            ([0.0; 2], 0.0)
        } else {
            ([delta[0] / length, delta[1] / length], delta[2] / length)
        };
        Some(Leg { from, to, u, length, lean: contact.lean(m), lie, class })
    }

    /// For a point within reach of the move's line: its place along the move, its squared distance
    /// across, its half chord, and where on the line the cutter is lowest over it.
    #[inline(always)]
    pub fn lowest<C: Contact>(
        &self,
        contact: &C,
        reach: f64,
        x: f64,
        y: f64,
    ) -> Option<(f64, f64, f64, f64)> {
        let (dx, dy) = (x - self.from[0], y - self.from[1]);
        let s = self.u[0] * dx + self.u[1] * dy;
        let d = self.u[0] * dy - self.u[1] * dx;
        let d2 = d * d;
        let left = reach * reach - d2;
        if left < 0.0 {
            return None;
        }
        let q = left.sqrt();
        Some((s, d2, q, s + contact.slide(d2, q, &self.lean)))
    }

    /// Whether this move goes on to lower a point that the cutter covers at its start.
    #[inline(always)]
    pub fn takes<C: Contact>(&self, contact: &C, reach: f64, x: f64, y: f64) -> bool {
        let moves = matches!(self.lie, Lie::Along(_) | Lie::Oblique);
        moves && self.lowest(contact, reach, x, y).is_some_and(|(.., lowest)| lowest > OVERLAP_MM)
    }
}
