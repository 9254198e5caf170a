//! A few rows of the stock, through which programs are cut one after the other.

use super::super::contact::Contact;
use super::super::judged::{CHUNK, Judged};
use super::above::{Above, GROUP};
use super::along::{Lines, Samples};
use super::bite::{Bite, ProgramCut, Watch};
use super::leg::{Leg, Lie};
use super::{OVERLAP_MM, REACH_MM};
use crate::grid::Window;

/// More than the rounding of a height in mm.
const ROUNDED_MM: f64 = 1e-6;

pub(super) struct Band<'a> {
    pub z_mm: &'a mut [f32],
    /// Places of the samples, and of some past the last.
    pub x_mm: &'a [f64],
    pub y_mm: Vec<f64>,
    /// Samples per mm.
    pub per_mm: f64,
    pub window: Window,
    pub datum_mm: f64,
}

impl Band<'_> {
    /// Cuts a program.
    #[inline(always)]
    pub fn take<C: Contact, V: Above>(&mut self, contact: C, judged: &Judged) -> ProgramCut {
        let mut watches = [Watch::NOTHING; 3];
        let motions = &judged.reading.motions;
        let reach = contact.radius() + OVERLAP_MM;
        let Window { columns, rows, .. } = self.window;
        let low = [self.x_mm[0] - reach, self.y_mm[0] - reach];
        let high = [self.x_mm[columns - 1] + reach, self.y_mm[rows - 1] + reach];
        let apart =
            |l: [f64; 2], h: [f64; 2]| h[0] < low[0] || l[0] > high[0] || h[1] < low[1] || l[1] > high[1];
        let mut lines = Lines::new(columns, rows);
        // No sample stands higher now or later, and no cutter is lower than its tip.
        let top = f64::from(highest(self.z_mm)) + ROUNDED_MM;
        for (chunk, bounds) in judged.chunks.iter().enumerate() {
            if apart(bounds[0], bounds[1]) {
                continue;
            }
            let first = chunk * CHUNK;
            let last = (first + CHUNK).min(motions.len());
            let mut next = Leg::of(&contact, judged, first, self.datum_mm);
            for index in first..last {
                let this = next;
                next = (index + 1 < motions.len())
                    .then(|| Leg::of(&contact, judged, index + 1, self.datum_mm))
                    .flatten();
                let Some(this) = this else { continue };
                let l = [this.from[0].min(this.to[0]), this.from[1].min(this.to[1])];
                let h = [this.from[0].max(this.to[0]), this.from[1].max(this.to[1])];
                if apart(l, h) || this.from[2].min(this.to[2]) > top {
                    continue;
                }
                let watch = &mut watches[this.class as usize];
                let legs = (&this, next.as_ref());
                match this.lie {
                    Lie::Nothing => {}
                    Lie::Point => self.disc(&contact, &this, index, watch),
                    Lie::Along(0) => self.along::<C, V, 0>(&mut lines, &contact, legs, index, watch),
                    Lie::Along(_) => self.along::<C, V, 1>(&mut lines, &contact, legs, index, watch),
                    Lie::Oblique => self.oblique(&contact, legs, index, watch),
                }
            }
        }
        let bite = |watch: &Watch| {
            (watch.motion != usize::MAX).then(|| Bite {
                depth_mm: f64::from(watch.depth),
                at_mm: [self.x_mm[watch.column], self.y_mm[watch.row], f64::from(watch.z) + self.datum_mm],
                line: motions[watch.motion].line,
                motion: watch.motion,
                row: self.window.row + watch.row as i64,
                column: self.window.column + watch.column as i64,
            })
        };
        let [cut, plunge, rapid] = watches;
        ProgramCut { cut: bite(&cut), plunge: bite(&plunge), rapid: bite(&rapid) }
    }

    #[inline(always)]
    pub(super) fn samples(&self, axis: usize) -> Samples {
        let Window { column, row, columns, rows } = self.window;
        let (start, count) = if axis == 0 { (column, columns) } else { (row, rows) };
        Samples::new(self.per_mm, start, count)
    }

    /// First and one past the last index along an axis whose samples lie in low .. high mm.
    #[inline(always)]
    pub(super) fn range(&self, axis: usize, low: f64, high: f64) -> (usize, usize) {
        let samples = self.samples(axis);
        let first = samples.index(low - OVERLAP_MM) as usize;
        let end = samples.index(high + OVERLAP_MM) as usize;
        (first, end.max(first))
    }

    #[inline(always)]
    fn lower(&mut self, row: usize, column: usize, new: f32, motion: usize, watch: &mut Watch) {
        let z = &mut self.z_mm[row * self.window.columns + column];
        if new < *z {
            watch.see(*z, new, motion, row, column);
            *z = new;
        }
    }

    /// The cutter standing at the move's end.
    #[inline(always)]
    fn disc<C: Contact>(&mut self, contact: &C, leg: &Leg, motion: usize, watch: &mut Watch) {
        let reach = contact.radius() + REACH_MM;
        let [x, y, z] = leg.to;
        let (first, end) = self.range(1, y - reach, y + reach);
        for row in first..end {
            let d = self.y_mm[row] - y;
            let d2 = d * d;
            let q = (reach * reach - d2).max(0.0).sqrt();
            let (first, end) = self.range(0, x - q, x + q);
            for column in first..end {
                let w = self.x_mm[column] - x;
                self.lower(row, column, (z + contact.rise(d2 + w * w)) as f32, motion, watch);
            }
        }
    }

    #[inline(always)]
    fn oblique<C: Contact>(
        &mut self,
        contact: &C,
        (leg, next): (&Leg, Option<&Leg>),
        motion: usize,
        watch: &mut Watch,
    ) {
        let reach = contact.radius() + REACH_MM;
        let next = next.filter(|n| n.class == leg.class);
        let ([ux, uy], length, m) = (leg.u, leg.length, leg.lean.m);
        let low = leg.from[1].min(leg.to[1]) - reach;
        let high = leg.from[1].max(leg.to[1]) + reach;
        let (first, end) = self.range(1, low, high);
        // Uphill and level, nothing behind the start has its minimum on this move.
        let behind = if m >= 0.0 { 0.0 } else { reach };
        for row in first..end {
            let dy = self.y_mm[row] - leg.from[1];
            // |d| <= reach and -behind <= s <= length + reach, both linear in x.
            let (mut west, mut east) = (f64::NEG_INFINITY, f64::INFINITY);
            for (rate, offset, low, high) in
                [(-uy, ux * dy, -reach, reach), (ux, uy * dy, -behind, length + reach)]
            {
                if rate != 0.0 {
                    let (a, b) = ((low - offset) / rate, (high - offset) / rate);
                    west = west.max(a.min(b));
                    east = east.min(a.max(b));
                }
            }
            let (first, end) = self.range(0, leg.from[0] + west, leg.from[0] + east);
            for column in first..end {
                let (x, y) = (self.x_mm[column], self.y_mm[row]);
                let Some((s, d2, q, lowest)) = leg.lowest(contact, reach, x, y) else { continue };
                if lowest < -OVERLAP_MM {
                    continue;
                }
                let (enters, leaves) = ((s - q).max(0.0), (s + q).min(length));
                if enters > leaves {
                    continue;
                }
                if lowest > length
                    && let Some(next) = next
                    && next.takes(contact, reach, x, y)
                {
                    continue;
                }
                let t = lowest.clamp(enters, leaves);
                let new = (leg.from[2] + m * t + contact.rise(d2 + (t - s) * (t - s))) as f32;
                self.lower(row, column, new, motion, watch);
            }
        }
    }
}

