//! How much light each place of a screen needs (paper, section 3.3).

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;

use super::power::{Vertex, clip};
use super::{AreaRule, Elevation, Error, Polyhedron, Scene, sight};
use crate::optics::{even_gain, projected_solid_angle};

/// Directions lower than this over the screen plane count as under it: 3e-12 sr in Eq. 9.
const LOWEST_Z: f64 = 1e-6;
/// Most cells at which Eq. 9 is worked out; between them, on larger screens, it is interpolated.
const MOST_CELLS: usize = 400_000;

/// The light that each place needs for the same luminance everywhere.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Columns and rows of cells that Eq. 9 was worked out at, growing, with the first and the last.
    columns: Vec<usize>,
    rows: Vec<usize>,
    /// L of Eq. 9 in sr, row-major, lowest row first.
    l_sr: Vec<f64>,
    /// What a projector has to send there for each unit of its own light: L over the part of the beam that a
    /// cell catches, which is 1 on a flat screen.
    need: Vec<f64>,
    most_need: f64,
    heights_m: Option<Vec<f64>>,
    width_m: f64,
    origin_m: DVec2,
    projector_m: DVec3,
    pub figures: Figures,
}

/// L of Eq. 9 over the screen and the gains that follow, relative to a Lambertian screen of reflectance 1.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Figures {
    pub l_min_sr: f64,
    pub l_mean_sr: f64,
    pub l_max_sr: f64,
    /// At the cell in the middle, or the upper right of the two or four there.
    pub l_centre_sr: f64,
    /// The mask's smallest and mean value; the largest is 1.
    pub mask_min: f64,
    pub mask_mean: f64,
    /// Reflectance of the mirrors at normal incidence.
    pub reflectance: f64,
    /// Without a mask, at the centre.
    pub gain_uncalibrated_centre: f64,
    /// With the mask as a filter: every place as dark as the one that needs most.
    pub gain_attenuation: f64,
    /// With a projector that sends the same light where it is needed.
    pub gain_redirection: f64,
}

/// L of Eq. 9 at a point in sr: the integral of cos(theta) over all directions to the audience, exact for convex
/// polyhedra; what several cover counts once. `tilt` is the gradient of the surface that theta is measured from: the
/// cosine is (o_z - tilt . o_xy), that of a cell's base by its area on the flat screen.
pub fn projected_sr(audience: &[Polyhedron], point_m: DVec3, tilt: DVec2) -> f64 {
    let normal = DVec3::new(-tilt.x, -tilt.y, 1.0);
    let mut spare: Vec<Vertex> = Vec::new();
    let mut sum = 0.0;
    for mut piece in sight::pieces(audience, point_m, LOWEST_Z) {
        if tilt != DVec2::ZERO {
            // Above the base: o_z - tilt . o_xy >= 0.
            clip(&mut piece, &mut spare, tilt.to_array(), 1.0, 0);
        }
        let corners: Vec<DVec3> = piece.iter().map(|([x, y], _)| DVec3::new(*x, *y, 1.0)).collect();
        sum += projected_solid_angle(&corners, normal);
    }
    sum
}

