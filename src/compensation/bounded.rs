//! Every sample under every position, but for stretches of samples of which none can raise any.
//!
//! The highest of 8 and of 32 samples from each one on are tabulated, the latter of 8 rows at once, too.
//! Such a maximum with the greatest s of its stretch is at least what each sample of it asks for, in f32 too:
//! where it is no more than a position already has the stretch is left out, and the bits stay. Nothing
//! is asked of the profile but that it falls outwards, so this is the way for vees, tapers, bulls and
//! cutters widened by an allowance: the steeper they are against the surface, the less of them is looked at.

use super::field::{Field, PAD, TILE, Targets};
use super::lanes::{LANES, NONE, Vectors, groups, groups_mut, higher, widest};
use super::pairs::Pairs;
use super::stencil::ArcRef;

/// Samples of a long and of a short stretch, as powers of two.
const LEVELS: [usize; 2] = [5, 3];

/// Rows of a long stretch.
const ROWS: usize = 8;

/// Radius in samples from which tabulating maxima pays.
pub(super) const LEAST_RADIUS: f64 = 8.0;

const GROUPS: usize = TILE / LANES;

widest! {
    /// What [`super::brute::every_tap`] gives.
    fn bounded<P: Pairs>(field: &Field, pairs: &P, skip_flat: bool, out: &mut Targets) = body
}

/// Offsets on one side of the axis, from the near one to the far one, in some rows of the field.
#[derive(Clone, Copy)]
struct Stretch {
    block: usize,
    near: i32,
    far: i32,
    /// No s of these offsets is greater.
    s: f32,
}

#[inline(always)]
pub(super) fn body<V: Vectors, P: Pairs>(field: &Field, pairs: &P, skip_flat: bool, out: &mut Targets) {
    let highest = Highest::of::<V>(field);
    let length = field.row(-1).len();
    let slack_mm = pairs.slack_mm();
    let mut stretches = Vec::new();
    for b in 0..out.rows {
        list(pairs, b, skip_flat, &mut stretches);
        let inputs = pairs.inputs(b);
        for tile in (0..out.columns).step_by(TILE) {
            let to = groups_mut(&mut out.row_mut(b)[tile..][..TILE]);
            let mut best = [V::splat(NONE); GROUPS];
            for (best, to) in best.iter_mut().zip(to.iter()) {
                *best = V::load(to);
            }
            let start = PAD as i64 + tile as i64 + pairs.shift(b);
            for stretch in &stretches {
                let of_rows = &highest.of_rows[stretch.block * length..][..length];
                let at = start + i64::from(stretch.near.min(stretch.far));
                if rises::<V>(of_rows, at, stretch.s + slack_mm, &best) == 0 {
                    continue;
                }
                let first = (stretch.block * ROWS) as i64;
                for a in first.max(inputs.start)..(first + ROWS as i64).min(inputs.end) {
                    let Some(arc) = pairs.arc(a, b) else { continue };
                    let [long, short] = [0, 1].map(|k| &highest.tables[k][a as usize * length..][..length]);
                    for span in arc.arc.spans(skip_flat) {
                        let Some([near, far]) = stretch.within(span) else { continue };
                        let at = start + i64::from(near.min(far));
                        if rises::<V>(long, at, arc.s(near) + slack_mm, &best) != 0 {
                            raise::<V>(short, field.row(a), &arc, start, [near, far], slack_mm, &mut best);
                        }
                    }
                }
            }
            for (to, best) in to.iter_mut().zip(best) {
                V::store(best, to);
            }
        }
    }
}

impl Stretch {
    /// The part within a span of an arc, from the near end to the far one.
    #[inline(always)]
    fn within(&self, [lo, hi]: [i32; 2]) -> Option<[i32; 2]> {
        if self.near >= 0 {
            let (near, far) = (self.near.max(lo), self.far.min(hi));
            (near <= far).then_some([near, far])
        } else {
            let (near, far) = (self.near.min(hi), self.far.max(lo));
            (near >= far).then_some([near, far])
        }
    }
}