/// The highest of all that are numbers, found in as many places at once as vectors have.
#[inline(always)]
pub(super) fn highest(z_mm: &[f32]) -> f32 {
    let higher = |a: f32, b: f32| if b > a { b } else { a };
    let mut most = [f32::NEG_INFINITY; GROUP];
    let groups = z_mm.chunks_exact(GROUP);
    let rest = groups.remainder().iter().copied();
    for group in groups {
        for (most, z) in most.iter_mut().zip(group) {
            *most = higher(*most, *z);
        }
    }
    // Halves on halves, which waits less than one after the other.
    let mut half = GROUP / 2;
    while half > 0 {
        for k in 0..half {
            most[k] = higher(most[k], most[k + half]);
        }
        half /= 2;
    }
    rest.fold(most[0], higher)
}

#[cfg(test)]
mod tests {
    use super::super::above::Portable;
    use super::super::along::LINES;
    use super::*;
    use crate::cutter::Shape;
    use crate::verify::contact::with_contact;
    use crate::verify::{Options, Reading};

    /// Passes along x over hills, half of them level, that come back deeper.
    fn reading() -> Reading {
        let mut text = String::from("G21 G90 M3\nG0 Z2\nG0 X0 Y0\nF300\n");
        for pass in 0..40 {
            let y = 0.03 * f64::from(pass % 20);
            let deep = -0.1 - 0.1 * f64::from(pass / 20);
            text += &format!("G0 Z1\nG0 X-0.1 Y{y:.4}\nG1 Z{deep:.4}\n");
            for k in 1..=14 {
                let x = -0.1 + 0.14 * f64::from(k);
                let hill = if pass % 4 < 2 { 0.0 } else { 0.08 * (5.0 * x + y).sin() };
                text += &format!("G1 X{x:.4} Z{:.4}\n", deep + hill);
            }
        }
        Reading::of((text + "G0 Z2\nM2\n").as_bytes(), &Options::default()).expect("a program")
    }

