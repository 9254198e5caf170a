//! One cell: the convex surface whose facets have given gradients and projected areas.
//!
//! The paper's Minkowski problem with a square base (section 3.1, Eqs. 4 to 8) is a semi-discrete
//! optimal transport problem on the square: of u(x) = min_i (g_i . x + c_i) find the offsets c for
//! which plane i is the lowest over an area p_i. It is solved by the damped Newton method of
//! Kitagawa, Merigot and Thibert, "Convergence of a Newton algorithm for semi-discrete optimal
//! transport", J. Eur. Math. Soc. 21 (2019), doi:10.4171/jems/889.

use super::laplacian::Laplacian;
use super::power::{Diagram, SIDES, area, area_and_moments};

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
    /// Largest relative area error at the start and after each iteration.
    pub history: Vec<f64>,
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
    laplacian: Laplacian,
    gx: Vec<f64>,
    gy: Vec<f64>,
    p: Vec<f64>,
    tried: Vec<f64>,
    b: Vec<f64>,
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
    let Workspace { diagram, laplacian, gx, gy, p, tried, b } = workspace;
    let order = sweep_order(&cell.gradients);
    let n = order.len();
    let arranged = |out: &mut Vec<f64>, of: &dyn Fn(usize) -> f64| {
        out.clear();
        out.extend(order.iter().map(|&k| of(k)));
    };
    arranged(gx, &|k| cell.gradients[k][0]);
    arranged(gy, &|k| cell.gradients[k][1]);
    arranged(p, &|k| cell.areas_mm2[k]);
    diagram.forget();
    let half = 0.5 * width_mm;
    let areas = |diagram: &mut Diagram, c: &[f64], out: &mut Vec<f64>| {
        diagram.compute(gx, gy, c, [-half; 2], [half; 2]);
        out.clear();
        out.extend((0..n).map(|i| area(diagram.polygon(i))));
    };
    let start = quadratic_start(&cell.gradients, half);
    let mut c: Vec<f64> = order.iter().map(|&k| start[k]).collect();
    let mut a = Vec::with_capacity(n);
    areas(diagram, &c, &mut a);
    let least = |list: &[f64]| list.iter().copied().fold(f64::INFINITY, f64::min);
    let floor = 0.5 * least(p).min(least(&a));
    let (mut error, mut iterations) = (worst(&a, p), 0);
    cell.history.push(error);
    let mut r = Vec::with_capacity(n);
    while error > tolerance {
        if iterations == ITERATIONS {
            return Err(NotConverged { error, iterations });
        }
        diagram.remember();
        r.clear();
        r.extend(a.iter().zip(&*p).map(|(a, p)| a - p));
        // The sum is zero but for rounding, which the singular Laplacian would blow up.
        let mean = r.iter().sum::<f64>() / n as f64;
        r.iter_mut().for_each(|r| *r -= mean);
        let size = norm(r.iter().copied());
        couple(laplacian, diagram, gx, gy);
        let step = laplacian.solve(&r).ok_or(NotConverged { error, iterations })?;
        let mut t = 1.0;
        loop {
            tried.clear();
            tried.extend(c.iter().zip(&step).map(|(c, d)| c + t * d));
            areas(diagram, tried, b);
            let left = norm(b.iter().zip(&*p).map(|(b, p)| b - p));
            // Where rounding is all that is left, the last step may have done what can be done.
            if (least(b) >= floor && left <= (1.0 - 0.5 * t) * size) || worst(b, p) <= tolerance {
                std::mem::swap(&mut c, tried);
                std::mem::swap(&mut a, b);
                break;
            }
            t *= 0.5;
            if t < SMALLEST_STEP {
                return Err(NotConverged { error, iterations });
            }
        }
        iterations += 1;
        error = worst(&a, p);
        cell.history.push(error);
    }
    let mut volume = 0.0;
    for i in 0..n {
        let (area, [mx, my]) = area_and_moments(diagram.polygon(i));
        volume += gx[i] * mx + gy[i] * my + c[i] * area;
    }
    let mean = volume / (width_mm * width_mm);
    cell.offsets_mm = vec![0.0; n];
    cell.achieved_mm2 = vec![0.0; n];
    for (at, &k) in order.iter().enumerate() {
        cell.offsets_mm[k] = c[at] - mean;
        cell.achieved_mm2[k] = a[at];
    }
    cell.iterations = iterations;
    Ok(cell)
}

/// Facets along the axis in which their gradients spread further: neighbours stand near each other
/// in this order, which the linear system and the search for neighbours live by.
fn sweep_order(gradients: &[[f64; 2]]) -> Vec<usize> {
    let extent = |axis: usize| {
        let values = gradients.iter().map(|g| g[axis]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    let axis = usize::from(extent(1) > extent(0));
    let mut order: Vec<usize> = (0..gradients.len()).collect();
    order.sort_unstable_by(|&a, &b| gradients[a][axis].total_cmp(&gradients[b][axis]).then(a.cmp(&b)));
    order
}

fn worst(areas: &[f64], wanted: &[f64]) -> f64 {
    areas.iter().zip(wanted).map(|(a, p)| (a - p).abs() / p).fold(0.0, f64::max)
}

fn norm(list: impl Iterator<Item = f64>) -> f64 {
    list.map(|v| v * v).sum::<f64>().sqrt()
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
        history: Vec::new(),
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

/// The graph Laplacian L of the diagram, W_ij = length of the edge between i and j over
/// |g_i - g_j|: the areas' derivative is -L.
fn couple(laplacian: &mut Laplacian, diagram: &Diagram, gx: &[f64], gy: &[f64]) {
    laplacian.clear(gx.len());
    for i in 0..gx.len() {
        let polygon = diagram.polygon(i);
        for (at, &(from, label)) in polygon.iter().enumerate() {
            // Each edge once, from its lower side, so that L is symmetric to the bit.
            if label >= SIDES[0] || label as usize <= i {
                continue;
            }
            let j = label as usize;
            let to = polygon[if at + 1 < polygon.len() { at + 1 } else { 0 }].0;
            let (ex, ey) = (to[0] - from[0], to[1] - from[1]);
            let (dx, dy) = (gx[i] - gx[j], gy[i] - gy[j]);
            laplacian.couple(i, j, ((ex * ex + ey * ey) / (dx * dx + dy * dy)).sqrt());
        }
    }
}
