//! Links of a zigzag that stay down, only where that is proved safe.

use super::envelope::Cutter;
use super::ground::Ground;
use super::strip::Strip;
use super::{Axis, Error, GridPoint, Site};

/// Longer ways than this many stepovers are travelled on the clearance plane.
pub(super) const LONGEST_STEPOVERS: f64 = 4.0;

/// Height in units of a level link from one place to another (along, across, units), or None where
/// the way is too high to be worth it, or leads past what is known.
pub(super) fn level(
    site: &Site,
    cutter: &Cutter,
    ground: &Ground,
    from: GridPoint,
    to: GridPoint,
    leave_mm: f64,
) -> Option<i32> {
    let place = |p: GridPoint| [f64::from(p[0]) * site.unit_mm, f64::from(p[1]) * site.unit_mm];
    let lowest_mm = ground.straight(cutter, place(from), place(to))? + leave_mm;
    let z = site.unit_above(lowest_mm).max(from[2]).max(to[2]);
    (z <= site.unit_above(site.top_allowance_mm)).then_some(z)
}

/// [`level`] where no strip is held: reads what the link's cutter can meet.
pub(super) fn elsewhere(
    site: &Site,
    cutter: &Cutter,
    along: Axis,
    from: GridPoint,
    to: GridPoint,
    leave_mm: f64,
) -> Result<Option<i32>, Error> {
    let end = |pick: fn(i32, i32) -> i32, axis: usize| f64::from(pick(from[axis], to[axis])) * site.unit_mm;
    let low_mm = [0, 1].map(|axis| end(Ord::min, axis));
    let high_mm = [0, 1].map(|axis| end(Ord::max, axis));
    let reach_mm = cutter.reach_mm;
    let strip =
        Strip::around(site.surface, along, low_mm.map(|mm| mm - reach_mm), high_mm.map(|mm| mm + reach_mm))?;
    Ok(level(site, cutter, &Ground::new(&strip, cutter), from, to, leave_mm))
}
