//! The exact drop of a cutter on planar faces, where samples alone would let it fall too far.
//!
//! Samples miss what stands between them: on a ridge or a step the true surface is higher than
//! any of them, and a position from samples gouges by up to some um. Here the cutter is dropped on
//! the faces themselves, in f64, at every position that its bound says a face could raise. With s
//! concave, z + s over a face is concave: its maximum is the point whose slope the profile has, if
//! that lies on the face, else it is on an edge that this point lies beyond.

use super::{Profile, RowTarget};
use crate::cutter::Shape;
use crate::grid::Heights;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Rows that are lifted together.
const ROWS: usize = 32;

/// Cells of the index to a cutter's radius.
const CELLS: f64 = 2.0;

/// Cells of the index at most; more positions than faces would only look at empty ones.
const MOST_CELLS: f64 = 4e6;

/// Faces over all cells at most, 4 bytes each.
const MOST_MEMBERS: usize = 1 << 25;

/// Raises cutter locations on samples to the exact drop on convex faces: `outlines_mm` are their
/// corners, counter-clockwise seen from above, in the frame of the samples and with their datum.
/// Row k of `cl` stands at row `cl.window.row + k every` of the samples.
///
/// What comes out is the higher of the two: never below the drop on these faces by more than
/// the rounding to f32, and nowhere above what it was where that was higher.
pub fn lift(cl: &mut Heights, every: usize, profile: &Profile, outlines_mm: &[Vec<[f64; 3]>]) {
    let window = cl.window;
    let step_mm = profile.step_mm();
    if window.columns == 0 {
        return;
    }
    let faces = Faces::new(outlines_mm, profile);
    cl.z_mm.par_chunks_mut(ROWS * window.columns).enumerate().for_each(|(chunk, z_mm)| {
        for (k, z_mm) in z_mm.chunks_exact_mut(window.columns).enumerate() {
            let row = window.row + ((chunk * ROWS + k) * every) as i64;
            let target = RowTarget {
                x0_mm: (window.column as f64 + 0.5) * step_mm,
                y_mm: (row as f64 + 0.5) * step_mm,
                count: window.columns,
            };
            faces.lift_row(&target, step_mm, z_mm);
        }
    });
}

