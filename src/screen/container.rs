//! The design container: an `.npz` that plain numpy reads.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, Write};
use std::path::Path;

use npyz::{DType, NpyFile, Order, TypeChar, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::{Cell, CellRange, Design, Elevation, Facet, Frame, Profile, Seam};
use crate::whole::{Whole, folder};

/// Most bytes that one array may hold.
const MOST_BYTES: u64 = 1 << 34;
/// What an archive's member may hold without the larger fields of a zip64, with room for a header.
const MOST_BYTES_OF_A_SMALL_FILE: u64 = (1 << 32) - (1 << 16);

/// Why a container or an elevation file was not read or written.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
    #[error("{path} cannot be written: {source}; hint: its folder must be writable and have room")]
    Unwritable { path: String, source: std::io::Error },
    #[error("{path} is no .npy file: {source}; hint: numpy.save writes them")]
    NoArray { path: String, source: std::io::Error },
    #[error(
        "{path} is no complete .npz archive: {source}; hint: it may be cut off, write it again with screenmill design"
    )]
    Archive { path: String, source: zip::result::ZipError },
    #[error(
        "{path} has no array \"{array}\"; hint: a design holds cell, core, cell_mm, elevation_mm, facet_start, gradient, offset_mm, area_mm2, profile and seam"
    )]
    Missing { path: String, array: &'static str },
    #[error("{path}: array \"{array}\" cannot be read: {source}; hint: it may be cut off")]
    Array { path: String, array: &'static str, source: std::io::Error },
    #[error("{path}: array \"{array}\" holds {found}, {wanted} are wanted")]
    Type { path: String, array: &'static str, found: String, wanted: &'static str },
    #[error("{path}: array \"{array}\" has the shape {found:?}, {wanted} is wanted")]
    Shape { path: String, array: &'static str, found: Vec<u64>, wanted: String },
    #[error("{path}: array \"{array}\" says {claimed} bytes and has {held}; hint: it may be cut off")]
    Size { path: String, array: &'static str, claimed: u128, held: u64 },
    #[error("{path}: {array}[{index}] is {value}, {wanted} is wanted")]
    Value { path: String, array: &'static str, index: usize, value: f64, wanted: String },
    #[error("{path}: cell ({column}, {row}) stands twice in array \"cell\"")]
    Twice { path: String, column: i32, row: i32 },
    #[error(
        "{path}: {found} cells do not fill their {columns} x {rows} rectangle; hint: the first that is missing is ({column}, {row})"
    )]
    Gap { path: String, found: usize, columns: u64, rows: u64, column: i64, row: i64 },
    #[error(
        "{path}: core {c0} {r0} {c1} {r1} reaches past the cells, which are {has_c0} {has_r0} {has_c1} {has_r1}"
    )]
    Core {
        path: String,
        c0: i32,
        r0: i32,
        c1: i32,
        r1: i32,
        has_c0: i32,
        has_r0: i32,
        has_c1: i64,
        has_r1: i64,
    },
}

/// Writes a container cell by cell. What grows with the facets waits in unnamed files beside the
/// container, since its arrays stand in it one after the other; what is kept in memory is 20 bytes a cell.
pub struct DesignWriter {
    frame: Frame,
    /// The container as errors name it.
    name: String,
    file: Whole,
    cells: Vec<[i32; 2]>,
    elevation_mm: Vec<f64>,
    facet_start: Vec<i64>,
    gradient: Spool,
    offset: Spool,
    area: Spool,
}

/// Numbers that wait on disk.
struct Spool(BufWriter<File>);

impl Spool {
    fn beside(path: &Path) -> std::io::Result<Spool> {
        let file = tempfile::tempfile_in(folder(path))?;
        Ok(Spool(BufWriter::with_capacity(1 << 18, file)))
    }

    fn put(&mut self, value: f64) -> std::io::Result<()> {
        self.0.write_all(&value.to_le_bytes())
    }

    /// The bytes from the first, ready to be read.
    fn rewound(self) -> std::io::Result<File> {
        let mut file = self.0.into_inner().map_err(|e| e.into_error())?;
        file.rewind()?;
        Ok(file)
    }
}

