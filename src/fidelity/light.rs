//! Where the projector's light goes: one reflection at every sample of a heightfield, against the audience.
//!
//! A sample of projected area dA with surface normal N = (-z_x, -z_y, 1) takes E (i . N) dA of the light,
//! reflects the share F(i . n) of it into o = 2 (i . n) n - i, and that ray meets the audience or does not.
//! Facets are mirrors. Normals are central differences at the raster step, for the design and for the cut alike.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::grid::{Heights, Window};

/// Directions are binned by (o_x, o_y), where equal areas are equal cos(theta) d(omega): a uniform
/// luminance is a uniform density.
const BINS: usize = 20;

/// Probes across each bin that measure how much of it the audience fills.
const PROBES: usize = 24;

/// Bins that the audience fills less than this are left out of the uniformity.
const FILLED: f64 = 0.25;

/// Where a tile stands: screen point in metres = origin + rotation . p / 1000, p in mm of the tile's frame.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    pub origin_m: DVec3,
    pub rotation: DMat3,
}

impl Pose {
    /// A point of the tile's frame in the screen's.
    pub fn point_m(&self, p_mm: DVec3) -> DVec3 {
        self.origin_m + self.rotation * p_mm * 1e-3
    }
}

/// The room that the light is judged in.
pub struct Room<'a> {
    pub projector_m: DVec3,
    /// Whether a ray from a point in a unit direction meets the audience.
    pub audience: &'a (dyn Fn(DVec3, DVec3) -> bool + Sync),
    /// Reflectance at a cosine of incidence.
    pub reflectance: &'a (dyn Fn(f64) -> f64 + Sync),
    /// Steepest face of the surface: a ray that leaves steeper than this meets no other face.
    pub steepest: f64,
}

/// Shares of the incident light; they sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    pub on_audience: f64,
    pub leak: f64,
    pub absorbed: f64,
    /// Light that leaves so flat that a second reflection is not ruled out.
    pub unresolved: f64,
}

/// Sums of light over the samples seen so far.
#[derive(Clone, Debug)]
pub struct LightTally {
    incident: f64,
    on_audience: f64,
    leak: f64,
    absorbed: f64,
    unresolved: f64,
    bins: Vec<f64>,
}

impl Default for LightTally {
    fn default() -> LightTally {
        LightTally {
            incident: 0.0,
            on_audience: 0.0,
            leak: 0.0,
            absorbed: 0.0,
            unresolved: 0.0,
            bins: vec![0.0; BINS * BINS],
        }
    }
}

impl LightTally {
    /// Adds the samples of `window`; `heights` covers it with a halo of one sample where there is data.
    pub fn add(&mut self, heights: &Heights, window: Window, step_mm: f64, pose: &Pose, room: &Room) {
        let rows: Vec<LightTally> = (window.row..window.row_end())
            .into_par_iter()
            .map(|row| LightTally::of_row(heights, window, row, step_mm, pose, room))
            .collect();
        for row in &rows {
            self.merge(row);
        }
    }

    /// Adds another tally; the caller keeps the order of blocks so that sums are the same each run.
    pub fn merge(&mut self, other: &LightTally) {
        self.incident += other.incident;
        self.on_audience += other.on_audience;
        self.leak += other.leak;
        self.absorbed += other.absorbed;
        self.unresolved += other.unresolved;
        for (sum, bin) in self.bins.iter_mut().zip(&other.bins) {
            *sum += bin;
        }
    }

    fn of_row(h: &Heights, window: Window, row: i64, step_mm: f64, pose: &Pose, room: &Room) -> LightTally {
        let mut tally = LightTally::default();
        let at = |column: i64, row: i64| {
            let inside = (h.window.column..h.window.column_end()).contains(&column)
                && (h.window.row..h.window.row_end()).contains(&row);
            if inside { h.row(row)[(column - h.window.column) as usize] as f64 } else { f64::NAN }
        };
        let middle = |row: i64, column: i64| at(column, row);
        for column in window.column..window.column_end() {
            let z = middle(row, column);
            if z.is_nan() {
                continue;
            }
            let Some(zx) = slope(at(column - 1, row), z, at(column + 1, row), step_mm) else { continue };
            let Some(zy) = slope(at(column, row - 1), z, at(column, row + 1), step_mm) else { continue };
            let p_mm = DVec3::new((column as f64 + 0.5) * step_mm, (row as f64 + 0.5) * step_mm, z);
            let point = pose.point_m(p_mm);
            let normal = pose.rotation * DVec3::new(-zx, -zy, 1.0);
            let incoming = (room.projector_m - point).normalize();
            let taken = incoming.dot(normal);
            if taken <= 0.0 {
                continue;
            }
            let n = normal.normalize();
            let cosine = incoming.dot(n);
            let out = 2.0 * cosine * n - incoming;
            let reflected = taken * (room.reflectance)(cosine);
            tally.incident += taken;
            tally.absorbed += taken - reflected;
            if out.z <= room.steepest * out.x.hypot(out.y) {
                tally.unresolved += reflected;
            } else if (room.audience)(point, out) {
                tally.on_audience += reflected;
                tally.bins[bin_of(out.x) + BINS * bin_of(out.y)] += reflected;
            } else {
                tally.leak += reflected;
            }
        }
        tally
    }

    /// Shares of the incident light, or None before any light fell.
    pub fn shares(&self) -> Option<Shares> {
        (self.incident > 0.0).then(|| Shares {
            on_audience: self.on_audience / self.incident,
            leak: self.leak / self.incident,
            absorbed: self.absorbed / self.incident,
            unresolved: self.unresolved / self.incident,
        })
    }

