//! Every sample under every position of a cutter that stands on samples: a fallback whose work does not depend on the
//! surface, and the way of small cutters.
//!
//! The four samples at (+-dx, +-dy) from the axis have one entry of the table, and rounding is monotonic: the sum with
//! the highest of them is the highest of their sums, to the bit. So samples above and below the axis are taken together
//! first, then added up column by column, and the columns beside the axis taken together last: a quarter of the sums.

use super::field::{Field, PAD, Sense, TILE, line};
use super::held::Rows;
use super::lanes::{LANES, NONE, Vectors, groups, groups_mut, widest};
use super::outlet::Outlet;
use super::pairs::OnSamples;
use super::profile::Profile;
use super::stencil::Stencil;
use crate::grid::Window;

/// Columns that are worked on together, at least and at most: their sums stay in a near cache.
const STRIP: [usize; 2] = [256, 2048];

/// The same by the reach of a cutter: so far are they moved from one strip to the next.
const STRIP_REACHES: usize = 24;

widest! {
    /// Gives each row of targets by every sample in its reach, of which `field` holds few more than these.
    fn every_sample<>(h: Rows<'_>, input: Window, sense: Sense, on: &OnSamples<'_>, field: &mut Field, to: &mut [Outlet<'_>]) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors>(
    h: Rows<'_>,
    input: Window,
    sense: Sense,
    on: &OnSamples<'_>,
    field: &mut Field,
    to: &mut [Outlet<'_>],
) {
    let Some(first) = to.first() else { return };
    let columns = first.columns();
    let are_many = Outlet::are_many(to);
    let reach = on.reach;
    field.hold(input, 2 * reach as usize + 1);
    let mut fold = Fold::new(on.stencil, reach as usize, columns);
    let mut row = vec![NONE; columns.next_multiple_of(TILE) + TILE];
    // The field's column under the left end of the cutter at the first target.
    let left = (on.shift - reach) as usize;
    let mut taken = -1;
    for (b, to) in to.iter_mut().enumerate() {
        let axis = on.target(b) - on.input_row;
        for a in (axis - reach).max(taken)..=axis + reach {
            field.take(a, h, input, sense);
        }
        taken = axis + reach + 1;
        // Those that the next row of targets needs.
        let next = [(axis + on.every - reach).max(taken), axis + on.every + reach + 1].map(|a| input.row + a);
        for strip in (0..columns).step_by(fold.strip) {
            let column = input.column + on.shift + strip as i64;
            let ahead = |tile| h.fetch::<V>(next, column + tile as i64);
            let columns = fold.strip.min(columns - strip);
            fold.strip::<V>(field, axis, left, [strip, columns], ahead, &mut row[strip..]);
        }
        to.give::<V>(sense, &row, are_many);
    }
    V::streamed();
}

/// Sums, and what else takes as long, by which [`every_sample`] finds a position.
pub(super) fn sums(profile: &Profile) -> f64 {
    let radius = profile.radius();
    std::f64::consts::FRAC_PI_4 * radius * radius + 2.5 * radius + 1.0
}

/// Groups of lanes that it takes for so many targets.
pub(super) fn work(profile: &Profile, columns: usize, rows: usize) -> f64 {
    sums(profile) * rows as f64 * columns.div_ceil(LANES) as f64
}

/// [`TILE`] columns, from a cache line on.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Pair([[f32; LANES]; TILE / LANES]);

/// A strip of a row of targets, and what is worked out on the way.
struct Fold {
    /// The cutter: s(dx, dy) by dx, in the order of dy, and where each dx ends.
    s: Vec<f32>,
    ends: Vec<usize>,
    reach: usize,
    /// Columns of targets in a strip.
    strip: usize,
    /// The higher of the samples dy above and below the axis.
    pairs: Vec<Pair>,
    /// By dx, the highest of these with s(dx, dy) added.
    sums: Vec<f32>,
    /// From one dx to the next.
    stride: usize,
}

impl Fold {
    fn new(stencil: &Stencil, reach: usize, columns: usize) -> Fold {
        let (mut s, mut ends) = (Vec::new(), Vec::new());
        for dx in 0..=reach as i64 {
            if let Some(arc) = stencil.arc(dx) {
                s.extend((0..=arc.arc.hi).map(|dy| arc.s(dy)));
            }
            ends.push(s.len());
        }
        let strip = (STRIP_REACHES * reach).clamp(STRIP[0], STRIP[1]).min(columns).next_multiple_of(TILE);
        let stride = (strip + 2 * reach + LANES).next_multiple_of(TILE) + TILE;
        let pairs = vec![Pair([[NONE; LANES]; TILE / LANES]); reach + 1];
        Fold { s, ends, reach, strip, pairs, sums: vec![NONE; (reach + 1) * stride + LANES], stride }
    }

    /// Columns `strip ..` of the targets whose axes stand in row `axis` of the field, the cutter's left end from column
    /// `left` on: after those of the strip before. `ahead` asks for what is needed later, tile by tile.
    #[inline(always)]
    fn strip<V: Vectors>(
        &mut self,
        field: &Field,
        axis: i64,
        left: usize,
        [strip, columns]: [usize; 2],
        ahead: impl Fn(usize),
        to: &mut [f32],
    ) {
        let (reach, stride) = (self.reach, self.stride);
        let origin = line(&self.sums);
        // All is worked out from a cache line on.
        let (start, beside) = (PAD + (left + strip) / LANES * LANES, left % LANES);
        let mut known = 0;
        if strip > 0 {
            known = (2 * reach + beside).next_multiple_of(TILE);
            for sums in self.sums[origin..].chunks_exact_mut(stride) {
                sums.copy_within(self.strip..self.strip + known, 0);
            }
        }
        for tile in (known..columns + 2 * reach + beside).step_by(TILE) {
            let i = start + tile;
            ahead(tile);
            for (pair, dy) in self.pairs.iter_mut().zip(0..) {
                let [below, above] = [-dy, dy].map(|dy| groups(&field.row(axis + dy)[i..][..TILE]));
                for ((pair, below), above) in pair.0.iter_mut().zip(below).zip(above) {
                    V::store(V::greater(V::load(below), V::load(above)), pair);
                }
            }
            let mut from = 0;
            for (dx, sums) in self.sums[origin..].chunks_exact_mut(stride).enumerate() {
                let mut best = [V::splat(NONE); TILE / LANES];
                let of_dx = &self.s[from..self.ends[dx]];
                from = self.ends[dx];
                for (pair, s) in self.pairs.iter().zip(of_dx) {
                    let s = V::splat(*s);
                    for (best, pair) in best.iter_mut().zip(&pair.0) {
                        *best = V::greater(*best, V::add(V::load(pair), s));
                    }
                }
                for (to, best) in groups_mut(&mut sums[tile..][..TILE]).iter_mut().zip(best) {
                    V::store(best, to);
                }
            }
        }
        let sums = &self.sums[origin + beside..];
        for tile in (0..columns).step_by(TILE) {
            let at = |dx: usize, i: usize| groups(&sums[dx * stride + tile + i..][..TILE]);
            let mut best = [V::splat(NONE); TILE / LANES];
            for (best, sum) in best.iter_mut().zip(at(0, reach)) {
                *best = V::load(sum);
            }
            for dx in 1..=reach {
                let both = at(dx, reach - dx).iter().zip(at(dx, reach + dx));
                for (best, (left, right)) in best.iter_mut().zip(both) {
                    *best = V::greater(*best, V::greater(V::load(left), V::load(right)));
                }
            }
            for (to, best) in groups_mut(&mut to[tile..][..TILE]).iter_mut().zip(best) {
                V::store(best, to);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::brute;
    use super::super::field::Targets;
    use super::super::tiles::{OnTile, surfaces};
    use super::super::{Tables, Way};
    use super::*;

    #[test]
    fn strips_meet_and_rows_between_are_left_out() {
        let mut random = surfaces::Random(11);
        let mut noise = |_, _| if random.next() < 0.01 { f64::NAN } else { 90.0 * random.next() };
        let [tall, wide] =
            [(700, 150), (2100, 9)].map(|(columns, rows)| surfaces::from(columns, rows, &mut noise));
        // The last one's sums go along by more than one tile.
        for (h, cutter, every) in [
            (&tall, "ball:0.2", 1),
            (&tall, "ball:0.5", 3),
            (&tall, "vee:60:0:0.12", 7),
            (&tall, "ball:0.1", 40),
            (&wide, "ball:0.8", 2),
        ] {
            let tables =
                Tables::new(Profile::new(cutter.parse().expect("a cutter"), 0.01, 0.0).expect("a profile"));
            for sense in [Sense::Raise, Sense::Lower] {
                let of = OnTile::new(h.into(), &tables, every, sense, Way::EveryTap);
                let out = h.window.grown(4);
                let rows = out.rows.div_ceil(every);
                let (input, pairs) = of.pairs(Window { rows, ..out });
                let [mut folded, mut by_definition] = [0.0, 1.0].map(|z| vec![z; rows * out.columns]);
                let mut to = Outlet::plain(&mut folded, out.columns);
                every_sample(h.into(), input, sense, &pairs, &mut Field::empty(0, 0), &mut to);
                let mut targets = Targets::new(out.columns, rows);
                let field = Field::of(h.into(), input, sense);
                brute::every_tap(&field, &pairs, false, &mut targets);
                for (row, to) in Outlet::plain(&mut by_definition, out.columns).iter_mut().enumerate() {
                    to.give_portable(sense, targets.row(row));
                }
                let bits = |z_mm: &[f32]| z_mm.iter().map(|z| z.to_bits()).collect::<Vec<_>>();
                assert!(bits(&folded) == bits(&by_definition), "{cutter}, every {every}, {sense:?}");
            }
        }
    }
}
