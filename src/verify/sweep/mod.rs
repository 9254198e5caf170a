//! The cutter swept through the stock, block by block, exact on the samples.
//!
//! Every sample's height becomes the least of what it was and the lowest the cutter came over it. A
//! move is straight, so per sample that is one closed form (see [`super::contact`]). Of a chain of
//! moves each sample is taken only by those over which its height has a minimum: where one move
//! hands a sample on, still falling, to the next, the next will take it. That saves most of the
//! work, and makes a bite a property of the path, not of how the path was cut into blocks.

mod above;
mod along;
mod band;
mod bite;
mod leg;

use rayon::prelude::*;

pub use bite::{Bite, ProgramCut};

use self::above::GROUP;
use self::along::LINES;
use self::band::Band;
use super::contact::{Contact, with_contact};
use super::judged::Judged;
use crate::grid::{Heights, Window};

/// A sample at distance exactly R counts; the sum of coordinates that places it may be off by this.
const REACH_MM: f64 = 1e-10;
/// Both moves at a corner take the samples this near to the border between them.
const OVERLAP_MM: f64 = 1e-9;
/// Rows per task; a constant, so that it is no part of how the answer comes about.
const BAND_ROWS: usize = 64;

/// A block after all programs.
#[derive(Clone, Debug)]
pub struct Swept {
    /// Heights in the part frame less the datum, NaN beyond the blank.
    pub heights: Heights,
    /// One per program, in their order.
    pub programs: Vec<ProgramCut>,
}

/// Cuts the programs through a block of stock in their order.
///
/// `stock` holds heights in mm less `datum_mm`, NaN where there is none (see [`super::Blank::heights`]); its samples
/// stand at ((column + 1/2) step, (row + 1/2) step) of the part frame. Heights are computed in double and
/// stored as float: exact to the nanometre within 8 mm of the datum. The answer for a sample is the
/// same to the bit whatever the block and however many threads.
pub fn sweep(stock: Heights, step_mm: f64, datum_mm: f64, programs: &[Judged]) -> Swept {
    let window = stock.window;
    if window.samples() == 0 {
        return Swept { heights: stock, programs: vec![ProgramCut::default(); programs.len()] };
    }
    if window.columns < GROUP {
        // Beside the block there is nothing to cut.
        let mut wide = Heights::empty(Window { columns: GROUP, ..window });
        for (wide, row) in wide.z_mm.chunks_exact_mut(GROUP).zip(stock.z_mm.chunks_exact(window.columns)) {
            wide[..window.columns].copy_from_slice(row);
        }
        let swept = sweep(wide, step_mm, datum_mm, programs);
        return Swept { heights: swept.heights.crop(window), ..swept };
    }
    let mut heights = stock;
    let mut totals = vec![ProgramCut::default(); programs.len()];
    let places = |first: i64, count: usize| -> Vec<f64> {
        (0..count + LINES).map(|k| ((first + k as i64) as f64 + 0.5) * step_mm).collect()
    };
    let x_mm = places(window.column, window.columns);
    let bands: Vec<Vec<ProgramCut>> = heights
        .z_mm
        .par_chunks_mut(window.columns * BAND_ROWS)
        .enumerate()
        .map(|(index, z_mm)| {
            let row = window.row + (index * BAND_ROWS) as i64;
            let rows = z_mm.len() / window.columns;
            let mut band = Band {
                z_mm,
                x_mm: &x_mm,
                y_mm: places(row, rows),
                per_mm: step_mm.recip(),
                window: Window { row, rows, ..window },
                datum_mm,
            };
            programs
                .iter()
                .map(|judged| with_contact!(&judged.shape, contact => widest(&mut band, contact, judged)))
                .collect()
        })
        .collect();
    for band in &bands {
        for (total, part) in totals.iter_mut().zip(band) {
            total.merge(part);
        }
    }
    Swept { heights, programs: totals }
}

