//! `.npy` height files: two dimensions, row 0 the lowest y.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

use npyz::{DType, Endianness, NpyHeader, Order, TypeChar};

use super::Error;
use super::image::Found;
use super::raw::{self, Layout, Raw, Stored};

/// What a band of rows may take while columns are turned into rows.
const BAND_BYTES: u64 = 64 << 20;

pub(super) fn read(path: &Path) -> Result<Found, Error> {
    let name = path.display().to_string();
    let io = |source| Error::Io { path: name.clone(), source };
    let refused = |reason: String| Error::Npy { path: name.clone(), reason };
    let mut file = File::open(path).map_err(io)?;
    if file.metadata().map_err(io)?.len() == 0 {
        return Err(Error::Empty { path: name });
    }
    let header = NpyHeader::from_reader(&mut file)
        .map_err(|error| refused(format!("its header cannot be read ({error})")))?;
    let offset = file.stream_position().map_err(io)?;
    let &[rows, columns] = header.shape() else {
        return Err(refused(format!("an array of {} dimensions, heights have 2", header.shape().len())));
    };
    let DType::Plain(kind) = header.dtype() else {
        return Err(refused("an array of records".into()));
    };
    let stored = match (kind.type_char(), kind.size_field()) {
        (TypeChar::Float, 4) => Stored::F32,
        (TypeChar::Float, 8) => Stored::F64,
        _ => return Err(refused(format!("an array of type \"{kind}\""))),
    };
    let big_endian = kind.endianness() == Endianness::Big;
    let (file, offset) = match header.order() {
        Order::C => (file, offset),
        Order::Fortran => (by_rows(file, &name, offset, [columns, rows], stored)?, 0),
    };
    let layout = Layout {
        columns,
        rows,
        stored,
        big_endian,
        top_first: false,
        groups: vec![offset],
        group_rows: rows.max(1),
    };
    let raw = Raw::new(name, file, layout)?;
    Ok(Found { raw, pitch_mm: None, no_data: None })
}

/// The same samples row by row in a temporary file. numpy saves a transposed array column by column.
fn by_rows(
    mut file: File,
    name: &str,
    offset: u64,
    [columns, rows]: [u64; 2],
    stored: Stored,
) -> Result<File, Error> {
    raw::claim(name, columns, rows, stored.bytes())?;
    let io = |source| Error::Io { path: name.into(), source };
    let size = stored.bytes();
    let (wanted, found) = (offset + columns * rows * size, file.metadata().map_err(io)?.len());
    if wanted > found {
        return Err(Error::Truncated { path: name.into(), wanted, found });
    }
    let mut turned = raw::spool(name, columns, rows, stored)?;
    let band = (BAND_BYTES / (columns * size)).clamp(1, rows);
    let mut column = vec![0; (band * size) as usize];
    let mut whole = vec![0; (band * columns * size) as usize];
    for first in (0..rows).step_by(band as usize) {
        let held = (band.min(rows - first) * size) as usize;
        for nth in 0..columns {
            file.seek(SeekFrom::Start(offset + (nth * rows + first) * size)).map_err(io)?;
            file.read_exact(&mut column[..held]).map_err(io)?;
            let places = whole[(nth * size) as usize..].chunks_mut((columns * size) as usize);
            for (place, sample) in places.zip(column[..held].chunks_exact(size as usize)) {
                place[..size as usize].copy_from_slice(sample);
            }
        }
        turned.write_all(&whole[..held * columns as usize]).map_err(io)?;
    }
    Ok(turned)
}
