//! The exact drop of a cutter on planar faces, where samples alone would let it fall too far.
//!
//! Samples miss what stands between them: on a ridge or a step the true surface is higher than
//! any of them, and a position from samples gouges by up to some um. Here the cutter is dropped on
//! the faces themselves, in f64, at every position that its bound says a face could raise. With s
//! concave, z + s over a face is concave: its maximum is the point whose slope the profile has, if
//! that lies on the face, else it is on an edge.

use super::Profile;
use crate::cutter::Shape;
use crate::grid::{Heights, Window};
use rayon::prelude::*;

/// Rows that are lifted together.
const ROWS: usize = 32;

/// Raises cutter locations on samples to the exact drop on convex faces: `outlines_mm` are their
/// corners, counter-clockwise seen from above, in the frame of the samples and with their datum.
/// Row k of `cl` stands at row `cl.window.row + k every` of the samples.
///
/// What comes out is the higher of the two: never below the drop on these faces by more than
/// the rounding to f32, and nowhere above what it was where that was higher.
pub fn lift(cl: &mut Heights, every: usize, profile: &Profile, outlines_mm: &[Vec<[f64; 3]>]) {
    let window = cl.window;
    let reach_mm = profile.radius_mm();
    let step_mm = profile.step_mm();
    let faces: Vec<Face> = outlines_mm.iter().filter_map(|outline| Face::new(outline, profile)).collect();
    if window.columns == 0 {
        return;
    }
    cl.z_mm.par_chunks_mut(ROWS * window.columns).enumerate().for_each(|(chunk, z_mm)| {
        let y_of = |k: usize| ((window.row + ((chunk * ROWS + k) * every) as i64) as f64 + 0.5) * step_mm;
        let rows = z_mm.len() / window.columns;
        let (low, high) = (y_of(0) - reach_mm, y_of(rows - 1) + reach_mm);
        for face in faces.iter().filter(|face| face.low[1] <= high && face.high[1] >= low) {
            for (k, z_mm) in z_mm.chunks_exact_mut(window.columns).enumerate() {
                face.lift_row(profile, &window, y_of(k), z_mm);
            }
        }
    });
}

struct Face<'a> {
    corners: &'a [[f64; 3]],
    low: [f64; 3],
    high: [f64; 3],
    /// None for a vertical one, which is its edges.
    plane: Option<Plane>,
}

/// z = gradient . p + offset, and the point of the cutter that has its slope.
struct Plane {
    gradient: [f64; 2],
    offset: f64,
    /// The contact less the axis.
    contact: [f64; 2],
    /// z of the cutter's lowest point above the plane's height at the axis.
    above: f64,
}

impl Face<'_> {
    fn new<'a>(corners: &'a [[f64; 3]], profile: &Profile) -> Option<Face<'a>> {
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
            let r_mm = contact_radius_mm(profile, slope);
            let along = if slope > 0.0 { r_mm / slope } else { 0.0 };
            let contact = gradient.map(|g| g * along);
            let above = slope * r_mm + profile.s_mm(r_mm).unwrap_or(0.0);
            Plane { gradient, offset, contact, above }
        });
        Some(Face { corners, low, high, plane })
    }

    fn lift_row(&self, profile: &Profile, window: &Window, y_mm: f64, z_mm: &mut [f32]) {
        let (reach_mm, step_mm) = (profile.radius_mm(), profile.step_mm());
        let beside_mm = (self.low[1] - y_mm).max(y_mm - self.high[1]).max(0.0);
        if beside_mm > reach_mm {
            return;
        }
        let half_mm = (reach_mm * reach_mm - beside_mm * beside_mm).sqrt();
        let column = |x_mm: f64| x_mm / step_mm - 0.5 - window.column as f64;
        let first = column(self.low[0] - half_mm).floor().max(0.0) as usize;
        let end = ((column(self.high[0] + half_mm).ceil() + 1.0).max(0.0) as usize).min(z_mm.len());
        for (i, z_mm) in z_mm.iter_mut().enumerate().take(end).skip(first) {
            let x_mm = ((window.column + i as i64) as f64 + 0.5) * step_mm;
            let now = if z_mm.is_nan() { f64::NEG_INFINITY } else { f64::from(*z_mm) };
            let aside_mm = (self.low[0] - x_mm).max(x_mm - self.high[0]).max(0.0);
            let Some(s_mm) = profile.s_mm(aside_mm.hypot(beside_mm)) else { continue };
            if self.high[2] + s_mm <= now {
                continue;
            }
            let drop = self.drop([x_mm, y_mm], profile, now);
            if drop > now {
                *z_mm = drop as f32;
            }
        }
    }

    /// The height of the cutter on this face, as far as it is above `now`.
    fn drop(&self, axis: [f64; 2], profile: &Profile, now: f64) -> f64 {
        if let Some(plane) = &self.plane {
            let z = plane.gradient[0] * axis[0] + plane.gradient[1] * axis[1] + plane.offset + plane.above;
            if z <= now {
                return now;
            }
            if self.covers([axis[0] + plane.contact[0], axis[1] + plane.contact[1]]) {
                return z;
            }
        }
        let mut best = now;
        for (i, a) in self.corners.iter().enumerate() {
            let b = &self.corners[(i + 1) % self.corners.len()];
            best = best.max(drop_on_edge(a, b, axis, profile, best));
        }
        best
    }

    /// Whether a point lies over the face or on its edge, whichever way round its corners go.
    fn covers(&self, p: [f64; 2]) -> bool {
        let (mut left, mut right) = (false, false);
        for (i, a) in self.corners.iter().enumerate() {
            let b = &self.corners[(i + 1) % self.corners.len()];
            let side = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
            left |= side > 0.0;
            right |= side < 0.0;
        }
        !(left && right)
    }
}

