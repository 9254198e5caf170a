//! STL files, binary and ASCII.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};

use super::mesh::Triangles;
use super::{Error, Mesh, stl_text};

/// Bytes of a binary STL before its triangles, and of each triangle.
const HEADER: u64 = 84;
const TRIANGLE: u64 = 50;

/// Some editors put it before a text.
const BOM: [u8; 3] = [0xEF, 0xBB, 0xBF];

/// The unit an STL was written in; the format does not say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unit {
    #[default]
    Mm,
    Metre,
    Inch,
}

impl Unit {
    /// Millimetres to the unit.
    pub fn mm(self) -> f64 {
        match self {
            Unit::Mm => 1.0,
            Unit::Metre => 1000.0,
            Unit::Inch => 25.4,
        }
    }
}

/// The axis of an STL that points out of the stock. The part is turned, never mirrored: with Y up
/// the file's -Z becomes the part's Y, with X up its Y becomes the part's X and its Z the part's Y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    X,
    Y,
    #[default]
    Z,
}

impl std::str::FromStr for Unit {
    type Err = Error;

    fn from_str(text: &str) -> Result<Unit, Error> {
        match text {
            "mm" => Ok(Unit::Mm),
            "m" => Ok(Unit::Metre),
            "inch" | "in" => Ok(Unit::Inch),
            _ => Err(Error::UnitName { text: text.into() }),
        }
    }
}

impl std::str::FromStr for Up {
    type Err = Error;

    fn from_str(text: &str) -> Result<Up, Error> {
        match text {
            "x" | "X" => Ok(Up::X),
            "y" | "Y" => Ok(Up::Y),
            "z" | "Z" => Ok(Up::Z),
            _ => Err(Error::UpName { text: text.into() }),
        }
    }
}

impl Up {
    fn rotation(self) -> DMat3 {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        match self {
            Up::Z => DMat3::IDENTITY,
            Up::Y => DMat3::from_cols(x, z, -y),
            Up::X => DMat3::from_cols(z, x, y),
        }
    }

    fn letter(self) -> char {
        match self {
            Up::X => 'x',
            Up::Y => 'y',
            Up::Z => 'z',
        }
    }
}

/// Reads a mesh and moves the lower left corner of its bounding box to the origin; z stays. Says in
/// `notes` what looks wrong about its size.
pub(super) fn read(
    path: &Path,
    unit: Unit,
    up: Up,
    step_mm: f64,
    notes: &mut Vec<String>,
) -> Result<Mesh, Error> {
    let name = path.display().to_string();
    let corners = corners(path, &name)?;
    if corners.is_empty() {
        return Err(Error::NoTriangles { path: name });
    }
    let turn = DAffine3::from_mat3(up.rotation() * unit.mm());
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (index, triangle) in corners.iter().enumerate() {
        for corner in triangle {
            let [x, y, z] = corner.map(f64::from);
            if !(x.is_finite() && y.is_finite() && z.is_finite()) {
                return Err(Error::NotFinite { path: name, triangle: index as u64 + 1, x, y, z });
            }
            let p = turn.transform_point3(DVec3::new(x, y, z));
            low = low.min(p);
            high = high.max(p);
        }
    }
    let size = high - low;
    let largest = size.x.max(size.y);
    if unit == Unit::Mm {
        // A part is machined between about 5 mm and 3 m: smaller than that by a metre's or an
        // inch's factor is far more often a wrong unit than a part.
        let said = format!("{name} measures {:.4} x {:.4} x {:.4} mm", size.x, size.y, size.z);
        if largest < 2.5 {
            notes.push(format!("{said}: is it in metres? hint: --unit m"));
        } else if largest < 5.0 {
            notes.push(format!("{said}: is it in inches? hint: --unit inch"));
        }
    }
    if largest > 20_000.0 {
        notes.push(format!(
            "{name} measures {:.0} x {:.0} mm, larger than any machine: is the unit right? hint: --unit",
            size.x, size.y
        ));
    }
    let shift = DAffine3::from_translation(DVec3::new(-low.x, -low.y, 0.0));
    Mesh::new(Triangles::Single { corners, frame: shift * turn }, step_mm, &name, up.letter())
}

fn corners(path: &Path, name: &str) -> Result<Vec<[[f32; 3]; 3]>, Error> {
    let io = |source| Error::Io { path: name.into(), source };
    let mut file = File::open(path).map_err(io)?;
    let found = file.metadata().map_err(io)?.len();
    if found == 0 {
        return Err(Error::Empty { path: name.into() });
    }
    let mut head = [0; HEADER as usize];
    let read = read_up_to(&mut file, &mut head).map_err(io)?;
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let announced = u64::from(u32::from_le_bytes([head[80], head[81], head[82], head[83]]));
    let wanted = HEADER + TRIANGLE * announced;
    // Exporters exist that begin a binary file with "solid": its length tells the two apart.
    let binary = read == HEADER as usize && wanted == found;
    let blank =
        head[..read].iter().take_while(|&&byte| byte.is_ascii_whitespace() || BOM.contains(&byte)).count();
    if !binary && head[blank..].get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) {
        file.seek(SeekFrom::Start(blank as u64)).map_err(io)?;
        return stl_text::corners(BufReader::new(file), name);
    }
    if found < HEADER {
        return Err(Error::StlHeader { path: name.into(), found });
    }
    if found < wanted {
        return Err(Error::StlSize { path: name.into(), triangles: announced, wanted, found });
    }
    let mut reader = Overlaid { head: &[0], after: 1, file, at: 0 };
    let mut corners = Vec::with_capacity(announced as usize);
    for triangle in stl_io::create_stl_reader(&mut reader).map_err(io)? {
        corners.push(triangle.map_err(io)?.vertices.map(|v| v.0));
    }
    Ok(corners)
}

/// A file with another beginning: the reader takes a binary file that starts with "solid " for text.
struct Overlaid {
    head: &'static [u8],
    /// Where in the file reading goes on after the head.
    after: u64,
    file: File,
    at: u64,
}

impl Read for Overlaid {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut left = &self.head[(self.at as usize).min(self.head.len())..];
        let count = if left.is_empty() { self.file.read(buffer)? } else { left.read(buffer)? };
        self.at += count as u64;
        if self.at == self.head.len() as u64 {
            self.file.seek(SeekFrom::Start(self.after))?;
        }
        Ok(count)
    }
}

impl Seek for Overlaid {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        match to {
            SeekFrom::Start(0) => self.at = 0,
            _ => return Err(std::io::ErrorKind::Unsupported.into()),
        }
        Ok(0)
    }
}

/// Fills as much of `buffer` as the file has.
fn read_up_to(file: &mut File, buffer: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match file.read(&mut buffer[filled..])? {
            0 => break,
            count => filled += count,
        }
    }
    Ok(filled)
}
