//! Shank and holder against the metal that still stands when they come by.
//!
//! The stock is followed in the order of the motions on a coarse lattice. Nothing is followed while the lower end of
//! the shank stays above the blank, which is the common case.

use super::judged::{Blank, CHUNK, Judged};
use super::reading::{Motion, Reading};
use super::skyline::Skyline;
use super::sweep;
use crate::grid::{Heights, Window};
use crate::machine::Cylinder;

/// Pitch of the lattice where the blank is not too large for it.
const STEP_MM: f64 = 0.1;
/// Samples that are held at most.
const MOST_SAMPLES: f64 = 16e6;
/// Less than this is rounding.
const DEPTH_MM: f64 = 1e-4;

/// A shank or holder that runs into metal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyHit {
    /// "shank" or "holder".
    pub what: &'static str,
    /// How far its lower end is below the metal.
    pub depth_mm: f64,
    /// The metal that it meets, in the frame of the part.
    pub at_mm: [f64; 3],
    /// Line of the program's text.
    pub line: u32,
}

/// The deepest hit of each program, in their order; `bodies` are the cylinders above the cutter of each program.
///
/// On the lattice a cylinder is larger by half the diagonal of a cell, so it touches a sample wherever it touches the
/// metal around it; what stands higher between samples than at them is missed by at most the metal's slope times
/// that.
pub fn body_hits(blank: &Blank, programs: &[Judged], bodies: &[Vec<Cylinder>]) -> Vec<Option<BodyHit>> {
    let deep: Vec<bool> =
        programs.iter().zip(bodies).map(|(judged, body)| deep(blank, judged, body)).collect();
    let mut hits = vec![None; programs.len()];
    let Some(last) = deep.iter().rposition(|&deep| deep) else { return hits };
    let area = (blank.high_mm[0] - blank.low_mm[0]) * (blank.high_mm[1] - blank.low_mm[1]);
    let step_mm = (area / MOST_SAMPLES).sqrt().max(STEP_MM);
    let low = blank.low_mm.map(|mm| (mm / step_mm).floor() as i64);
    let high = blank.high_mm.map(|mm| (mm / step_mm).ceil() as i64);
    let window = Window {
        column: low[0],
        row: low[1],
        columns: (high[0] - low[0]).max(0) as usize,
        rows: (high[1] - low[1]).max(0) as usize,
    };
    let stock = blank.heights(window, step_mm, blank.top_mm);
    let mut metal = Metal { skyline: Skyline::new(&stock), heights: stock, step_mm, datum_mm: blank.top_mm };
    for index in 0..=last {
        let judged = &programs[index];
        if deep[index] {
            hits[index] = metal.follow(judged, &bodies[index]);
        } else {
            metal.heights = sweep(metal.heights, step_mm, blank.top_mm, std::slice::from_ref(judged)).heights;
            metal.skyline = Skyline::new(&metal.heights);
        }
    }
    hits
}

/// Whether any of the cylinders gets below the blank's top.
fn deep(blank: &Blank, judged: &Judged, body: &[Cylinder]) -> bool {
    let Some(from_mm) = body.iter().map(|cylinder| cylinder.from_mm).reduce(f64::min) else { return false };
    let below = blank.top_mm - judged.zero_mm[2] - from_mm;
    judged.reading.motions.iter().any(|motion| motion.known() && motion.to_mm[2] < below)
}

struct Metal {
    heights: Heights,
    skyline: Skyline,
    step_mm: f64,
    datum_mm: f64,
}

impl Metal {
    /// Cuts a program, and gives the deepest hit of its body. Motions are taken together while no body comes near the
    /// metal as it stood before them, and one by one where it does.
    fn follow(&mut self, judged: &Judged, body: &[Cylinder]) -> Option<BodyHit> {
        let motions = &judged.reading.motions;
        let mut deepest: Option<BodyHit> = None;
        for first in (0..motions.len()).step_by(CHUNK) {
            let end = (first + CHUNK).min(motions.len());
            if (first..end).all(|index| self.hit(judged, body, index).is_none()) {
                self.cut(judged, first, end);
                continue;
            }
            for index in first..end {
                if let Some(hit) = self.hit(judged, body, index)
                    && deepest.is_none_or(|deepest| hit.depth_mm > deepest.depth_mm)
                {
                    deepest = Some(hit);
                }
                self.cut(judged, index, index + 1);
            }
        }
        deepest
    }

