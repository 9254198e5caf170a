//! The table behind [`super::ends`]: from every grid point within reach, the moves to all later ones, eight
//! positions at a time.

use super::eight::{EIGHT, Eight, Portable};
use super::ends::{BLOCK, FLANKS, Measure, weights};
use super::funnel::Vertex;

/// A cost that nothing undercuts, for positions without such a state.
const ABSENT: f64 = f64::NEG_INFINITY;

/// Eight positions.
#[derive(Clone)]
struct Positions {
    low: [f64; EIGHT],
    high: [f64; EIGHT],
    exact: [f64; EIGHT],
    w: [f64; EIGHT],
    /// What is added to a point's height where moves begin at it.
    turn: [f64; EIGHT],
    /// Sums up to and with each position, of w, w g and w g^2 for the slope g that leads to it.
    sums: [[f64; EIGHT]; 3],
}

/// One grid point between the bounds of each of eight positions, and the cheapest way to it.
#[derive(Clone)]
struct Points {
    z: [f64; EIGHT],
    cost: [f64; EIGHT],
    /// Position and layer that the way comes from: position times the layers, and the layer.
    from: [u32; EIGHT],
}

/// What moves have to keep to, in units.
pub(super) struct Bounds<'a> {
    /// Between which a move may pass a position; nothing between them where every move ends.
    pub(super) low: &'a [f64],
    pub(super) high: &'a [f64],
    /// Between which a move may end, if a whole unit lies there; the lowest one above them otherwise.
    pub(super) ends: &'a [[f64; 2]],
    /// How much higher than whole units moves end, and how much is added where the next one begins: heights of a pass
    /// beside its line are counted from a slope across it. Nothing for a straight one.
    pub(super) off: &'a [[f64; 2]],
}

/// Grid points between the bounds of positions in a row, in groups of eight; the last group may run past the end.
pub(super) struct Table {
    count: usize,
    positions: Vec<Positions>,
    /// 1 over the distance in positions, which is less [`EIGHT`] than the index; 0 up to there.
    part: Vec<f64>,
    /// The lowest points of all positions, the second lowest, and so on.
    layers: Vec<Vec<Points>>,
    block: f64,
    slope_cost: f64,
    height_cost: f64,
}

impl Table {
    /// Bounds and exact heights in units; none of them empty.
    pub(super) fn new(bounds: &Bounds, exact: &[f64], measure: &Measure) -> Table {
        let Bounds { low, high, ends, off } = bounds;
        let count = low.len();
        let groups = count.div_ceil(EIGHT);
        let weights = weights(exact, measure);
        // Past the end no line is between the bounds.
        let end = Positions {
            low: [f64::INFINITY; EIGHT],
            high: [f64::NEG_INFINITY; EIGHT],
            exact: [0.0; EIGHT],
            w: [0.0; EIGHT],
            turn: [0.0; EIGHT],
            sums: [[0.0; EIGHT]; 3],
        };
        let mut table = Table {
            count,
            positions: vec![end; groups],
            part: (0..=(groups + 1) * EIGHT)
                .map(|i| if i > EIGHT { 1.0 / (i - EIGHT) as f64 } else { 0.0 })
                .collect(),
            layers: Vec::new(),
            block: BLOCK / measure.pitch_mm,
            slope_cost: (measure.unit_mm / measure.pitch_mm).powi(2),
            height_cost: FLANKS * (measure.unit_mm / measure.stepover_mm).powi(2),
        };
        let mut sum = [0.0; 3];
        for i in 0..count {
            let (group, lane) = (i / EIGHT, i % EIGHT);
            let w = weights[i];
            let g = if i == 0 { 0.0 } else { exact[i] - exact[i - 1] };
            let to = &mut table.positions[group];
            (to.low[lane], to.high[lane], to.exact[lane], to.w[lane]) = (low[i], high[i], exact[i], w);
            for (k, term) in [w, w * g, w * g * g].into_iter().enumerate() {
                sum[k] += term;
                to.sums[k][lane] = sum[k];
            }
            to.turn[lane] = off[i][1];
            let first = (ends[i][0] - off[i][0]).ceil();
            let states = ((ends[i][1] - off[i][0]).floor() - first).max(0.0) as usize + 1;
            while table.layers.len() < states {
                let none = Points { z: [0.0; EIGHT], cost: [ABSENT; EIGHT], from: [0; EIGHT] };
                table.layers.push(vec![none; groups]);
            }
            for (nth, layer) in table.layers[..states].iter_mut().enumerate() {
                layer[group].z[lane] = first + nth as f64 + off[i][0];
                layer[group].cost[lane] = if i == 0 { 0.0 } else { f64::INFINITY };
            }
        }
        table
    }

