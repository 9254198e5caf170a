//! Uncompressed samples in a file, read by position.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::sync::Mutex;

use super::{Error, MOST_SAMPLES};

/// Columns at most: some rows are held whole by every stage. 168 m at 10 um.
const MOST_COLUMNS: u64 = 1 << 24;

/// How one sample is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stored {
    U8,
    U16,
    F32,
    F64,
}

impl Stored {
    pub fn bytes(self) -> u64 {
        match self {
            Stored::U8 => 1,
            Stored::U16 => 2,
            Stored::F32 => 4,
            Stored::F64 => 8,
        }
    }

    /// Bits of an integer; None for a float, which is its own height.
    pub fn bits(self) -> Option<u32> {
        match self {
            Stored::U8 => Some(8),
            Stored::U16 => Some(16),
            Stored::F32 | Stored::F64 => None,
        }
    }
}

/// Where the rows of an image lie in a file.
pub(super) struct Layout {
    pub columns: u64,
    pub rows: u64,
    pub stored: Stored,
    pub big_endian: bool,
    /// Row 0 of the file is the highest y.
    pub top_first: bool,
    /// Offset of every group of rows, and how many rows a group has.
    pub groups: Vec<u64>,
    pub group_rows: u64,
}

/// An open file and its layout.
pub(super) struct Raw {
    pub path: String,
    pub layout: Layout,
    file: Mutex<File>,
}

impl Raw {
    /// Checks that the file has all that the layout announces.
    pub fn new(path: String, file: File, layout: Layout) -> Result<Raw, Error> {
        let found = file.metadata().map_err(|source| Error::Io { path: path.clone(), source })?.len();
        claim(&path, layout.columns, layout.rows, layout.stored.bytes())?;
        let row_bytes = layout.columns * layout.stored.bytes();
        for (index, &offset) in layout.groups.iter().enumerate() {
            let rows = layout.group_rows.min(layout.rows.saturating_sub(index as u64 * layout.group_rows));
            let wanted = offset.saturating_add(rows * row_bytes);
            if wanted > found {
                let wanted = wanted.max(layout.rows * row_bytes);
                return Err(Error::Truncated { path, wanted, found });
            }
        }
        Ok(Raw { path, layout, file: Mutex::new(file) })
    }

    /// Samples `columns` of part row `row` (0 is the lowest y) as they are stored, as doubles.
    pub fn row(&self, row: u64, columns: std::ops::Range<u64>, out: &mut Vec<f64>) -> Result<(), Error> {
        let layout = &self.layout;
        let file_row = if layout.top_first { layout.rows - 1 - row } else { row };
        let group = layout.groups[(file_row / layout.group_rows) as usize];
        let size = layout.stored.bytes();
        let place = group + ((file_row % layout.group_rows) * layout.columns + columns.start) * size;
        let mut bytes = vec![0u8; ((columns.end - columns.start) * size) as usize];
        let io = |source| Error::Io { path: self.path.clone(), source };
        {
            let mut file = self.file.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            file.seek(SeekFrom::Start(place)).map_err(io)?;
            file.read_exact(&mut bytes).map_err(io)?;
        }
        out.clear();
        let big = layout.big_endian;
        match layout.stored {
            Stored::U8 => out.extend(bytes.iter().map(|&b| f64::from(b))),
            Stored::U16 => out.extend(
                bytes
                    .as_chunks()
                    .0
                    .iter()
                    .map(|&b| f64::from(if big { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })),
            ),
            Stored::F32 => out.extend(
                bytes
                    .as_chunks()
                    .0
                    .iter()
                    .map(|&b| f64::from(if big { f32::from_be_bytes(b) } else { f32::from_le_bytes(b) })),
            ),
            Stored::F64 => out.extend(
                bytes
                    .as_chunks()
                    .0
                    .iter()
                    .map(|&b| if big { f64::from_be_bytes(b) } else { f64::from_le_bytes(b) }),
            ),
        }
        Ok(())
    }
}

/// Refuses a header whose image cannot be held, before anything is allocated for it.
pub(super) fn claim(path: &str, columns: u64, rows: u64, bytes: u64) -> Result<(), Error> {
    if columns == 0 || rows == 0 {
        return Err(Error::NoSamples { path: path.into(), columns, rows });
    }
    let side = u64::from(u32::MAX);
    if columns > side || rows > side || columns as f64 * rows as f64 > MOST_SAMPLES {
        return Err(Error::HugeClaim { path: path.into(), columns, rows, bytes, limit: MOST_SAMPLES });
    }
    if columns > MOST_COLUMNS {
        return Err(Error::Wide { path: path.into(), columns, rows, most: MOST_COLUMNS });
    }
    Ok(())
}

/// A nameless temporary file for an image that has to be decoded first; gone when it is closed.
pub(super) fn spool(path: &str, columns: u64, rows: u64, stored: Stored) -> Result<File, Error> {
    claim(path, columns, rows, stored.bytes())?;
    let folder = std::env::temp_dir();
    let io = |source| Error::Io { path: folder.display().to_string(), source };
    let wanted = columns * rows * stored.bytes();
    let free = fs4::available_space(&folder).map_err(io)?;
    if wanted > free {
        let folder = folder.display().to_string();
        return Err(Error::NoSpace { path: path.into(), folder, wanted, free });
    }
    tempfile::tempfile_in(&folder).map_err(io)
}
