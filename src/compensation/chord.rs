use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, NONE, Vectors, higher, raise_both, whole_groups, widest};
use super::pairs::Pairs;

widest! {
    /// The flat bottom: maxima over discs, chord by chord. Each row's maxima over 2^p samples are
    /// made once; a chord is then the maximum of two of them.
    ///
    /// Urbach and Wilkinson, IEEE Trans. Image Processing 17 (2008), doi:10.1109/TIP.2007.912582.
    fn flat_bottom<P: Pairs>(field: &Field, pairs: &P, out: &mut Targets, reach: f64) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(field: &Field, pairs: &P, out: &mut Targets, reach: f64) {
    let levels = (2.0 * reach + 2.0).log2().floor() as usize + 1;
    let length = field.row(-1).len();
    let columns = whole_groups(out.columns);
    let mut maxima = vec![NONE; levels * length];
    for a in 0..field.rows as i64 {
        maxima[..length].copy_from_slice(field.row(a));
        for level in 1..levels {
            let half = 1usize << (level - 1);
            let (lower, upper) = maxima[(level - 1) * length..][..2 * length].split_at_mut(length);
            // Past the end there is no data, so the last maxima are those of half the length.
            let whole = length.saturating_sub(half) / LANES * LANES;
            higher::<V>(&mut upper[..whole], &lower[..whole], &lower[half..][..whole]);
            for i in whole..length {
                let far = lower.get(i + half).copied().unwrap_or(NONE);
                upper[i] = if lower[i] > far { lower[i] } else { far };
            }
        }
        for b in pairs.targets(a, -reach, reach) {
            let Some(arc) = pairs.arc(a, b) else { continue };
            let (lo, hi) = (arc.arc.flat_lo as i64, arc.arc.flat_hi as i64);
            if lo > hi {
                continue;
            }
            let level = (hi - lo + 1).ilog2() as usize;
            let row = &maxima[level * length..][..length];
            let start = PAD as i64 + pairs.shift(b);
            let near = &row[(start + lo) as usize..][..columns];
            let far = &row[(start + hi + 1 - (1i64 << level)) as usize..][..columns];
            raise_both::<V>(&mut out.row_mut(b)[..columns], near, far);
        }
    }
}