impl DesignWriter {
    /// Begins a container. Nothing stands under `path` until what [`DesignWriter::finish`] gives is published.
    pub fn create(path: &Path, frame: &Frame) -> Result<DesignWriter, ContainerError> {
        let name = || path.display().to_string();
        let unwritable = |source| ContainerError::Unwritable { path: name(), source };
        let spool = || Spool::beside(path).map_err(unwritable);
        Ok(DesignWriter {
            frame: *frame,
            name: name(),
            file: Whole::beside(path).map_err(unwritable)?,
            cells: Vec::new(),
            elevation_mm: Vec::new(),
            facet_start: vec![0],
            gradient: spool()?,
            offset: spool()?,
            area: spool()?,
        })
    }

    /// Appends the next cell, by row, then column.
    pub fn push(&mut self, cell: &Cell) -> Result<(), ContainerError> {
        self.put(cell).map_err(|source| ContainerError::Unwritable { path: self.name.clone(), source })
    }

    /// Where the container is until it has its name.
    pub fn hidden(&self) -> &Path {
        self.file.hidden()
    }

    fn put(&mut self, cell: &Cell) -> std::io::Result<()> {
        for facet in &cell.facets {
            self.gradient.put(facet.gradient[0])?;
            self.gradient.put(facet.gradient[1])?;
            self.offset.put(facet.offset_mm)?;
            self.area.put(facet.area_mm2)?;
        }
        let facets = self.facet_start.last().copied().unwrap_or(0) + cell.facets.len() as i64;
        self.cells.push([cell.column, cell.row]);
        self.elevation_mm.push(cell.elevation_mm);
        self.facet_start.push(facets);
        Ok(())
    }

    /// The whole container, to be put under its name.
    pub fn finish(self) -> Result<Whole, ContainerError> {
        let name = self.name.clone();
        self.archived().map_err(|source| ContainerError::Unwritable { path: name, source })
    }

    fn archived(self) -> std::io::Result<Whole> {
        let n = self.cells.len() as u64;
        let m = self.facet_start.last().copied().unwrap_or(0) as u64;
        let Frame { core: CellRange { c0, r0, c1, r1 }, cell_mm, profile, seam, .. } = self.frame;
        let mut done = ZipWriter::new(BufWriter::with_capacity(1 << 18, self.file));
        let zip = &mut done;
        array(zip, "cell", &[n, 2], self.cells.into_iter().flatten())?;
        array(zip, "core", &[4], [c0, r0, c1, r1])?;
        array(zip, "cell_mm", &[], [cell_mm])?;
        array(zip, "elevation_mm", &[n], self.elevation_mm)?;
        array(zip, "facet_start", &[n + 1], self.facet_start)?;
        spooled(zip, "gradient", &[m, 2], self.gradient)?;
        spooled(zip, "offset_mm", &[m], self.offset)?;
        spooled(zip, "area_mm2", &[m], self.area)?;
        array(zip, "profile", &[], [i32::from(profile == Profile::Dish)])?;
        array(zip, "seam", &[], [i32::from(seam == Seam::Stitched)])?;
        done.finish()?.into_inner().map_err(|error| error.into_error())
    }
}

impl Design {
    /// Writes the container; the same design gives the same bytes. Nothing is left under `path` if
    /// that fails.
    pub fn write(&self, path: &Path) -> Result<(), ContainerError> {
        let mut writer = DesignWriter::create(path, &self.frame())?;
        for cell in &self.cells {
            writer.push(cell)?;
        }
        let unwritable = |source| ContainerError::Unwritable { path: path.display().to_string(), source };
        writer.finish()?.publish().map_err(unwritable)
    }

    /// Reads a container and checks that its arrays fit together.
    pub fn read(path: &Path) -> Result<Design, ContainerError> {
        let file = File::open(path)
            .map_err(|source| ContainerError::Io { path: path.display().to_string(), source })?;
        Design::from_archive(BufReader::new(file), &path.display().to_string())
    }

