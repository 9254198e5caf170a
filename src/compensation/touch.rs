//! Stretches of a row of cutter locations that rest on a plane, or on an edge.
//!
//! With s concave, z + s over a face is concave: its maximum is the point whose slope the cutter has, if that
//! lies on the face, else it is on an edge. So a row rests on a plane where that point, shifted along with the
//! axis, crosses the face, and on an edge where the cutter's slopes there lie between those of its faces.

use super::facets::{Face, Facets};
use super::meridian::Meridian;
use super::profile::REACH_MM;
use super::ridges::{Ridge, down, up};
use super::weld::SAME_MM;
use std::ops::Range;

/// Positions of a row that are held against an edge at once.
const RUN: usize = 16;

/// Positions of one row, and the cutter's height at each so far.
pub(super) struct Stretch<'a> {
    pub(super) x_mm: &'a [f64],
    pub(super) y_mm: f64,
    pub(super) pitch_mm: f64,
    pub(super) now: &'a mut [f64],
}

impl Stretch<'_> {
    /// Positions between two places.
    fn between(&self, [low_mm, high_mm]: [f64; 2]) -> Range<usize> {
        let [low, high] = [low_mm, high_mm].map(|mm| (mm - self.x_mm[0]) / self.pitch_mm);
        if !(high >= 0.0 && low < self.x_mm.len() as f64) {
            return 0..0;
        }
        let first = low as usize;
        let first = if low > first as f64 { first + 1 } else { first };
        let end = (high as usize).saturating_add(1).min(self.x_mm.len());
        first.min(end)..end
    }
}

/// The point of the cutter that has a plane's slope.
#[derive(Debug)]
pub(super) struct Rest {
    /// Less the axis.
    contact: [f64; 2],
    /// z of the cutter's lowest point above the plane's height at the axis.
    above: f64,
}

impl Rest {
    pub(super) fn new(face: &Face, meridian: &Meridian) -> Rest {
        let [gx, gy] = face.gradient;
        let slope = (gx * gx + gy * gy).sqrt();
        let r_mm = meridian.contact_mm(slope);
        let along = if slope > 0.0 { r_mm / slope } else { 0.0 };
        let above = slope * r_mm + meridian.s_mm(r_mm * r_mm).unwrap_or(0.0);
        Rest { contact: [gx * along, gy * along], above }
    }

    /// Lowest and highest place of the axis in x and y with the cutter on the face.
    pub(super) fn places(&self, corners: &[[f64; 3]]) -> [[f64; 2]; 2] {
        [0, 1].map(|axis| {
            let at = corners.iter().map(|corner| corner[axis] - self.contact[axis]);
            at.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], mm| [low.min(mm), high.max(mm)])
        })
    }

    /// Raises a stretch to the plane where its point of contact is on the face.
    pub(super) fn raise(&self, face: &Face, corners: &[[f64; 3]], stretch: &mut Stretch) {
        let y_mm = stretch.y_mm + self.contact[1];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut a = &corners[corners.len() - 1];
        for b in corners {
            if (a[1] <= y_mm) != (b[1] <= y_mm) {
                let x_mm = a[0] + (y_mm - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
                (low, high) = (low.min(x_mm), high.max(x_mm));
            }
            a = b;
        }
        if low > high {
            return;
        }
        let range = stretch.between([low - self.contact[0], high - self.contact[0]]);
        let [gx, gy] = face.gradient;
        let first = &corners[0];
        let base = first[2] + gy * (stretch.y_mm - first[1]) + self.above;
        for (now, x_mm) in stretch.now[range.clone()].iter_mut().zip(&stretch.x_mm[range]) {
            let z_mm = base + gx * (x_mm - first[0]);
            *now = if z_mm > *now { z_mm } else { *now };
        }
    }
}

/// Where the axis may stand with the cutter on an edge, in mm from its first end along the edge and to the
/// right of it.
#[derive(Debug)]
pub(super) struct Band {
    along: [f32; 2],
    right: [f32; 2],
}

