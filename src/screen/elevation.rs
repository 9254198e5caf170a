//! How high each cell stands: bases joined to one smooth surface (paper, section 3.2).

use std::f64::consts::PI;

use glam::DVec2;
use rayon::prelude::*;
use rustdct::DctPlanner;

use super::facets::{Moments, mirror};
use super::scene::Scene;
use super::{ElevationMethod, Error, sight};

/// Gaps between the nodes at which the mean gradient is worked out, along the longer side of a
/// screen of 2 m; elsewhere by the square root of its length, which keeps the error in mm.
const GAPS: f64 = 256.0;
/// The first guess is made with this many times fewer.
const FIRST_GUESS: f64 = 8.0;
/// The surface has settled when no cell moves more than this, in m.
const SETTLED_M: f64 = 1e-7;
const ITERATIONS: usize = 40;
/// Screens of more cells are settled with wider cells first: only few rounds are left for theirs.
const MANY_CELLS: usize = 1_000_000;
/// How many cells the wider ones may be, about.
const FEW_CELLS: f64 = 40_000.0;
/// Rows and columns that are worked on together: a grid is transposed in such squares, so that both
/// sides stay in the cache.
const BLOCK: usize = 32;
/// Largest elevation that is taken as given.
pub const MOST_MM: f64 = 1e5;

/// Elevation of every cell of a screen in mm, row-major, the lowest row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Elevation {
    pub columns: usize,
    pub rows: usize,
    pub z_mm: Vec<f64>,
}

impl Elevation {
    /// The elevation of one cell.
    pub fn at(&self, column: usize, row: usize) -> f64 {
        self.z_mm[row * self.columns + column]
    }

    /// Refuses an elevation of another shape than the screen's cells, or one with values that are
    /// no heights.
    pub fn check(&self, scene: &Scene) -> Result<(), Error> {
        let (wanted_columns, wanted_rows) = (scene.columns(), scene.rows());
        let (columns, rows) = (self.columns, self.rows);
        if (columns, rows) != (wanted_columns, wanted_rows) || self.z_mm.len() != columns * rows {
            return Err(Error::ElevationShape { rows, columns, wanted_rows, wanted_columns });
        }
        match self.z_mm.iter().position(|z| z.is_nan() || z.abs() > MOST_MM) {
            Some(at) => Err(Error::ElevationValue {
                column: at % columns,
                row: at / columns,
                value_mm: self.z_mm[at],
                most_mm: MOST_MM,
            }),
            None => Ok(()),
        }
    }
}

/// The elevation that the scene's method gives, mean zero over the screen.
///
/// Poisson: minimises over all pairs of neighbouring cells the squared difference between their
/// step and the one their mean gradients ask for, with the positions updated until no cell moves
/// by more than 0.1 um. The mean gradient is the limit of dense sampling, integrated over the solid
/// angle of the audience at nodes (256 gaps along a screen of 2 m) and interpolated by cubics;
/// the heights that this gives are within 1 um of those without interpolation.
pub fn elevation(scene: &Scene) -> Result<Elevation, Error> {
    let gaps = GAPS * (0.5 * scene.width_m.max(scene.height_m)).sqrt();
    let (columns, rows) = (scene.columns(), scene.rows());
    let mut height_m = vec![0.0; columns * rows];
    if scene.elevation == ElevationMethod::Poisson {
        if columns * rows > MANY_CELLS {
            let wider = (height_m.len() as f64 / FEW_CELLS).sqrt().ceil();
            guess(scene, &mut height_m, wider)?;
        }
        settle(scene, &Nodes::over(columns, rows, gaps / FIRST_GUESS), &mut height_m)?;
        settle(scene, &Nodes::over(columns, rows, gaps), &mut height_m)?;
    }
    height_m.iter_mut().for_each(|h| *h *= 1e3);
    Ok(Elevation { columns, rows, z_mm: height_m })
}

