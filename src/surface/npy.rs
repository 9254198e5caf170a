//! `.npy` height files: two dimensions, row 0 the lowest y.

use std::fs::File;
use std::io::Seek;
use std::path::Path;

use npyz::{DType, Endianness, NpyHeader, Order, TypeChar};

use super::Error;
use super::image::Found;
use super::raw::{Layout, Raw, Stored};

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
    if header.order() == Order::Fortran {
        return Err(refused("an array in Fortran order".into()));
    }
    let DType::Plain(kind) = header.dtype() else {
        return Err(refused("an array of records".into()));
    };
    let stored = match (kind.type_char(), kind.size_field()) {
        (TypeChar::Float, 4) => Stored::F32,
        (TypeChar::Float, 8) => Stored::F64,
        _ => return Err(refused(format!("an array of type \"{kind}\""))),
    };
    let big_endian = kind.endianness() == Endianness::Big;
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
