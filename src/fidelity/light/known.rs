//! The light of surfaces that are one and the same for the most part, as a design and what a cutter leaves of it:
//! only where they differ is light followed again.

use glam::DVec3;
use rayon::prelude::*;

use super::lit::{Lit, bands};
use super::row::Chunk;
use super::tally::LightTally;
use super::{Pose, Room};
use crate::grid::{Heights, Window};

/// A surface whose light is known.
pub struct Known<'a> {
    heights: &'a Heights,
    window: Window,
    step_mm: f64,
    pose: &'a Pose,
    room: &'a Room<'a>,
    lit: Option<Lit<'a>>,
    /// Of the samples of `window`: whether no ray from it comes near anything, so that only its neighbours count.
    free: Vec<bool>,
    light: LightTally,
}

impl<'a> Known<'a> {
    /// Follows the light of the samples of `window`, as [`LightTally::add`] does.
    pub fn new(
        heights: &'a Heights,
        window: Window,
        step_mm: f64,
        pose: &'a Pose,
        room: &'a Room<'a>,
    ) -> Known<'a> {
        let lit = Lit::new(heights, window, step_mm, pose, room);
        let mut free = vec![false; window.samples()];
        let mut light = LightTally::default();
        if let Some(lit) = &lit {
            let outlines = lit.outlines();
            let rows = bands(window);
            let bands: Vec<&mut [bool]> =
                free.chunks_mut((rows[0].1 - rows[0].0) as usize * window.columns).collect();
            let tallies: Vec<LightTally> = rows
                .into_par_iter()
                .zip(bands)
                .map(|((first, end), free)| {
                    let (mut tally, mut chunk) = (lit.tally(), Chunk::new());
                    for (row, free) in (first..end).zip(free.chunks_mut(window.columns)) {
                        let sums = (&mut tally, &mut chunk);
                        lit.row(outlines.as_deref(), (row, window), sums, &mut None, |column, done| {
                            free[(column - window.column) as usize..][..done.len()].copy_from_slice(done);
                        });
                    }
                    tally
                })
                .collect();
            tallies.iter().for_each(|tally| light.merge(tally));
        }
        Known { heights, window, step_mm, pose, room, lit, free, light }
    }

    /// The light of the surface.
    pub fn into_light(self) -> LightTally {
        self.light
    }

    /// The light of another surface in the same room; of the samples that are as they were nothing is followed
    /// again. The same as [`LightTally::add`] gives, but for the rounding of its sums.
    pub fn with(&self, other: &Heights) -> LightTally {
        let (window, step_mm) = (self.window, self.step_mm);
        let (Some(lit), Some(changed)) = (&self.lit, Lit::new(other, window, step_mm, self.pose, self.room))
        else {
            return self.anew(other);
        };
        let (Some(known), Some(outlines)) = (lit.outlines(), changed.outlines()) else {
            return self.anew(other);
        };
        if other.window != self.heights.window {
            return self.anew(other);
        }
        let both = [(lit, known.as_slice()), (&changed, outlines.as_slice())];
        let tallies: Vec<[LightTally; 2]> = bands(window)
            .into_par_iter()
            .map(|(first, end)| {
                let mut tallies = both.map(|(lit, _)| lit.tally());
                let mut chunk = Chunk::new();
                let (mut same, mut columns) = (vec![false; window.columns], vec![0; window.columns + 1]);
                for row in first..end {
                    let count = self.differ((lit, &changed), row, (&mut same, &mut columns));
                    for columns in columns[..count].chunks(Chunk::SAMPLES) {
                        for ((lit, outlines), tally) in both.iter().zip(&mut tallies) {
                            follow(lit, outlines, (row, columns), tally, &mut chunk);
                        }
                    }
                }
                tallies
            })
            .collect();
        let mut light = self.light.clone();
        let [mut before, mut after] = both.map(|(lit, _)| lit.tally());
        for [known, changed] in &tallies {
            before.merge(known);
            after.merge(changed);
        }
        light.exchange(&before, &after);
        light
    }

    fn anew(&self, other: &Heights) -> LightTally {
        let mut light = LightTally::default();
        light.add(other, self.window, self.step_mm, self.pose, self.room, None);
        light
    }

    /// The columns of a row at which the light may differ; gives how many.
    fn differ<'h>(
        &'h self,
        (lit, changed): (&Lit, &Lit<'h>),
        row: i64,
        (same, columns): (&mut [bool], &mut [i64]),
    ) -> usize {
        let (window, around) = (self.window, self.heights.window);
        let (first, count) = ((window.column - around.column) as usize, window.columns);
        let inner =
            first > 0 && first + count < around.columns && row > around.row && row + 1 < around.row_end();
        if !inner {
            columns.iter_mut().zip(window.column..).for_each(|(to, column)| *to = column);
            return count;
        }
        let five = |heights: &'h Heights| {
            let line = |row: i64, from: usize| &heights.row(row)[from..from + count];
            [
                line(row, first),
                line(row, first - 1),
                line(row, first + 1),
                line(row - 1, first),
                line(row + 1, first),
            ]
        };
        let start = (row - window.row) as usize * window.columns;
        same.copy_from_slice(&self.free[start..start + count]);
        for (known, other) in five(self.heights).iter().zip(five(changed.ground.heights)) {
            for ((same, known), other) in same.iter_mut().zip(*known).zip(other) {
                *same &= known == other;
            }
        }
        // Where something stands higher around a sample, its rays are looked at again.
        changed.relief.harder(&lit.relief, (row - around.row) as usize, first..first + count, |columns| {
            same[columns.start - first..columns.end - first].fill(false);
        });
        let mut found = 0;
        for (column, same) in (window.column..).zip(same.iter()) {
            columns[found] = column;
            found += usize::from(!same);
        }
        found
    }
}

