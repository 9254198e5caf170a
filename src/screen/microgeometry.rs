//! One cell: the convex surface whose facets have given gradients and projected areas.
//!
//! The paper's Minkowski problem with a square base (section 3.1, Eqs. 4 to 8) is a semi-discrete
//! optimal transport problem on the square: of u(x) = min_i (g_i . x + c_i) find the offsets c for
//! which plane i is the lowest over an area p_i. It is solved by the damped Newton method of
//! Kitagawa, Merigot and Thibert, "Convergence of a Newton algorithm for semi-discrete optimal
//! transport", J. Eur. Math. Soc. 21 (2019), doi:10.4171/jems/889.

use std::sync::Once;

use faer::prelude::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Par, Side};

use super::power::{Diagram, SIDES, area_and_moments};

/// Gradients closer than this are one facet.
pub const SAME_GRADIENT: f64 = 1e-9;
/// Facets of less than this part of the mean area are dropped.
pub const NO_AREA: f64 = 1e-9;
const ITERATIONS: usize = 200;
/// Smallest Newton step that is tried.
const SMALLEST_STEP: f64 = 1e-9;

/// A solved cell: bump z = min_k(gradient_k . p + offset_k), p in mm from the cell's centre, with
/// mean height zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    pub gradients: Vec<[f64; 2]>,
    pub offsets_mm: Vec<f64>,
    /// Wanted projected areas; their sum is the cell's.
    pub areas_mm2: Vec<f64>,
    /// Projected areas that the offsets give.
    pub achieved_mm2: Vec<f64>,
    /// For each facet given, the one it was merged into; None if it was dropped for its area.
    pub merged_into: Vec<Option<usize>>,
    pub iterations: usize,
}

/// The areas were not reached: the largest relative error and the steps made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotConverged {
    pub error: f64,
    pub iterations: usize,
}

/// Buffers that are kept from one cell to the next; they carry nothing over.
#[derive(Default)]
pub struct Workspace {
    diagram: Diagram,
    gx: Vec<f64>,
    gy: Vec<f64>,
}

/// Finds the offsets for facets of these gradients and areas (up to a common factor) over a
/// square of side `width_mm`, to a largest relative area error of `tolerance`. Equal gradients are
/// merged and facets of no area dropped, so the solution may have fewer.
pub fn solve(
    workspace: &mut Workspace,
    gradients: &[[f64; 2]],
    weights: &[f64],
    width_mm: f64,
    tolerance: f64,
) -> Result<Solution, NotConverged> {
    let mut cell = merge(gradients, weights, width_mm * width_mm);
    let Workspace { diagram, gx, gy } = workspace;
    gx.clear();
    gy.clear();
    gx.extend(cell.gradients.iter().map(|g| g[0]));
    gy.extend(cell.gradients.iter().map(|g| g[1]));
    diagram.forget();
    let half = 0.5 * width_mm;
    let p = &cell.areas_mm2;
    let n = p.len();
    let areas = |diagram: &mut Diagram, c: &[f64]| -> Vec<f64> {
        diagram.compute(gx, gy, c, [-half; 2], [half; 2]);
        (0..n).map(|i| area_and_moments(diagram.polygon(i)).0).collect()
    };
    let mut c = quadratic_start(&cell.gradients, half);
    let mut a = areas(diagram, &c);
    let least = |list: &[f64]| list.iter().copied().fold(f64::INFINITY, f64::min);
    let floor = 0.5 * least(p).min(least(&a));
    let (mut error, mut iterations) = (worst(&a, p), 0);
    while error > tolerance {
        if iterations == ITERATIONS {
            return Err(NotConverged { error, iterations });
        }
        diagram.remember();
        let mut r: Vec<f64> = a.iter().zip(p).map(|(a, p)| a - p).collect();
        // The sum is zero but for rounding, which the singular Laplacian would blow up.
        let mean = r.iter().sum::<f64>() / n as f64;
        r.iter_mut().for_each(|r| *r -= mean);
        let size = norm(&r);
        let step = newton_step(diagram, gx, gy, &r).ok_or(NotConverged { error, iterations })?;
        let mut t = 1.0;
        loop {
            let tried: Vec<f64> = c.iter().zip(&step).map(|(c, d)| c + t * d).collect();
            let b = areas(diagram, &tried);
            let left: Vec<f64> = b.iter().zip(p).map(|(b, p)| b - p).collect();
            if least(&b) >= floor && norm(&left) <= (1.0 - 0.5 * t) * size {
                (c, a) = (tried, b);
                break;
            }
            // Where rounding is all that is left, the last step may have done what can be done.
            if worst(&b, p) <= tolerance {
                (c, a) = (tried, b);
                break;
            }
            t *= 0.5;
            if t < SMALLEST_STEP {
                return Err(NotConverged { error, iterations });
            }
        }
        iterations += 1;
        error = worst(&a, p);
    }
    let mut volume = 0.0;
    for i in 0..n {
        let (area, [mx, my]) = area_and_moments(diagram.polygon(i));
        volume += gx[i] * mx + gy[i] * my + c[i] * area;
    }
    let mean = volume / (width_mm * width_mm);
    cell.offsets_mm = c.iter().map(|c| c - mean).collect();
    cell.achieved_mm2 = a;
    cell.iterations = iterations;
    Ok(cell)
}