/// The elevation of the same screen with cells so many times wider, at the places of its own.
fn guess(scene: &Scene, height_m: &mut [f64], wider: f64) -> Result<(), Error> {
    let columns = scene.columns();
    let mut coarse = scene.clone();
    coarse.microgeometry.width_mm *= wider;
    let found = elevation(&coarse)?;
    let place = |cell: usize| (cell as f64 + 0.5) / wider - 0.5;
    height_m.par_chunks_mut(columns).enumerate().for_each(|(row, line)| {
        for (column, h) in line.iter_mut().enumerate() {
            *h = 1e-3 * bilinear(&found.z_mm, found.columns, found.rows, place(column), place(row));
        }
    });
    Ok(())
}

/// Solves and moves the cells until they stay where they are.
fn settle(scene: &Scene, nodes: &Nodes, height_m: &mut Vec<f64>) -> Result<(), Error> {
    let (columns, rows) = (scene.columns(), scene.rows());
    let mut change_m = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let field = Field::new(scene, nodes, columns, height_m)?;
        let next = poisson(&|row| field.row(row), columns, rows, 1e-3 * scene.microgeometry.width_mm);
        change_m = next.iter().zip(&*height_m).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        *height_m = next;
        if change_m <= SETTLED_M {
            return Ok(());
        }
    }
    Err(Error::ElevationNotSettled { change_m, iterations: ITERATIONS })
}

/// Places evenly spread over the screen, in cells; at most one a cell.
struct Nodes {
    x: Vec<f64>,
    y: Vec<f64>,
}

impl Nodes {
    /// With this many gaps along the longer side.
    fn over(columns: usize, rows: usize, gaps: f64) -> Nodes {
        let stride = ((columns.max(rows) - 1) as f64 / gaps).max(1.0);
        let side = |count: usize| {
            let last = (count - 1) as f64;
            let gaps = (last / stride).ceil();
            (0..=gaps as usize).map(|k| if k == 0 { 0.0 } else { k as f64 * last / gaps }).collect()
        };
        Nodes { x: side(columns), y: side(rows) }
    }
}

/// The mean gradient of a cell at this place: of the surface, dz/dx and dz/dy.
pub(super) fn mean_gradient(scene: &Scene, column: f64, row: f64, height_m: f64) -> Result<DVec2, Error> {
    let x = scene.centre_m(column, row, height_m);
    let cell = (column.round() as i32, row.round() as i32);
    scene.check_point(cell, x)?;
    let mut moments = Moments::default();
    sight::integrate(&scene.audience, x, |o, weight| moments.add(&mirror(scene, x, o), o, weight));
    let grazing = Error::Grazing { column: cell.0, row: cell.1, mx: 0.0, my: 0.0 };
    moments.mean_gradient(scene.microgeometry.area).ok_or(grazing)
}

/// The mean gradient at nodes, to be interpolated between them.
struct Field {
    at_nodes: Vec<DVec2>,
    along_x: Vec<Stencil>,
    along_y: Vec<Stencil>,
    across: usize,
}

impl Field {
    fn new(scene: &Scene, nodes: &Nodes, columns: usize, height_m: &[f64]) -> Result<Field, Error> {
        let rows = height_m.len() / columns;
        let across = nodes.x.len();
        let at_nodes: Vec<Result<DVec2, Error>> = (0..across * nodes.y.len())
            .into_par_iter()
            .map(|at| {
                let (column, row) = (nodes.x[at % across], nodes.y[at / across]);
                mean_gradient(scene, column, row, bilinear(height_m, columns, rows, column, row))
            })
            .collect();
        let at_nodes = at_nodes.into_iter().collect::<Result<_, _>>()?;
        Ok(Field {
            at_nodes,
            along_x: stencils(&nodes.x, columns),
            along_y: stencils(&nodes.y, rows),
            across,
        })
    }