    /// Reads a container from memory or a stream; `path` names it in errors.
    pub fn from_archive<R: Read + Seek>(reader: R, path: &str) -> Result<Design, ContainerError> {
        let archive = ZipArchive::new(reader)
            .map_err(|source| ContainerError::Archive { path: path.into(), source })?;
        let mut arrays = Arrays { archive, path };
        let scalar = |value: Vec<f64>| value[0];
        let cell = arrays.read("cell", &[None, Some(2)], Numbers::Whole)?;
        let n = cell.len() / 2;
        let core = arrays.read("core", &[Some(4)], Numbers::Whole)?;
        let cell_mm = scalar(arrays.read("cell_mm", &[], Numbers::Real)?);
        let elevation = arrays.read("elevation_mm", &[Some(n)], Numbers::Real)?;
        let start = arrays.read("facet_start", &[Some(n + 1)], Numbers::Whole)?;
        let gradient = arrays.read("gradient", &[None, Some(2)], Numbers::Real)?;
        let m = gradient.len() / 2;
        let offset = arrays.read("offset_mm", &[Some(m)], Numbers::Real)?;
        let area = arrays.read("area_mm2", &[Some(m)], Numbers::Real)?;
        let profile = scalar(arrays.read("profile", &[], Numbers::Whole)?);
        let seam = scalar(arrays.read("seam", &[], Numbers::Whole)?);

        let path = || path.to_string();
        let refuse = |array, index, value, wanted: &str| {
            Err(ContainerError::Value { path: path(), array, index, value, wanted: wanted.into() })
        };
        if n == 0 {
            return Err(ContainerError::Shape {
                path: path(),
                array: "cell",
                found: vec![0, 2],
                wanted: "at least one cell".into(),
            });
        }
        if cell_mm <= 0.0 {
            return refuse("cell_mm", 0, cell_mm, "a width above 0");
        }
        if profile != 0.0 && profile != 1.0 {
            return refuse("profile", 0, profile, "0 (bump) or 1 (dish)");
        }
        if seam != 0.0 && seam != 1.0 {
            return refuse("seam", 0, seam, "0 (step) or 1 (stitched)");
        }
        for (array, values) in [("cell", &cell), ("core", &core)] {
            if let Some(index) = values.iter().position(|v| v.abs() > f64::from(1 << 30)) {
                return refuse(array, index, values[index], "a column or row within 2^30");
            }
        }
        if start[0] != 0.0 {
            return refuse("facet_start", 0, start[0], "0");
        }
        for index in 1..=n {
            if start[index] <= start[index - 1] {
                return refuse("facet_start", index, start[index], "a larger number than the one before");
            }
        }
        if start[n] != m as f64 {
            return refuse("facet_start", n, start[n], &format!("the number of facets, {m},"));
        }
        let mut cells = Vec::with_capacity(n);
        for k in 0..n {
            let facets = (start[k] as usize..start[k + 1] as usize)
                .map(|f| Facet {
                    gradient: [gradient[2 * f], gradient[2 * f + 1]],
                    offset_mm: offset[f],
                    area_mm2: area[f],
                })
                .collect();
            let (column, row) = (cell[2 * k] as i32, cell[2 * k + 1] as i32);
            cells.push(Cell { column, row, elevation_mm: elevation[k], facets });
        }
        cells.sort_by_key(|cell| (cell.row, cell.column));
        let core =
            CellRange { c0: core[0] as i32, r0: core[1] as i32, c1: core[2] as i32, r1: core[3] as i32 };
        let design = Design {
            core,
            cell_mm,
            profile: if profile == 1.0 { Profile::Dish } else { Profile::Bump },
            seam: if seam == 1.0 { Seam::Stitched } else { Seam::Step },
            cells,
        };
        design.check_layout(path())?;
        Ok(design)
    }