/// Works out Eq. 9 at every cell: on the flat screen, as the paper does, or at these elevations. Then a cell also
/// catches more or less of the beam, by its distance to the projector and its tilt; and where areas are `exact`,
/// theta is measured from the cell's own base, as in its design.
///
/// Errors: a cell that sees no audience, lies in it, or stands behind the projector.
pub fn calibrate(scene: &Scene, elevation: Option<&Elevation>) -> Result<Calibration, Error> {
    let cells = scene.columns() as f64 * scene.rows() as f64;
    let every = (cells / MOST_CELLS as f64).sqrt().ceil() as usize;
    let places = |count: usize| (0..count - 1).step_by(every).chain([count - 1]).collect::<Vec<usize>>();
    let (columns, rows) = (places(scene.columns()), places(scene.rows()));
    let across = columns.len();
    let at_cell = |column: usize, row: usize| -> Result<[f64; 3], Error> {
        let height_m = elevation.map_or(0.0, |elevation| 1e-3 * elevation.at(column, row));
        let x = scene.centre_m(column as f64, row as f64, height_m);
        scene.check_point((column as i32, row as i32), x)?;
        let m = elevation.map_or(DVec2::ZERO, |elevation| base_gradient(scene, elevation, column, row));
        let tilt = if scene.microgeometry.area == AreaRule::Exact { m } else { DVec2::ZERO };
        let l = projected_sr(&scene.audience, x, tilt);
        let i = scene.projector_m - x;
        let nearer = scene.projector_m.z / i.z;
        Ok([l, (1.0 - m.dot(i.truncate()) / i.z).max(0.0) * nearer * nearer, height_m])
    };
    let found: Vec<Result<[f64; 3], Error>> = (0..across * rows.len())
        .into_par_iter()
        .map(|at| at_cell(columns[at % across], rows[at / across]))
        .collect();
    let found = found.into_iter().collect::<Result<Vec<_>, Error>>()?;
    let l_sr: Vec<f64> = found.iter().map(|cell| cell[0]).collect();
    let need: Vec<f64> =
        found.iter().map(|[l, caught, _]| if *caught > 0.0 { l / caught } else { 0.0 }).collect();
    // Every cell counts for its share of the screen, half a gap to either side.
    let shares = |places: &[usize]| -> Vec<f64> {
        let edge = |k: usize| 0.5 * (places[k] + places[k + 1]) as f64;
        let last = places.len() - 1;
        (0..=last)
            .map(|k| {
                let low = if k == 0 { places[0] as f64 - 0.5 } else { edge(k - 1) };
                let high = if k == last { places[last] as f64 + 0.5 } else { edge(k) };
                high - low
            })
            .collect()
    };
    let (wide, high) = (shares(&columns), shares(&rows));
    let mean = |of: &dyn Fn(usize) -> f64| -> f64 {
        (0..found.len()).map(|at| of(at) * wide[at % across] * high[at / across]).sum::<f64>() / cells
    };
    let (least, most) = (
        |v: &[f64]| v.iter().copied().fold(f64::INFINITY, f64::min),
        |v: &[f64]| v.iter().copied().fold(0.0, f64::max),
    );
    let centre = at_cell(scene.columns() / 2, scene.rows() / 2)?[0];
    let reflectance = scene.reflector.reflectance.at(1.0);
    let (most_need, l_mean_sr) = (most(&need), mean(&|at| l_sr[at]));
    let mean_need = l_mean_sr / mean(&|at| found[at][1]);
    let width_m = 1e-3 * scene.microgeometry.width_mm;
    Ok(Calibration {
        heights_m: elevation.map(|_| found.iter().map(|cell| cell[2]).collect()),
        width_m,
        origin_m: scene.centre_m(0.0, 0.0, 0.0).truncate(),
        projector_m: scene.projector_m,
        figures: Figures {
            l_min_sr: least(&l_sr),
            l_mean_sr,
            l_max_sr: most(&l_sr),
            l_centre_sr: centre,
            mask_min: least(&need) / most_need,
            mask_mean: mean_need / most_need,
            reflectance,
            gain_uncalibrated_centre: even_gain(reflectance, centre),
            gain_attenuation: even_gain(reflectance, most_need),
            gain_redirection: even_gain(reflectance, mean_need),
        },
        columns,
        rows,
        l_sr,
        need,
        most_need,
    })
}

/// The gradient of the surface that the cells' elevations are on, at a cell.
pub fn base_gradient(scene: &Scene, elevation: &Elevation, column: usize, row: usize) -> DVec2 {
    let slope = |at: usize, count: usize, height: &dyn Fn(usize) -> f64| {
        let (before, after) = (at.saturating_sub(1), (at + 1).min(count - 1));
        let run_mm = (after - before) as f64 * scene.microgeometry.width_mm;
        if run_mm > 0.0 { (height(after) - height(before)) / run_mm } else { 0.0 }
    };
    DVec2::new(
        slope(column, elevation.columns, &|c| elevation.at(c, row)),
        slope(row, elevation.rows, &|r| elevation.at(column, r)),
    )
}

impl Calibration {
    /// What the projector has to send along the ray that meets the plane z = 0 at this point, from 0 to 1: bilinear
    /// between cells, continued over the outer half of the last ones.
    pub fn mask(&self, on_plane_m: DVec2) -> f64 {
        let mut x = on_plane_m;
        if let Some(heights_m) = &self.heights_m {
            // The ray meets the elevated surface elsewhere; slopes below 1 make this settle.
            for _ in 0..12 {
                let part = self.interpolated(heights_m, x) / self.projector_m.z;
                x = on_plane_m + (self.projector_m.truncate() - on_plane_m) * part;
            }
        }
        self.mask_at(x)
    }

    /// What it has to send to the surface's own point over (x, y), from 0 to 1.
    pub fn mask_at(&self, x_m: DVec2) -> f64 {
        (self.interpolated(&self.need, x_m) / self.most_need).clamp(0.0, 1.0)
    }

    /// L of Eq. 9 at a point of the screen.
    pub fn l_sr(&self, x_m: DVec2) -> f64 {
        self.interpolated(&self.l_sr, x_m)
    }

    fn interpolated(&self, values: &[f64], x_m: DVec2) -> f64 {
        let place = (x_m - self.origin_m) / self.width_m;
        let (c0, c1, s) = between(&self.columns, place.x);
        let (r0, r1, t) = between(&self.rows, place.y);
        let at = |c: usize, r: usize| values[r * self.columns.len() + c];
        (at(c0, r0) * (1.0 - s) + at(c1, r0) * s) * (1.0 - t) + (at(c0, r1) * (1.0 - s) + at(c1, r1) * s) * t
    }
}

/// The two places around a value, and how far it is from the first to the second; up to half a cell beyond.
fn between(places: &[usize], value: f64) -> (usize, usize, f64) {
    let last = places.len() - 1;
    let value = value.clamp(places[0] as f64 - 0.5, places[last] as f64 + 0.5);
    let high = places.partition_point(|&place| (place as f64) < value).clamp(1.min(last), last);
    let low = high.saturating_sub(1);
    let gap = (places[high] - places[low]) as f64;
    (low, high, if gap > 0.0 { (value - places[low] as f64) / gap } else { 0.0 })
}