    /// The mean gradient of every cell of a row.
    fn row(&self, row: usize) -> Vec<DVec2> {
        let y = &self.along_y[row];
        let column_of_nodes: Vec<DVec2> = (0..self.across)
            .map(|i| y.terms().map(|(node, weight)| self.at_nodes[node * self.across + i] * weight).sum())
            .collect();
        let cell = |x: &Stencil| x.terms().map(|(node, weight)| column_of_nodes[node] * weight).sum();
        self.along_x.iter().map(cell).collect()
    }
}

/// Between four cells; beyond the outer ones along the same lines.
fn bilinear(values: &[f64], columns: usize, rows: usize, column: f64, row: f64) -> f64 {
    let first = |place: f64, count: usize| (place.max(0.0).floor() as usize).min(count.saturating_sub(2));
    let (c0, r0) = (first(column, columns), first(row, rows));
    let (c1, r1) = ((c0 + 1).min(columns - 1), (r0 + 1).min(rows - 1));
    let (s, t) = (column - c0 as f64, row - r0 as f64);
    let at = |c: usize, r: usize| values[r * columns + c];
    (at(c0, r0) * (1.0 - s) + at(c1, r0) * s) * (1.0 - t) + (at(c0, r1) * (1.0 - s) + at(c1, r1) * s) * t
}

/// Up to four nodes and their weights: Lagrange's cubic through the nearest nodes.
struct Stencil {
    first: usize,
    weights: [f64; 4],
    len: usize,
}

impl Stencil {
    fn terms(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.weights[..self.len].iter().enumerate().map(|(k, &weight)| (self.first + k, weight))
    }
}

fn stencils(nodes: &[f64], count: usize) -> Vec<Stencil> {
    let len = nodes.len().min(4);
    let gap = if nodes.len() > 1 { nodes[1] - nodes[0] } else { 1.0 };
    (0..count)
        .map(|cell| {
            let at = cell as f64 / gap;
            let first = (at.floor() as usize).saturating_sub(1).min(nodes.len() - len);
            let mut weights = [0.0; 4];
            for (k, weight) in weights.iter_mut().enumerate().take(len) {
                *weight = (0..len)
                    .filter(|&other| other != k)
                    .map(|other| (at - (first + other) as f64) / (k as f64 - other as f64))
                    .product();
            }
            Stencil { first, weights, len }
        })
        .collect()
}

/// Heights in m of mean zero that minimise the sum over neighbours a, b of
/// (h_b - h_a - w (m_a + m_b)/2 . e)^2. The normal equations are the grid's Laplacian with free borders,
/// which the cosine transform makes diagonal.
fn poisson(m: &(dyn Fn(usize) -> Vec<DVec2> + Sync), columns: usize, rows: usize, width_m: f64) -> Vec<f64> {
    let mut right = vec![0.0; columns * rows];
    // Gradients are made a few rows at a time: all of them would take twice what the heights do.
    right.par_chunks_mut(columns * BLOCK).enumerate().for_each(|(block, lines)| {
        let first = block * BLOCK;
        let mut below = if first > 0 { m(first - 1) } else { Vec::new() };
        let mut own = m(first);
        for (row, line) in (first..).zip(lines.chunks_mut(columns)) {
            let above = if row + 1 < rows { m(row + 1) } else { Vec::new() };
            for ((value, m), below) in line.iter_mut().zip(&own).zip(&below) {
                *value += 0.5 * width_m * (below.y + m.y);
            }
            for column in 1..columns {
                let step = 0.5 * width_m * (own[column - 1].x + own[column].x);
                line[column - 1] -= step;
                line[column] += step;
            }
            for ((value, m), above) in line.iter_mut().zip(&own).zip(&above) {
                *value -= 0.5 * width_m * (m.y + above.y);
            }
            below = std::mem::replace(&mut own, above);
        }
    });
    let mut planner = DctPlanner::new();
    let (across, up) = (planner.plan_dct2(columns), planner.plan_dct2(rows));
    right.par_chunks_mut(columns).for_each(|line| across.process_dct2(line));
    let mut turned = transposed(&right, columns);
    drop(right);
    turned.par_chunks_mut(rows).enumerate().for_each(|(k, line)| {
        up.process_dct2(line);
        for (l, value) in line.iter_mut().enumerate() {
            let eigenvalue = 4.0
                - 2.0 * (PI * k as f64 / columns as f64).cos()
                - 2.0 * (PI * l as f64 / rows as f64).cos();
            // The constant is free: mean zero.
            *value = if k + l == 0 { 0.0 } else { *value / eigenvalue };
        }
        up.process_dct3(line);
    });
    let mut heights = transposed(&turned, rows);
    drop(turned);
    let scale = 4.0 / (columns as f64 * rows as f64);
    heights.par_chunks_mut(columns).for_each(|line| {
        across.process_dct3(line);
        line.iter_mut().for_each(|h| *h *= scale);
    });
    heights
}

