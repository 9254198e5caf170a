//! The outline of a cutter from its axis to its rim as a flat, an arc and a line, for the exact
//! drop: where it meets a straight edge is then a closed form, or a few Newton steps on a torus.

use super::Profile;
use super::profile::REACH_MM;
use crate::cutter::Shape;

/// A step this small against the arc's radius is the last one: Newton doubles the digits.
const LAST_STEP: f64 = 1e-4;

/// Steps at most; bisection alone needs no more to come to the rounding of a double.
const MOST_STEPS: usize = 60;

/// Slopes that differ by so small a part may be one.
const ROUNDING: f64 = 1e-9;

/// All lengths in mm, allowance included.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meridian {
    reach: f64,
    /// Radius of the flat bottom.
    flat: f64,
    /// Radius of the arc that follows.
    arc: f64,
    /// Distance from the axis at which the arc ends, and the height there.
    tangent: f64,
    risen: f64,
    /// Slope of the line that follows; none where the arc ends at the rim.
    cone: Option<f64>,
}

impl Meridian {
    pub(super) fn new(profile: &Profile) -> Meridian {
        let reach = profile.radius_mm();
        let flat = profile.plateau_mm();
        let (arc, tangent, risen, cone) = match profile.shape() {
            Shape::Flat { .. } => (0.0, reach, 0.0, None),
            Shape::Ball { diameter_mm } => (0.5 * diameter_mm, reach, 0.5 * diameter_mm, None),
            Shape::Bull { corner_radius_mm, .. } => (corner_radius_mm, reach, corner_radius_mm, None),
            Shape::Vee { included_angle_deg, .. } => {
                (0.0, flat, 0.0, Some(1.0 / (0.5 * included_angle_deg).to_radians().tan()))
            }
            Shape::Taper { tip_diameter_mm, half_angle_deg, .. } => {
                let (sin, cos) = half_angle_deg.to_radians().sin_cos();
                let tip = 0.5 * tip_diameter_mm;
                (tip, flat + tip * cos, tip * (1.0 - sin), Some(cos / sin))
            }
        };
        Meridian { reach, flat, arc, tangent, risen, cone }
    }

    pub(super) fn reach_mm(&self) -> f64 {
        self.reach
    }

    /// [`Profile::s_mm`] at a distance whose square is given.
    pub(super) fn s_mm(&self, squared_mm2: f64) -> Option<f64> {
        if squared_mm2 <= self.flat * self.flat {
            return Some(0.0);
        }
        let most = self.reach + REACH_MM;
        if squared_mm2 > most * most || squared_mm2.is_nan() {
            return None;
        }
        if self.flat == 0.0 && squared_mm2 <= self.tangent * self.tangent {
            return Some((self.arc * self.arc - squared_mm2).max(0.0).sqrt() - self.arc);
        }
        let r = squared_mm2.sqrt();
        if r <= self.tangent {
            let d = r - self.flat;
            return Some((self.arc * self.arc - d * d).max(0.0).sqrt() - self.arc);
        }
        // Past the end of the arc, or of the flat, by the rounding of a reach only.
        let Some(cone) = self.cone else { return Some(-self.risen) };
        Some(-self.risen - (r.min(self.reach) - self.tangent) * cone)
    }

    /// Distance from the axis at which the outline has this slope; the rim where it is never so steep.
    pub(super) fn contact_mm(&self, slope: f64) -> f64 {
        if slope <= 0.0 {
            return 0.0;
        }
        match self.cone {
            Some(cone) if slope >= cone => self.reach,
            _ => (self.flat + self.arc * slope / (1.0 + slope * slope).sqrt()).min(self.reach),
        }
    }

    /// Whether it is a half sphere alone.
    pub(super) fn is_ball(&self) -> bool {
        self.flat == 0.0 && self.cone.is_none()
    }

    /// Whether it is a disc alone.
    pub(super) fn is_disc(&self) -> bool {
        self.arc == 0.0 && self.cone.is_none()
    }

    /// Where the cutter, less its axis, has a slope between these, in two directions square to each other: bounds
    /// in the same directions.
    pub(super) fn offsets(&self, slopes: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
        [0, 1].map(|k| {
            let ([low, high], other) = (slopes[k], slopes[1 - k]);
            [-self.farthest(-low, other), self.farthest(high, other)]
        })
    }

    /// How far from the axis in one direction the slope in it is `slope` at most and that across it lies
    /// between these. With k the slope and r the distance, r slope / k, which grows with slope and, but for the
    /// leap of r where a cone begins, falls with k.
    fn farthest(&self, slope: f64, across: [f64; 2]) -> f64 {
        if slope.is_infinite() {
            return self.reach * slope.signum();
        }
        let most = across[0].abs().max(across[1].abs());
        let least =
            if across[0] <= 0.0 && across[1] >= 0.0 { 0.0 } else { across[0].abs().min(across[1].abs()) };
        let squares = [least, most].map(|across| slope * slope + across * across);
        let [shallow, steep] = squares.map(f64::sqrt);
        let round = |k: f64| self.flat / k + self.arc / (1.0 + k * k).sqrt();
        let cone = self.cone.unwrap_or(f64::INFINITY);
        let before = shallow <= cone * (1.0 + ROUNDING);
        let past = steep >= cone * (1.0 - ROUNDING);
        if slope >= 0.0 {
            let before = if before { round(shallow) } else { 0.0 };
            let past = if past { self.reach / shallow.max(cone * (1.0 - ROUNDING)) } else { 0.0 };
            // At no slope the contact is anywhere on the flat.
            let r = slope * before.max(past);
            let most = if steep >= cone * (1.0 - ROUNDING) { self.reach } else { round(steep) * steep };
            if r.is_nan() || slope == 0.0 { self.flat } else { r.min(most) }
        } else {
            let before = if before { round(steep.min(cone)) } else { f64::INFINITY };
            let past = if past { self.reach / steep } else { f64::INFINITY };
            slope * before.min(past)
        }
    }