/// Follows samples of a row, which need not lie side by side.
fn follow(
    lit: &Lit,
    outlines: &[&[[DVec3; 2]]],
    (row, columns): (i64, &[i64]),
    tally: &mut LightTally,
    chunk: &mut Chunk,
) {
    let ends = columns.first().zip(columns.last());
    if ends.is_some_and(|(first, last)| lit.ground.surrounded(*first, *last + 1, row)) {
        chunk.gather((lit.ground.heights, &lit.relief, &lit.stage), outlines, row, columns);
        lit.chunk(tally, chunk, row, |k| columns[k], columns.len(), &mut None);
    } else {
        for &column in columns {
            lit.sample(tally, column, row);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;
    use crate::compensation::{Profile, closing};
    use crate::fidelity::light::{Metal, body};
    use crate::optics::{ComplexIndex, Reflectance};

    const STEP_MM: f64 = 0.01;

    /// Facets with steps between them, some deep enough to throw shadows, and a hole.
    fn facets(window: Window) -> Heights {
        let mut heights = Heights::empty(window);
        for (index, z) in heights.z_mm.iter_mut().enumerate() {
            let (c, r) = ((index % window.columns) as i64, (index / window.columns) as i64);
            let (i, j) = (c / 37, r / 29);
            let turn = |by: f64| ((i * 7 + j * 13) as f64 * by).fract() - 0.5;
            let slope = 0.3 * turn(0.618) * (c % 37) as f64 + 0.4 * turn(0.755) * (r % 29) as f64;
            *z = (slope * STEP_MM + 0.08 * turn(0.57)) as f32;
            if (c - 60).pow(2) + (r - 50).pow(2) < 40 {
                *z = f32::NAN;
            }
        }
        heights
    }

    fn apart(a: &LightTally, b: &LightTally) -> f64 {
        assert_eq!((a.samples, a.shadowed), (b.samples, b.shadowed));
        let sums = |t: &LightTally| [t.incident, t.on_audience, t.leak, t.absorbed, t.unresolved];
        let [room, met] = [(&a.room, &b.room), (&a.met, &b.met)]
            .map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        let of_sums = sums(a).iter().zip(sums(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        (of_sums.max(room).max(met)) / a.incident
    }

    #[test]
    fn what_changed_is_followed_again_and_nothing_else_counts() {
        let near = Window { column: -16, row: 4, columns: 600, rows: 420 };
        let window = Window { column: 0, row: 20, columns: 568, rows: 388 };
        let around = facets(Window { column: -56, row: -36, columns: 680, rows: 500 });
        let design = around.crop(near);
        let audience = [body(DVec3::new(0.3, 0.1, 3.0), 0.4), body(DVec3::new(-1.0, 0.2, 3.5), 0.5)];
        let rotation = DMat3::from_rotation_x(0.1) * DMat3::from_rotation_y(-0.15);
        let pose = Pose { origin_m: DVec3::new(0.1, -0.2, 0.05), rotation };
        let aluminium = Reflectance::Metal(ComplexIndex { n: 1.0, k: 6.4 });
        for metal in [Metal::new(aluminium, None, 0.0), Metal::new(aluminium, Some(0.1), 0.02)] {
            let projector_m = DVec3::new(0.9, 0.1, 1.0);
            let room = Room { projector_m, audience: &audience, metal, steepest: 0.5, far_field: None };
            let known = Known::new(&design, window, STEP_MM, &pose, &room);
            let mut alone = LightTally::default();
            alone.add(&design, window, STEP_MM, &pose, &room, None);
            assert_eq!(apart(&alone, &known.light), 0.0);
            for cutter in ["ball:0.4", "flat:0.3"] {
                let profile =
                    Profile::new(cutter.parse().expect("a cutter"), STEP_MM, 0.0).expect("a profile");
                let mut closed = closing(&around, &profile, near);
                for (z, design) in closed.z_mm.iter_mut().zip(&design.z_mm) {
                    *z = if design.is_nan() { f32::NAN } else { *z };
                }
                let (with, mut alone) = (known.with(&closed), LightTally::default());
                alone.add(&closed, window, STEP_MM, &pose, &room, None);
                let far = apart(&alone, &with);
                assert!(far < 1e-12, "{cutter}: {far}");
                assert!(apart_at_all(&alone, &known.light), "{cutter} changes the light");
                assert!(alone.shadowed > 100, "some of it lies in shadow: {}", alone.shadowed);
            }
        }
    }

    fn apart_at_all(a: &LightTally, b: &LightTally) -> bool {
        (a.on_audience - b.on_audience).abs() > 1e-6 * a.incident
    }
}
