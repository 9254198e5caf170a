use super::field::{Field, PAD, Targets};
use super::lanes::{LANES, NONE, Vectors, groups, groups_mut, higher, whole_groups, widest};
use super::pairs::Pairs;
use std::ops::Range;

/// Columns of targets that are worked on together: what their rows ask of the tables stays in the
/// nearest cache.
const STRIP: usize = 512;

/// Rows of samples whose chords are taken together, so that targets are read and written once for
/// all of them.
const ROWS: usize = 4;

widest! {
    /// The flat bottom: maxima over discs, chord by chord. Each row's maxima over 2^p samples are
    /// made once; a chord is then the maximum of two of them.
    ///
    /// Urbach and Wilkinson, IEEE Trans. Image Processing 17 (2008), doi:10.1109/TIP.2007.912582.
    ///
    /// `wanted` tells of each target row which groups of lanes are to be raised, in order; None is all of them.
    fn flat_bottom<P: Pairs>(
        field: &Field,
        pairs: &P,
        out: &mut Targets,
        reach: f64,
        wanted: Option<&[Vec<Range<usize>>]>,
    ) = body
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(
    field: &Field,
    pairs: &P,
    out: &mut Targets,
    reach: f64,
    wanted: Option<&[Vec<Range<usize>>]>,
) {
    let levels = (2.0 * reach + 2.0).log2().floor() as usize + 1;
    let shifts = (0..out.rows)
        .map(|b| pairs.shift(b))
        .fold([i64::MAX, i64::MIN], |[low, high], shift| [low.min(shift), high.max(shift)]);
    if out.rows == 0 {
        return;
    }
    let halo = reach.ceil() as i64 + 1;
    let mut maxima = Maxima::default();
    for strip in (0..out.columns).step_by(STRIP) {
        let columns = whole_groups((out.columns - strip).min(STRIP));
        let groups = strip / LANES..(strip + columns) / LANES;
        let all = std::slice::from_ref(&groups);
        let parts = |b: usize| wanted.map_or(all, |wanted| overlapping(&wanted[b], &groups));
        let start = PAD as i64 + strip as i64;
        let from = (start + shifts[0] - halo).max(0);
        let end = start + shifts[1] + columns as i64 + halo + LANES as i64;
        let end = end.min(field.row(-1).len() as i64).max(from);
        maxima.hold(from as usize..end as usize, levels);
        for a in (0..field.rows as i64).step_by(ROWS) {
            let rows = ROWS.min(field.rows - a as usize);
            let targets = (a..a + rows as i64)
                .map(|a| pairs.targets(a, -reach, reach))
                .filter(|targets| !targets.is_empty())
                .reduce(|all, targets| all.start.min(targets.start)..all.end.max(targets.end));
            let targets = targets.unwrap_or(0..0);
            if targets.clone().all(|b| parts(b).is_empty()) {
                continue;
            }
            for k in 0..rows {
                maxima.fill::<V>(k, field.row(a + k as i64));
            }
            for b in targets {
                let parts = parts(b);
                if parts.is_empty() {
                    continue;
                }
                let mut chords: [[&[f32]; 2]; ROWS] = [[&[]; 2]; ROWS];
                let mut count = 0;
                for k in 0..rows {
                    let Some(arc) = pairs.arc(a + k as i64, b) else { continue };
                    let (lo, hi) = (i64::from(arc.arc.flat_lo), i64::from(arc.arc.flat_hi));
                    if lo <= hi {
                        chords[count] = maxima.chord(k, start + pairs.shift(b), [lo, hi], columns);
                        count += 1;
                    }
                }
                let to = &mut out.row_mut(b)[strip..][..columns];
                for part in parts {
                    let part = part.start.max(groups.start)..part.end.min(groups.end);
                    let part = (part.start - groups.start) * LANES..(part.end - groups.start) * LANES;
                    let to = &mut to[part.clone()];
                    let cut = |chord| columns_of(chord, &part);
                    match chords {
                        _ if count == 0 => {}
                        [p, q, r, s] if count == ROWS => raise::<V, 4>(to, [p, q, r, s].map(cut)),
                        [p, q, r, _] if count == 3 => raise::<V, 3>(to, [p, q, r].map(cut)),
                        [p, q, _, _] if count == 2 => raise::<V, 2>(to, [p, q].map(cut)),
                        [p, _, _, _] => raise::<V, 1>(to, [p].map(cut)),
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn columns_of<'a>(chord: [&'a [f32]; 2], part: &Range<usize>) -> [&'a [f32]; 2] {
    chord.map(|row| &row[part.clone()])
}

/// Those of some ranges in order that share something with `range`.
#[inline(always)]
fn overlapping<'a>(ranges: &'a [Range<usize>], range: &Range<usize>) -> &'a [Range<usize>] {
    let first = ranges.partition_point(|part| part.end <= range.start);
    let end = ranges.partition_point(|part| part.start < range.end);
    &ranges[first..end.max(first)]
}

/// to = max(to, both of all chords), over whole groups.
#[inline(always)]
fn raise<V: Vectors, const N: usize>(to: &mut [f32], chords: [[&[f32]; 2]; N]) {
    let chords = chords.map(|chord| chord.map(|row| groups(&row[..to.len()])));
    for (g, to) in groups_mut(to).iter_mut().enumerate() {
        let mut best = V::load(to);
        for [near, far] in &chords {
            best = V::greater(V::greater(V::load(&near[g]), V::load(&far[g])), best);
        }
        V::store(best, to);
    }
}

/// The highest of 2^level samples from each one on, of some rows and columns.
#[derive(Default)]
struct Maxima {
    columns: Range<usize>,
    levels: usize,
    /// Row by row, level by level.
    z: Vec<f32>,
}

impl Maxima {
    fn hold(&mut self, columns: Range<usize>, levels: usize) {
        self.z.clear();
        self.z.resize(ROWS * levels * columns.len(), NONE);
        (self.columns, self.levels) = (columns, levels);
    }

    #[inline(always)]
    fn fill<V: Vectors>(&mut self, k: usize, row: &[f32]) {
        let length = self.columns.len();
        let tables = &mut self.z[k * self.levels * length..][..self.levels * length];
        tables[..length].copy_from_slice(&row[self.columns.clone()]);
        for level in 1..self.levels {
            let half = 1usize << (level - 1);
            let (lower, upper) = tables[(level - 1) * length..][..2 * length].split_at_mut(length);
            // Past the end there is no data, so the last maxima are those of half the length.
            let whole = length.saturating_sub(half) / LANES * LANES;
            higher::<V>(&mut upper[..whole], &lower[..whole], &lower[half.min(length)..][..whole]);
            for i in whole..length {
                let far = lower.get(i + half).copied().unwrap_or(NONE);
                upper[i] = if lower[i] > far { lower[i] } else { far };
            }
        }
    }

    /// Two tables' rows whose maximum is that of samples `lo ..= hi` columns from each of `count`
    /// from `start` on.
    #[inline(always)]
    fn chord(&self, k: usize, start: i64, [lo, hi]: [i64; 2], count: usize) -> [&[f32]; 2] {
        let length = self.columns.len();
        let level = (hi - lo + 1).ilog2() as usize;
        let row = &self.z[(k * self.levels + level) * length..][..length];
        let start = start - self.columns.start as i64;
        [&row[(start + lo) as usize..][..count], &row[(start + hi + 1 - (1i64 << level)) as usize..][..count]]
    }
}