    /// Finds the cheapest way to every point, with the widest vectors that this processor has; the answer is the
    /// same for all.
    pub(super) fn fill(&mut self) {
        #[cfg(target_arch = "x86_64")]
        {
            use super::eight::Avx512;
            #[target_feature(enable = "avx512f,avx512vl,avx2")]
            fn avx512(table: &mut Table) {
                table.fill_with::<Avx512>();
            }
            #[target_feature(enable = "avx2")]
            fn avx2(table: &mut Table) {
                table.fill_with::<Portable>();
            }
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx2")
            {
                // SAFETY: the features were found on this processor.
                return unsafe { avx512(self) };
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the feature was found on this processor.
                return unsafe { avx2(self) };
            }
        }
        self.fill_with::<Portable>();
    }

    #[inline(always)]
    fn fill_with<E: Eight>(&mut self) {
        for i in 0..self.count.saturating_sub(1) {
            for nth in 0..self.layers.len() {
                if self.layers[nth][i / EIGHT].cost[i % EIGHT].is_finite() {
                    self.moves_from::<E>(i, nth);
                }
            }
        }
    }

    /// Tries every move that begins at a point.
    #[inline(always)]
    fn moves_from<E: Eight>(&mut self, i: usize, nth: usize) {
        let from = (i * self.layers.len() + nth) as u32;
        let (group, lane) = (i / EIGHT, i % EIGHT);
        let origin = &self.layers[nth][group];
        let z = E::splat(origin.z[lane] + self.positions[group].turn[lane]);
        // No move from here costs less than this.
        let at_least = E::splat(origin.cost[lane] + self.block);
        let [sum_w, sum_wg, sum_wg2] = self.positions[group].sums;
        let before = [E::splat(sum_w[lane]), E::splat(sum_wg[lane]), E::splat(sum_wg2[lane])];
        let (slope_cost, height_cost) = (E::splat(self.slope_cost), E::splat(self.height_cost));
        let (zero, eight) = (E::splat(0.0), E::splat(EIGHT as f64));
        let (none, all) = (E::splat(f64::NEG_INFINITY), E::splat(f64::INFINITY));
        let (mut least, mut most) = (none, all);
        // Over the positions passed, d away and q above the point: w d^2, w d q, w q^2.
        let mut behind = [zero; 3];
        // The first group may hold the point itself and some before it.
        let start = (i + 1) / EIGHT;
        let mut later = u8::MAX << ((i + 1) % EIGHT);
        let mut d = E::add(
            E::load(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]),
            E::splat((start * EIGHT) as f64 - i as f64),
        );
        let parts = &self.part[(start + 1) * EIGHT - i..];
        let groups = self.positions[start..].iter().zip(parts.chunks_exact(EIGHT)).enumerate();
        for (k, (positions, part)) in groups {
            let Some(part) = part.first_chunk::<EIGHT>() else { return };
            let part = E::load(part);
            let w = E::choose(later, E::load(&positions.w), zero);
            let q = E::subtract(E::load(&positions.exact), z);
            let (wd, wq) = (E::multiply(w, d), E::multiply(w, q));
            let wd2 = E::add(sums::<E>(E::multiply(wd, d)), behind[0]);
            let wdq = E::add(sums::<E>(E::multiply(wd, q)), behind[1]);
            let wq2 = E::add(sums::<E>(E::multiply(wq, q)), behind[2]);
            let [w, wg, wg2] = &positions.sums;
            let w = E::subtract(E::load(w), before[0]);
            let wg = E::subtract(E::load(wg), before[1]);
            let wg2 = E::subtract(E::load(wg2), before[2]);
            let low = E::multiply(E::subtract(E::load(&positions.low), z), part);
            let high = E::multiply(E::subtract(E::load(&positions.high), z), part);
            let (low, high) = (E::choose(later, low, none), E::choose(later, high, all));
            let (low, high) = (E::greater(greatest::<E>(low), least), E::less(least_of::<E>(high), most));
            // The bounds of the positions before each.
            let (over, under) = (E::after(low, least), E::after(high, most));
            for layer in &mut self.layers {
                let points = &mut layer[start + k];
                let old = E::load(&points.cost);
                let open = later & E::is_less(at_least, old);
                if open == 0 {
                    continue;
                }
                let s = E::multiply(E::subtract(E::load(&points.z), z), part);
                let meant = open & !E::is_less(s, over) & !E::is_less(under, s);
                let turned = E::multiply(slope_cost, squares::<E>(s, w, wg, wg2));
                let raised = E::multiply(height_cost, squares::<E>(s, wd2, wdq, wq2));
                let new = E::add(E::add(at_least, turned), raised);
                let better = meant & E::is_less(new, old);
                E::store(E::choose(better, new, old), &mut points.cost);
                E::mark(&mut points.from, better, from);
            }
            (least, most) = (E::last(low), E::last(high));
            if E::is_less(most, least) != 0 {
                break;
            }
            behind = [E::last(wd2), E::last(wdq), E::last(wq2)];
            d = E::add(d, eight);
            later = u8::MAX;
        }
    }

    /// The way to the cheapest point of the last position: whole units, `off` taken away again.
    pub(super) fn best(&self, off: &[[f64; 2]]) -> Vec<Vertex> {
        let layers = self.layers.len();
        let last = self.count - 1;
        let at = |nth: usize, i: usize| (&self.layers[nth][i / EIGHT], i % EIGHT);
        let cost = |nth: usize| {
            let (points, lane) = at(nth, last);
            points.cost[lane]
        };
        let reached = (0..layers).filter(|nth| cost(*nth) != ABSENT);
        let best = reached.min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(0);
        let mut out = Vec::new();
        let (mut i, mut nth) = (last, best);
        loop {
            let (points, lane) = at(nth, i);
            out.push((i, (points.z[lane] - off[i][0]).round() as i32));
            if i == 0 {
                break;
            }
            let from = points.from[lane] as usize;
            (i, nth) = (from / layers, from % layers);
        }
        out.reverse();
        out
    }
}