/// Cuts a program with the widest vectors that this processor has; the answer is the same for all.
fn widest<C: Contact>(band: &mut Band, contact: C, judged: &Judged) -> ProgramCut {
    #[cfg(target_arch = "x86_64")]
    {
        use above::{Avx2, Avx512};
        #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
        fn avx512<C: Contact>(band: &mut Band, contact: C, judged: &Judged) -> ProgramCut {
            band.take::<C, Avx512>(contact, judged)
        }
        #[target_feature(enable = "avx2")]
        fn avx2<C: Contact>(band: &mut Band, contact: C, judged: &Judged) -> ProgramCut {
            band.take::<C, Avx2>(contact, judged)
        }
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx2")
        {
            // SAFETY: the features were found on this processor.
            return unsafe { avx512(band, contact, judged) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the feature was found on this processor.
            return unsafe { avx2(band, contact, judged) };
        }
    }
    band.take::<C, above::Portable>(contact, judged)
}

#[cfg(test)]
mod tests {
    use super::above::{Above, Portable};
    use super::*;
    use crate::cutter::Shape;
    use crate::verify::{Blank, Options, Reading};

    /// Passes along both axes that turn up and down, a descent, and moves at an angle.
    fn reading() -> Reading {
        let mut text = String::from("G21 G90 M3\nG0 Z2\nG0 X0 Y0\nF300\nG1 Z-0.2\n");
        for k in 0..60 {
            let (a, b) = ((f64::from(k) * 0.618_034).fract(), (f64::from(k) * 0.754_878).fract());
            let z = -0.6 * (f64::from(k) * 0.569_840).fract();
            text += &match k % 4 {
                0 | 1 => format!("G1 X{:.4} Z{z:.4}\n", 1.7 * a),
                2 => format!("G1 Y{:.4} Z{z:.4}\n", 1.3 * b),
                _ => format!("G1 X{:.4} Y{:.4} Z{z:.4}\n", 1.7 * b, 1.3 * a),
            };
        }
        Reading::of((text + "G0 Z2\nM2\n").as_bytes(), &Options::default()).expect("a program")
    }

    fn cut<V: Above>(reading: &Reading, shape: Shape) -> (Vec<u32>, ProgramCut) {
        let window = Window { column: -13, row: -9, columns: 101, rows: 64 };
        let blank = Blank { low_mm: [-0.15; 2], high_mm: [1.5; 2], top_mm: 0.1 };
        let step_mm = 0.02;
        let mut heights = blank.heights(window, step_mm, 0.0);
        let places = |first: i64, count: usize| -> Vec<f64> {
            (0..count + LINES).map(|k| ((first + k as i64) as f64 + 0.5) * step_mm).collect()
        };
        let x_mm = places(window.column, window.columns);
        let mut band = Band {
            z_mm: &mut heights.z_mm,
            x_mm: &x_mm,
            y_mm: places(window.row, window.rows),
            per_mm: 1.0 / step_mm,
            window,
            datum_mm: 0.0,
        };
        let judged = Judged::new(reading, shape, [0.0; 3]);
        let cut = with_contact!(&shape, contact => band.take::<_, V>(contact, &judged));
        (heights.z_mm.iter().map(|z| z.to_bits()).collect(), cut)
    }

    #[test]
    fn every_instruction_set_cuts_the_same() {
        let reading = reading();
        for name in ["ball:0.6", "flat:0.5", "bull:0.6:0.1", "vee:60:0.1:0.7", "taper:0.2:10:0.6"] {
            let shape = name.parse().expect("a cutter");
            let plain = cut::<Portable>(&reading, shape);
            assert!(plain.1.deepest_bite_mm() > 0.3, "{name}: {:?}", plain.1);
            #[cfg(target_arch = "x86_64")]
            {
                if is_x86_feature_detected!("avx2") {
                    assert!(cut::<above::Avx2>(&reading, shape) == plain, "{name} with AVX2");
                }
                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
                    assert!(cut::<above::Avx512>(&reading, shape) == plain, "{name} with AVX-512");
                }
            }
        }
    }
}
