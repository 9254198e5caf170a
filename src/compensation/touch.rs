//! The drop of a cutter on one planar face.
//!
//! With s concave, z + s over a face is concave: its maximum is the point whose slope the cutter has, if that
//! lies on the face, else it is on an edge that this point lies beyond.

use super::meridian::Meridian;

/// A tangent steeper than so many reaches a reach stands near the rim, where rounding makes it no bound.
const STEEPEST: f64 = 100.0;

#[derive(Debug)]
pub(super) struct Face<'a> {
    corners: &'a [[f64; 3]],
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
    /// None for a vertical one, which is its edges.
    plane: Option<Plane>,
}

/// z = gradient . p + offset, and the point of the cutter that has its slope.
#[derive(Debug)]
struct Plane {
    gradient: [f64; 2],
    offset: f64,
    /// The contact less the axis.
    contact: [f64; 2],
    /// z of the cutter's lowest point above the plane's height at the axis.
    above: f64,
    /// Mean of the corners, and how far the farthest of them lies from it.
    middle: [f64; 2],
    around: f64,
    /// 1 if the corners go round counter-clockwise seen from above, else -1.
    turn: f64,
}

impl<'a> Face<'a> {
    pub(super) fn new(corners: &'a [[f64; 3]], meridian: &Meridian) -> Option<Face<'a>> {
        let first = *corners.first()?;
        let (mut low, mut high) = (first, first);
        for corner in corners {
            for axis in 0..3 {
                low[axis] = low[axis].min(corner[axis]);
                high[axis] = high[axis].max(corner[axis]);
            }
        }
        // Newell's normal, which bears corners on a line.
        let mut normal = [0.0; 3];
        for (i, a) in corners.iter().enumerate() {
            let b = &corners[(i + 1) % corners.len()];
            let (a, b) = ([0, 1, 2].map(|k| a[k] - first[k]), [0, 1, 2].map(|k| b[k] - first[k]));
            for (k, n) in normal.iter_mut().enumerate() {
                let (p, q) = ((k + 1) % 3, (k + 2) % 3);
                *n += a[p] * b[q] - a[q] * b[p];
            }
        }
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        let plane = (normal[2].abs() > 1e-9 * length).then(|| {
            let gradient = [-normal[0] / normal[2], -normal[1] / normal[2]];
            let offset = first[2] - gradient[0] * first[0] - gradient[1] * first[1];
            let slope = gradient[0].hypot(gradient[1]);
            let r_mm = meridian.contact_mm(slope);
            let along = if slope > 0.0 { r_mm / slope } else { 0.0 };
            let contact = gradient.map(|g| g * along);
            let above = slope * r_mm + meridian.s_mm(r_mm * r_mm).unwrap_or(0.0);
            let middle = [0, 1].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / corners.len() as f64);
            let around = corners.iter().map(|c| (c[0] - middle[0]).hypot(c[1] - middle[1]));
            let around = around.fold(0.0, f64::max);
            Plane { gradient, offset, contact, above, middle, around, turn: normal[2].signum() }
        });
        Some(Face { corners, low, high, plane })
    }

    /// False where no position of a stretch of a row, x_mm(i) for the heights in `now`, can be raised above
    /// what it has now.
    pub(super) fn may_raise(
        &self,
        meridian: &Meridian,
        y_mm: f64,
        x_mm: impl Fn(usize) -> f64,
        now: &[f64],
    ) -> bool {
        let (first_mm, last_mm) = (x_mm(0), x_mm(now.len() - 1));
        let beside = (self.low[1] - y_mm).max(y_mm - self.high[1]).max(0.0);
        let aside = (self.low[0] - last_mm).max(first_mm - self.high[0]).max(0.0);
        let Some(s) = meridian.s_mm(beside * beside + aside * aside) else { return false };
        let most = self.high[2] + s;
        if now.iter().all(|now| *now >= most) {
            return false;
        }
        let Some(plane) = &self.plane else { return true };
        let middle = [0.5 * (first_mm + last_mm), y_mm];
        let most = plane.bound(middle, 0.5 * (last_mm - first_mm), meridian);
        now.iter().enumerate().any(|(i, now)| *now < most + plane.gradient[0] * (x_mm(i) - middle[0]))
    }

