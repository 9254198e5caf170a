use super::Profile;
use super::field::{Field, PAD, TILE, Targets};
use super::lanes::{LANES, NONE, Vectors, groups, groups_mut, widest};
use super::pairs::Pairs;

widest! {
    /// Every sample under every position, those under a flat bottom left out if asked: the
    /// definition, in vectors. The work does not depend on the surface.
    fn every_tap<P: Pairs>(field: &Field, pairs: &P, skip_flat: bool, out: &mut Targets) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(field: &Field, pairs: &P, skip_flat: bool, out: &mut Targets) {
    for b in 0..out.rows {
        let shift = pairs.shift(b);
        for tile in (0..out.columns).step_by(TILE) {
            let mut best = [V::splat(NONE); TILE / LANES];
            for a in pairs.inputs(b) {
                let Some(arc) = pairs.arc(a, b) else { continue };
                let row = field.row(a);
                let start = PAD as i64 + tile as i64 + shift;
                for [lo, hi] in arc.arc.spans(skip_flat) {
                    for dx in lo..=hi {
                        let s = V::splat(arc.s(dx));
                        let from = groups(&row[(start + dx as i64) as usize..][..TILE]);
                        for (best, from) in best.iter_mut().zip(from) {
                            *best = V::greater(V::add(V::load(from), s), *best);
                        }
                    }
                }
            }
            for (to, best) in groups_mut(&mut out.row_mut(b)[tile..][..TILE]).iter_mut().zip(best) {
                V::store(V::greater(best, V::load(to)), to);
            }
        }
    }
}

/// Groups of lanes that [`every_tap`] takes for so many targets.
pub(super) fn work(profile: &Profile, columns: usize, rows: usize) -> f64 {
    let taps = std::f64::consts::PI * profile.radius() * profile.radius();
    taps * rows as f64 * columns.div_ceil(LANES) as f64
}
