//! The projector's mask as pictures.

use std::path::Path;

use png::{BitDepth, ColorType, Encoder};
use rayon::prelude::*;

use super::{Error, write_beside};
use crate::progress::Progress;
use crate::whole::Whole;

/// Rows that are worked out at once.
const BAND: usize = 64;

/// Values a pixel takes in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    Eight,
    Sixteen,
}

/// Writes a grey picture of `columns` x `rows` pixels, without its name yet; `value` gives a pixel's from 0 to 1 by its
/// column and row, the top row first. None if it was interrupted.
pub fn write(
    path: &Path,
    [columns, rows]: [u32; 2],
    depth: Depth,
    value: &(dyn Fn(u32, u32) -> f64 + Sync),
    progress: &dyn Progress,
) -> Result<Option<Whole>, Error> {
    let failed = |source: png::EncodingError| Error::Io {
        path: path.display().to_string(),
        source: std::io::Error::other(source),
    };
    progress.begin(if depth == Depth::Eight { "mask of 8 bits" } else { "mask of 16 bits" }, u64::from(rows));
    let mut whole = true;
    let file = write_beside(path, |writer| {
        let mut encoder = Encoder::new(writer, columns, rows);
        encoder.set_color(ColorType::Grayscale);
        encoder.set_depth(if depth == Depth::Eight { BitDepth::Eight } else { BitDepth::Sixteen });
        let mut encoder = encoder.write_header().map_err(failed)?;
        let mut stream = encoder.stream_writer().map_err(failed)?;
        for first in (0..rows).step_by(BAND) {
            if progress.interrupted() {
                whole = false;
                return Ok(());
            }
            let band: Vec<Vec<u8>> = (first..(first + BAND as u32).min(rows))
                .into_par_iter()
                .map(|row| {
                    let values = (0..columns).map(|column| value(column, row).clamp(0.0, 1.0));
                    match depth {
                        Depth::Eight => values.map(|v| (255.0 * v).round() as u8).collect(),
                        Depth::Sixteen => {
                            values.flat_map(|v| ((65535.0 * v).round() as u16).to_be_bytes()).collect()
                        }
                    }
                })
                .collect();
            for row in &band {
                std::io::Write::write_all(&mut stream, row)
                    .map_err(|source| Error::Io { path: path.display().to_string(), source })?;
            }
            progress.advance(band.len() as u64);
        }
        stream.finish().map_err(failed)
    })?;
    Ok(whole.then_some(file))
}
