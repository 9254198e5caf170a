//! A strip made ready once for all that is asked about it.

use super::envelope::Cutter;
use super::strip::Strip;
use crate::compensation::{Faces, Places};

/// What a cutter meets on a strip.
pub(super) struct Ground<'a> {
    pub(super) strip: &'a Strip,
    /// Its faces as the widened cutter meets them.
    pub(super) wide: Faces<'a>,
    places: Places<'a>,
}

impl<'a> Ground<'a> {
    pub(super) fn new(strip: &'a Strip, cutter: &Cutter) -> Ground<'a> {
        let step_mm = cutter.exact.profile().step_mm();
        let (wide, places) = rayon::join(|| cutter.faces(strip), || Places::new(&strip.heights, step_mm));
        Ground { strip, wide, places }
    }

    /// Lowest height in mm at which the cutter may go straight from one place to another (along,
    /// across); None where nothing is in reach, so that nothing is known of what stands there.
    pub(super) fn straight(&self, cutter: &Cutter, from_mm: [f64; 2], to_mm: [f64; 2]) -> Option<f64> {
        let (du, dv) = (to_mm[0] - from_mm[0], to_mm[1] - from_mm[1]);
        let steps = (du.hypot(dv) / cutter.pitch_mm).ceil().max(1.0);
        let mut near = None;
        let mut highest = f64::NEG_INFINITY;
        for i in 0..=steps as usize {
            let t = i as f64 / steps;
            let place = [from_mm[0] + t * du, from_mm[1] + t * dv];
            let sampled = self.places.drop_mm(cutter.wide.profile(), place, &mut near);
            if sampled.is_nan() {
                return None;
            }
            highest = highest.max(self.wide.lift_point(place, sampled));
        }
        Some(highest)
    }
}
