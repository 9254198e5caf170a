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
    let lowest_mm = ground.straight(cutter, place(site, from), place(site, to))? + leave_mm;
    let z = site.unit_above(lowest_mm).max(from[2]).max(to[2]);
    (z <= site.unit_above(site.top_allowance_mm)).then_some(z)
}

/// [`level`] where no strip is held: reads what the link's cutter can meet. Both ends are points of the coarsest grid of
/// the job, on which it is decided whether the way is too high.
pub(super) fn elsewhere(
    site: &Site,
    cutter: &Cutter,
    along: Axis,
    from: GridPoint,
    to: GridPoint,
    leave_mm: f64,
) -> Result<Option<i32>, Error> {
    let (common, times) = (site.common(), site.times());
    let [a, b] = [from, to].map(|p| place(&common, [p[0] / times, p[1] / times, 0]));
    let reach_mm = cutter.reach_mm;
    let low_mm = [0, 1].map(|axis| a[axis].min(b[axis]) - reach_mm);
    let high_mm = [0, 1].map(|axis| a[axis].max(b[axis]) + reach_mm);
    let strip = Strip::around(site.surface, along, low_mm, high_mm)?;
    let Some(lowest_mm) = Ground::new(&strip, cutter).straight(cutter, a, b) else { return Ok(None) };
    let lowest_mm = lowest_mm + leave_mm;
    let free = common.unit_above(lowest_mm) <= common.unit_above(site.top_allowance_mm);
    Ok(free.then(|| site.unit_above(lowest_mm).max(from[2]).max(to[2])))
}

/// Along and across in mm.
fn place(site: &Site, at: GridPoint) -> [f64; 2] {
    [f64::from(at[0]) * site.unit_mm, f64::from(at[1]) * site.unit_mm]
}