    /// Takes away what the cutter takes in the motions from `first` to `end`.
    fn cut(&mut self, judged: &Judged, first: usize, end: usize) {
        let motions = &judged.reading.motions[first.saturating_sub(1)..end];
        let reach = judged.shape.radius_mm() + 2.0 * self.step_mm;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for motion in motions.iter().filter(|motion| motion.known()) {
            for axis in 0..2 {
                low[axis] = low[axis].min(motion.to_mm[axis] + judged.zero_mm[axis] - reach);
                high[axis] = high[axis].max(motion.to_mm[axis] + judged.zero_mm[axis] + reach);
            }
        }
        let Some(window) = self.window(low, high) else { return };
        let reading = Reading {
            summary: judged.reading.summary.clone(),
            motions: motions.to_vec(),
            dwells: Vec::new(),
            arcs: Vec::new(),
            path_modes: Vec::new(),
            pauses: Vec::new(),
        };
        let part = Judged::new(&reading, judged.shape, judged.zero_mm);
        let cut = sweep(self.heights.crop(window), self.step_mm, self.datum_mm, &[part]).heights;
        let whole = self.heights.window;
        for row in window.row..window.row_end() {
            let start = (row - whole.row) as usize * whole.columns + (window.column - whole.column) as usize;
            self.heights.z_mm[start..start + window.columns].copy_from_slice(cut.row(row));
        }
        self.skyline.renew(&self.heights, window);
    }

    fn hit(&self, judged: &Judged, body: &[Cylinder], index: usize) -> Option<BodyHit> {
        let motion = &judged.reading.motions[index];
        if !motion.known() {
            return None;
        }
        let place = |motion: &Motion| -> [f64; 3] {
            std::array::from_fn(|axis| motion.to_mm[axis] + judged.zero_mm[axis])
        };
        let to = place(motion);
        let before = index.checked_sub(1).map(|index| &judged.reading.motions[index]);
        let from = before.filter(|motion| motion.known()).map_or(to, place);
        let mut deepest: Option<BodyHit> = None;
        for cylinder in body {
            if from[2].min(to[2]) + cylinder.from_mm >= self.datum_mm {
                continue;
            }
            if let Some((depth_mm, at_mm)) = self.under(cylinder, from, to)
                && deepest.is_none_or(|hit| depth_mm > hit.depth_mm)
            {
                deepest = Some(BodyHit { what: cylinder.what, depth_mm, at_mm, line: motion.line });
            }
        }
        deepest
    }

