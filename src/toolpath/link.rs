//! Links of a zigzag that stay down, only where that is proved safe.

use super::envelope::Cutter;
use super::strip::Strip;
use super::{GridPoint, Site};

/// Longer ways than this many stepovers are travelled on the clearance plane.
pub(super) const LONGEST_STEPOVERS: f64 = 4.0;

/// Height in units of a level link from one place to another (along, across, units), or None where
/// the way is too long, too high to be worth it, or leads past what is known.
pub(super) fn level(
    site: &Site,
    cutter: &Cutter,
    strip: &Strip,
    from: GridPoint,
    to: GridPoint,
    leave_mm: f64,
    longest_mm: f64,
) -> Option<i32> {
    let place = |p: GridPoint| [f64::from(p[0]) * site.unit_mm, f64::from(p[1]) * site.unit_mm];
    let (a, b) = (place(from), place(to));
    if (b[0] - a[0]).hypot(b[1] - a[1]) > longest_mm {
        return None;
    }
    let lowest_mm = cutter.straight(strip, a, b)? + leave_mm;
    let z = site.unit_above(lowest_mm).max(from[2]).max(to[2]);
    (z <= site.unit_above(site.top_allowance_mm)).then_some(z)
}