/// s^2 a - 2 s b + c, which is a sum of squares.
#[inline(always)]
fn squares<E: Eight>(s: E::Group, a: E::Group, b: E::Group, c: E::Group) -> E::Group {
    let falls = E::multiply(E::add(s, s), b);
    E::greater(E::add(E::subtract(E::multiply(E::multiply(s, s), a), falls), c), E::splat(0.0))
}

/// Of each lane and all before it.
#[inline(always)]
fn sums<E: Eight>(a: E::Group) -> E::Group {
    let nothing = E::splat(0.0);
    let a = E::add(a, E::after(a, nothing));
    let a = E::add(a, E::after2(a, nothing));
    E::add(a, E::after4(a, nothing))
}

#[inline(always)]
fn greatest<E: Eight>(a: E::Group) -> E::Group {
    let nothing = E::splat(f64::NEG_INFINITY);
    let a = E::greater(a, E::after(a, nothing));
    let a = E::greater(a, E::after2(a, nothing));
    E::greater(a, E::after4(a, nothing))
}

#[inline(always)]
fn least_of<E: Eight>(a: E::Group) -> E::Group {
    let nothing = E::splat(f64::INFINITY);
    let a = E::less(a, E::after(a, nothing));
    let a = E::less(a, E::after2(a, nothing));
    E::less(a, E::after4(a, nothing))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MEASURE: Measure = Measure { unit_mm: 0.01, pitch_mm: 0.01, stepover_mm: 0.05, tip_mm: 0.5 };

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_instruction_set_gives_the_same_bits(
            slopes in proptest::collection::vec(-0.6..0.6f64, 1..12),
            length in 1usize..40,
        ) {
            let facets = slopes.iter().flat_map(|slope| std::iter::repeat_n(*slope, length));
            let exact: Vec<f64> = facets.scan(0.4, |z, slope| { *z += slope; Some(*z) }).collect();
            let low: Vec<f64> = exact.iter().map(|z| z - 0.1).collect();
            let high: Vec<f64> = exact.iter().map(|z| z + 0.95).collect();
            let ends: Vec<[f64; 2]> = low.iter().zip(&high).map(|(low, high)| [*low, *high]).collect();
            let off = vec![[0.0; 2]; low.len()];
            let bounds = Bounds { low: &low, high: &high, ends: &ends, off: &off };
            let mut widest = Table::new(&bounds, &exact, &MEASURE);
            widest.fill();
            let mut portable = Table::new(&bounds, &exact, &MEASURE);
            portable.fill_with::<Portable>();
            for (a, b) in widest.layers.iter().flatten().zip(portable.layers.iter().flatten()) {
                prop_assert!(a.cost.iter().zip(&b.cost).all(|(a, b)| a.to_bits() == b.to_bits()));
            }
            prop_assert_eq!(widest.best(&off), portable.best(&off));
        }
    }
}
