//! What moves that begin anywhere and end anywhere turn and raise the surface, from sums kept once.

use super::eight::{EIGHT, Eight};
use super::ends::{FLANKS, Measure, weights};

/// Groups of positions whose sums are counted from the first of them, so that little cancels.
pub(super) const SPAN: usize = 32;

/// For eight positions, sums over those of their span up to and with each. x counts positions from the span's first,
/// e is the exact height above the one there, g the slope that leads to a position; w and v are what it costs there to
/// be turned by a slope of one and raised by one, both in units.
#[derive(Clone)]
pub(super) struct Sums {
    v: [f64; EIGHT],
    /// 2 v x
    vx: [f64; EIGHT],
    /// 2 v e
    ve: [f64; EIGHT],
    /// w + v x^2
    squares: [f64; EIGHT],
    /// 2 (w g + v x e)
    products: [f64; EIGHT],
    /// w g^2 + v e^2
    exact: [f64; EIGHT],
}

impl Sums {
    /// Of all positions, in groups of eight; exact heights in units.
    #[inline(always)]
    pub(super) fn along(exact: &[f64], measure: &Measure) -> Vec<Sums> {
        let turned = (measure.unit_mm / measure.pitch_mm).powi(2);
        let raised = FLANKS * (measure.unit_mm / measure.stepover_mm).powi(2);
        let none = [0.0; EIGHT];
        let empty = Sums { v: none, vx: none, ve: none, squares: none, products: none, exact: none };
        let mut out = vec![empty; exact.len().div_ceil(EIGHT)];
        let mut sums = [0.0; 6];
        for (i, weight) in weights(exact, measure).into_iter().enumerate() {
            let first = i - i % (SPAN * EIGHT);
            if i == first {
                sums = [0.0; 6];
            }
            let (w, v) = (weight * turned, weight * raised);
            let (x, e) = ((i - first) as f64, exact[i] - exact[first]);
            let g = if i == 0 { 0.0 } else { exact[i] - exact[i - 1] };
            let squares = w + v * x * x;
            let products = 2.0 * (w * g + v * x * e);
            let terms = [v, 2.0 * v * x, 2.0 * v * e, squares, products, w * g * g + v * e * e];
            let (to, lane) = (&mut out[i / EIGHT], i % EIGHT);
            let all = [&mut to.v, &mut to.vx, &mut to.ve, &mut to.squares, &mut to.products, &mut to.exact];
            for ((sum, term), to) in sums.iter_mut().zip(terms).zip(all) {
                *sum += term;
                to[lane] = *sum;
            }
        }
        out
    }

    /// A, B and C of each position: a line of slope s through (x, e) costs A s^2 - B s + C over the span up to there.
    #[inline(always)]
    pub(super) fn through<E: Eight>(&self, x: E::Group, e: E::Group) -> [E::Group; 3] {
        let (v, ve) = (E::load(&self.v), E::load(&self.ve));
        let xv = E::multiply(x, v);
        let vx = E::subtract(E::load(&self.vx), xv);
        let a = E::subtract(E::load(&self.squares), E::multiply(x, vx));
        let b = E::subtract(E::load(&self.products), E::multiply(x, ve));
        let b = E::subtract(b, E::multiply(e, E::subtract(vx, xv)));
        let c = E::multiply(e, E::subtract(ve, E::multiply(e, v)));
        [a, b, E::subtract(E::load(&self.exact), c)]
    }
}
