use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::optics::half_vector;
use crate::progress::in_order;
use crate::screen::{self, Elevation, Error, Grazing, Scene};

/// A beam's spread over the distance to the next one: wide enough to leave no ripple between them, and so
/// narrow that the audience's edge stays an edge.
const SPREAD: f64 = 0.6;
/// A beam is nothing beyond this many standard deviations.
const REACH: f64 = 5.0;

/// The light of one facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Where it goes.
    pub direction: DVec3,
    /// The facet's normal.
    pub normal: DVec3,
    /// Part of the light on the cell's area of the flat screen that goes there.
    pub flux: f64,
}

/// The light of one cell.
#[derive(Clone, Debug)]
pub struct CellLight {
    pub point_m: DVec3,
    pub beams: Vec<Beam>,
    /// Gradient of the surface that the cell stands on.
    tilt: DVec2,
    /// Light on the cell over that on as much of the flat screen from the same projector.
    caught: f64,
    /// 1 / sigma^2 of a beam's spread, in 1/rad^2.
    kappa: f64,
}

impl CellLight {
    /// The light of a cell that stands at this elevation, on a surface of this gradient. Errors: as of its design.
    pub fn new(
        scene: &Scene,
        (column, row): (usize, usize),
        elevation_m: f64,
        tilt: DVec2,
    ) -> Result<CellLight, Error> {
        let x = scene.centre_m(column as f64, row as f64, elevation_m);
        let cell = (column as i32, row as i32);
        let wanted = scene.microgeometry.facets;
        let sampled = screen::directions(&scene.view(x), wanted).ok_or(Error::SeesTooLittle {
            column: cell.0,
            row: cell.1,
            x_m: x.x,
            y_m: x.y,
            z_m: x.z,
            facets: wanted,
            most: screen::MOST_SAMPLES,
        })?;
        let facets =
            screen::facets(scene, x, &sampled.list).map_err(|Grazing { mean_gradient: [mx, my] }| {
                Error::Grazing { column: cell.0, row: cell.1, mx, my }
            })?;
        let i = (scene.projector_m - x).normalize();
        let total: f64 = facets.weights.iter().sum();
        let beams = sampled.list.iter().zip(&facets.weights).map(|(&o, weight)| {
            let h = half_vector(i, o);
            let cosine = i.dot(h);
            // A facet of projected area p catches p (i . h) / h_z of the light, the flat screen p i_z.
            let flux = weight / total * cosine / (h.z * i.z) * scene.reflector.reflectance.at(cosine);
            Beam { direction: o, normal: h, flux }
        });
        // The lattice holds `density` points on the hemisphere.
        let gap2 = 2.0 * PI / sampled.density;
        // A microfacet that leans by s turns the ray by 2 s; its slopes have the variance alpha^2 / 2.
        let lobe2 = scene.reflector.roughness.map_or(0.0, |alpha| 2.0 * alpha * alpha);
        let nearer = scene.projector_m.z / (scene.projector_m.z - x.z);
        Ok(CellLight {
            point_m: x,
            beams: beams.collect(),
            tilt,
            caught: nearer * nearer,
            kappa: 1.0 / (SPREAD * SPREAD * gap2 + lobe2),
        })
    }

    /// Luminance in a unit direction, relative to that of a Lambertian of reflectance 1 in the plane of the flat
    /// screen under the same projector: the gain. Every beam is spread as a von Mises-Fisher lobe.
    pub fn gain(&self, o: DVec3) -> f64 {
        let seen = o.z - self.tilt.dot(o.truncate());
        if seen > 0.0 { self.intensity(o) / seen } else { 0.0 }
    }

    /// Flux per solid angle, pi times that per light on the cell's area of the flat screen.
    pub fn intensity(&self, o: DVec3) -> f64 {
        let least = 1.0 - 0.5 * REACH * REACH / self.kappa;
        let mut sum = 0.0;
        for beam in &self.beams {
            let cosine = beam.direction.dot(o);
            if cosine > least {
                sum += beam.flux * (self.kappa * (cosine - 1.0)).exp();
            }
        }
        0.5 * self.caught * sum * self.kappa / (1.0 - (-2.0 * self.kappa).exp())
    }

    /// The same towards a place.
    pub fn gain_towards(&self, place_m: DVec3) -> f64 {
        self.gain((place_m - self.point_m).normalize())
    }

    /// Standard deviation of a beam's spread in radians.
    pub fn spread_rad(&self) -> f64 {
        self.kappa.sqrt().recip()
    }

    /// Part of the incident light that is reflected.
    pub fn reflected(&self) -> f64 {
        self.beams.iter().map(|beam| beam.flux).sum()
    }
}

/// Cells spread evenly over the screen, row-major, lowest row first.
pub struct Grid {
    pub columns: usize,
    pub rows: usize,
    pub cells: Vec<CellLight>,
}

impl Grid {
    /// About `across` cells along the longer side.
    pub fn over(scene: &Scene, elevation: Option<&Elevation>, across: usize) -> Result<Grid, Error> {
        let longer = scene.columns().max(scene.rows());
        let places = |count: usize| -> Vec<usize> {
            let wanted = (count * across).div_ceil(longer).clamp(1, count);
            (0..wanted).map(|k| (2 * k + 1) * count / (2 * wanted)).collect()
        };
        let (x, y) = (places(scene.columns()), places(scene.rows()));
        let cells = lights(scene, elevation, x.len() * y.len(), |at| (x[at % x.len()], y[at / x.len()]))?;
        Ok(Grid { columns: x.len(), rows: y.len(), cells })
    }
}

/// Cells spread over a square piece in the middle of the screen: `across` in a row over `side_mm`.
pub fn patch(
    scene: &Scene,
    elevation: Option<&Elevation>,
    side_mm: f64,
    across: usize,
) -> Result<Grid, Error> {
    let places = |count: usize| -> Vec<usize> {
        let side = ((side_mm / scene.microgeometry.width_mm).round() as usize).clamp(1, count);
        let wanted = across.min(side);
        let first = (count - side) / 2;
        (0..wanted).map(|k| first + (2 * k + 1) * side / (2 * wanted)).collect()
    };
    let (x, y) = (places(scene.columns()), places(scene.rows()));
    let cells = lights(scene, elevation, x.len() * y.len(), |at| (x[at % x.len()], y[at / x.len()]))?;
    Ok(Grid { columns: x.len(), rows: y.len(), cells })
}

fn lights(
    scene: &Scene,
    elevation: Option<&Elevation>,
    count: usize,
    place: impl Fn(usize) -> (usize, usize) + Sync,
) -> Result<Vec<CellLight>, Error> {
    in_order(count, |at| {
        let (column, row) = place(at);
        match elevation {
            None => CellLight::new(scene, (column, row), 0.0, DVec2::ZERO),
            Some(elevation) => {
                let tilt = screen::base_gradient(scene, elevation, column, row);
                CellLight::new(scene, (column, row), 1e-3 * elevation.at(column, row), tilt)
            }
        }
    })
}