/// An edge in its own directions.
struct Edge<'a> {
    a: &'a [f64; 3],
    ux: f64,
    uy: f64,
    length: f64,
    slope: f64,
    top: f64,
}

impl<'a> Edge<'a> {
    fn of(ridge: &Ridge, corners: &'a [[f64; 3]]) -> Edge<'a> {
        let (a, b) = (&corners[ridge.a as usize], &corners[ridge.b as usize]);
        let top = a[2].max(b[2]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = (dx * dx + dy * dy).sqrt();
        if length == 0.0 {
            return Edge { a, ux: 1.0, uy: 0.0, length, slope: 0.0, top };
        }
        Edge { a, ux: dx / length, uy: dy / length, length, slope: (b[2] - a[2]) / length, top }
    }
}

impl Band {
    pub(super) fn new(ridge: &Ridge, facets: &Facets, meridian: &Meridian) -> Band {
        let slopes = [ridge.along, ridge.across].map(|range| range.map(f64::from));
        let [along, left] = meridian.offsets(slopes);
        let length = Edge::of(ridge, &facets.corners).length;
        // The axis less the contact, which lies between 0 and the length.
        Band {
            along: [down(-along[1] - SAME_MM), up(length - along[0] + SAME_MM)],
            right: [down(left[0] - SAME_MM), up(left[1] + SAME_MM)],
        }
    }

    /// Lowest and highest place of the axis in x and y.
    pub(super) fn places(&self, ridge: &Ridge, facets: &Facets) -> [[f64; 2]; 2] {
        let edge = Edge::of(ridge, &facets.corners);
        let bounds = |origin: f64, along: f64, right: f64| {
            let ends = |by: f64, range: &[f32; 2]| {
                let [p, q] = range.map(|mm| f64::from(mm) * by);
                [p.min(q), p.max(q)]
            };
            let (along, right) = (ends(along, &self.along), ends(right, &self.right));
            [0, 1].map(|end| origin + along[end] + right[end])
        };
        [bounds(edge.a[0], edge.ux, edge.uy), bounds(edge.a[1], edge.uy, -edge.ux)]
    }

    /// Raises the part of a stretch that may rest on the edge.
    pub(super) fn raise(&self, ridge: &Ridge, facets: &Facets, meridian: &Meridian, stretch: &mut Stretch) {
        let edge = Edge::of(ridge, &facets.corners);
        let dy = stretch.y_mm - edge.a[1];
        let along = part(edge.ux, dy * edge.uy, &self.along);
        let right = part(edge.uy, -dy * edge.ux, &self.right);
        let x_mm = [along[0].max(right[0]) + edge.a[0], along[1].min(right[1]) + edge.a[0]];
        let range = stretch.between(x_mm);
        let one_run = range.len() <= RUN;
        for start in range.clone().step_by(RUN) {
            let run = start..(start + RUN).min(range.end);
            let (x_mm, now) = (&stretch.x_mm[run.clone()], &mut stretch.now[run]);
            if one_run || edge.may_raise(dy, meridian, x_mm, now) {
                edge.raise(dy, meridian, x_mm, now);
            }
        }
    }
}

/// Where `by` x + `more` lies in a range.
fn part(by: f64, more: f64, range: &[f32; 2]) -> [f64; 2] {
    let [low, high] = range.map(|mm| f64::from(mm) - more);
    if by > 0.0 {
        [low / by, high / by]
    } else if by < 0.0 {
        [high / by, low / by]
    } else if low <= 0.0 && high >= 0.0 {
        [f64::NEG_INFINITY, f64::INFINITY]
    } else {
        [f64::INFINITY, f64::NEG_INFINITY]
    }
}

impl Edge<'_> {
    /// Foot of the axis along the edge, from its first end, and distance to the right of it.
    fn foot(&self, dy: f64, x_mm: f64) -> (f64, f64) {
        let dx = x_mm - self.a[0];
        (dx * self.ux + dy * self.uy, dx * self.uy - dy * self.ux)
    }

    /// False where no position of a run can be raised.
    fn may_raise(&self, dy: f64, meridian: &Meridian, x_mm: &[f64], now: &[f64]) -> bool {
        let (first, last) = (self.foot(dy, x_mm[0]), self.foot(dy, x_mm[x_mm.len() - 1]));
        let off = if first.1 * last.1 <= 0.0 { 0.0 } else { first.1.abs().min(last.1.abs()) };
        let past = (first.0.min(last.0) - self.length).max(-first.0.max(last.0)).max(0.0);
        let Some(s_mm) = meridian.s_mm(off * off + past * past) else { return false };
        let least = now.iter().fold(f64::INFINITY, |least, &now| if now < least { now } else { least });
        self.top + s_mm > least
    }

    fn raise(&self, dy: f64, meridian: &Meridian, x_mm: &[f64], now: &mut [f64]) {
        let reach = meridian.reach_mm();
        let most = (reach + REACH_MM) * (reach + REACH_MM);
        if meridian.is_ball() {
            // Cut along the line, the ball is a circle.
            let sine = self.slope / (1.0 + self.slope * self.slope).sqrt();
            for (x_mm, now) in x_mm.iter().zip(now) {
                let (foot, off) = self.foot(dy, *x_mm);
                let left = reach * reach - off * off;
                let u = (left.max(0.0).sqrt() * sine).min(self.length - foot).max(-foot);
                let z_mm = self.a[2] + self.slope * (foot + u) + (left - u * u).max(0.0).sqrt() - reach;
                *now = if off * off + u * u <= most && z_mm > *now { z_mm } else { *now };
            }
        } else if meridian.is_disc() {
            let way = if self.slope == 0.0 { 0.0 } else { self.slope.signum() };
            for (x_mm, now) in x_mm.iter().zip(now) {
                let (foot, off) = self.foot(dy, *x_mm);
                let left = reach * reach - off * off;
                let u = (left.max(0.0).sqrt() * way).min(self.length - foot).max(-foot);
                let z_mm = self.a[2] + self.slope * (foot + u);
                *now = if off * off + u * u <= most && z_mm > *now { z_mm } else { *now };
            }
        } else {
            for (x_mm, now) in x_mm.iter().zip(now) {
                let (foot, off) = self.foot(dy, *x_mm);
                *now = self.height(foot, off * off, meridian, *now);
            }
        }
    }

    /// The cutter's height on the edge with its axis off it by a distance (squared), or `now` where that is higher.
    fn height(&self, foot: f64, off2: f64, meridian: &Meridian, now: f64) -> f64 {
        let reach = meridian.reach_mm();
        let half = (reach * reach - off2).max(0.0).sqrt();
        let (low, high) = ((-foot).max(-half), (self.length - foot).min(half));
        let at = |u: f64, rise: f64| {
            let s_mm = meridian.s_mm(off2 + u * u).unwrap_or(f64::NEG_INFINITY);
            self.a[2] + self.slope * foot + rise + s_mm
        };
        // Nowhere higher than nearest to the axis but for the edge's own rise.
        let rises =
            |low: f64, high: f64| at(0f64.clamp(low, high), (self.slope * low).max(self.slope * high)) > now;
        let u = if low > high {
            // An end that lies on the cutter's rim but for rounding, or out of reach.
            if foot < 0.0 { -foot } else { self.length - foot }
        } else if !rises(low, high) {
            return now;
        } else if self.slope < 0.0 {
            // Mirrored where the edge falls.
            -meridian.along_mm(off2, -self.slope, -high, -low)
        } else {
            meridian.along_mm(off2, self.slope, low, high)
        };
        at(u, self.slope * u).max(now)
    }
}
