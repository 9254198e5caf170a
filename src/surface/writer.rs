//! Height files, written in bands from the lowest row up. A file gets its name when it is whole.

use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use npyz::WriterBuilder;

use super::Error;
use super::raw::claim;
use crate::grid::Heights;
use crate::whole::{Whole, folder};

/// Bytes of the strips of a TIFF, about.
const STRIP_BYTES: u64 = 1 << 20;

/// Samples that are spelled before they are written, about: they are to stay in a core's cache meanwhile.
const SPELLED: usize = 1 << 16;

/// Writes heights of any size to `.tif`, `.npy` or 16-bit `.png`, by the extension. The bytes
/// depend on the heights alone, not on the bands they came in.
pub struct HeightWriter {
    name: String,
    file: Whole,
    columns: usize,
    rows: usize,
    given: usize,
    format: Format,
    buffer: Vec<u8>,
}

enum Format {
    /// 32-bit float, top row first, by position; the offset of the first row.
    Tiff {
        data: u64,
    },
    Npy,
    /// Values wait here, lowest row first, since a PNG begins with the top row.
    Png {
        z_range_mm: [f64; 2],
        values: File,
    },
}

impl HeightWriter {
    /// Opens a file of this many samples. `z_range_mm` are the heights of a PNG's darkest and
    /// brightest value; the other formats need none. Errors: an extension without a format, a
    /// folder that cannot be written, a disk without the room.
    pub fn create(
        path: &Path,
        columns: usize,
        rows: usize,
        step_mm: f64,
        z_range_mm: [f64; 2],
    ) -> Result<HeightWriter, Error> {
        let name = path.display().to_string();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let kind = match extension.as_str() {
            "tif" | "tiff" => Kind::Tiff,
            "npy" => Kind::Npy,
            "png" => Kind::Png,
            _ => return Err(Error::OutputKind { path: name, extension }),
        };
        claim(&name, columns as u64, rows as u64, 4)?;
        let io = |source| Error::Unwritable { path: name.clone(), source };
        let free = fs4::available_space(folder(path)).map_err(io)?;
        let wanted = columns as u64 * rows as u64 * if kind == Kind::Png { 2 } else { 4 };
        if wanted > free {
            return Err(Error::NoSpaceToWrite { path: name, wanted, free });
        }
        let mut file = Whole::beside(path).map_err(io)?;
        let format = match kind {
            Kind::Tiff => {
                let head = tiff_head(columns as u64, rows as u64, step_mm);
                file.write_all(&head).map_err(io)?;
                file.file_mut().set_len(head.len() as u64 + wanted).map_err(io)?;
                Format::Tiff { data: head.len() as u64 }
            }
            Kind::Npy => {
                let kind = if cfg!(target_endian = "big") { ">f4" } else { "<f4" };
                let kind = kind.parse().map_err(|_| io(std::io::ErrorKind::InvalidInput.into()))?;
                npyz::WriteOptions::new_header_only()
                    .dtype(npyz::DType::new_scalar(kind))
                    .shape(&[rows as u64, columns as u64])
                    .writer(file.file_mut())
                    .write_header_only()
                    .map_err(io)?;
                Format::Npy
            }
            Kind::Png => {
                if columns > i32::MAX as usize || rows > i32::MAX as usize {
                    return Err(Error::PngSize { path: name, columns, rows });
                }
                let [z_min_mm, z_max_mm] = z_range_mm;
                if !(z_max_mm > z_min_mm && (z_max_mm - z_min_mm).is_finite()) {
                    return Err(Error::BadRange { path: name, z_min_mm, z_max_mm });
                }
                Format::Png { z_range_mm, values: tempfile::tempfile_in(folder(path)).map_err(io)? }
            }
        };
        Ok(HeightWriter { name, file, columns, rows, given: 0, format, buffer: Vec::new() })
    }

    /// The next rows. Bands follow each other from row 0 up and are as wide as the file.
    ///
    /// # Panics
    /// When a band is of another width or has more rows than are left.
    pub fn write(&mut self, band: &Heights) -> Result<(), Error> {
        self.write_rows(band.window.columns, &band.z_mm)
    }

