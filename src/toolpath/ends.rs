//! Vertices of a mirror's moves where its heights fall on a coarse grid.
//!
//! On a grid of 10 um a move over a facet of 0.3 mm whose ends are rounded turns the mirror by degrees, and
//! a pass that runs higher than its neighbours is cut away by them, so that their flanks, turned by
//! height / stepover, stand in its place. Both are angles. Of all polylines on the grid that stay between
//! the bounds this one has the least sum of
//!
//! ```text
//!   w ((s - g)^2 + FLANKS ((z - b) / stepover)^2)   at every position, and BLOCK for each move
//! ```
//!
//! s, z: slope and height of the move; g, b: those of the exact cutter location; w: how much of the surface the
//! position makes. A ball that rolls over a crease stands on one line of it all the way, so w is 0 there, and a
//! short move of a wrong slope costs nothing. Found by dynamic programming over (position, unit): from each,
//! the funnel of slopes that stay between the bounds, and the sums of the least squares kept as it goes.

use super::funnel::{Vertex, straighten};
use super::table::{Bounds, Table};

/// Both flanks of a pass turn when it is off, each by the difference of two passes: between once and four times
/// the square of one. The light of a designed tile is best at four, and flat from there on.
pub(super) const FLANKS: f64 = 4.0;

/// What a move costs, in square radians times mm: half a degree over a quarter of a millimetre.
pub(super) const BLOCK: f64 = 2e-5;

/// What the squares are measured in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    pub(super) unit_mm: f64,
    /// Between positions.
    pub(super) pitch_mm: f64,
    pub(super) stepover_mm: f64,
    /// Radius of the cutter's round tip; 0 without one.
    pub(super) tip_mm: f64,
}

/// How much of the surface each position makes, 0 to 1: the contact moves by 1 + r z'' of what the axis does.
pub(super) fn weights(exact: &[f64], measure: &Measure) -> Vec<f64> {
    let bend = measure.tip_mm * measure.unit_mm / (measure.pitch_mm * measure.pitch_mm);
    (0..exact.len())
        .map(|i| match exact.get(i.wrapping_sub(1)..(i + 2).min(exact.len())) {
            Some(&[a, b, c]) => (1.0 + bend * (a - 2.0 * b + c)).clamp(0.0, 1.0),
            _ => 1.0,
        })
        .collect()
}

/// Vertices within `low[i] ..= high[i]` (units) at every position, from the first to the last, that follow
/// `exact` best. The bounds must be a unit apart.
pub(super) fn lay(low: &[f64], high: &[f64], exact: &[f64], measure: &Measure) -> Vec<Vertex> {
    if low.is_empty() {
        return Vec::new();
    }
    let ends: Vec<[f64; 2]> = low.iter().zip(high).map(|(low, high)| [*low, *high]).collect();
    let off = vec![[0.0; 2]; low.len()];
    straighten(lay_between(&Bounds { low, high, ends: &ends, off: &off }, exact, measure))
}

