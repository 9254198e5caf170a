//! By how much a pass turns the mirrors that it cuts, against the pass that no grid and no simplification
//! had moved.

use super::ends::{Measure, weights};
use super::funnel::Vertex;

/// What is steeper, as a slope, is no mirror: a wall between cells of a tile that lies level leans by its wedge.
const WALL: f64 = 2.0;

/// By how much mirrors are turned along the passes: each stretch of a pass that follows a plane, as a whole. Creases and
/// fillets, where the cutter rolls over or rests on two faces, do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tilt {
    /// Square degrees times positions.
    squares: f64,
    positions: f64,
    /// The mirror that is turned most as a whole.
    pub worst: Option<Worst>,
}

/// A mirror's stretch of one pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worst {
    pub deg: f64,
    pub length_mm: f64,
    /// Its middle in the tile's frame.
    pub at_mm: [f64; 2],
}

impl Tilt {
    /// Root of the mean square over the mirrors' lengths in degrees, no more than the worst; None where no plane was
    /// followed.
    pub fn rms_deg(&self) -> Option<f64> {
        (self.positions > 0.0).then(|| (self.squares / self.positions).sqrt())
    }

    /// Both together; of equals the first is the worst.
    pub(super) fn merge(&mut self, other: &Tilt) {
        self.squares += other.squares;
        self.positions += other.positions;
        if let Some(worst) = other.worst {
            self.meet(worst);
        }
    }

    fn meet(&mut self, worst: Worst) {
        if self.worst.is_none_or(|before| worst.deg > before.deg) {
            self.worst = Some(worst);
        }
    }

    /// Adds a run's vertices. `place_mm` tells where a position lies.
    pub(super) fn add(
        &mut self,
        exact: &[f64],
        vertices: &[Vertex],
        measure: &Measure,
        place_mm: impl Fn(usize) -> [f64; 2],
    ) {
        let weights = weights(exact, measure);
        let plane = |i: usize| (0.5..1.5).contains(&weights[i]);
        let wall = |i: usize| (exact[i + 1] - exact[i]).abs() * measure.unit_mm > WALL * measure.pitch_mm;
        let Some(&(_, start)) = vertices.first() else { return };
        let (mut first, mut above) = (0, f64::from(start) - exact[0]);
        for pair in vertices.windows(2) {
            let ((a, za), (b, zb)) = (pair[0], pair[1]);
            let slope = f64::from(zb - za) / (b - a) as f64;
            let line = |i: usize| f64::from(za) + slope * (i - a) as f64;
            for i in a + 1..=b {
                let on = plane(i - 1) && plane(i) && !wall(i - 1);
                if !on || i + 1 == exact.len() {
                    let end = if on { i } else { i - 1 };
                    let length_mm = (end - first) as f64 * measure.pitch_mm;
                    // Shorter stretches are slivers beside a crease.
                    if length_mm >= measure.stepover_mm && end > first {
                        let turned = line(end) - exact[end] - above;
                        let positions = (end - first) as f64;
                        let deg =
                            (turned * measure.unit_mm / (positions * measure.pitch_mm)).atan().to_degrees();
                        self.squares += deg * deg * positions;
                        self.positions += positions;
                        let at_mm = place_mm(first.midpoint(end));
                        self.meet(Worst { deg: deg.abs(), length_mm, at_mm });
                    }
                    (first, above) = (i, line(i) - exact[i]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEASURE: Measure = Measure { unit_mm: 0.01, pitch_mm: 0.01, stepover_mm: 0.05, tip_mm: 0.5 };

    #[test]
    fn a_mirror_turned_by_a_unit_over_its_length() {
        let exact: Vec<f64> = (0..41).map(|i| 0.2 * f64::from(i)).collect();
        let mut tilt = Tilt::default();
        tilt.add(&exact, &[(0, 0), (40, 9)], &MEASURE, |i| [i as f64, 7.0]);
        let worst = tilt.worst.unwrap();
        // 1 unit over 40 positions, on a line through the first.
        assert!((worst.deg - (1.0f64 / 40.0).atan().to_degrees()).abs() < 1e-9, "{worst:?}");
        assert_eq!((worst.at_mm, worst.length_mm), ([20.0, 7.0], 0.4));
        let rms = tilt.rms_deg().unwrap();
        assert!((rms - worst.deg).abs() < 1e-12, "the only mirror is the worst: {rms}");
    }

    #[test]
    fn a_leaning_wall_is_no_mirror() {
        let exact: Vec<f64> = (0..41).map(|i| 2.5 * f64::from(i)).collect();
        let mut tilt = Tilt::default();
        tilt.add(&exact, &[(0, 0), (40, 101)], &MEASURE, |_| [0.0; 2]);
        assert_eq!((tilt.rms_deg(), tilt.worst), (None, None));
    }

    #[test]
    fn what_rolls_over_a_crease_is_no_mirror() {
        // An arc of the ball's own radius.
        let exact: Vec<f64> = (-20..=20).map(|i: i32| -f64::from(i * i) * 0.01 / (2.0 * 0.5)).collect();
        let mut tilt = Tilt::default();
        tilt.add(&exact, &[(0, -4), (40, -4)], &MEASURE, |_| [0.0; 2]);
        assert_eq!((tilt.rms_deg(), tilt.worst), (None, None));
    }
}
