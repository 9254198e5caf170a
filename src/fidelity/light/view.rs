use glam::DVec3;
use rayon::prelude::*;

/// Directions are binned by (o_x, o_y), where equal areas are equal cos(theta) d(omega): a uniform
/// luminance is a uniform density.
pub(super) const BINS: usize = 20;

/// Probes across each bin that measure how much of it the audience fills.
const PROBES: usize = 24;

/// How the audience looks from a part: the integral of Eq. 9, and its share of every bin of direction.
#[derive(Clone, Debug)]
pub struct View {
    /// L = integral of cos(theta) over the audience in sr, mean over the points.
    pub projected_sr: f64,
    pub(super) bins_sr: Vec<f64>,
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

/// The bin of one component of a direction, of `bins` from -1 to 1.
#[inline]
pub(super) fn bin_of(component: f64, bins: usize) -> usize {
    (((component + 1.0) * 0.5 * bins as f64) as usize).min(bins - 1)
}