    /// The cutter's height on this face at a place of its axis, or `now` where that is higher.
    pub(super) fn drop_at(&self, axis: [f64; 2], meridian: &Meridian, now: f64) -> f64 {
        let beside = (self.low[1] - axis[1]).max(axis[1] - self.high[1]).max(0.0);
        let aside = (self.low[0] - axis[0]).max(axis[0] - self.high[0]).max(0.0);
        let Some(s) = meridian.s_mm(aside * aside + beside * beside) else { return now };
        if self.high[2] + s <= now {
            return now;
        }
        let edges = || (0..self.corners.len()).map(|i| [i, (i + 1) % self.corners.len()]);
        let mut best = now;
        let Some(plane) = &self.plane else {
            for [i, j] in edges() {
                best = on_edge(&self.corners[i], &self.corners[j], axis, meridian, best);
            }
            return best;
        };
        if plane.bound(axis, 0.0, meridian) <= now {
            return now;
        }
        let p = [axis[0] + plane.contact[0], axis[1] + plane.contact[1]];
        let mut covers = true;
        for [i, j] in edges() {
            let (a, b) = (&self.corners[i], &self.corners[j]);
            let side = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
            // From any other edge the heights rise towards the contact, through the face.
            if side * plane.turn < 0.0 {
                covers = false;
                best = on_edge(a, b, axis, meridian, best);
            }
        }
        if covers { plane.at(axis) + plane.above } else { best }
    }
}

impl Plane {
    fn at(&self, p: [f64; 2]) -> f64 {
        self.gradient[0] * p[0] + self.gradient[1] * p[1] + self.offset
    }

    /// z + s over the face with the axis up to `half` along x from `axis`: what it exceeds nowhere once the
    /// plane's own rise with the axis is taken off.
    ///
    /// It lies below the plane's contact, and below its tangent at the face's middle, from which it falls by
    /// at least half the cutter's least curvature times the square of the distance.
    fn bound(&self, axis: [f64; 2], half: f64, meridian: &Meridian) -> f64 {
        let most = self.at(axis) + self.above;
        let away = [self.middle[0] - axis[0], self.middle[1] - axis[1]];
        let squared = away[0] * away[0] + away[1] * away[1];
        let Some(s) = meridian.s_mm(squared) else { return most };
        let Some(per_mm) = meridian.slope_per_mm(squared) else { return most };
        if per_mm * meridian.reach_mm() >= STEEPEST {
            return most;
        }
        let rises = [0, 1].map(|k| self.gradient[k] - per_mm * away[k]);
        let rise = (rises[0] * rises[0] + rises[1] * rises[1]).sqrt();
        let curvature = meridian.least_curvature();
        let farthest = self.around + half;
        let distance = if rise < curvature * farthest { rise / curvature } else { farthest };
        most.min(self.at(self.middle) + s + (rise - 0.5 * curvature * distance) * distance)
    }
}

/// The cutter's height on an edge, or `now` where that is higher.
fn on_edge(a: &[f64; 3], b: &[f64; 3], axis: [f64; 2], meridian: &Meridian, now: f64) -> f64 {
    if a[2].max(b[2]) <= now {
        return now;
    }
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = (dx * dx + dy * dy).sqrt();
    let reach = meridian.reach_mm();
    let (ax, ay) = (axis[0] - a[0], axis[1] - a[1]);
    let on = |squared: f64, z: f64| meridian.s_mm(squared).map_or(now, |s| (z + s).max(now));
    if length < 1e-12 {
        return on(ax * ax + ay * ay, a[2].max(b[2]));
    }
    let (ux, uy) = (dx / length, dy / length);
    let (foot, off) = (ax * ux + ay * uy, ax * uy - ay * ux);
    let off2 = off * off;
    if off2 > reach * reach {
        // A line along the rim may lie past it by rounding, with an end or all of it.
        return on(ax * ax + ay * ay, a[2]).max(on((ax - dx).powi(2) + (ay - dy).powi(2), b[2]));
    }
    let half = (reach * reach - off2).sqrt();
    let (low, high) = ((-foot).max(-half), (length - foot).min(half));
    if low > high {
        // An end that lies on the cutter's rim but for rounding.
        return on(ax * ax + ay * ay, a[2]).max(on((ax - dx).powi(2) + (ay - dy).powi(2), b[2]));
    }
    let slope = (b[2] - a[2]) / length;
    let at_foot = a[2] + slope * foot;
    let nearest = 0f64.clamp(low, high);
    if on(off2 + nearest * nearest, at_foot + (slope * low).max(slope * high)) <= now {
        return now;
    }
    // Mirrored where the edge falls.
    let u = if slope < 0.0 {
        -meridian.along_mm(off2, -slope, -high, -low)
    } else {
        meridian.along_mm(off2, slope, low, high)
    };
    on(off2 + u * u, at_foot + slope * u)
}