fn worst(areas: &[f64], wanted: &[f64]) -> f64 {
    areas.iter().zip(wanted).map(|(a, p)| (a - p).abs() / p).fold(0.0, f64::max)
}

fn norm(list: &[f64]) -> f64 {
    list.iter().map(|v| v * v).sum::<f64>().sqrt()
}

fn merge(gradients: &[[f64; 2]], weights: &[f64], area_mm2: f64) -> Solution {
    let negligible = NO_AREA * weights.iter().sum::<f64>() / weights.len() as f64;
    let mut cell = Solution {
        gradients: Vec::with_capacity(gradients.len()),
        offsets_mm: Vec::new(),
        areas_mm2: Vec::with_capacity(gradients.len()),
        achieved_mm2: Vec::new(),
        merged_into: Vec::with_capacity(gradients.len()),
        iterations: 0,
    };
    for (g, &p) in gradients.iter().zip(weights) {
        if p <= negligible {
            cell.merged_into.push(None);
            continue;
        }
        let same = |h: &[f64; 2]| (g[0] - h[0]).powi(2) + (g[1] - h[1]).powi(2) < SAME_GRADIENT.powi(2);
        match cell.gradients.iter().position(same) {
            Some(at) => {
                cell.areas_mm2[at] += p;
                cell.merged_into.push(Some(at));
            }
            None => {
                cell.merged_into.push(Some(cell.gradients.len()));
                cell.gradients.push(*g);
                cell.areas_mm2.push(p);
            }
        }
    }
    let scale = area_mm2 / cell.areas_mm2.iter().sum::<f64>();
    cell.areas_mm2.iter_mut().for_each(|p| *p *= scale);
    cell
}

/// Planes that touch a concave quadratic at points inside the square: each is the lowest at its
/// own point, so no cell starts empty.
fn quadratic_start(gradients: &[[f64; 2]], half_mm: f64) -> Vec<f64> {
    let mut centre = [0.0; 2];
    let mut extent = [0.0; 2];
    for axis in 0..2 {
        let low = gradients.iter().map(|g| g[axis]).fold(f64::INFINITY, f64::min);
        let high = gradients.iter().map(|g| g[axis]).fold(f64::NEG_INFINITY, f64::max);
        centre[axis] = 0.5 * (low + high);
        extent[axis] = 0.5 * (high - low);
    }
    let widest = extent[0].max(extent[1]);
    let scale = extent.map(|e| {
        let e = if e > 1e-9 * widest { e } else { widest };
        if e > 0.0 { 0.9 * half_mm / e } else { 0.0 }
    });
    let bowl = |g: &[f64; 2]| {
        let d = [g[0] - centre[0], g[1] - centre[1]];
        0.5 * (scale[0] * d[0] * d[0] + scale[1] * d[1] * d[1])
    };
    gradients.iter().map(bowl).collect()
}

/// Solves L d = r for the graph Laplacian L of the diagram, W_ij = length of the edge between i
/// and j over |g_i - g_j|: the areas' derivative is -L. One unknown is pinned, since only
/// differences count. None if L is singular beyond that.
fn newton_step(diagram: &Diagram, gx: &[f64], gy: &[f64], r: &[f64]) -> Option<Vec<f64>> {
    // Cells are what runs in parallel; a factorisation split over threads would round by their number.
    static ONE_THREAD: Once = Once::new();
    ONE_THREAD.call_once(|| faer::set_global_parallelism(Par::Seq));
    let n = r.len();
    if n < 2 {
        return Some(vec![0.0; n]);
    }
    let mut diagonal = vec![0.0; n];
    let mut entries: Vec<Triplet<u32, u32, f64>> = Vec::with_capacity(5 * n);
    for i in 0..n {
        let polygon = diagram.polygon(i);
        for (at, &(from, label)) in polygon.iter().enumerate() {
            // Each edge once, from its lower side, so that L is symmetric to the bit.
            if label >= SIDES[0] || label as usize <= i {
                continue;
            }
            let j = label as usize;
            let to = polygon[(at + 1) % polygon.len()].0;
            let length = (to[0] - from[0]).hypot(to[1] - from[1]);
            let weight = length / (gx[i] - gx[j]).hypot(gy[i] - gy[j]);
            diagonal[i] += weight;
            diagonal[j] += weight;
            if j < n - 1 {
                entries.push(Triplet::new(label, i as u32, -weight));
            }
        }
    }
    entries.extend((0..n - 1).map(|i| Triplet::new(i as u32, i as u32, diagonal[i])));
    let matrix = SparseColMat::<u32, f64>::try_new_from_triplets(n - 1, n - 1, &entries).ok()?;
    let factors = matrix.sp_cholesky(Side::Lower).ok()?;
    let right = Mat::from_fn(n - 1, 1, |i, _| r[i]);
    let solved = factors.solve(&right);
    let mut step: Vec<f64> = (0..n - 1).map(|i| solved[(i, 0)]).collect();
    step.push(0.0);
    step.iter().all(|d| d.is_finite()).then_some(step)
}
