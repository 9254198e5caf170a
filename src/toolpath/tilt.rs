//! By how much a pass turns the mirrors that it cuts, against the pass that no grid and no simplification
//! had moved.

use super::ends::{Measure, weights};
use super::funnel::Vertex;

/// What is steeper, as a slope, is no mirror: a wall between cells of a tile that lies level leans by its wedge.
const WALL: f64 = 2.0;

/// Where the cutter is lifted farther from its exact location, in parts of what is between positions, a wall stands
/// beside it: it makes no mirror.
const LIFTED: f64 = 0.1;

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

    /// Adds a run. `place_mm` tells where a position lies.
    pub(super) fn add(&mut self, run: &Run, measure: &Measure, place_mm: impl Fn(usize) -> [f64; 2]) {
        let Run { exact, kept, above } = *run;
        let weights = weights(exact, measure);
        let plane = |i: usize| {
            (0.5..1.5).contains(&weights[i])
                && (kept[i] - exact[i]) * measure.unit_mm <= LIFTED * measure.pitch_mm
        };
        let wall = |i: usize| (exact[i + 1] - exact[i]).abs() * measure.unit_mm > WALL * measure.pitch_mm;
        let mut first = 0;
        for i in 1..exact.len() {
            let on = plane(i - 1) && plane(i) && !wall(i - 1);
            if !on || i + 1 == exact.len() {
                let end = if on { i } else { i - 1 };
                let length_mm = (end - first) as f64 * measure.pitch_mm;
                // Shorter stretches are slivers beside a crease.
                if length_mm >= measure.stepover_mm && end > first {
                    let turned = above[end] - above[first];
                    let positions = (end - first) as f64;
                    let deg = (turned * measure.unit_mm / (positions * measure.pitch_mm)).atan().to_degrees();
                    self.squares += deg * deg * positions;
                    self.positions += positions;
                    let at_mm = place_mm(first.midpoint(end));
                    self.meet(Worst { deg: deg.abs(), length_mm, at_mm });
                }
                first = i;
            }
        }
    }
}

/// Positions of a pass in a row, in units: the exact location, what is kept to, and how far the cutter stands above the
/// exact location where it goes.
#[derive(Clone, Copy)]
pub(super) struct Run<'a> {
    pub(super) exact: &'a [f64],
    pub(super) kept: &'a [f64],
    pub(super) above: &'a [f64],
}

/// How far each position of a run stands above its exact location.
pub(super) fn above(exact: &[f64], vertices: &[Vertex]) -> Vec<f64> {
    let mut out = Vec::with_capacity(exact.len());
    out.extend(vertices.first().map(|&(_, z)| f64::from(z) - exact[0]));
    for pair in vertices.windows(2) {
        let ((a, za), (b, zb)) = (pair[0], pair[1]);
        let slope = f64::from(zb - za) / (b - a) as f64;
        out.extend((a + 1..=b).map(|i| f64::from(za) + slope * (i - a) as f64 - exact[i]));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEASURE: Measure = Measure { unit_mm: 0.01, pitch_mm: 0.01, stepover_mm: 0.05, tip_mm: 0.5 };

    fn add(tilt: &mut Tilt, exact: &[f64], vertices: &[Vertex], place_mm: impl Fn(usize) -> [f64; 2]) {
        let run = Run { exact, kept: exact, above: &above(exact, vertices) };
        tilt.add(&run, &MEASURE, place_mm);
    }

    #[test]
    fn a_mirror_turned_by_a_unit_over_its_length() {
        let exact: Vec<f64> = (0..41).map(|i| 0.2 * f64::from(i)).collect();
        let mut tilt = Tilt::default();
        add(&mut tilt, &exact, &[(0, 0), (40, 9)], |i| [i as f64, 7.0]);
        let worst = tilt.worst.unwrap();
        // 1 unit over 40 positions, on a line through the first.
        assert!((worst.deg - (1.0f64 / 40.0).atan().to_degrees()).abs() < 1e-9, "{worst:?}");
        assert_eq!((worst.at_mm, worst.length_mm), ([20.0, 7.0], 0.4));
        let rms = tilt.rms_deg().unwrap();
        assert!((rms - worst.deg).abs() < 1e-12, "the only mirror is the worst: {rms}");
    }

    #[test]
    fn what_is_lifted_beside_a_wall_is_no_mirror() {
        let exact = [0.0; 41];
        let kept: Vec<f64> = (0..41).map(|i| if i < 30 { 0.05 } else { 4.0 }).collect();
        let mut tilt = Tilt::default();
        let above = above(&exact, &[(0, 1), (29, 1), (30, 4), (40, 4)]);
        tilt.add(&Run { exact: &exact, kept: &kept, above: &above }, &MEASURE, |_| [0.0; 2]);
        assert_eq!(tilt.rms_deg(), Some(0.0), "{tilt:?}");
        assert_eq!(tilt.worst.unwrap().length_mm, 0.29);
    }

    #[test]
    fn a_leaning_wall_is_no_mirror() {
        let exact: Vec<f64> = (0..41).map(|i| 2.5 * f64::from(i)).collect();
        let mut tilt = Tilt::default();
        add(&mut tilt, &exact, &[(0, 0), (40, 101)], |_| [0.0; 2]);
        assert_eq!((tilt.rms_deg(), tilt.worst), (None, None));
    }

    #[test]
    fn what_rolls_over_a_crease_is_no_mirror() {
        // An arc of the ball's own radius.
        let exact: Vec<f64> = (-20..=20).map(|i: i32| -f64::from(i * i) * 0.01 / (2.0 * 0.5)).collect();
        let mut tilt = Tilt::default();
        add(&mut tilt, &exact, &[(0, -4), (40, -4)], |_| [0.0; 2]);
        assert_eq!((tilt.rms_deg(), tilt.worst), (None, None));
    }
}