    /// The cells fill one rectangle that holds the core, so that any cell is found by counting.
    fn check_layout(&self, path: String) -> Result<(), ContainerError> {
        for pair in self.cells.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            if (a.column, a.row) == (b.column, b.row) {
                return Err(ContainerError::Twice { path, column: a.column, row: a.row });
            }
        }
        let low = |of: fn(&Cell) -> i32| self.cells.iter().map(of).min().unwrap_or_default();
        let high = |of: fn(&Cell) -> i32| self.cells.iter().map(of).max().unwrap_or_default();
        let (left, bottom) = (low(|c| c.column), low(|c| c.row));
        let columns = i64::from(high(|c| c.column)) - i64::from(left) + 1;
        let rows = i64::from(high(|c| c.row)) - i64::from(bottom) + 1;
        let place = |at: usize| {
            let at = at as i64;
            (i64::from(left) + at % columns, i64::from(bottom) + at / columns)
        };
        let odd = |&at: &usize| {
            let here = self.cells.get(at).map(|c| (i64::from(c.column), i64::from(c.row)));
            here != Some(place(at))
        };
        let found = self.cells.len();
        if let Some(at) = (0..found).find(odd).or((found as i64 != columns * rows).then_some(found)) {
            let (column, row) = place(at);
            let (columns, rows) = (columns as u64, rows as u64);
            return Err(ContainerError::Gap { path, found, columns, rows, column, row });
        }
        let CellRange { c0, r0, c1, r1 } = self.core;
        let (has_c1, has_r1) = (i64::from(left) + columns, i64::from(bottom) + rows);
        let across = left <= c0 && c0 < c1 && i64::from(c1) <= has_c1;
        let up = bottom <= r0 && r0 < r1 && i64::from(r1) <= has_r1;
        if !across || !up {
            let (has_c0, has_r0) = (left, bottom);
            return Err(ContainerError::Core { path, c0, r0, c1, r1, has_c0, has_r0, has_c1, has_r1 });
        }
        Ok(())
    }
}

impl Elevation {
    /// Reads an elevation of rows x columns in mm from a `.npy`, the lowest row first.
    pub fn read(path: &Path) -> Result<Elevation, ContainerError> {
        let name = path.display().to_string();
        let io = |source| ContainerError::Io { path: path.display().to_string(), source };
        let mut file = File::open(path).map_err(io)?;
        let held = file.metadata().map_err(io)?.len();
        let mut magic = [0; 6];
        let begins = file.read(&mut magic).and_then(|_| file.rewind());
        begins.map_err(|source| ContainerError::NoArray { path: name.clone(), source })?;
        if magic != *b"\x93NUMPY" {
            let source = std::io::Error::other(if held == 0 { "it is empty" } else { "it begins otherwise" });
            return Err(ContainerError::NoArray { path: name, source });
        }
        let (z_mm, shape) =
            numbers(BufReader::new(file), held, "elevation", &name, &[None, None], Numbers::Heights)?;
        Ok(Elevation { columns: shape[1] as usize, rows: shape[0] as usize, z_mm })
    }
}

fn array<W, T, I>(zip: &mut ZipWriter<W>, name: &str, shape: &[u64], values: I) -> std::io::Result<()>
where
    W: Write + Seek,
    T: npyz::AutoSerialize,
    I: IntoIterator<Item = T>,
{
    begin(zip, name, shape)?;
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(zip).begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}

/// An array of float64 whose bytes, little-endian, are there already.
fn spooled<W: Write + Seek>(
    zip: &mut ZipWriter<W>,
    name: &str,
    shape: &[u64],
    spool: Spool,
) -> std::io::Result<()> {
    begin(zip, name, shape)?;
    let header =
        npyz::WriteOptions::<f64>::new().default_dtype().shape(shape).writer(&mut *zip).begin_nd()?;
    drop(header);
    let mut bytes = BufReader::with_capacity(1 << 18, spool.rewound()?);
    std::io::copy(&mut bytes, zip)?;
    Ok(())
}

fn begin<W: Write + Seek>(zip: &mut ZipWriter<W>, name: &str, shape: &[u64]) -> std::io::Result<()> {
    let items = shape.iter().product::<u64>();
    // Stored, not deflated: facets are noise to a compressor, and numpy maps what is stored.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .large_file(items >= MOST_BYTES_OF_A_SMALL_FILE / 8)
        .last_modified_time(DateTime::default());
    zip.start_file(format!("{name}.npy"), options)?;
    Ok(())
}

