//! TIFF height images: 32- or 64-bit floats in mm, or unsigned integers with a range.

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::path::Path;

use ::tiff::decoder::{ChunkType, Decoder, DecodingResult};
use ::tiff::tags::{ByteOrder, Tag};
use ::tiff::{ColorType, TiffError};

use super::Error;
use super::image::Found;
use super::raw::{Layout, Raw, Stored, claim, spool};

const UNCOMPRESSED: u32 = 1;

pub(super) fn read(path: &Path) -> Result<Found, Error> {
    let name = path.display().to_string();
    let io = |source| Error::Io { path: name.clone(), source };
    let refused = |reason: String| Error::Tiff { path: name.clone(), reason };
    let file = File::open(path).map_err(io)?;
    if file.metadata().map_err(io)?.len() == 0 {
        return Err(Error::Empty { path: name });
    }
    let bad = |error: TiffError| refused(format!("it cannot be read ({error})"));
    let again = file.try_clone().map_err(io)?;
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(bad)?;
    let (columns, rows) = decoder.dimensions().map_err(bad)?;
    let stored = match (decoder.colortype().map_err(bad)?, sample_format(&mut decoder)?) {
        (ColorType::Gray(32), 3) => Stored::F32,
        (ColorType::Gray(64), 3) => Stored::F64,
        (ColorType::Gray(8), 1) => Stored::U8,
        (ColorType::Gray(16), 1) => Stored::U16,
        (ColorType::Gray(bits), kind) => {
            let kind = match kind {
                1 => "unsigned integers",
                2 => "signed integers",
                3 => "floats",
                _ => "samples of another kind",
            };
            return Err(refused(format!("{kind} of {bits} bits are no heights")));
        }
        (other, _) => return Err(refused(format!("its pixels are {other:?}, not one value each"))),
    };
    if decoder.more_images() {
        return Err(refused("it has more than one page".into()));
    }
    let (columns, rows) = (u64::from(columns), u64::from(rows));
    claim(&name, columns, rows, stored.bytes())?;
    let pitch_mm = pitch(&mut decoder, &name)?;
    let no_data = match decoder.find_tag(Tag::GdalNodata).map_err(bad)? {
        None => None,
        Some(value) => {
            let text = value.into_string().map_err(bad)?;
            let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
            let number: f64 =
                text.parse().map_err(|_| refused(format!("its no-data value \"{text}\" is no number")))?;
            // The file keeps the value as a decimal; a float image holds it rounded.
            (!number.is_nan()).then_some(if stored == Stored::F32 {
                f64::from(number as f32)
            } else {
                number
            })
        }
    };
    let compression =
        decoder.find_tag_unsigned::<u32>(Tag::Compression).map_err(bad)?.unwrap_or(UNCOMPRESSED);
    let raw = if compression == UNCOMPRESSED && decoder.get_chunk_type() == ChunkType::Strip {
        let groups = decoder
            .find_tag_unsigned_vec::<u64>(Tag::StripOffsets)
            .map_err(bad)?
            .ok_or_else(|| refused("it has no strip offsets".into()))?;
        let group_rows =
            decoder.find_tag_unsigned::<u64>(Tag::RowsPerStrip).map_err(bad)?.unwrap_or(rows).clamp(1, rows);
        if groups.len() as u64 != rows.div_ceil(group_rows) {
            let (has, wants) = (groups.len(), rows.div_ceil(group_rows));
            return Err(refused(format!("it has {has} strips, {rows} rows by {group_rows} are {wants}")));
        }
        let big_endian = decoder.byte_order() == ByteOrder::BigEndian;
        let layout = Layout { columns, rows, stored, big_endian, top_first: true, groups, group_rows };
        Raw::new(name.clone(), again, layout)?
    } else {
        decode(&mut decoder, &name, columns, rows, stored)?
    };
    Ok(Found { raw, pitch_mm, no_data })
}

type FileDecoder = Decoder<BufReader<File>>;

fn sample_format(decoder: &mut FileDecoder) -> Result<u16, Error> {
    let formats = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat).ok().flatten();
    Ok(formats.and_then(|formats| formats.first().copied()).unwrap_or(1))
}

