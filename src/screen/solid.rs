//! Designed cells as closed solids for CAD and mesh tools.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use rayon::prelude::*;

use super::power::Diagram;
use super::rows::Rows;
use super::top::{Sketch, Square, Top};
use super::{Cell, Design, Frame, Seam};
use crate::whole::{Whole, folder};

/// Metal under the lowest point, in mm.
const BASE_MM: f64 = 1.0;
/// Bytes of a binary STL before its triangles.
const HEADER: usize = 84;

/// Why a solid was not written.
#[derive(Debug, thiserror::Error)]
pub enum SolidError {
    #[error("{path} cannot be written: {source}; hint: its folder must be writable and have room")]
    Io { path: String, source: std::io::Error },
    #[error(
        "{triangles} triangles and more do not fit into an .stl, which counts to {most}; hint: fewer cells with --cells"
    )]
    TooMany { triangles: u64, most: u64 },
    #[error("cell ({column}, {row}) has no facets that a mesh can hold; hint: wider cells or fewer facets")]
    NoMesh { column: i32, row: i32 },
}

/// Writes the core of a design as a binary STL in mm, cell by cell: with vertical steps one closed
/// solid a cell, stitched one closed solid for all. Walls are vertical, the base stands 1 mm under the
/// lowest point, the frame is the part's, z that of the design. What is kept in memory is the rows
/// of cells that a row needs; the outline waits on disk for the base, which is known at the end.
pub struct SolidWriter {
    frame: Frame,
    /// The solid as errors name it.
    name: String,
    out: BufWriter<Whole>,
    triangles: u64,
    rows: Rows,
    /// Upper sides of the row of squares below, if stitched.
    below: Vec<Vec<[f32; 3]>>,
    outlines: BufWriter<File>,
    lowest: f32,
}

/// What of a square's outline is a wall, side by side from the bottom counter-clockwise.
struct Outline {
    sides: [Vec<[f32; 3]>; 4],
    wall: [bool; 4],
}

impl Design {
    /// Writes the core's cells as a binary STL: see [`SolidWriter`]. Nothing is left under `path` if that fails.
    pub fn write_stl(&self, path: &Path) -> Result<(), SolidError> {
        let mut writer = SolidWriter::create(path, &self.frame())?;
        for cell in &self.cells {
            writer.push(cell)?;
        }
        let failed = |source| SolidError::Io { path: path.display().to_string(), source };
        writer.finish()?.publish().map_err(failed)
    }
}

impl SolidWriter {
    /// Begins a solid. Nothing stands under `path` until what [`SolidWriter::finish`] gives is published.
    pub fn create(path: &Path, frame: &Frame) -> Result<SolidWriter, SolidError> {
        let io = |source| SolidError::Io { path: path.display().to_string(), source };
        let mut out = BufWriter::with_capacity(1 << 18, Whole::beside(path).map_err(io)?);
        out.write_all(&[0; HEADER]).map_err(io)?;
        let outlines = tempfile::tempfile_in(folder(path)).map_err(io)?;
        Ok(SolidWriter {
            frame: *frame,
            name: path.display().to_string(),
            out,
            triangles: 0,
            rows: Rows::new(frame),
            below: Vec::new(),
            outlines: BufWriter::with_capacity(1 << 18, outlines),
            lowest: f32::INFINITY,
        })
    }

    /// Appends the next cell, by row, then column, the ring of a stitched design included.
    pub fn push(&mut self, cell: &Cell) -> Result<(), SolidError> {
        self.rows.push(cell).map_or(Ok(()), |row| self.write_row(row))
    }

    /// Where the file is until it has its name.
    pub fn hidden(&self) -> &Path {
        self.out.get_ref().hidden()
    }

    /// The whole file, to be put under its name.
    pub fn finish(mut self) -> Result<Whole, SolidError> {
        if let Some(row) = self.rows.last() {
            self.write_row(row)?;
        }
        let name = self.name.clone();
        let io = |source| SolidError::Io { path: name.clone(), source };
        let base = (f64::from(self.lowest) - BASE_MM) as f32;
        let SolidWriter { mut out, outlines, mut triangles, .. } = self;
        let mut outlines = outlines.into_inner().map_err(|e| io(e.into_error()))?;
        outlines.rewind().map_err(io)?;
        let mut outlines = BufReader::with_capacity(1 << 18, outlines);
        while let Some(outline) = Outline::read(&mut outlines).map_err(io)? {
            for triangle in outline.walls(base) {
                put(&mut out, triangle).map_err(io)?;
                triangles += 1;
            }
        }
        let most = u64::from(u32::MAX);
        let count = u32::try_from(triangles).map_err(|_| SolidError::TooMany { triangles, most })?;
        out.seek(SeekFrom::Start(HEADER as u64 - 4)).map_err(io)?;
        out.write_all(&count.to_le_bytes()).map_err(io)?;
        out.into_inner().map_err(|e| io(e.into_error()))
    }

