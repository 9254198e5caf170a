//! The drop of a cutter on planar faces by its definition, and reliefs that are hard on it.

use super::surfaces::Random;
use screenmill::compensation::Profile;

/// Steps of a search; each leaves two thirds.
const STEPS: usize = 62;

/// Place of the greatest value of a concave function.
fn search(mut low: f64, mut high: f64, at: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..STEPS {
        let (p, q) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(p) < at(q) {
            low = p;
        } else {
            high = q;
        }
    }
    at(0.5 * (low + high)).max(at(low)).max(at(high))
}

/// Height of a cutter's lowest point on convex faces with its axis at a place; -inf where it touches none.
pub fn drop_mm(faces: &[Vec<[f64; 3]>], profile: &Profile, axis: [f64; 2]) -> f64 {
    let reach = profile.radius_mm();
    let s = |d: f64| profile.s_mm(d.min(reach)).unwrap_or(f64::NEG_INFINITY);
    let mut best = f64::NEG_INFINITY;
    for face in faces {
        let near = (0..2).all(|k| {
            face.iter().any(|c| c[k] <= axis[k] + reach) && face.iter().any(|c| c[k] >= axis[k] - reach)
        });
        if !near {
            continue;
        }
        let edges = || (0..face.len()).map(|i| (face[i], face[(i + 1) % face.len()]));
        for (a, b) in edges() {
            // Where the edge is in reach, between t = 0 and 1.
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let (px, py) = (a[0] - axis[0], a[1] - axis[1]);
            let (square, half) = (dx * dx + dy * dy, px * dx + py * dy);
            let within = half * half - square * (px * px + py * py - reach * reach);
            let (low, high) = if square == 0.0 {
                (0.0, if px.hypot(py) <= reach { 1.0 } else { -1.0 })
            } else if within < 0.0 {
                continue;
            } else {
                let root = within.sqrt();
                (((-half - root) / square).max(0.0), ((root - half) / square).min(1.0))
            };
            if low <= high {
                let at = |t: f64| a[2] + t * (b[2] - a[2]) + s((px + t * dx).hypot(py + t * dy));
                best = best.max(search(low, high, at));
            }
        }
        // The plane, where it is touched inside: the point of the cutter that has its slope lies uphill.
        let (a, b, c) = (face[0], face[1], face[2]);
        let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
        let area = u[0] * v[1] - u[1] * v[0];
        if area.abs() < 1e-12 {
            continue;
        }
        let g = [(u[2] * v[1] - v[2] * u[1]) / area, (v[2] * u[0] - u[2] * v[0]) / area];
        let slope = g[0].hypot(g[1]);
        if slope < 1e-12 {
            let inside = edges().all(|(a, b)| {
                area * ((b[0] - a[0]) * (axis[1] - a[1]) - (b[1] - a[1]) * (axis[0] - a[0])) >= 0.0
            });
            best = if inside { best.max(a[2]) } else { best };
            continue;
        }
        let (mut low, mut high) = (0.0, reach);
        for _ in 0..STEPS {
            let (p, q) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if slope * p + s(p) < slope * q + s(q) { low = p } else { high = q }
        }
        let r = 0.5 * (low + high);
        let at = [0, 1].map(|k| axis[k] + g[k] / slope * r);
        let inside = edges()
            .all(|(a, b)| area * ((b[0] - a[0]) * (at[1] - a[1]) - (b[1] - a[1]) * (at[0] - a[0])) >= 0.0);
        if inside {
            best = best.max(a[2] + g[0] * (at[0] - a[0]) + g[1] * (at[1] - a[1]) + s(r));
        }
    }
    best
}

/// Triangles over n x n jittered squares of 0.31 mm, rough, with columns that stand on some of them,
/// a needle, and gaps whose borders nothing adjoins.
pub fn relief(n: usize, seed: u64) -> Vec<Vec<[f64; 3]>> {
    let mut random = Random(seed);
    let mut corner = |i: usize, j: usize| {
        let z = if random.next() < 0.3 { 0.6 } else { 0.1 } * random.next();
        [0.31 * i as f64 + 0.12 * random.next(), 0.31 * j as f64 + 0.12 * random.next(), z]
    };
    let corners: Vec<Vec<[f64; 3]>> = (0..=n).map(|j| (0..=n).map(|i| corner(i, j)).collect()).collect();
    let mut faces = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let (a, b) = (corners[j][i], corners[j][i + 1]);
            let (c, d) = (corners[j + 1][i + 1], corners[j + 1][i]);
            let kind = random.next();
            if kind < 0.05 {
                continue;
            }
            let split = if kind < 0.5 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
            faces.extend(split.map(Vec::from));
            if random.next() < 0.15 {
                let [x, y, z] = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
                let (top, half) = (z + 0.4 * random.next(), 0.03 + 0.05 * random.next());
                let foot =
                    [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]];
                faces.push(foot.iter().map(|[x, y]| [*x, *y, top]).collect());
                for (k, p) in foot.iter().enumerate() {
                    let q = foot[(k + 1) % 4];
                    let at = |p: &[f64; 2], z: f64| [p[0], p[1], z];
                    faces.push(vec![at(p, 0.0), at(&q, 0.0), at(&q, top)]);
                    faces.push(vec![at(p, 0.0), at(&q, top), at(p, top)]);
                }
            }
        }
    }
    faces.push(vec![[0.7, 0.7, 0.0], [0.7, 0.7, 0.5], [0.7, 0.7, 0.2]]);
    faces
}