    /// Mean luminance over the audience, far field, relative to a Lambertian of reflectance 1:
    /// pi * share / L, with L of Eq. 9.
    pub fn gain(&self, view: &View) -> Option<f64> {
        let shares = self.shares()?;
        (view.projected_sr > 0.0).then(|| std::f64::consts::PI * shares.on_audience / view.projected_sr)
    }

    /// 1 - (standard deviation / mean) of the luminance over the bins of direction that the audience fills.
    pub fn uniformity(&self, view: &View) -> Option<f64> {
        let bin_sr = (2.0 / BINS as f64).powi(2);
        let (mut weight, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (flux, area) in self.bins.iter().zip(&view.bins_sr) {
            if *area < FILLED * bin_sr {
                continue;
            }
            let luminance = flux / area;
            weight += area;
            sum += area * luminance;
            squares += area * luminance * luminance;
        }
        let mean = sum / weight;
        (mean > 0.0).then(|| 1.0 - (squares / weight - mean * mean).max(0.0).sqrt() / mean)
    }
}

fn slope(before: f64, here: f64, after: f64, step_mm: f64) -> Option<f64> {
    match (before.is_nan(), after.is_nan()) {
        (false, false) => Some((after - before) / (2.0 * step_mm)),
        (true, false) => Some((after - here) / step_mm),
        (false, true) => Some((here - before) / step_mm),
        (true, true) => None,
    }
}

fn bin_of(component: f64) -> usize {
    (((component + 1.0) * 0.5 * BINS as f64) as usize).min(BINS - 1)
}

/// How the audience looks from a part: the integral of Eq. 9, and its share of every bin of direction.
#[derive(Clone, Debug)]
pub struct View {
    /// L = integral of cos(theta) over the audience in sr, mean over the points.
    pub projected_sr: f64,
    bins_sr: Vec<f64>,
}

impl View {
    /// The mean view from these points, by a fixed grid of probes in (o_x, o_y).
    pub fn from_points(points_m: &[DVec3], audience: &(dyn Fn(DVec3, DVec3) -> bool + Sync)) -> View {
        let across = BINS * PROBES;
        let spacing = 2.0 / across as f64;
        let rows: Vec<Vec<f64>> = (0..across)
            .into_par_iter()
            .map(|j| {
                let y = (j as f64 + 0.5) * spacing - 1.0;
                let mut row = vec![0.0; BINS];
                for i in 0..across {
                    let x = (i as f64 + 0.5) * spacing - 1.0;
                    let z2 = 1.0 - x * x - y * y;
                    if z2 <= 0.0 {
                        continue;
                    }
                    let out = DVec3::new(x, y, z2.sqrt());
                    let seen = points_m.iter().filter(|point| audience(**point, out)).count();
                    row[i / PROBES] += seen as f64 * spacing * spacing / points_m.len() as f64;
                }
                row
            })
            .collect();
        let mut bins_sr = vec![0.0; BINS * BINS];
        for (j, row) in rows.iter().enumerate() {
            for (i, area) in row.iter().enumerate() {
                bins_sr[i + BINS * (j / PROBES)] += area;
            }
        }
        View { projected_sr: bins_sr.iter().sum(), bins_sr }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(window: Window, gradient: [f64; 2], step_mm: f64) -> Heights {
        let halo = window.grown(1);
        let mut heights = Heights::empty(halo);
        for row in halo.row..halo.row_end() {
            for column in halo.column..halo.column_end() {
                let z = gradient[0] * column as f64 * step_mm + gradient[1] * row as f64 * step_mm;
                let at = (row - halo.row) as usize * halo.columns + (column - halo.column) as usize;
                heights.z_mm[at] = z as f32;
            }
        }
        heights
    }

    #[test]
    fn a_flat_mirror_sends_everything_one_way() {
        let window = Window { column: 0, row: 0, columns: 32, rows: 32 };
        let heights = plane(window, [0.2, 0.0], 0.01);
        let pose = Pose { origin_m: DVec3::ZERO, rotation: DMat3::IDENTITY };
        let n = DVec3::new(-0.2, 0.0, 1.0).normalize();
        let i = DVec3::Z;
        let wanted = 2.0 * i.dot(n) * n - i;
        let near = |_: DVec3, out: DVec3| out.dot(wanted) > 1.0 - 1e-6;
        let room = Room {
            projector_m: DVec3::new(0.0, 0.0, 1e6),
            audience: &near,
            reflectance: &|_| 0.9,
            steepest: 0.2,
        };
        let mut tally = LightTally::default();
        tally.add(&heights, window, 0.01, &pose, &room);
        let shares = tally.shares().expect("light fell");
        assert!((shares.on_audience - 0.9).abs() < 1e-9, "{shares:?}");
        let sum = shares.on_audience + shares.leak + shares.absorbed + shares.unresolved;
        assert!((sum - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_surface_that_fills_the_half_space_evenly_has_gain_one() {
        let everywhere = |_: DVec3, _: DVec3| true;
        let view = View::from_points(&[DVec3::ZERO], &everywhere);
        assert!((view.projected_sr - std::f64::consts::PI).abs() < 2e-3, "{}", view.projected_sr);
        let mut tally = LightTally { incident: 1.0, on_audience: 1.0, ..LightTally::default() };
        for (flux, area) in tally.bins.iter_mut().zip(&view.bins_sr) {
            *flux = area / view.projected_sr;
        }
        assert!((tally.gain(&view).expect("light") - 1.0).abs() < 1e-3);
        assert!((tally.uniformity(&view).expect("light") - 1.0).abs() < 1e-9);
    }
}