/// All offsets of a target row, those that are likely to raise it first.
fn list<P: Pairs>(pairs: &P, b: usize, skip_flat: bool, stretches: &mut Vec<Stretch>) {
    stretches.clear();
    let inputs = pairs.inputs(b);
    let mut first = inputs.start.max(0);
    while first < inputs.end {
        let block = first as usize / ROWS;
        let end = (((block + 1) * ROWS) as i64).min(inputs.end);
        let reach = (first..end)
            .filter_map(|a| pairs.arc(a, b))
            .fold(-1, |reach, arc| arc.arc.hi.max(-arc.arc.lo).max(reach));
        for outwards in [1, -1] {
            let mut near = if outwards > 0 { 0 } else { -1 };
            while outwards * near <= reach {
                let far = near + outwards * ((1 << LEVELS[0]) - 1);
                let mut stretch = Stretch { block, near, far, s: NONE };
                for arc in (first..end).filter_map(|a| pairs.arc(a, b)) {
                    let nearest =
                        arc.arc.spans(skip_flat).into_iter().filter_map(|span| stretch.within(span));
                    stretch.s = nearest.fold(stretch.s, |most, [near, _]| most.max(arc.s(near)));
                }
                if stretch.s > NONE {
                    stretches.push(stretch);
                }
                near = far + outwards;
            }
        }
        first = end;
    }
    stretches.sort_by(|p, q| q.s.total_cmp(&p.s));
}

/// Takes the samples of one row at some offsets, short stretch by short stretch.
#[inline(always)]
fn raise<V: Vectors>(
    maxima: &[f32],
    row: &[f32],
    arc: &ArcRef,
    start: i64,
    [near, far]: [i32; 2],
    slack_mm: f32,
    best: &mut [V::Group; GROUPS],
) {
    let outwards = if near >= 0 { 1 } else { -1 };
    let length = (1 << LEVELS[1]) - 1;
    let mut first = near;
    while outwards * first <= outwards * far {
        let last = if outwards > 0 { (first + length).min(far) } else { (first - length).max(far) };
        let (low, high) = (first.min(last), first.max(last));
        let raised = rises::<V>(maxima, start + i64::from(low), arc.s(first) + slack_mm, best);
        for (g, best) in best.iter_mut().enumerate() {
            if raised >> g & 1 == 0 {
                continue;
            }
            let z = &row[(start + i64::from(low)) as usize + g * LANES..];
            for dx in low..=high {
                let z = groups(&z[(dx - low) as usize..][..LANES]);
                *best = V::greater(V::add(V::load(&z[0]), V::splat(arc.s(dx))), *best);
            }
        }
        first = last + outwards;
    }
}

/// The groups, as bits, in which a stretch whose maxima begin at `at` could raise a position.
#[inline(always)]
fn rises<V: Vectors>(maxima: &[f32], at: i64, s: f32, best: &[V::Group; GROUPS]) -> u32 {
    let s = V::splat(s);
    let mut bits = 0;
    for (g, (z, best)) in groups(&maxima[at as usize..][..TILE]).iter().zip(best).enumerate() {
        if V::at_least(*best, V::add(V::load(z), s)) != u16::MAX {
            bits |= 1 << g;
        }
    }
    bits
}

/// The highest of so many samples from each one of a row on.
struct Highest {
    /// Row by row, for long and short stretches.
    tables: [Vec<f32>; 2],
    /// The long one's over [`ROWS`] rows.
    of_rows: Vec<f32>,
}

impl Highest {
    #[inline(always)]
    fn of<V: Vectors>(field: &Field) -> Highest {
        let length = field.row(-1).len();
        let mut tables = [0, 1].map(|_| vec![NONE; field.rows * length]);
        let mut of_rows = vec![NONE; field.rows.div_ceil(ROWS) * length];
        let mut now = vec![NONE; length];
        let mut next = vec![NONE; length];
        for a in 0..field.rows {
            now.copy_from_slice(field.row(a as i64));
            for level in 1..=LEVELS[0] {
                let half = 1usize << (level - 1);
                let whole = length.saturating_sub(half) / LANES * LANES;
                higher::<V>(&mut next[..whole], &now[..whole], &now[half.min(length)..][..whole]);
                // Past the end there is no data.
                for i in whole..length {
                    let far = now.get(i + half).copied().unwrap_or(NONE);
                    next[i] = if now[i] > far { now[i] } else { far };
                }
                std::mem::swap(&mut now, &mut next);
                if let Some(table) = LEVELS.iter().position(|at| *at == level) {
                    tables[table][a * length..][..length].copy_from_slice(&now);
                }
            }
            for (z, now) in of_rows[a / ROWS * length..][..length].iter_mut().zip(&now) {
                *z = if *now > *z { *now } else { *z };
            }
        }
        Highest { tables, of_rows }
    }
}