fn transposed(values: &[f64], columns: usize) -> Vec<f64> {
    let rows = values.len() / columns;
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(rows * BLOCK).enumerate().for_each(|(block, lines)| {
        let first = block * BLOCK;
        for low in (0..rows).step_by(BLOCK) {
            for (column, line) in lines.chunks_mut(rows).enumerate() {
                for (row, value) in line.iter_mut().enumerate().take(low + BLOCK).skip(low) {
                    *value = values[row * columns + first + column];
                }
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(name: &str) -> Scene {
        let path = format!("{}/samples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        Scene::read(path.as_ref()).expect("a sample scene")
    }

    #[test]
    fn a_field_that_has_a_surface_gives_it_back() {
        let (columns, rows, width) = (23, 17, 0.004);
        let height = |x: f64, y: f64| 0.3 * x * x - 0.2 * x * y + 0.1 * y * y + 0.05 * x;
        let at = |k: usize| (k % columns, k / columns);
        let position = |k: usize| (at(k).0 as f64 * width, at(k).1 as f64 * width);
        let m: Vec<DVec2> = (0..columns * rows)
            .map(|k| {
                let (x, y) = position(k);
                DVec2::new(0.6 * x - 0.2 * y + 0.05, -0.2 * x + 0.2 * y)
            })
            .collect();
        let exact: Vec<f64> = (0..columns * rows).map(|k| height(position(k).0, position(k).1)).collect();
        let mean = exact.iter().sum::<f64>() / exact.len() as f64;
        // The trapezoid of a linear gradient is exact.
        let rows_of = |row: usize| m[row * columns..][..columns].to_vec();
        for (h, e) in poisson(&rows_of, columns, rows, width).iter().zip(&exact) {
            assert!((h - (e - mean)).abs() < 1e-15);
        }
    }

    #[test]
    fn a_screen_of_many_cells_settles_where_it_does_without_wider_ones() {
        let mut scene = sample("home-theatre");
        scene.microgeometry.width_mm = 8.0;
        let (columns, rows) = (scene.columns(), scene.rows());
        let mut short = vec![0.0; columns * rows];
        guess(&scene, &mut short, 2.0).expect("settles");
        settle(&scene, &Nodes::over(columns, rows, GAPS), &mut short).expect("settles");
        let long = elevation(&scene).expect("settles");
        let off_m = short.iter().zip(&long.z_mm).map(|(a, b)| (a - 1e-3 * b).abs()).fold(0.0, f64::max);
        assert!(off_m < SETTLED_M, "{off_m} m");
    }

    #[test]
    fn interpolating_the_mean_gradient_costs_less_than_a_micrometre() {
        let mut scene = sample("theatre");
        scene.microgeometry.width_mm = 6.0;
        let (columns, rows) = (scene.columns(), scene.rows());
        let mut interpolated = vec![0.0; columns * rows];
        settle(&scene, &Nodes::over(columns, rows, GAPS), &mut interpolated).expect("settles");
        let mut exact = interpolated.clone();
        settle(&scene, &Nodes::over(columns, rows, 1e9), &mut exact).expect("settles");
        let worst_m = interpolated.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst_m < 5e-7, "{worst_m} m");
    }
}
