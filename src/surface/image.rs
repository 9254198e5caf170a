//! Height images: samples of another pitch, read by windows.

use std::path::Path;

use rayon::prelude::*;

use super::raw::{Raw, Stored};
use super::{Error, Surface, WALL_DEG, columns_mm, covering, mirrored_columns_mm, npy, png, reversed, tiff};
use crate::grid::{Heights, Lattice, Window};

/// A pitch this near to the step, as a part of it, is the step.
const SAME_PITCH: f64 = 1e-9;

/// Samples read ahead at once: 32 MiB of doubles.
const BLOCK_SAMPLES: usize = 1 << 22;

/// A height image of any size on disk. Pixel (column i, row j from below) stands at
/// ((i + 1/2) pitch, (j + 1/2) pitch); between pixels heights are bilinear, in the outer half pixel
/// they are those of the outermost one. Next to a no-data pixel there is no data.
pub struct HeightImage {
    raw: Raw,
    pitch_mm: f64,
    lattice: Lattice,
    no_data: Option<f64>,
    /// Height of a stored value v is low + v * scale.
    low_mm: f64,
    scale_mm: f64,
    top_mm: f64,
    bottom_mm: f64,
    steepest: [f64; 2],
}

/// What a reader finds in a file.
pub(super) struct Found {
    pub raw: Raw,
    pub pitch_mm: Option<f64>,
    pub no_data: Option<f64>,
}

/// What the user says about a file that does not say it itself.
pub(super) struct Said {
    pub pixel_mm: Option<f64>,
    pub z_min_mm: Option<f64>,
    pub z_max_mm: Option<f64>,
}

/// The kinds of file that hold heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Tiff,
    Npy,
    Png,
}

pub(super) fn read(
    path: &Path,
    format: Format,
    said: &Said,
    step_mm: f64,
    notes: &mut Vec<String>,
) -> Result<HeightImage, Error> {
    let found = match format {
        Format::Tiff => tiff::read(path)?,
        Format::Npy => npy::read(path)?,
        Format::Png => png::read(path)?,
    };
    let name = found.raw.path.clone();
    if let Some(pixel_mm) = said.pixel_mm
        && !(pixel_mm > 0.0 && pixel_mm.is_finite())
    {
        return Err(Error::Pixel { pixel_mm });
    }
    let pitch_mm = match (found.pitch_mm, said.pixel_mm) {
        (None, None) => return Err(Error::NoPitch { path: name }),
        (Some(file_mm), Some(asked_mm)) if (file_mm - asked_mm).abs() > 1e-6 * file_mm => {
            return Err(Error::PitchDiffers { path: name, file_mm, asked_mm });
        }
        (Some(pitch_mm), _) | (None, Some(pitch_mm)) => pitch_mm,
    };
    let (low_mm, scale_mm) = match found.raw.layout.stored.bits() {
        None => (0.0, 1.0),
        Some(bits) => {
            let (Some(z_min_mm), Some(z_max_mm)) = (said.z_min_mm, said.z_max_mm) else {
                return Err(Error::NoRange { path: name, bits });
            };
            let range = z_max_mm - z_min_mm;
            if !(range > 0.0 && range.is_finite()) {
                return Err(Error::BadRange { path: name, z_min_mm, z_max_mm });
            }
            let values = f64::from((1u32 << bits) - 1);
            if bits == 8 {
                notes.push(format!(
                    "{name}: 8 bits make steps of {:.4} mm; hint: a 16-bit image",
                    range / values
                ));
            }
            (z_min_mm, range / values)
        }
    };
    if (pitch_mm - step_mm).abs() > SAME_PITCH * step_mm {
        notes.push(format!("{name}: resampled from a pitch of {pitch_mm} mm to {step_mm} mm, bilinear"));
    }
    HeightImage::new(found, pitch_mm, low_mm, scale_mm, step_mm)
}

impl HeightImage {
    fn new(
        found: Found,
        pitch_mm: f64,
        low_mm: f64,
        scale_mm: f64,
        step_mm: f64,
    ) -> Result<HeightImage, Error> {
        let Found { raw, no_data, .. } = found;
        let (columns, rows) = (raw.layout.columns, raw.layout.rows);
        let same = (pitch_mm - step_mm).abs() <= SAME_PITCH * step_mm;
        let lattice = covering(columns as f64 * pitch_mm, rows as f64 * pitch_mm, step_mm)?;
        let lattice = if same {
            Lattice { columns: columns as usize, rows: rows as usize, ..lattice }
        } else {
            lattice
        };
        let mut image = HeightImage {
            raw,
            pitch_mm: if same { step_mm } else { pitch_mm },
            lattice,
            no_data,
            low_mm,
            scale_mm,
            top_mm: f64::NEG_INFINITY,
            bottom_mm: f64::INFINITY,
            steepest: [0.0; 2],
        };
        image.measure()?;
        if image.top_mm == f64::NEG_INFINITY {
            return Err(Error::AllNoData { path: image.raw.path, samples: columns * rows });
        }
        Ok(image)
    }