    /// Writes the tops of one row of squares.
    fn write_row(&mut self, row: i32) -> Result<(), SolidError> {
        let Frame { core, seam, .. } = self.frame;
        let columns: Vec<i32> = (core.c0..core.c1).collect();
        let sketches: Vec<Sketch> = columns
            .par_iter()
            .map_init(Diagram::default, |diagram, &column| self.sketch(diagram, column, row))
            .collect();
        let stitched = seam == Seam::Stitched;
        let tops: Vec<Option<(Top, Outline)>> = sketches
            .par_iter()
            .enumerate()
            .map(|(k, sketch)| {
                let mut sides = sketch.sides.each_ref().map(Vec::as_slice);
                if stitched && k > 0 {
                    sides[3] = &sketches[k - 1].sides[1];
                }
                if stitched && row > core.r0 {
                    sides[0] = &self.below[k];
                }
                let top = sketch.triangulated(&sides)?;
                let column = columns[k];
                let wall = if stitched {
                    [row == core.r0, column + 1 == core.c1, row + 1 == core.r1, column == core.c0]
                } else {
                    [true; 4]
                };
                Some((top, Outline { sides: sides.map(<[_]>::to_vec), wall }))
            })
            .collect();
        let io = |source| SolidError::Io { path: self.name.clone(), source };
        for (top, column) in tops.into_iter().zip(columns) {
            let (top, outline) = top.ok_or(SolidError::NoMesh { column, row })?;
            for corners in &top.triangles {
                put(&mut self.out, corners.map(|at| top.points[at as usize])).map_err(io)?;
            }
            self.triangles += top.triangles.len() as u64;
            self.lowest = top.points.iter().fold(self.lowest, |low, point| low.min(point[2]));
            outline.write(&mut self.outlines).map_err(io)?;
        }
        let most = u64::from(u32::MAX);
        if self.triangles > most {
            return Err(SolidError::TooMany { triangles: self.triangles, most });
        }
        if stitched {
            self.below = sketches
                .into_iter()
                .map(|sketch| sketch.sides.into_iter().nth(2).unwrap_or_default())
                .collect();
        }
        Ok(())
    }
}

impl SolidWriter {
    fn sketch(&self, diagram: &mut Diagram, column: i32, row: i32) -> Sketch {
        let Frame { core, cell_mm, profile, seam, .. } = self.frame;
        let datum_mm = self.rows.cell(column, row).map_or(0.0, |cell| cell.elevation_mm);
        let edge = |at: i32, from: i32| f64::from(at - from) * cell_mm;
        let square = Square {
            low: [edge(column, core.c0), edge(row, core.r0)],
            high: [edge(column + 1, core.c0), edge(row + 1, core.r0)],
            datum_mm,
            sign: profile.sign(),
        };
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(right, up)| {
            let own = seam == Seam::Step;
            let cells = [(-1, -1), (0, -1), (-1, 0), (0, 0)].map(|(dc, dr)| {
                let at = (column + right + dc, row + up + dr);
                (!own || at == (column, row)).then(|| self.rows.cell(at.0, at.1)).flatten().map(|cell| {
                    // Seen from the cell, the corner is on its right if the cell is on the corner's left.
                    let p = [-0.5 - f64::from(dc), -0.5 - f64::from(dr)].map(|share| share * cell_mm);
                    square.sign * cell.height_mm(p, profile)
                })
            });
            (square.sign * cells.into_iter().flatten().fold(f64::NEG_INFINITY, f64::max)) as f32
        });
        Sketch::new(diagram, &self.rows.planes(column, row), &square, corners)
    }
}

impl Outline {
    fn write(&self, out: &mut impl Write) -> std::io::Result<()> {
        for (points, wall) in self.sides.iter().zip(self.wall) {
            out.write_all(&[u8::from(wall)])?;
            let ends = [points[0], points[points.len() - 1]];
            // No wall, no points between: the base has the corners only.
            let points = if wall { points.as_slice() } else { &ends };
            out.write_all(&(points.len() as u32).to_le_bytes())?;
            for number in points.iter().flatten() {
                out.write_all(&number.to_le_bytes())?;
            }
        }
        Ok(())
    }

    /// The next outline, or None at the end.
    fn read(from: &mut impl Read) -> std::io::Result<Option<Outline>> {
        let mut outline = Outline { sides: Default::default(), wall: [false; 4] };
        for side in 0..4 {
            let mut head = [0; 1];
            if side == 0 && from.read(&mut head)? == 0 {
                return Ok(None);
            } else if side > 0 {
                from.read_exact(&mut head)?;
            }
            outline.wall[side] = head[0] == 1;
            let mut number = [0; 4];
            from.read_exact(&mut number)?;
            for _ in 0..u32::from_le_bytes(number) {
                let mut point = [0.0; 3];
                for value in &mut point {
                    from.read_exact(&mut number)?;
                    *value = f32::from_le_bytes(number);
                }
                outline.sides[side].push(point);
            }
        }
        Ok(Some(outline))
    }

    /// Walls and base over the height `base`, facing outward.
    fn walls(&self, base: f32) -> Vec<[[f32; 3]; 3]> {
        let (low, high) = (self.sides[0][0], self.sides[1][self.sides[1].len() - 1]);
        let centre = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), base];
        let foot = |p: [f32; 3]| [p[0], p[1], base];
        let mut triangles = Vec::new();
        for (side, points) in self.sides.iter().enumerate() {
            for pair in points.windows(2) {
                // Counter-clockwise: bottom and right rise, top and left fall.
                let [a, b] = if side < 2 { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
                if self.wall[side] {
                    triangles.push([foot(a), foot(b), b]);
                    triangles.push([foot(a), b, a]);
                }
                triangles.push([centre, foot(b), foot(a)]);
            }
        }
        triangles
    }
}

fn put(out: &mut impl Write, corners: [[f32; 3]; 3]) -> std::io::Result<()> {
    let [a, b, c] = corners.map(|corner| glam::DVec3::from_array(corner.map(f64::from)));
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array();
    let mut bytes = [0; 50];
    let numbers = normal.into_iter().chain(corners.into_iter().flatten());
    for (place, number) in bytes.chunks_exact_mut(4).zip(numbers) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    out.write_all(&bytes)
}
