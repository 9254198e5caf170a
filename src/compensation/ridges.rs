//! Edges that can hold a cutter, and the slopes it may have there.

use super::facets::Point;
use super::weld::SAME_MM;

/// Edges around a point that are looked at; each may be left out.
const MOST_AROUND: usize = 12;

/// Directions closer than this are parallel.
const PARALLEL: f64 = 1e-9;

/// An edge between two points, and what its faces ask of the cutter's slope across it, to the left.
pub(super) struct Edge {
    pub(super) a: u32,
    pub(super) b: u32,
    pub(super) low: f64,
    pub(super) high: f64,
    /// Whether there is a face with a gradient on that side.
    pub(super) left: bool,
    pub(super) right: bool,
    /// Something stands straight above it.
    pub(super) dead: bool,
}

impl Edge {
    pub(super) fn new(a: u32, b: u32) -> Edge {
        let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
        Edge { a, b, low, high, left: false, right: false, dead: false }
    }
}

/// An edge that can hold a cutter, or a point.
#[derive(Debug)]
pub(super) struct Ridge {
    /// Corners of its ends.
    pub(super) a: u32,
    pub(super) b: u32,
    /// Slopes of the cutter where it rests on the edge or on an end of it: from a to b, and to the left of that.
    pub(super) along: [f32; 2],
    pub(super) across: [f32; 2],
}

/// An edge in its own directions.
struct Line {
    along: [f64; 2],
    across: [f64; 2],
    length: f64,
    slope: f64,
}

impl Line {
    fn new(a: &[f64; 3], b: &[f64; 3]) -> Line {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = (dx * dx + dy * dy).sqrt();
        let along = [dx / length, dy / length];
        Line { along, across: [-along[1], along[0]], length, slope: (b[2] - a[2]) / length }
    }
}

pub(super) fn down(value: f64) -> f32 {
    (value as f32).next_down()
}

pub(super) fn up(value: f64) -> f32 {
    (value as f32).next_up()
}

/// The edges that are no valleys. `corner_of` gives a corner of each point.
pub(super) fn ridges(
    corners: &[[f64; 3]],
    corner_of: &[u32],
    edges: &[Edge],
    points: &[Point],
) -> Vec<Ridge> {
    let place = |point: u32| &corners[corner_of[point as usize] as usize];
    let ends = |edge: &Edge| [edge.a as usize, edge.b as usize];
    let mut open: Vec<bool> = points.iter().map(|point| point.open).collect();
    for edge in edges.iter().filter(|edge| !(edge.left && edge.right)) {
        ends(edge).into_iter().for_each(|point| open[point] = true);
    }
    // The edges around each open point, counted first.
    let mut starts = vec![0u32; points.len() + 1];
    let mut met = vec![false; points.len()];
    for point in edges.iter().flat_map(ends) {
        met[point] = true;
        starts[point + 1] += u32::from(open[point]);
    }
    for point in 0..points.len() {
        starts[point + 1] += starts[point];
    }
    let mut next = starts.clone();
    let mut around = vec![0u32; starts[points.len()] as usize];
    for (nth, edge) in edges.iter().enumerate() {
        for point in ends(edge).into_iter().filter(|&point| open[point]) {
            around[next[point] as usize] = nth as u32;
            next[point] += 1;
        }
    }
    let mut found = Vec::new();
    let mut halves = Vec::new();
    for edge in edges.iter().filter(|edge| !edge.dead && edge.low <= edge.high) {
        let line = Line::new(place(edge.a), place(edge.b));
        let across = [edge.low, edge.high];
        // Past b the slope along the edge may be less than its own, past a more.
        let mut least = |point: u32, sign: f64| {
            let at = &points[point as usize];
            if at.under {
                return f64::INFINITY;
            }
            if !open[point as usize] {
                let by = line.along.map(|part| sign * part);
                return (0..2).map(|k| (by[k] * at.low[k]).min(by[k] * at.high[k])).sum();
            }
            halves.clear();
            let range = starts[point as usize] as usize..starts[point as usize + 1] as usize;
            for &nth in around[range].iter().take(MOST_AROUND) {
                let other = &edges[nth as usize];
                let to = if other.a == point { other.b } else { other.a };
                let other = Line::new(place(point), place(to));
                let dot = |by: [f64; 2]| other.along[0] * by[0] + other.along[1] * by[1];
                let slack = SAME_MM * (1.0 + other.slope.abs() + 1.0 / other.length);
                halves.push([sign * dot(line.along), dot(line.across), other.slope - slack]);
            }
            least_along(&mut halves, across)
        };
        let low = least(edge.b, 1.0).min(line.slope);
        let high = (-least(edge.a, -1.0)).max(line.slope);
        let slack = SAME_MM * (1.0 + line.slope.abs() + 1.0 / line.length);
        found.push(Ridge {
            a: corner_of[edge.a as usize],
            b: corner_of[edge.b as usize],
            along: [down(low - slack), up(high + slack)],
            across: across_of(across),
        });
    }
    // Needles, of which only the tip is left.
    for point in (0..points.len()).filter(|&point| !met[point] && !points[point].under) {
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        found.push(Ridge { a: corner_of[point], b: corner_of[point], along: all, across: all });
    }
    found
}

fn across_of([low, high]: [f64; 2]) -> [f32; 2] {
    [down(low), up(high)]
}

/// The least x for which some y between `low` and `high` has p x + q y >= m for all [p, q, m]; -inf where there
/// is no least one, or none at all but for rounding.
fn least_along(halves: &mut Vec<[f64; 3]>, [low, high]: [f64; 2]) -> f64 {
    if low.is_finite() {
        halves.push([0.0, 1.0, low]);
    }
    if high.is_finite() {
        halves.push([0.0, -1.0, -high]);
    }
    let endless = |x: f64, y: f64| x < -PARALLEL && halves.iter().all(|[p, q, _]| p * x + q * y >= -PARALLEL);
    if endless(-1.0, 0.0) || halves.iter().any(|&[p, q, _]| endless(q, -p) || endless(-q, p)) {
        return f64::NEG_INFINITY;
    }
    let mut least = f64::INFINITY;
    for (i, &[p, q, m]) in halves.iter().enumerate() {
        if q.abs() <= PARALLEL && halves.iter().all(|half| half[1].abs() <= PARALLEL) {
            // All of them bound x alone.
            let bounds = halves.iter().filter(|half| half[0] > 0.0).map(|half| half[2] / half[0]);
            return bounds.fold(f64::NEG_INFINITY, f64::max);
        }
        for &[p2, q2, m2] in &halves[..i] {
            let det = p * q2 - p2 * q;
            if det.abs() <= PARALLEL {
                continue;
            }
            let (x, y) = ((m * q2 - m2 * q) / det, (p * m2 - p2 * m) / det);
            let slack = SAME_MM * (1.0 + x.abs() + y.abs());
            if x < least && halves.iter().all(|[p, q, m]| p * x + q * y >= m - slack) {
                least = x - slack;
            }
        }
    }
    if least < f64::INFINITY { least } else { f64::NEG_INFINITY }
}