    /// One pass over the file: highest, lowest, steepest, and nothing infinite.
    fn measure(&mut self) -> Result<(), Error> {
        let (columns, rows) = (self.raw.layout.columns, self.raw.layout.rows);
        let group = (BLOCK_SAMPLES as u64 / columns / 8).max(1);
        let starts: Vec<u64> = (0..rows).step_by(group as usize).collect();
        let steepest_face = WALL_DEG.to_radians().tan();
        let found: Vec<([f64; 2], [f64; 2])> = starts
            .par_iter()
            .map(|&start| {
                let (mut range, mut steep) = ([f64::INFINITY, f64::NEG_INFINITY], [0.0f64; 2]);
                let (mut line, mut before) = (Vec::new(), Vec::new());
                let slope = |a: f64, b: f64| {
                    let slope = (a - b).abs() / self.pitch_mm;
                    if slope < steepest_face { slope } else { 0.0 }
                };
                for row in start..(start + group + 1).min(rows) {
                    self.line(row, 0..columns, &mut line)?;
                    let [least, most] = [-extreme(&line, |z| -z), extreme(&line, |z| z)];
                    if (least == f64::NEG_INFINITY || most == f64::INFINITY)
                        && let Some((column, &value)) = line.iter().enumerate().find(|(_, z)| z.is_infinite())
                    {
                        let path = self.raw.path.clone();
                        return Err(Error::InfiniteHeight { path, column: column as u64, row, value });
                    }
                    range = [range[0].min(least), range[1].max(most)];
                    steep[0] = steep[0].max(steepest(&line, &line[1..], slope));
                    steep[1] = steep[1].max(steepest(&line, &before, slope));
                    std::mem::swap(&mut line, &mut before);
                }
                Ok((range, steep))
            })
            .collect::<Result<_, Error>>()?;
        for (range, steep) in found {
            self.bottom_mm = self.bottom_mm.min(range[0]);
            self.top_mm = self.top_mm.max(range[1]);
            self.steepest = [self.steepest[0].max(steep[0]), self.steepest[1].max(steep[1])];
        }
        Ok(())
    }

    /// Heights of stored pixels in mm.
    fn line(&self, row: u64, columns: std::ops::Range<u64>, out: &mut Vec<f64>) -> Result<(), Error> {
        self.raw.row(row, columns, out)?;
        if let Some(no_data) = self.no_data {
            for z in out.iter_mut().filter(|z| **z == no_data) {
                *z = f64::NAN;
            }
        }
        if !matches!(self.raw.layout.stored, Stored::F32 | Stored::F64) {
            for z in out.iter_mut() {
                *z = self.low_mm + *z * self.scale_mm;
            }
        }
        Ok(())
    }

    /// The pixel before a place, the share of the one after it, or None outside the image.
    fn between(&self, place_mm: f64, count: u64) -> Option<(u64, f64)> {
        let length = count as f64 * self.pitch_mm;
        let past = 1e-6 * self.pitch_mm;
        if !(place_mm >= -past && place_mm <= length + past) {
            return None;
        }
        let mut at = (place_mm / self.pitch_mm - 0.5).clamp(0.0, (count - 1) as f64);
        // A sample on a pixel takes that pixel alone, though rounding puts it a hair beside it.
        if (at - at.round()).abs() < SAME_PITCH * count as f64 {
            at = at.round();
        }
        let before = at.floor();
        Some((before as u64, at - before))
    }

    fn sample(&self, xs: &[f64], window: Window, datum_mm: f64) -> Result<Heights, Error> {
        let mut heights = Heights { window, z_mm: vec![0.0; window.samples()] };
        self.sample_onto(xs, window, datum_mm, &mut heights.z_mm)?;
        Ok(heights)
    }