/// Convex faces that one cutter may touch, found by place.
#[derive(Debug)]
pub struct Faces<'a> {
    profile: Profile,
    faces: Vec<Face<'a>>,
    low_mm: [f64; 2],
    cell_mm: f64,
    cells: [usize; 2],
    /// Where each cell's faces begin in `members`, row by row, and where the last one's end.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl<'a> Faces<'a> {
    /// Outlines as [`lift`] takes them.
    pub fn new(outlines_mm: &'a [Vec<[f64; 3]>], profile: &Profile) -> Faces<'a> {
        let faces: Vec<Face> = outlines_mm.iter().filter_map(|outline| Face::new(outline, profile)).collect();
        let reach_mm = profile.radius_mm();
        let extreme = |axis: usize, sign: f64| {
            let ends = faces.iter().map(|f| if sign < 0.0 { -f.low[axis] } else { f.high[axis] });
            sign * (ends.fold(f64::NEG_INFINITY, f64::max) + reach_mm)
        };
        let mut all = Faces {
            profile: *profile,
            faces: Vec::new(),
            low_mm: [extreme(0, -1.0), extreme(1, -1.0)],
            cell_mm: reach_mm / CELLS,
            cells: [0; 2],
            starts: vec![0],
            members: Vec::new(),
        };
        if faces.is_empty() {
            return all;
        }
        let size_mm = [0, 1].map(|axis| extreme(axis, 1.0) - all.low_mm[axis]);
        all.cell_mm = all.cell_mm.max((size_mm[0] * size_mm[1] / MOST_CELLS).sqrt());
        loop {
            all.cells = size_mm.map(|mm| (mm / all.cell_mm).floor() as usize + 1);
            let held: usize =
                faces.iter().map(|face| all.span(face).map(|r| r.count()).iter().product::<usize>()).sum();
            // Long slivers have large boxes.
            if held <= MOST_MEMBERS || all.cells == [1, 1] {
                break;
            }
            all.cell_mm *= 2.0;
        }
        // Counted first, so that the index is two flat lists.
        let mut counts = vec![0u32; all.cells[0] * all.cells[1] + 1];
        faces.iter().for_each(|face| all.each_cell(face, |cell| counts[cell + 1] += 1));
        for cell in 1..counts.len() {
            counts[cell] += counts[cell - 1];
        }
        let mut next = counts.clone();
        let mut members = vec![0u32; next[next.len() - 1] as usize];
        for (nth, face) in faces.iter().enumerate() {
            all.each_cell(face, |cell| {
                members[next[cell] as usize] = nth as u32;
                next[cell] += 1;
            });
        }
        Faces { faces, starts: counts, members, ..all }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// The columns and rows of cells from which a cutter can touch a face.
    fn span(&self, face: &Face) -> [RangeInclusive<usize>; 2] {
        let reach_mm = self.profile.radius_mm();
        [0, 1].map(|axis| {
            let cell = |mm: f64| ((mm - self.low_mm[axis]) / self.cell_mm).floor().max(0.0) as usize;
            let last = self.cells[axis] - 1;
            cell(face.low[axis] - reach_mm).min(last)..=cell(face.high[axis] + reach_mm).min(last)
        })
    }

    fn each_cell(&self, face: &Face, mut tell: impl FnMut(usize)) {
        let [columns, rows] = self.span(face);
        for row in rows {
            for column in columns.clone() {
                tell(row * self.cells[0] + column);
            }
        }
    }

    /// Place of a coordinate among the cells of an axis; None outside.
    fn cell(&self, axis: usize, mm: f64) -> Option<usize> {
        let at = ((mm - self.low_mm[axis]) / self.cell_mm).floor();
        (at >= 0.0 && at < self.cells[axis] as f64).then_some(at as usize)
    }

    fn at(&self, column: usize, row: usize) -> &[u32] {
        let cell = row * self.cells[0] + column;
        &self.members[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Raises the cutter locations at x0_mm + i pitch_mm of one row to the exact drop.
    pub fn lift_row(&self, target: &RowTarget, pitch_mm: f64, z_mm: &mut [f32]) {
        let Some(row) = self.cell(1, target.y_mm) else { return };
        let count = z_mm.len().min(target.count);
        let mut i = 0;
        while i < count {
            let x_mm = target.x0_mm + i as f64 * pitch_mm;
            let Some(column) = self.cell(0, x_mm) else {
                i += 1;
                continue;
            };
            let end_mm = self.low_mm[0] + (column + 1) as f64 * self.cell_mm;
            let end = (((end_mm - target.x0_mm) / pitch_mm).ceil() as usize).clamp(i + 1, count);
            for &nth in self.at(column, row) {
                self.faces[nth as usize].lift_row(&self.profile, target, pitch_mm, i, &mut z_mm[i..end]);
            }
            i = end;
        }
    }

    /// The exact drop at one place [x, y], or `z_mm` where that is higher; NaN is no location.
    pub fn lift_point(&self, place_mm: [f64; 2], z_mm: f64) -> f64 {
        let mut now = if z_mm.is_nan() { f64::NEG_INFINITY } else { z_mm };
        if let (Some(column), Some(row)) = (self.cell(0, place_mm[0]), self.cell(1, place_mm[1])) {
            for &nth in self.at(column, row) {
                now = now.max(self.faces[nth as usize].drop_at(place_mm, &self.profile, now));
            }
        }
        if now.is_finite() { now } else { z_mm }
    }
}

#[derive(Debug)]
struct Face<'a> {
    corners: &'a [[f64; 3]],
    low: [f64; 3],
    high: [f64; 3],
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
    fn new(corners: &'a [[f64; 3]], profile: &Profile) -> Option<Face<'a>> {
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
            let middle = [0, 1].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / corners.len() as f64);
            let around = corners.iter().map(|c| (c[0] - middle[0]).hypot(c[1] - middle[1]));
            let around = around.fold(0.0, f64::max);
            Plane { gradient, offset, contact, above, middle, around, turn: normal[2].signum() }
        });
        Some(Face { corners, low, high, plane })
    }

    /// Raises the locations of positions `from` on.
    fn lift_row(&self, profile: &Profile, target: &RowTarget, pitch_mm: f64, from: usize, z_mm: &mut [f32]) {
        let reach_mm = profile.radius_mm();
        let beside_mm = (self.low[1] - target.y_mm).max(target.y_mm - self.high[1]).max(0.0);
        if beside_mm > reach_mm {
            return;
        }
        let half_mm = (reach_mm * reach_mm - beside_mm * beside_mm).sqrt();
        let place = |x_mm: f64| (x_mm - target.x0_mm) / pitch_mm - from as f64;
        let first = place(self.low[0] - half_mm).floor().max(0.0) as usize;
        let end = ((place(self.high[0] + half_mm).ceil() + 1.0).max(0.0) as usize).min(z_mm.len());
        for (i, z_mm) in z_mm.iter_mut().enumerate().take(end).skip(first) {
            let x_mm = target.x0_mm + (from + i) as f64 * pitch_mm;
            let now = if z_mm.is_nan() { f64::NEG_INFINITY } else { f64::from(*z_mm) };
            let drop = self.drop_at([x_mm, target.y_mm], profile, now);
            if drop > now {
                *z_mm = drop as f32;
            }
        }
    }

    /// [`Face::drop`] where a bound does not rule it out.
    fn drop_at(&self, axis: [f64; 2], profile: &Profile, now: f64) -> f64 {
        let beside_mm = (self.low[1] - axis[1]).max(axis[1] - self.high[1]).max(0.0);
        let aside_mm = (self.low[0] - axis[0]).max(axis[0] - self.high[0]).max(0.0);
        let Some(s_mm) = profile.s_mm(aside_mm.hypot(beside_mm)) else { return now };
        if self.high[2] + s_mm <= now || self.tangent(axis, profile).is_some_and(|most| most <= now) {
            return now;
        }
        self.drop(axis, profile, now)
    }

    /// z + s over the face lies below its tangent at the middle; None where a ball has none.
    fn tangent(&self, axis: [f64; 2], profile: &Profile) -> Option<f64> {
        let plane = self.plane.as_ref().filter(|_| profile.is_ball())?;
        let away = [plane.middle[0] - axis[0], plane.middle[1] - axis[1]];
        let radius = profile.radius_mm();
        let centre2 = radius * radius - away[0] * away[0] - away[1] * away[1];
        if centre2 <= 1e-4 * radius * radius {
            return None;
        }
        let centre = centre2.sqrt();
        let z = plane.gradient[0] * plane.middle[0] + plane.gradient[1] * plane.middle[1] + plane.offset;
        let rise = [plane.gradient[0] - away[0] / centre, plane.gradient[1] - away[1] / centre];
        Some(z + centre - radius + (rise[0] * rise[0] + rise[1] * rise[1]).sqrt() * plane.around)
    }

    /// The height of the cutter on this face, as far as it is above `now`.
    fn drop(&self, axis: [f64; 2], profile: &Profile, now: f64) -> f64 {
        let edges = || (0..self.corners.len()).map(|i| [i, (i + 1) % self.corners.len()]);
        let mut best = now;
        let Some(plane) = &self.plane else {
            for [i, j] in edges() {
                best = best.max(drop_on_edge(&self.corners[i], &self.corners[j], axis, profile, best));
            }
            return best;
        };
        let z = plane.gradient[0] * axis[0] + plane.gradient[1] * axis[1] + plane.offset + plane.above;
        if z <= now {
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
                best = best.max(drop_on_edge(a, b, axis, profile, best));
            }
        }
        if covers { z } else { best }
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