    /// Where on a line that passes the axis at a distance (squared) and rises by `slope` >= 0 the
    /// cutter's height on it is greatest, u from the foot, between `low` and `high` where the
    /// cutter reaches.
    pub(super) fn along_mm(&self, off2: f64, slope: f64, low: f64, high: f64) -> f64 {
        if slope == 0.0 {
            return 0f64.clamp(low, high);
        }
        let within = |r: f64| (r * r - off2).max(0.0).sqrt();
        let arc_end = within(self.tangent);
        if off2 < self.tangent * self.tangent && self.arc > 0.0 && low < arc_end {
            if self.flat == 0.0 {
                // Cut along the line, the ball is a circle.
                let u = within(self.arc) * slope / (1.0 + slope * slope).sqrt();
                if u <= arc_end || self.cone.is_none() {
                    return u.clamp(low, high);
                }
            } else {
                let start = within(self.flat);
                if high <= start {
                    return high;
                }
                let end = arc_end.min(high);
                let u = self.on_torus(off2, slope, start.max(low), end);
                if u < end || end < arc_end {
                    return u.min(high);
                }
            }
        }
        let u = match self.cone {
            None => arc_end,
            Some(cone) if slope >= cone => f64::INFINITY,
            Some(cone) => arc_end.max((off2 / (cone * cone - slope * slope)).sqrt() * slope),
        };
        u.clamp(low, high)
    }

    /// [`Meridian::along_mm`] on the arc around a flat, between `low` and `high` on it. With d = r - flat and
    /// c = u / r the outline rises along the line by g = c d / sqrt(arc^2 - d^2); solved for its
    /// sine g / sqrt(1 + g^2), which is nearly linear in u.
    fn on_torus(&self, off2: f64, slope: f64, mut low: f64, mut high: f64) -> f64 {
        let wanted = slope / (1.0 + slope * slope).sqrt();
        let at = |u: f64| {
            let r = (off2 + u * u).sqrt();
            let (d, c) = (r - self.flat, u / r);
            let beside = off2 / (r * r);
            let below2 = self.arc * self.arc - d * d * beside;
            if below2 <= 0.0 {
                return (1.0, 0.0);
            }
            let below = below2.sqrt();
            let sine = d * c / below;
            let rise = (c * c + d * beside / r + sine * d * self.flat * c * beside / (r * below)) / below;
            (sine, rise)
        };
        // As if the line passed through the axis.
        let r = self.flat + self.arc * wanted;
        let mut u = (r * r - off2).max(0.0).sqrt().clamp(low, high);
        // Whether `high` is only where the arc or the line ends.
        let mut open = true;
        for _ in 0..MOST_STEPS {
            let (sine, rise) = at(u);
            if sine >= wanted {
                (high, open) = (u, false);
            } else if u >= high {
                return u;
            } else {
                low = u;
            }
            let step = (wanted - sine) / rise;
            if step.abs() <= LAST_STEP * self.arc {
                return (u + step).clamp(low, high);
            }
            if high - low <= LAST_STEP * LAST_STEP * self.arc {
                break;
            }
            let next = u + step;
            u = if next > low && next < high {
                next
            } else if next >= high && open {
                high
            } else {
                0.5 * (low + high)
            };
        }
        u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meets_a_line_where_a_search_meets_it() {
        let cutters = ["ball:0.5", "flat:0.6", "bull:1:0.2", "bull:0.4:0", "vee:60:0.1:0.5", "vee:90:0:0.4"];
        for text in cutters.into_iter().chain(["taper:0.2:10:0.5", "taper:0.1:60:0.8"]) {
            for allowance_mm in [0.0, 0.0047, 0.2] {
                let profile = Profile::new(text.parse().unwrap(), 0.01, allowance_mm).unwrap();
                let meridian = Meridian::new(&profile);
                let reach = meridian.reach_mm();
                for i in 0..=40 {
                    let r = reach * f64::from(i) / 40.0;
                    let (s, want) = (meridian.s_mm(r * r).unwrap(), profile.s_mm(r).unwrap());
                    assert!((s - want).abs() < 1e-7, "{text} {allowance_mm} at {r}: {s} of {want}");
                    let off2 = 0.99 * r * r;
                    let half = (reach * reach - off2).sqrt();
                    for slope in [0.0, 1e-3, 0.1, 0.3, 0.7, 1.7, 2.5, 40.0] {
                        for [from, to] in [[-1.0, 1.0], [-0.9, 0.2], [0.1, 0.4], [0.8, 1.0]] {
                            let (low, high) = (from * half, to * half);
                            let at = |u: f64| profile.s_mm((off2 + u * u).sqrt()).map(|s| s + slope * u);
                            let searched = (0..=2000)
                                .filter_map(|k| at(low + (high - low) * f64::from(k) / 2000.0))
                                .fold(f64::NEG_INFINITY, f64::max);
                            let u = meridian.along_mm(off2, slope, low, high);
                            let found = at(u.clamp(low, high)).unwrap_or(f64::NEG_INFINITY);
                            assert!(
                                found > searched - 1e-8,
                                "{text} {allowance_mm} off {off2} slope {slope} {low}..{high}: {found} at {u}, {searched}"
                            );
                        }
                    }
                }
            }
        }
    }
}