    fn cut(shape: &Shape, each: impl FnOnce(&mut Band, &Judged)) -> Vec<f32> {
        let window = Window { column: -20, row: -20, columns: 210, rows: LINES };
        // Hills and holes, so that some blocks stand above the cutter and others do not.
        let stock = |k: usize| match (k % window.columns, k / window.columns) {
            (column, row) if (column + row) % 97 == 0 => f32::NAN,
            (column, row) => 0.05 - 0.2 * ((column / 40 + row / 16) % 3) as f32,
        };
        let mut z_mm: Vec<f32> = (0..window.samples()).map(stock).collect();
        let places = |first: i64, count: usize| -> Vec<f64> {
            (0..count + LINES).map(|k| ((first + k as i64) as f64 + 0.5) * 0.01).collect()
        };
        let (x_mm, y_mm) = (places(window.column, window.columns), places(window.row, window.rows));
        let reading = reading();
        let judged = Judged::new(&reading, *shape, [0.0; 3]);
        let mut band = Band { z_mm: &mut z_mm, x_mm: &x_mm, y_mm, per_mm: 100.0, window, datum_mm: 0.0 };
        each(&mut band, &judged);
        z_mm
    }

    #[test]
    fn moves_along_the_samples_cut_what_any_move_cuts() {
        for name in ["ball:0.6", "flat:0.5", "bull:0.6:0.1", "vee:60:0.1:0.7", "taper:0.2:10:0.6"] {
            let shape: Shape = name.parse().expect("a cutter");
            let mut watch = Watch::NOTHING;
            let oblique = cut(&shape, |band, judged| {
                with_contact!(&shape, contact => {
                    let leg = |index: usize| Leg::of(&contact, judged, index, 0.0);
                    for index in 0..judged.reading.motions.len() {
                        let (Some(this), next) = (leg(index), leg((index + 1).min(judged.reading.motions.len() - 1))) else { continue };
                        match this.lie {
                            Lie::Nothing => {}
                            Lie::Point => band.disc(&contact, &this, index, &mut watch),
                            _ => band.oblique(&contact, (&this, next.as_ref()), index, &mut watch),
                        }
                    }
                })
            });
            let mut found = ProgramCut::default();
            let along = cut(&shape, |band, judged| {
                found = with_contact!(&shape, contact => band.take::<_, Portable>(contact, judged));
            });
            let cuts = oblique.iter().filter(|z| **z < -0.16).count();
            assert!(cuts > 1000, "{name}: {cuts}");
            for (k, (a, b)) in along.iter().zip(&oblique).enumerate() {
                let same = (a.is_nan() && b.is_nan()) || (a - b).abs() < 2e-6;
                assert!(same, "{name}: {a} and {b} at sample {k}");
            }
            let deepest = found.deepest_bite_mm();
            assert!((deepest - f64::from(watch.depth)).abs() < 2e-6, "{name}: {deepest} and {}", watch.depth);
        }
    }
}