    /// As [`HeightWriter::write`], of rows of so many columns.
    ///
    /// # Panics
    /// As there.
    pub fn write_rows(&mut self, columns: usize, z_mm: &[f32]) -> Result<(), Error> {
        assert_eq!(columns, self.columns, "a band as wide as the file");
        let rows = z_mm.len() / columns;
        assert!(self.given + rows <= self.rows, "no more rows than announced");
        let io = |source| Error::Unwritable { path: self.name.clone(), source };
        let (z_mm, some) = (&z_mm[..rows * columns], columns * (SPELLED / columns).max(1));
        match &mut self.format {
            Format::Tiff { data } => {
                let row = (self.rows - self.given - rows) as u64;
                let place = *data + row * self.columns as u64 * 4;
                let file = self.file.file_mut();
                file.seek(SeekFrom::Start(place)).map_err(io)?;
                for z_mm in z_mm.rchunks(some) {
                    let lines = z_mm.chunks_exact(columns).rev();
                    put_floats(lines, &mut self.buffer, z_mm.len(), f32::to_le_bytes);
                    file.write_all(&self.buffer).map_err(io)?;
                }
            }
            Format::Npy => {
                for z_mm in z_mm.chunks(some) {
                    let lines = z_mm.chunks_exact(columns);
                    put_floats(lines, &mut self.buffer, z_mm.len(), f32::to_ne_bytes);
                    self.file.write_all(&self.buffer).map_err(io)?;
                }
            }
            Format::Png { z_range_mm: [low, high], values } => {
                let scale = 65535.0 / (*high - *low);
                self.buffer.clear();
                for (index, line) in z_mm.chunks_exact(columns).enumerate() {
                    for (column, &z_mm) in line.iter().enumerate() {
                        let path = || self.name.clone();
                        if z_mm.is_nan() {
                            return Err(Error::PngNoData { path: path(), column, row: self.given + index });
                        }
                        // Half a value past the ends still rounds to them.
                        let value = ((f64::from(z_mm) - *low) * scale).round();
                        if !(0.0..=65535.0).contains(&value) {
                            let (z_min_mm, z_max_mm) = (*low, *high);
                            return Err(Error::PngRange { path: path(), z_mm, z_min_mm, z_max_mm });
                        }
                        self.buffer.extend_from_slice(&(value as u16).to_be_bytes());
                    }
                }
                values.write_all(&self.buffer).map_err(io)?;
            }
        }
        self.given += rows;
        Ok(())
    }

    /// Where the file is until it has its name.
    pub fn hidden(&self) -> &Path {
        self.file.hidden()
    }

    /// Gives the file its name. Without this nothing is left.
    pub fn finish(self) -> Result<(), Error> {
        let name = self.name.clone();
        self.whole()?.publish().map_err(|source| Error::Unwritable { path: name, source })
    }

    /// The file with all that belongs in it, still without its name.
    pub fn whole(mut self) -> Result<Whole, Error> {
        if self.given != self.rows {
            return Err(Error::Unfinished { path: self.name, given: self.given, rows: self.rows });
        }
        let io = |source| Error::Unwritable { path: self.name.clone(), source };
        if let Format::Png { values, .. } = &mut self.format {
            encode_png(self.file.file_mut(), values, self.columns, self.rows).map_err(io)?;
        }
        self.file.flush().map_err(io)?;
        Ok(self.file)
    }
}

#[derive(PartialEq)]
enum Kind {
    Tiff,
    Npy,
    Png,
}

/// No data has one spelling, whatever sign arithmetic gave it.
fn put_floats<'a>(
    lines: impl Iterator<Item = &'a [f32]>,
    out: &mut Vec<u8>,
    count: usize,
    to: impl Fn(f32) -> [u8; 4],
) {
    // Written over, not filled with zeros first.
    out.resize(4 * count, 0);
    let mut left = out.as_chunks_mut().0;
    for line in lines {
        let (bytes, after) = left.split_at_mut(line.len());
        for (bytes, &z) in bytes.iter_mut().zip(line) {
            *bytes = to(if z.is_nan() { f32::NAN } else { z });
        }
        left = after;
    }
}