/// The same where moves may end elsewhere than they may pass.
pub(super) fn lay_between(bounds: &Bounds, exact: &[f64], measure: &Measure) -> Vec<Vertex> {
    Table::filled(bounds, exact, measure).best(bounds.off)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    const MEASURE: Measure = Measure { unit_mm: 0.01, pitch_mm: 0.01, stepover_mm: 0.05, tip_mm: 0.5 };

    /// The objective by its definition.
    pub(in super::super) fn cost(vertices: &[Vertex], exact: &[f64], measure: &Measure) -> f64 {
        let weights = weights(exact, measure);
        let mut sum = 0.0;
        for pair in vertices.windows(2) {
            let ((a, za), (b, zb)) = (pair[0], pair[1]);
            let s = f64::from(zb - za) / (b - a) as f64;
            sum += BLOCK;
            for i in a + 1..=b {
                let turned = (s - (exact[i] - exact[i - 1])) * measure.unit_mm / measure.pitch_mm;
                let raised = (f64::from(za) + s * (i - a) as f64 - exact[i]) * measure.unit_mm;
                let off = turned.powi(2) + FLANKS * (raised / measure.stepover_mm).powi(2);
                sum += weights[i] * measure.pitch_mm * off;
            }
        }
        sum
    }

    /// Every polyline between the bounds, tried.
    fn least(low: &[f64], high: &[f64], exact: &[f64], done: &mut Vec<Vertex>, best: &mut f64) {
        let (i, z) = done[done.len() - 1];
        if i + 1 == low.len() {
            *best = best.min(cost(done, exact, &MEASURE));
            return;
        }
        for j in i + 1..low.len() {
            for end in low[j].ceil() as i32..=high[j].floor() as i32 {
                let s = f64::from(end - z) / (j - i) as f64;
                let inside = (i + 1..j).all(|p| {
                    let line = f64::from(z) + s * (p - i) as f64;
                    line >= low[p] && line <= high[p]
                });
                if inside {
                    done.push((j, end));
                    least(low, high, exact, done, best);
                    done.pop();
                }
            }
        }
    }

    fn bounds(exact: &[f64]) -> (Vec<f64>, Vec<f64>) {
        (exact.iter().map(|z| z - 0.1).collect(), exact.iter().map(|z| z + 0.95).collect())
    }

    #[test]
    fn a_facet_between_two_others_keeps_its_slope() {
        // Heights of 0.3 mm facets that no unit fits, at slopes that a grid of 10 um cannot draw.
        let slopes = [0.217, -0.131, 0.083];
        let mut exact = vec![0.43];
        for slope in slopes {
            exact.extend((0..30).map(|_| slope).scan(exact[exact.len() - 1], |z, s| {
                *z += s;
                Some(*z)
            }));
        }
        let (low, high) = bounds(&exact);
        let vertices = lay(&low, &high, &exact, &MEASURE);
        for (middle, slope) in [15, 45, 75].into_iter().zip(slopes) {
            let after = vertices.partition_point(|v| v.0 <= middle);
            let ((a, za), (b, zb)) = (vertices[after - 1], vertices[after]);
            assert!(b - a >= 12, "{vertices:?}");
            let turned = f64::from(zb - za) / (b - a) as f64 - slope;
            assert!(turned.abs() < 0.01, "turned by {turned} at {middle}, {vertices:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_polyline_is_better(
            start in 0.0..1.0f64,
            slopes in proptest::collection::vec(-0.6..0.6f64, 2..4),
            length in 2usize..5,
        ) {
            let mut exact = vec![start];
            for slope in slopes {
                for _ in 0..length {
                    exact.push(exact[exact.len() - 1] + slope);
                }
            }
            let (low, high) = bounds(&exact);
            let found = cost(&lay(&low, &high, &exact, &MEASURE), &exact, &MEASURE);
            let mut best = f64::INFINITY;
            for z in low[0].ceil() as i32..=high[0].floor() as i32 {
                least(&low, &high, &exact, &mut vec![(0, z)], &mut best);
            }
            prop_assert!(found <= best + 1e-9, "{} of {}", found, best);
        }

        #[test]
        fn stays_within_its_bounds(
            steps in proptest::collection::vec(-3.0..3.0f64, 1..150),
            lift in proptest::collection::vec(0.0..5.0f64, 150),
        ) {
            let exact: Vec<f64> = steps.iter().scan(0.0, |z, s| { *z += s; Some(*z) }).collect();
            let bound: Vec<f64> = exact.iter().zip(&lift).map(|(z, l)| z + (l - 4.0).max(0.0)).collect();
            let (low, high) = bounds(&bound);
            let vertices = lay(&low, &high, &exact, &MEASURE);
            prop_assert_eq!((vertices[0].0, vertices[vertices.len() - 1].0), (0, exact.len() - 1));
            for pair in vertices.windows(2) {
                let ((a, za), (b, zb)) = (pair[0], pair[1]);
                for i in a..=b {
                    let line = f64::from(za) + f64::from(zb - za) * (i - a) as f64 / (b - a) as f64;
                    prop_assert!(line >= low[i] - 1e-9 && line <= high[i] + 1e-9, "{} at {}", line, i);
                }
            }
        }

        /// Heights off the grid's units, ends that lie elsewhere than what may be passed, and positions where all ends.
        #[test]
        fn moves_end_where_they_may(
            steps in proptest::collection::vec(-1.5..1.5f64, 2..80),
            raised in proptest::collection::vec(-0.4..0.4f64, 80),
            off in proptest::collection::vec(-0.9..0.9f64, 81),
            stops in proptest::collection::vec(0..12usize, 80),
        ) {
            let exact: Vec<f64> = steps.iter().scan(0.0, |z, s| { *z += s; Some(*z) }).collect();
            let count = exact.len();
            let stop = |i: usize| i == 0 || i + 1 == count || stops[i] == 0;
            let low: Vec<f64> = (0..count).map(|i| if stop(i) { f64::INFINITY } else { exact[i] }).collect();
            let high: Vec<f64> =
                (0..count).map(|i| if stop(i) { f64::NEG_INFINITY } else { exact[i] + 0.9 }).collect();
            let ends: Vec<[f64; 2]> =
                exact.iter().zip(&raised).map(|(z, up)| [z + up, z + up + 1.0]).collect();
            let off: Vec<[f64; 2]> =
                (0..count).map(|i| [off[i], if stop(i) { off[i + 1] } else { 0.0 }]).collect();
            let bounds = Bounds { low: &low, high: &high, ends: &ends, off: &off };
            let vertices = lay_between(&bounds, &exact, &MEASURE);
            prop_assert_eq!((vertices[0].0, vertices[vertices.len() - 1].0), (0, count - 1));
            prop_assert!((0..count).filter(|&i| stop(i)).all(|i| vertices.iter().any(|v| v.0 == i)));
            for pair in vertices.windows(2) {
                let ((a, za), (b, zb)) = (pair[0], pair[1]);
                let from = f64::from(za) + off[a][0] + off[a][1];
                let to = f64::from(zb) + off[b][0];
                prop_assert!(to >= ends[b][0] - 1e-9 && to <= ends[b][1] + 1e-9, "{} at {}", to, b);
                for i in a + 1..b {
                    let line = from + (to - from) * (i - a) as f64 / (b - a) as f64;
                    prop_assert!(line >= low[i] - 1e-9 && line <= high[i] + 1e-9, "{} at {}", line, i);
                }
            }
        }
    }
}
