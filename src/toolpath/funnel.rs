//! Few vertices on the controller's grid for many cutter locations.
//!
//! From a vertex, the lines that stay between the bounds of all positions seen so far form a funnel of
//! slopes; it is narrowed position by position, and the farthest position where it still holds a
//! whole unit becomes the next vertex (the visibility cone of polyline simplification, on integers).
//! Where the bounds are at least a unit apart there is always a next vertex.

/// A vertex: index of the position, height in whole units.
pub(super) type Vertex = (usize, i32);

/// Vertices of a polyline that stays within `low[i] ..= high[i]` (units) at every position and starts
/// and ends at the first and the last one. Positions are equally spaced. Between the bounds vertices
/// are laid as near to `wanted` as they can be.
pub(super) fn simplify(low: &[f64], high: &[f64], wanted: &[f64]) -> Vec<Vertex> {
    let Some(last) = low.len().checked_sub(1) else { return Vec::new() };
    let mut at = 0;
    let mut z = nearest(wanted[0], low[0], high[0]).unwrap_or(low[0].ceil());
    let mut out = vec![(0, z as i32)];
    while at < last {
        let (mut least, mut most) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut next = (at + 1, low[at + 1].ceil());
        for i in at + 1..=last {
            let run = (i - at) as f64;
            least = least.max((low[i] - z) / run);
            most = most.min((high[i] - z) / run);
            if least > most {
                break;
            }
            // The bound at i itself is applied again without the rounding of the division.
            let (from, to) = ((z + least * run).max(low[i]), (z + most * run).min(high[i]));
            if let Some(end) = nearest(wanted[i], from, to) {
                next = (i, end);
            }
        }
        (at, z) = next;
        out.push((at, z as i32));
    }
    straighten(out)
}

/// The whole number in low ..= high that is nearest to `wanted`.
fn nearest(wanted: f64, low: f64, high: f64) -> Option<f64> {
    let (first, last) = (low.ceil(), high.floor());
    (first <= last).then(|| wanted.round().clamp(first, last))
}

/// Leaves out vertices that stand exactly on the line of their neighbours.
pub(super) fn straighten(vertices: Vec<Vertex>) -> Vec<Vertex> {
    let mut out: Vec<Vertex> = Vec::with_capacity(vertices.len());
    for vertex in vertices {
        while let [.., a, b] = out[..] {
            let (ab, bc) = ((b.0 - a.0) as i64, (vertex.0 - b.0) as i64);
            if i64::from(b.1 - a.1) * bc != i64::from(vertex.1 - b.1) * ab {
                break;
            }
            out.pop();
        }
        out.push(vertex);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn height(vertices: &[Vertex], i: usize) -> f64 {
        let k = vertices.partition_point(|v| v.0 <= i).min(vertices.len() - 1).max(1);
        let ((a, za), (b, zb)) = (vertices[k - 1], vertices[k]);
        f64::from(za) + (f64::from(zb) - f64::from(za)) * (i - a) as f64 / (b - a) as f64
    }

    #[test]
    fn a_plane_is_one_move() {
        let wanted: Vec<f64> = (0..5000).map(|i| -0.377 * i as f64).collect();
        let low: Vec<f64> = wanted.iter().map(|w| w - 0.1).collect();
        let high: Vec<f64> = wanted.iter().map(|w| w + 1.1).collect();
        assert_eq!(simplify(&low, &high, &wanted).len(), 2);
    }

    #[test]
    fn one_position_is_one_vertex() {
        assert_eq!(simplify(&[1.2], &[2.3], &[1.3]), vec![(0, 2)]);
        assert!(simplify(&[], &[], &[]).is_empty());
    }

    proptest! {
        #[test]
        fn stays_within_its_bounds(
            wanted in proptest::collection::vec(-500.0..500.0f64, 2..200),
            smooth in 1usize..30,
            below in 0.0..20.0f64,
            above in 0.0..20.0f64,
        ) {
            let wanted: Vec<f64> = (0..wanted.len())
                .map(|i| {
                    let near = &wanted[i.saturating_sub(smooth)..=i];
                    near.iter().sum::<f64>() / near.len() as f64
                })
                .collect();
            let low: Vec<f64> = wanted.iter().map(|w| w - below).collect();
            let high: Vec<f64> = wanted.iter().map(|w| w + 1.0 + above).collect();
            let vertices = simplify(&low, &high, &wanted);
            prop_assert_eq!(vertices[0].0, 0);
            prop_assert_eq!(vertices[vertices.len() - 1].0, wanted.len() - 1);
            for i in 0..wanted.len() {
                let z = height(&vertices, i);
                prop_assert!(z >= low[i] - 1e-9 && z <= high[i] + 1e-9, "{} not in {}..{}", z, low[i], high[i]);
            }
        }
    }
}