fn encode_png(out: &mut File, values: &mut File, columns: usize, rows: usize) -> std::io::Result<()> {
    let refused = |error: ::png::EncodingError| std::io::Error::other(error.to_string());
    let mut encoder = ::png::Encoder::new(BufWriter::new(out), columns as u32, rows as u32);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.set_depth(::png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().map_err(refused)?;
    let mut stream = writer.stream_writer().map_err(refused)?;
    let mut line = vec![0u8; columns * 2];
    for row in (0..rows).rev() {
        values.seek(SeekFrom::Start((row * line.len()) as u64))?;
        values.read_exact(&mut line)?;
        stream.write_all(&line)?;
    }
    stream.finish().map_err(refused)?;
    writer.finish().map_err(refused)
}

/// Everything of a TIFF that stands before its pixels: header, directory and what it points to.
/// Rows lie in strips one after the other; BigTIFF where offsets pass 32 bits.
fn tiff_head(columns: u64, rows: u64, step_mm: f64) -> Vec<u8> {
    let strip_rows = (STRIP_BYTES / (4 * columns)).clamp(1, rows);
    let strips = rows.div_ceil(strip_rows);
    let bytes = |strip: u64| 4 * columns * strip_rows.min(rows - strip * strip_rows);
    let big = columns * rows * 4 + strips * 16 + 1024 > u64::from(u32::MAX);
    let size = |data: u64| -> (Vec<Entry>, u64) {
        let offsets = (0..strips).map(|strip| data + strip * strip_rows * columns * 4).collect();
        let entries = vec![
            Entry::long(256, &[columns]),
            Entry::long(257, &[rows]),
            Entry::short(258, 32),
            Entry::short(259, 1),
            Entry::short(262, 1),
            Entry::offsets(273, offsets, big),
            Entry::short(277, 1),
            Entry::long(278, &[strip_rows]),
            Entry::offsets(279, (0..strips).map(bytes).collect(), big),
            Entry::short(284, 1),
            Entry::short(339, 3),
            Entry::double(33550, &[step_mm, step_mm, 0.0]),
            Entry::double(33922, &[0.0, 0.0, 0.0, 0.0, rows as f64 * step_mm, 0.0]),
            Entry { tag: 42113, kind: 2, count: 4, value: b"nan\0".to_vec() },
        ];
        let inline = if big { 8 } else { 4 };
        let head =
            if big { 16 + 8 + 8 } else { 8 + 2 + 4 } + entries.len() as u64 * if big { 20 } else { 12 };
        let outside: u64 =
            entries.iter().map(|e| e.value.len().next_multiple_of(8) as u64).filter(|&n| n > inline).sum();
        (entries, (head + outside + 8).next_multiple_of(16))
    };
    // Offsets have the same width wherever they point, so one look at the size is enough.
    let (_, data) = size(0);
    let (entries, _) = size(data);
    let mut out = Vec::with_capacity(data as usize);
    out.extend(b"II");
    let word = |out: &mut Vec<u8>, value: u64| {
        if big {
            out.extend(value.to_le_bytes());
        } else {
            out.extend((value as u32).to_le_bytes());
        }
    };
    if big {
        out.extend([43, 0, 8, 0, 0, 0]);
        word(&mut out, 16);
        out.extend((entries.len() as u64).to_le_bytes());
    } else {
        out.extend([42, 0]);
        word(&mut out, 8);
        out.extend((entries.len() as u16).to_le_bytes());
    }
    let inline = if big { 8 } else { 4 };
    let directory = entries.len() * if big { 20 } else { 12 };
    let mut outside_at = (out.len() + directory + inline).next_multiple_of(8);
    let mut outside = Vec::new();
    for entry in &entries {
        out.extend(entry.tag.to_le_bytes());
        out.extend(entry.kind.to_le_bytes());
        word(&mut out, entry.count);
        if entry.value.len() <= inline {
            let mut value = entry.value.clone();
            value.resize(inline, 0);
            out.extend(value);
        } else {
            word(&mut out, outside_at as u64);
            let mut value = entry.value.clone();
            value.resize(value.len().next_multiple_of(8), 0);
            outside_at += value.len();
            outside.extend(value);
        }
    }
    word(&mut out, 0);
    out.resize(out.len().next_multiple_of(8), 0);
    out.extend(outside);
    out.resize(data as usize, 0);
    out
}

/// One field of a TIFF directory.
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    value: Vec<u8>,
}

impl Entry {
    fn short(tag: u16, value: u16) -> Entry {
        Entry { tag, kind: 3, count: 1, value: value.to_le_bytes().to_vec() }
    }

    fn long(tag: u16, values: &[u64]) -> Entry {
        let value = values.iter().flat_map(|&v| (v as u32).to_le_bytes()).collect();
        Entry { tag, kind: 4, count: values.len() as u64, value }
    }

    fn offsets(tag: u16, values: Vec<u64>, big: bool) -> Entry {
        if !big {
            return Entry::long(tag, &values);
        }
        let value = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Entry { tag, kind: 16, count: values.len() as u64, value }
    }

    fn double(tag: u16, values: &[f64]) -> Entry {
        let value = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        Entry { tag, kind: 12, count: values.len() as u64, value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::tiff::decoder::Decoder;
    use ::tiff::tags::Tag;

    /// A whole bed at 5 um: past 32 bits of bytes. Its data need not exist to be addressed.
    #[test]
    fn past_four_gigabytes_the_head_is_a_big_tiff() {
        let (columns, rows) = (61_000, 40_700);
        for (rows, big) in [(17_000, false), (rows, true)] {
            let head = tiff_head(columns, rows, 0.01);
            assert_eq!(head[2], if big { 43 } else { 42 });
            let data = head.len() as u64;
            let mut decoder = Decoder::new(std::io::Cursor::new(head)).unwrap();
            assert_eq!(decoder.dimensions().unwrap(), (columns as u32, rows as u32));
            let offsets = decoder.get_tag_u64_vec(Tag::StripOffsets).unwrap();
            let counts = decoder.get_tag_u64_vec(Tag::StripByteCounts).unwrap();
            assert_eq!(offsets[0], data);
            assert!((1..offsets.len()).all(|k| offsets[k] == offsets[k - 1] + counts[k - 1]));
            assert_eq!(counts.iter().sum::<u64>(), columns * rows * 4);
            assert_eq!(decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap()[0], 0.01);
        }
    }
}
