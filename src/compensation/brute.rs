use super::field::{Field, PAD, TILE, Targets};
use super::lanes::{NONE, widest};
use super::pairs::Pairs;

widest! {
    /// Every sample under every position: the definition, in vectors. The work
    /// does not depend on the surface.
    fn every_tap<P: Pairs>(field: &Field, pairs: &P, out: &mut Targets) = body
}

#[inline(always)]
fn body<P: Pairs>(field: &Field, pairs: &P, out: &mut Targets) {
    for b in 0..out.rows {
        let shift = pairs.shift(b);
        for tile in (0..out.columns).step_by(TILE) {
            let mut best = [NONE; TILE];
            for a in pairs.inputs(b) {
                let Some(arc) = pairs.arc(a, b) else { continue };
                let row = field.row(a);
                let start = PAD as i64 + tile as i64 + shift;
                for dx in arc.arc.lo..=arc.arc.hi {
                    let s = arc.s(dx);
                    let from = &row[(start + dx as i64) as usize..][..TILE];
                    for lane in 0..TILE {
                        let z = from[lane] + s;
                        best[lane] = if z > best[lane] { z } else { best[lane] };
                    }
                }
            }
            let to = &mut out.row_mut(b)[tile..][..TILE];
            for lane in 0..TILE {
                to[lane] = if best[lane] > to[lane] { best[lane] } else { to[lane] };
            }
        }
    }
}