/// ModelPixelScale in mm; an image without it carries no pitch.
fn pitch(decoder: &mut FileDecoder, name: &str) -> Result<Option<f64>, Error> {
    let refused = |reason: String| Error::Tiff { path: name.into(), reason };
    let Some(value) = decoder
        .find_tag(Tag::ModelPixelScaleTag)
        .map_err(|error| refused(format!("its pixel scale cannot be read ({error})")))?
    else {
        return Ok(None);
    };
    let scale =
        value.into_f64_vec().map_err(|error| refused(format!("its pixel scale cannot be read ({error})")))?;
    let &[x_mm, y_mm, ..] = scale.as_slice() else {
        return Err(refused(format!("its pixel scale has {} numbers, not 3", scale.len())));
    };
    if !(x_mm > 0.0 && x_mm.is_finite()) {
        return Err(Error::Pixel { pixel_mm: x_mm });
    }
    if (x_mm - y_mm).abs() > 1e-9 * x_mm {
        return Err(Error::NotSquare { path: name.into(), x_mm, y_mm });
    }
    Ok(Some(x_mm))
}

/// Decodes strips or tiles, one row of them at a time, into a temporary file.
fn decode(
    decoder: &mut FileDecoder,
    name: &str,
    columns: u64,
    rows: u64,
    stored: Stored,
) -> Result<Raw, Error> {
    let io = |source| Error::Io { path: name.into(), source };
    let refused = |reason: String| Error::Tiff { path: name.into(), reason };
    let (chunk_columns, chunk_rows) = decoder.chunk_dimensions();
    let (chunk_columns, chunk_rows) = (u64::from(chunk_columns), u64::from(chunk_rows));
    if chunk_columns == 0 || chunk_rows == 0 {
        return Err(refused(format!("its chunks are {chunk_columns} x {chunk_rows} pixels")));
    }
    let across = columns.div_ceil(chunk_columns);
    let size = stored.bytes() as usize;
    let mut out = BufWriter::with_capacity(1 << 20, spool(name, columns, rows, stored)?);
    let line = columns as usize * size;
    let mut band = vec![0u8; line * chunk_rows.min(rows) as usize];
    for group in 0..rows.div_ceil(chunk_rows) {
        let mut band_rows = 0;
        for column in 0..across {
            let index = u32::try_from(group * across + column)
                .map_err(|_| refused("it has more than 4294967295 chunks".into()))?;
            let (width, height) = decoder.chunk_data_dimensions(index);
            let bytes = match decoder
                .read_chunk(index)
                .map_err(|error| refused(format!("chunk {index} cannot be decoded ({error})")))?
            {
                DecodingResult::F32(v) if stored == Stored::F32 => bytes_of(&v, f32::to_le_bytes),
                DecodingResult::F64(v) if stored == Stored::F64 => bytes_of(&v, f64::to_le_bytes),
                DecodingResult::U16(v) if stored == Stored::U16 => bytes_of(&v, u16::to_le_bytes),
                DecodingResult::U8(v) if stored == Stored::U8 => v,
                _ => return Err(refused(format!("chunk {index} holds another kind of sample"))),
            };
            let width = width as usize * size;
            if bytes.len() < width * height as usize {
                return Err(refused(format!("chunk {index} ends early")));
            }
            band_rows = height as usize;
            for (row, from) in bytes.chunks_exact(width).take(band_rows).enumerate() {
                let start = row * line + (column * chunk_columns) as usize * size;
                band[start..start + width].copy_from_slice(from);
            }
        }
        out.write_all(&band[..band_rows * line]).map_err(io)?;
    }
    let file = out.into_inner().map_err(|error| io(error.into_error()))?;
    let layout = Layout {
        columns,
        rows,
        stored,
        big_endian: false,
        top_first: true,
        groups: vec![0],
        group_rows: rows,
    };
    Raw::new(name.into(), file, layout)
}

fn bytes_of<T: Copy, const N: usize>(values: &[T], to: fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|&value| to(value)).collect()
}
