//! The plain solver of a cell, as the oracle of the quick one and what its bench is measured by:
//! every pair of planes clips, every start is cold, a general sparse factorisation solves each step.

use faer::prelude::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};

type Vertex = ([f64; 2], usize);

fn clip(polygon: &[Vertex], normal: [f64; 2], offset: f64, label: usize) -> Vec<Vertex> {
    let beyond = |p: [f64; 2]| normal[0] * p[0] + normal[1] * p[1] - offset;
    let mut kept = Vec::new();
    for (at, &(p, edge)) in polygon.iter().enumerate() {
        let q = polygon[(at + 1) % polygon.len()].0;
        let (d, e) = (beyond(p), beyond(q));
        if d <= 0.0 {
            kept.push((p, edge));
        }
        if (d <= 0.0) != (e <= 0.0) {
            let t = d / (d - e);
            let cut = [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
            kept.push((cut, if d <= 0.0 { label } else { edge }));
        }
    }
    kept
}

/// Where each plane is the lowest of the square; labels past the planes are the square's sides.
pub fn diagram(g: &[[f64; 2]], c: &[f64], half: f64) -> Vec<Vec<Vertex>> {
    let n = g.len();
    (0..n)
        .map(|i| {
            let mut polygon = vec![
                ([-half, -half], n),
                ([half, -half], n + 1),
                ([half, half], n + 2),
                ([-half, half], n + 3),
            ];
            for j in (0..n).filter(|&j| j != i) {
                polygon = clip(&polygon, [g[i][0] - g[j][0], g[i][1] - g[j][1]], c[j] - c[i], j);
            }
            polygon
        })
        .collect()
}

pub fn area(polygon: &[Vertex]) -> f64 {
    let mut doubled = 0.0;
    for (at, &(p, _)) in polygon.iter().enumerate() {
        let q = polygon[(at + 1) % polygon.len()].0;
        doubled += p[0] * q[1] - p[1] * q[0];
    }
    0.5 * doubled
}

fn start(g: &[[f64; 2]], half: f64) -> Vec<f64> {
    let bound = |axis: usize, of: fn(f64, f64) -> f64| g.iter().map(|g| g[axis]).reduce(of).unwrap_or(0.0);
    let (low, high) = ([0, 1].map(|axis| bound(axis, f64::min)), [0, 1].map(|axis| bound(axis, f64::max)));
    g.iter()
        .map(|g| {
            let along = |axis: usize| {
                let d = g[axis] - 0.5 * (low[axis] + high[axis]);
                0.45 * half * d * d / (0.5 * (high[axis] - low[axis]))
            };
            along(0) + along(1)
        })
        .collect()
}

/// Offsets (up to a constant) for facets of these gradients and areas that sum to the square's, to
/// a relative error of 1e-6, and the Newton steps taken. For gradients that spread both ways.
pub fn solve(g: &[[f64; 2]], p: &[f64], width: f64) -> (Vec<f64>, usize) {
    let (n, half) = (g.len(), 0.5 * width);
    let areas = |c: &[f64]| -> (Vec<Vec<Vertex>>, Vec<f64>) {
        let cells = diagram(g, c, half);
        let areas = cells.iter().map(|cell| area(cell)).collect();
        (cells, areas)
    };
    let least = |list: &[f64]| list.iter().copied().fold(f64::INFINITY, f64::min);
    let norm = |list: &[f64]| list.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut c = start(g, half);
    let (mut cells, mut a) = areas(&c);
    let floor = 0.5 * least(p).min(least(&a));
    for steps in 0..100 {
        let mut r: Vec<f64> = a.iter().zip(p).map(|(a, p)| a - p).collect();
        if r.iter().zip(p).all(|(r, p)| r.abs() <= 1e-6 * p) {
            return (c, steps);
        }
        let mean = r.iter().sum::<f64>() / n as f64;
        r.iter_mut().for_each(|r| *r -= mean);
        let mut diagonal = vec![0.0; n];
        let mut entries = Vec::new();
        for (i, cell) in cells.iter().enumerate() {
            for (at, &(from, j)) in cell.iter().enumerate().filter(|(_, v)| v.1 < n && v.1 > i) {
                let to = cell[(at + 1) % cell.len()].0;
                let length = (to[0] - from[0]).hypot(to[1] - from[1]);
                let weight = length / (g[i][0] - g[j][0]).hypot(g[i][1] - g[j][1]);
                diagonal[i] += weight;
                diagonal[j] += weight;
                if j < n - 1 {
                    entries.push(Triplet::new(j, i, -weight));
                }
            }
        }
        entries.extend((0..n - 1).map(|i| Triplet::new(i, i, diagonal[i])));
        let matrix =
            SparseColMat::<usize, f64>::try_new_from_triplets(n - 1, n - 1, &entries).expect("a matrix");
        let solved =
            matrix.sp_cholesky(Side::Lower).expect("positive").solve(&Mat::from_fn(n - 1, 1, |i, _| r[i]));
        let step = |i: usize| if i < n - 1 { solved[(i, 0)] } else { 0.0 };
        let mut t = 1.0;
        loop {
            let tried: Vec<f64> = (0..n).map(|i| c[i] + t * step(i)).collect();
            let (new_cells, b) = areas(&tried);
            let left: Vec<f64> = b.iter().zip(p).map(|(b, p)| b - p).collect();
            if least(&b) >= floor && norm(&left) <= (1.0 - 0.5 * t) * norm(&r) {
                (c, cells, a) = (tried, new_cells, b);
                break;
            }
            t *= 0.5;
            assert!(t > 1e-9, "the plain solver is stuck");
        }
    }
    panic!("the plain solver does not end");
}