#[derive(Clone, Copy, PartialEq)]
enum Numbers {
    Whole,
    Real,
    /// As real ones, but whoever takes them says which of them are none.
    Heights,
}

struct Arrays<'a, R> {
    archive: ZipArchive<R>,
    path: &'a str,
}

impl<R: Read + Seek> Arrays<'_, R> {
    /// Reads one array of the shape given, where None is any length.
    fn read(
        &mut self,
        name: &'static str,
        shape: &[Option<usize>],
        kind: Numbers,
    ) -> Result<Vec<f64>, ContainerError> {
        let path = || self.path.to_string();
        let entry = match self.archive.by_name(&format!("{name}.npy")) {
            Ok(entry) => entry,
            Err(zip::result::ZipError::FileNotFound) => {
                return Err(ContainerError::Missing { path: path(), array: name });
            }
            Err(source) => return Err(ContainerError::Archive { path: path(), source }),
        };
        let held = entry.size();
        Ok(numbers(entry, held, name, self.path, shape, kind)?.0)
    }
}

/// Reads an array as numbers in row-major order, with its shape.
fn numbers<R: Read>(
    reader: R,
    held: u64,
    name: &'static str,
    path: &str,
    wanted: &[Option<usize>],
    kind: Numbers,
) -> Result<(Vec<f64>, Vec<u64>), ContainerError> {
    let broken = |source| ContainerError::Array { path: path.into(), array: name, source };
    let file = NpyFile::new(reader).map_err(broken)?;
    let found = file.shape().to_vec();
    let fits = found.len() == wanted.len()
        && found.iter().zip(wanted).all(|(&have, want)| want.is_none_or(|want| have == want as u64));
    if !fits {
        let sides: Vec<String> =
            wanted.iter().map(|w| w.map_or("any length".into(), |w| w.to_string())).collect();
        let wanted = format!("[{}]", sides.join(", "));
        return Err(ContainerError::Shape { path: path.into(), array: name, found, wanted });
    }
    let refuse = |found: String| ContainerError::Type {
        path: path.into(),
        array: name,
        found,
        wanted: if kind == Numbers::Whole { "whole numbers (int32 or int64)" } else { "float64 or float32" },
    };
    let DType::Plain(scalar) = file.dtype() else { return Err(refuse(file.dtype().descr())) };
    let claimed = found
        .iter()
        .fold(1u128, |size, &side| size.saturating_mul(u128::from(side)))
        .saturating_mul(u128::from(scalar.size_field()));
    if claimed > u128::from(held.min(MOST_BYTES)) {
        return Err(ContainerError::Size { path: path.into(), array: name, claimed, held });
    }
    let by_columns = file.order() == Order::Fortran;
    let values: Vec<f64> = match (kind, scalar.type_char(), scalar.size_field()) {
        (Numbers::Whole, TypeChar::Int, 4) => {
            file.into_vec::<i32>().map_err(broken)?.into_iter().map(f64::from).collect()
        }
        // Exact: columns, rows and counts of facets stay far below 2^53.
        (Numbers::Whole, TypeChar::Int, 8) => {
            file.into_vec::<i64>().map_err(broken)?.into_iter().map(|v| v as f64).collect()
        }
        (Numbers::Real | Numbers::Heights, TypeChar::Float, 4) => {
            file.into_vec::<f32>().map_err(broken)?.into_iter().map(f64::from).collect()
        }
        (Numbers::Real | Numbers::Heights, TypeChar::Float, 8) => file.into_vec::<f64>().map_err(broken)?,
        _ => return Err(refuse(scalar.to_string())),
    };
    if kind != Numbers::Heights
        && let Some(index) = values.iter().position(|v| !v.is_finite())
    {
        return Err(ContainerError::Value {
            path: path.into(),
            array: name,
            index,
            value: values[index],
            wanted: "a finite number".into(),
        });
    }
    if by_columns && found.len() == 2 {
        let (rows, columns) = (found[0] as usize, found[1] as usize);
        let turned = (0..rows * columns).map(|at| values[at % columns * rows + at / columns]).collect();
        return Ok((turned, found));
    }
    Ok((values, found))
}