/// Distance from the axis at which the profile has this slope.
fn contact_radius_mm(profile: &Profile, slope: f64) -> f64 {
    if slope <= 0.0 {
        return 0.0;
    }
    let on_ball = slope / (1.0 + slope * slope).sqrt();
    let radius_mm = profile.shape().radius_mm();
    let r_mm = match profile.shape() {
        Shape::Ball { .. } => radius_mm * on_ball,
        Shape::Flat { .. } => radius_mm,
        Shape::Bull { corner_radius_mm, .. } => radius_mm - corner_radius_mm + corner_radius_mm * on_ball,
        Shape::Vee { included_angle_deg, tip_diameter_mm, .. } => {
            let cone = 1.0 / (0.5 * included_angle_deg).to_radians().tan();
            if slope < cone { 0.5 * tip_diameter_mm } else { radius_mm }
        }
        Shape::Taper { tip_diameter_mm, half_angle_deg, .. } => {
            let cone = 1.0 / half_angle_deg.to_radians().tan();
            if slope < cone { (0.5 * tip_diameter_mm * on_ball).min(radius_mm) } else { radius_mm }
        }
    };
    profile.radius_mm() - radius_mm + r_mm
}

/// The height of the cutter on one edge, as far as it is above `now`.
fn drop_on_edge(a: &[f64; 3], b: &[f64; 3], axis: [f64; 2], profile: &Profile, now: f64) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = dx.hypot(dy);
    let reach = profile.radius_mm();
    let (ax, ay) = (axis[0] - a[0], axis[1] - a[1]);
    let on = |distance: f64, z: f64| profile.s_mm(distance).map_or(now, |s| z + s);
    if length < 1e-12 {
        return on(ax.hypot(ay), a[2].max(b[2]));
    }
    let (ux, uy) = (dx / length, dy / length);
    let (foot, off) = (ax * ux + ay * uy, (ax * uy - ay * ux).abs());
    if off > reach {
        return now;
    }
    let half = (reach * reach - off * off).sqrt();
    let (low, high) = ((foot - half).max(0.0), (foot + half).min(length));
    if low > high {
        // An end that lies on the cutter's rim but for rounding.
        return on(ax.hypot(ay), a[2]).max(on((ax - dx).hypot(ay - dy), b[2]));
    }
    let slope = (b[2] - a[2]) / length;
    let z = |t: f64| a[2] + slope * t;
    let nearest = foot.clamp(low, high) - foot;
    let Some(most) = profile.s_mm(off.hypot(nearest)) else { return now };
    if z(low).max(z(high)) + most <= now {
        return now;
    }
    let at = |t: f64| on(off.hypot(t - foot), z(t));
    if profile.is_ball() {
        // Cut along the edge, the ball is a circle of radius `half`.
        return at((foot + half * slope / (1.0 + slope * slope).sqrt()).clamp(low, high));
    }
    // Concave in t: thirds close in on the maximum.
    let (mut low, mut high) = (low, high);
    let mut best = at(low).max(at(high));
    for _ in 0..48 {
        let third = (high - low) / 3.0;
        let (p, q) = (low + third, high - third);
        let (zp, zq) = (at(p), at(q));
        best = best.max(zp).max(zq);
        if zp < zq {
            low = p;
        } else {
            high = q;
        }
    }
    best
}
