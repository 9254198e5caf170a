//! The table behind [`super::ends`]: from every grid point within reach, the moves to all later ones, eight
//! positions at a time.

use super::eight::{EIGHT, Eight, Portable};
use super::ends::{BLOCK, Measure};
use super::funnel::Vertex;
use super::misfit::{SPAN, Sums};

/// A cost that nothing undercuts, for positions without such a state.
const ABSENT: f64 = f64::NEG_INFINITY;

/// What eight positions may be passed between.
#[derive(Clone)]
struct Positions {
    low: [f64; EIGHT],
    high: [f64; EIGHT],
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
    sums: Vec<Sums>,
    /// Exact heights.
    exact: Vec<f64>,
    /// What is added to a point's height where moves begin at it.
    turns: Vec<f64>,
    /// 1 over the distance in positions, which is less [`EIGHT`] than the index; 0 up to there.
    part: Vec<f64>,
    /// Points at a position at most.
    layers: usize,
    /// Of each group its positions' lowest points, the second lowest, and so on.
    points: Vec<Points>,
    block: f64,
}

impl Table {
    /// Bounds and exact heights in units; none of them empty.
    #[inline(always)]
    fn new(bounds: &Bounds, exact: &[f64], measure: &Measure) -> Table {
        let Bounds { low, high, ends, off } = bounds;
        let count = low.len();
        let groups = count.div_ceil(EIGHT);
        let reach = |i: usize| {
            let first = (ends[i][0] - off[i][0]).ceil();
            (first, ((ends[i][1] - off[i][0]).floor() - first).max(0.0) as usize + 1)
        };
        let layers = (0..count).map(|i| reach(i).1).max().unwrap_or(1);
        // Past the end no line is between the bounds.
        let end = Positions { low: [f64::INFINITY; EIGHT], high: [f64::NEG_INFINITY; EIGHT] };
        let none = Points { z: [0.0; EIGHT], cost: [ABSENT; EIGHT], from: [0; EIGHT] };
        let mut table = Table {
            count,
            positions: vec![end; groups],
            sums: Sums::along(exact, measure),
            exact: exact.to_vec(),
            turns: off.iter().map(|off| off[1]).collect(),
            part: (0..=(groups + 1) * EIGHT)
                .map(|i| if i > EIGHT { 1.0 / (i - EIGHT) as f64 } else { 0.0 })
                .collect(),
            layers,
            points: vec![none; groups * layers],
            block: BLOCK / measure.pitch_mm,
        };
        for i in 0..count {
            let (group, lane) = (i / EIGHT, i % EIGHT);
            let to = &mut table.positions[group];
            (to.low[lane], to.high[lane]) = (low[i], high[i]);
            let (first, states) = reach(i);
            for (nth, points) in table.points[group * layers..][..states].iter_mut().enumerate() {
                points.z[lane] = first + nth as f64 + off[i][0];
                points.cost[lane] = if i == 0 { 0.0 } else { f64::INFINITY };
            }
        }
        table
    }

    /// The table with the cheapest way to every point, found with the widest vectors that this processor has; the answer
    /// is the same for all.
    pub(super) fn filled(bounds: &Bounds, exact: &[f64], measure: &Measure) -> Table {
        #[cfg(target_arch = "x86_64")]
        {
            use super::eight::Avx512;
            #[target_feature(enable = "avx512f,avx512vl,avx2")]
            fn avx512(bounds: &Bounds, exact: &[f64], measure: &Measure) -> Table {
                Table::filled_with::<Avx512>(bounds, exact, measure)
            }
            #[target_feature(enable = "avx2")]
            fn avx2(bounds: &Bounds, exact: &[f64], measure: &Measure) -> Table {
                Table::filled_with::<Portable>(bounds, exact, measure)
            }
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx2")
            {
                // SAFETY: the features were found on this processor.
                return unsafe { avx512(bounds, exact, measure) };
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the feature was found on this processor.
                return unsafe { avx2(bounds, exact, measure) };
            }
        }
        Table::filled_with::<Portable>(bounds, exact, measure)
    }

    #[inline(always)]
    fn filled_with<E: Eight>(bounds: &Bounds, exact: &[f64], measure: &Measure) -> Table {
        let mut table = Table::new(bounds, exact, measure);
        table.fill_with::<E>();
        table
    }

    #[inline(always)]
    fn fill_with<E: Eight>(&mut self) {
        for i in 0..self.count.saturating_sub(1) {
            for nth in 0..self.layers {
                if self.points[i / EIGHT * self.layers + nth].cost[i % EIGHT].is_finite() {
                    self.moves_from::<E>(i, nth);
                }
            }
        }
    }

