//! Greyscale PNG images as heights.

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;

use ::png::{BitDepth, ColorType, Decoder};

use super::Error;
use super::image::Found;
use super::raw::{Layout, Raw, Stored, spool};

/// Decodes row by row into a temporary file, so that memory does not grow with the image.
pub(super) fn read(path: &Path) -> Result<Found, Error> {
    let name = path.display().to_string();
    let io = |source| Error::Io { path: name.clone(), source };
    let refused = |reason: String| Error::Png { path: name.clone(), reason };
    let file = File::open(path).map_err(io)?;
    if file.metadata().map_err(io)?.len() == 0 {
        return Err(Error::Empty { path: name });
    }
    let bad = |error: ::png::DecodingError| refused(format!("it cannot be decoded ({error})"));
    let mut reader = Decoder::new(BufReader::new(file)).read_info().map_err(bad)?;
    let info = reader.info();
    let (columns, rows) = (u64::from(info.width), u64::from(info.height));
    if info.color_type != ColorType::Grayscale {
        return Err(refused(format!("its pixels are {:?}, not grey values alone", info.color_type)));
    }
    if info.interlaced {
        return Err(refused("it is interlaced".into()));
    }
    let stored = match info.bit_depth {
        BitDepth::Sixteen => Stored::U16,
        BitDepth::Eight => Stored::U8,
        depth => return Err(refused(format!("it has {} bits a pixel", depth as u8))),
    };
    let mut out = BufWriter::with_capacity(1 << 20, spool(&name, columns, rows, stored)?);
    let mut given = 0;
    while let Some(row) = reader.next_row().map_err(bad)? {
        out.write_all(row.data()).map_err(io)?;
        given += 1;
    }
    if given < rows {
        return Err(refused(format!("it ends after {given} of {rows} rows")));
    }
    let file = out.into_inner().map_err(|error| io(error.into_error()))?;
    let layout = Layout {
        columns,
        rows,
        stored,
        big_endian: true,
        top_first: true,
        groups: vec![0],
        group_rows: rows,
    };
    Ok(Found { raw: Raw::new(name, file, layout)?, pitch_mm: None, no_data: None })
}