    /// How deep the cylinder's lower end gets into the metal on its way, and where.
    fn under(&self, cylinder: &Cylinder, from: [f64; 3], to: [f64; 3]) -> Option<(f64, [f64; 3])> {
        let radius = cylinder.radius_mm + self.step_mm * std::f64::consts::FRAC_1_SQRT_2;
        let low: [f64; 2] = std::array::from_fn(|axis| from[axis].min(to[axis]) - radius);
        let high: [f64; 2] = std::array::from_fn(|axis| from[axis].max(to[axis]) + radius);
        let window = self.window(low, high)?;
        let highest = f64::from(self.skyline.highest(self.heights.window, window)) + self.datum_mm;
        if highest - from[2].min(to[2]) - cylinder.from_mm <= DEPTH_MM {
            return None;
        }
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].hypot(along[1]);
        let u = if length > 0.0 { along.map(|v| v / length) } else { [0.0; 2] };
        let rise = to[2] - from[2];
        let mut deepest: Option<(f64, [f64; 3])> = None;
        let whole = self.heights.window;
        for row in window.row..window.row_end() {
            let y = (row as f64 + 0.5) * self.step_mm;
            let start = (row - whole.row) as usize * whole.columns;
            for column in window.column..window.column_end() {
                let z =
                    f64::from(self.heights.z_mm[start + (column - whole.column) as usize]) + self.datum_mm;
                let x = (column as f64 + 0.5) * self.step_mm;
                let (dx, dy) = (x - from[0], y - from[1]);
                let (s, d) = (u[0] * dx + u[1] * dy, u[0] * dy - u[1] * dx);
                let (near, half) = if length > 0.0 {
                    (radius * radius - d * d, length)
                } else {
                    (radius * radius - dx * dx - dy * dy, 1.0)
                };
                if near < 0.0 {
                    continue;
                }
                let q = near.sqrt();
                let (enters, leaves) =
                    if length > 0.0 { ((s - q).max(0.0), (s + q).min(length)) } else { (0.0, 1.0) };
                if enters > leaves {
                    continue;
                }
                let lowest = from[2] + rise * (if rise < 0.0 { leaves } else { enters }) / half;
                let depth = z - lowest - cylinder.from_mm;
                // Beyond the blank z is not a number, and no depth.
                if depth > DEPTH_MM && deepest.is_none_or(|(most, _)| depth > most) {
                    deepest = Some((depth, [x, y, z]));
                }
            }
        }
        deepest
    }

    /// The samples of the metal between two corners.
    fn window(&self, low: [f64; 2], high: [f64; 2]) -> Option<Window> {
        if !(low[0] <= high[0] && low[1] <= high[1]) {
            return None;
        }
        let first = low.map(|mm| (mm / self.step_mm - 0.5).ceil() as i64);
        let end = high.map(|mm| (mm / self.step_mm - 0.5).floor() as i64 + 1);
        let wanted = Window {
            column: first[0],
            row: first[1],
            columns: (end[0] - first[0]).max(0) as usize,
            rows: (end[1] - first[1]).max(0) as usize,
        };
        self.heights.window.intersection(&wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutter::Shape;
    use crate::verify::Options;

    /// A slot 3 mm deep in steps of 1 mm, one pass each, along x through the middle of a blank of 20 x 10 mm.
    fn slot() -> Reading {
        let mut text = String::from("G21 G90 G94\nM3 S1000\nG0 Z5\nG0 X5 Y5\n");
        for z in 1..=3 {
            text += &format!("G1 Z-{z} F100\nX15\nG0 Z5\nX5\n");
        }
        text += "G0 Z5\nM30\n";
        Reading::of(text.as_bytes(), &Options::default()).expect("a program")
    }

    fn hit(reading: &Reading, neck_mm: f64, shank_mm: f64) -> Option<BodyHit> {
        let judged = Judged::new(reading, Shape::Flat { diameter_mm: 2.0 }, [0.0; 3]);
        let blank = Blank { low_mm: [0.0; 2], high_mm: [20.0, 10.0], top_mm: 0.0 };
        let shank = Cylinder { what: "shank", radius_mm: 0.5 * shank_mm, from_mm: neck_mm };
        body_hits(&blank, &[judged], &[vec![shank]])[0]
    }

    #[test]
    fn a_shank_hits_the_wall_of_a_slot_that_is_deeper_than_the_neck() {
        let reading = slot();
        assert_eq!(hit(&reading, 3.0, 6.0), None, "the neck is as long as the slot is deep");
        let hit = hit(&reading, 2.25, 6.0).expect("0.75 mm of it are too deep");
        assert!((hit.depth_mm - 0.75).abs() < 1e-4, "{hit:?}");
        assert_eq!((hit.what, hit.at_mm[2]), ("shank", 0.0));
    }

    #[test]
    fn a_shank_thinner_than_the_cutter_finds_its_way_clear() {
        assert_eq!(hit(&slot(), 2.25, 1.8), None);
    }
}