    fn sample_onto(&self, xs: &[f64], window: Window, datum_mm: f64, z_mm: &mut [f32]) -> Result<(), Error> {
        let (columns, rows) = (self.raw.layout.columns, self.raw.layout.rows);
        let places: Vec<_> = xs.iter().map(|&x| self.between(x, columns)).collect();
        let inside = || places.iter().flatten();
        let (Some(first), Some(last)) = (inside().map(|p| p.0).min(), inside().map(|p| p.0).max()) else {
            z_mm.fill(f32::NAN);
            return Ok(());
        };
        let span = first..(last + 2).min(columns);
        let as_they_are = as_they_are(&places);
        z_mm.par_chunks_mut(16 * window.columns).enumerate().try_for_each(|(chunk, out)| {
            out.fill(f32::NAN);
            let mut lines = [(u64::MAX, Vec::new()), (u64::MAX, Vec::new())];
            for (index, out) in out.chunks_mut(window.columns).enumerate() {
                let row = window.row + (chunk * 16 + index) as i64;
                let Some((below, share_y)) = self.between(self.lattice.y_mm(row), rows) else { continue };
                let above = if share_y == 0.0 { below } else { (below + 1).min(rows - 1) };
                for wanted in [below, above] {
                    if lines.iter().all(|line| line.0 != wanted) {
                        let older = usize::from(lines[1].0 == u64::MAX || lines[0].0 > lines[1].0);
                        let older = if lines[0].0 == u64::MAX { 0 } else { older };
                        lines[older].0 = wanted;
                        self.line(wanted, span.clone(), &mut lines[older].1)?;
                    }
                }
                let find = |wanted: u64| &lines[usize::from(lines[0].0 != wanted)].1;
                let (low, high) = (find(below), find(above));
                if let (Some(run), 0.0) = (&as_they_are, share_y) {
                    for (z, height) in out[run.clone()].iter_mut().zip(low) {
                        *z = (height - datum_mm) as f32;
                    }
                    continue;
                }
                for (z, place) in out.iter_mut().zip(&places) {
                    let Some((left, share_x)) = *place else { continue };
                    let left = (left - first) as usize;
                    // A pixel without a share must not count, even where it has no data.
                    let along = |line: &[f64]| match share_x {
                        0.0 => line[left],
                        _ => line[left] + share_x * (line[left + 1] - line[left]),
                    };
                    let height = match share_y {
                        0.0 => along(low),
                        _ => along(low) + share_y * (along(high) - along(low)),
                    };
                    *z = (height - datum_mm) as f32;
                }
            }
            Ok::<(), Error>(())
        })
    }
}

/// Where samples are the pixels one after the other, if they are.
fn as_they_are(places: &[Option<(u64, f64)>]) -> Option<std::ops::Range<usize>> {
    let start = places.iter().position(Option::is_some)?;
    let end = places.iter().rposition(Option::is_some)? + 1;
    let first = places[start]?.0;
    let pixels = (first..).map(|pixel| Some((pixel, 0.0)));
    places[start..end].iter().copied().eq(pixels.take(end - start)).then_some(start..end)
}

/// Values looked at together.
const LANES: usize = 16;

/// The greatest of what is made of these; -inf of nothing and of what is no number.
fn extreme(line: &[f64], of: impl Fn(f64) -> f64) -> f64 {
    let mut most = [f64::NEG_INFINITY; LANES];
    for part in line.chunks(LANES) {
        for (most, z) in most.iter_mut().zip(part) {
            let z = of(*z);
            *most = if z > *most { z } else { *most };
        }
    }
    most.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The greatest slope between pairs of heights; 0 of none.
fn steepest(line: &[f64], other: &[f64], slope: impl Fn(f64, f64) -> f64) -> f64 {
    let mut most = [0.0; LANES];
    for (a, b) in line.chunks(LANES).zip(other.chunks(LANES)) {
        for (most, (a, b)) in most.iter_mut().zip(a.iter().zip(b)) {
            let slope = slope(*a, *b);
            *most = if slope > *most { slope } else { *most };
        }
    }
    most.into_iter().fold(0.0, f64::max)
}

impl Surface for HeightImage {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn top_mm(&self) -> f64 {
        self.top_mm
    }

    fn bottom_mm(&self) -> f64 {
        self.bottom_mm
    }

    /// Between neighbouring pixels; steps steeper than a wall do not count.
    fn steepest(&self) -> [f64; 2] {
        self.steepest
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        self.sample(&columns_mm(&self.lattice, &window), window, datum_mm)
    }

    fn heights_onto(&self, window: Window, datum_mm: f64, z_mm: &mut [f32]) -> Result<(), Error> {
        self.sample_onto(&columns_mm(&self.lattice, &window), window, datum_mm, z_mm)
    }

    fn heights_mirrored(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        Ok(reversed(self.sample(&mirrored_columns_mm(&self.lattice, &window), window, datum_mm)?))
    }
}