    /// Tries every move that begins at a point.
    #[inline(always)]
    fn moves_from<E: Eight>(&mut self, i: usize, nth: usize) {
        let layers = self.layers;
        let from = (i * layers + nth) as u32;
        let (group, lane) = (i / EIGHT, i % EIGHT);
        let origin = &self.points[group * layers + nth];
        let z = origin.z[lane] + self.turns[i];
        let (none, all) = (E::splat(f64::NEG_INFINITY), E::splat(f64::INFINITY));
        let (mut least, mut most) = (none, all);
        let begun = E::splat(origin.cost[lane] + self.block);
        // A, B and C of what the move has cost before the span, less what stands in the span's sums before it; what
        // costs nothing is nothing to the bit, so that of equal ways the first is kept.
        let mut before = [0.0; 3];
        // The first group may hold the point itself and some before it.
        let mut start = (i + 1) / EIGHT;
        let mut later = u8::MAX << ((i + 1) % EIGHT);
        if group / SPAN == start / SPAN {
            let [x, e] = self.seen_from(group / SPAN, i, z).map(E::splat);
            let passed = self.sums[group].through::<E>(x, e).map(|sum| E::lane(sum, lane));
            before = std::array::from_fn(|k| before[k] - passed[k]);
        }
        let height = E::splat(z);
        while start < self.positions.len() {
            let span = start / SPAN;
            let end = ((span + 1) * SPAN).min(self.positions.len());
            let [x, e] = self.seen_from(span, i, z).map(E::splat);
            let spent = before.map(E::splat);
            let mut cost = spent;
            let parts = self.part[(start + 1) * EIGHT - i..].chunks_exact(EIGHT);
            for (group, part) in (start..end).zip(parts) {
                let Some(part) = part.first_chunk::<EIGHT>() else { return };
                let part = E::load(part);
                let Positions { low, high } = &self.positions[group];
                let mut low = E::multiply(E::subtract(E::load(low), height), part);
                let mut high = E::multiply(E::subtract(E::load(high), height), part);
                if later != u8::MAX {
                    (low, high) = (E::choose(later, low, none), E::choose(later, high, all));
                }
                let (low, high) = (E::greater(greatest::<E>(low), least), E::less(least_of::<E>(high), most));
                // The bounds of the positions before each.
                let (over, under) = (E::after(low, least), E::after(high, most));
                let [a, b, c] = self.sums[group].through::<E>(x, e);
                cost = [E::add(a, spent[0]), E::add(b, spent[1]), E::add(c, spent[2])];
                let [a, b, c] = [cost[0], cost[1], E::add(begun, cost[2])];
                for points in &mut self.points[group * layers..][..layers] {
                    let old = E::load(&points.cost);
                    let s = E::multiply(E::subtract(E::load(&points.z), height), part);
                    let new = E::add(E::multiply(E::subtract(E::multiply(a, s), b), s), c);
                    let better = E::is_less(E::within(later, over, s, under), new, old);
                    E::store(E::choose(better, new, old), &mut points.cost);
                    E::mark(&mut points.from, better, from);
                }
                (least, most) = (E::last(low), E::last(high));
                if E::is_less(u8::MAX, most, least) != 0 {
                    return;
                }
                later = u8::MAX;
            }
            before = cost.map(|sum| E::lane(sum, EIGHT - 1));
            start = end;
        }
    }

    /// Place and height of a point as a span's sums count them.
    #[inline(always)]
    fn seen_from(&self, span: usize, i: usize, z: f64) -> [f64; 2] {
        let first = span * SPAN * EIGHT;
        [i as f64 - first as f64, z - self.exact[first]]
    }

    /// The way to the cheapest point of the last position: whole units, `off` taken away again.
    pub(super) fn best(&self, off: &[[f64; 2]]) -> Vec<Vertex> {
        let layers = self.layers;
        let last = self.count - 1;
        let at = |nth: usize, i: usize| (&self.points[i / EIGHT * layers + nth], i % EIGHT);
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
    use super::super::ends::tests::cost;
    use super::*;
    use proptest::prelude::*;

    const MEASURE: Measure = Measure { unit_mm: 0.01, pitch_mm: 0.01, stepover_mm: 0.05, tip_mm: 0.5 };

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn costs_are_as_defined_and_the_same_bits_on_every_instruction_set(
            slopes in proptest::collection::vec(-0.6..0.6f64, 1..12),
            length in 1usize..80,
        ) {
            let facets = slopes.iter().flat_map(|slope| std::iter::repeat_n(*slope, length));
            let exact: Vec<f64> = facets.scan(0.4, |z, slope| { *z += slope; Some(*z) }).collect();
            let low: Vec<f64> = exact.iter().map(|z| z - 0.1).collect();
            let high: Vec<f64> = exact.iter().map(|z| z + 0.95).collect();
            let ends: Vec<[f64; 2]> = low.iter().zip(&high).map(|(low, high)| [*low, *high]).collect();
            let off = vec![[0.0; 2]; low.len()];
            let bounds = Bounds { low: &low, high: &high, ends: &ends, off: &off };
            let widest = Table::filled(&bounds, &exact, &MEASURE);
            let portable = Table::filled_with::<Portable>(&bounds, &exact, &MEASURE);
            for (a, b) in widest.points.iter().zip(&portable.points) {
                prop_assert!(a.cost.iter().zip(&b.cost).all(|(a, b)| a.to_bits() == b.to_bits()));
            }
            let best = widest.best(&off);
            prop_assert_eq!(&best, &portable.best(&off));
            let last = widest.count - 1;
            let costs = widest.points[last / EIGHT * widest.layers..].iter().map(|points| points.cost[last % EIGHT]);
            let least = costs.filter(|cost| *cost != ABSENT).fold(f64::INFINITY, f64::min) * MEASURE.pitch_mm;
            let by_definition = cost(&best, &exact, &MEASURE);
            prop_assert!((least - by_definition).abs() < 1e-10, "{} and {}", least, by_definition);
        }
    }
}
