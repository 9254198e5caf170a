use glam::DVec3;
use rayon::prelude::*;

use super::Grid;

/// Light of a piece of the screen on a matte wall that stands parallel to it.
#[derive(Clone, Debug)]
pub struct Wall {
    pub z_m: f64,
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub columns: usize,
    /// Illuminance, the largest 1; row-major, lowest row first.
    pub light: Vec<f64>,
}

/// The light on a wall at `z_m`, at points of a grid from `low` to `high` (x and y in m).
pub fn wall(grid: &Grid, z_m: f64, low: [f64; 2], high: [f64; 2], (columns, rows): (usize, usize)) -> Wall {
    let mut light: Vec<f64> = (0..columns * rows)
        .into_par_iter()
        .map(|at| {
            let (c, r) = ((at % columns) as f64 + 0.5, (at / columns) as f64 + 0.5);
            let place = DVec3::new(
                low[0] + (high[0] - low[0]) * c / columns as f64,
                low[1] + (high[1] - low[1]) * r / rows as f64,
                z_m,
            );
            // E = I cos / r^2.
            grid.cells
                .iter()
                .map(|cell| {
                    let way = place - cell.point_m;
                    cell.intensity(way.normalize()) * way.z / way.length().powi(3)
                })
                .sum()
        })
        .collect();
    let most = light.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    light.iter_mut().for_each(|value| *value /= most);
    Wall { z_m, low, high, columns, light }
}
