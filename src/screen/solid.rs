//! Designed cells as closed solids for CAD and mesh tools.

use std::io::{BufWriter, Write};
use std::path::Path;

use stl_io::{Normal, Triangle, Vertex};

use super::container::beside;
use super::{Cell, Design, Seam};

/// Corners closer than this are one, in mm: facets that meet compute their corner apart.
const WELD_MM: f64 = 1e-7;
/// Metal under the lowest point, in mm.
const BASE_MM: f64 = 1.0;

/// Why a solid was not written.
#[derive(Debug, thiserror::Error)]
pub enum SolidError {
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
    #[error("a stitched design is not written as .stl; hint: seam = \"step\", or screenmill raster")]
    Stitched,
    #[error(
        "{triangles} triangles do not fit into an .stl, which counts to {most}; hint: fewer cells with --cells"
    )]
    TooMany { triangles: u64, most: u64 },
    #[error(
        "cell ({column}, {row}): {edges} edges of its solid stay open; hint: facets of nearly equal gradients do this, try fewer"
    )]
    Open { column: i32, row: i32, edges: usize },
}

impl Design {
    /// Writes the core's cells as a binary STL in mm: one closed solid a cell with vertical walls
    /// and a common base 1 mm under the lowest point. The frame is the part's, z that of the design.
    /// Nothing is left under `path` if that fails.
    pub fn write_stl(&self, path: &Path) -> Result<(), SolidError> {
        let io = |source| SolidError::Io { path: path.display().to_string(), source };
        if self.seam == Seam::Stitched {
            return Err(SolidError::Stitched);
        }
        let lows = self.core_cells().map(|cell| cell.extremes_mm(self.cell_mm, self.profile)[0]);
        let base = lows.fold(f64::INFINITY, f64::min) - BASE_MM;
        let mut triangles = 0;
        for cell in self.core_cells() {
            triangles += self.solid(cell, base)?.len() as u64;
        }
        if triangles > u64::from(u32::MAX) {
            return Err(SolidError::TooMany { triangles, most: u64::from(u32::MAX) });
        }
        let file = beside(path).map_err(io)?;
        let mut buffer = BufWriter::new(file);
        self.write_triangles(&mut buffer, triangles as u32, base)?.map_err(io)?;
        let file = buffer.into_inner().map_err(|e| io(e.into_error()))?;
        file.persist(path).map_err(|e| io(e.error))?;
        Ok(())
    }

    /// Cell by cell, since a whole screen's triangles need not be in memory at once.
    fn write_triangles(
        &self,
        writer: &mut impl Write,
        count: u32,
        base: f64,
    ) -> Result<std::io::Result<()>, SolidError> {
        let mut header = [0; 84];
        header[80..].copy_from_slice(&count.to_le_bytes());
        if let Err(error) = writer.write_all(&header) {
            return Ok(Err(error));
        }
        for cell in self.core_cells() {
            for triangle in self.solid(cell, base)? {
                let numbers = triangle.normal.0.into_iter().chain(triangle.vertices.iter().flat_map(|v| v.0));
                let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).chain([0, 0]).collect();
                if let Err(error) = writer.write_all(&bytes) {
                    return Ok(Err(error));
                }
            }
        }
        Ok(Ok(()))
    }

    /// The closed solid of one cell over a base, in the part's frame.
    pub fn solid(&self, cell: &Cell, base_mm: f64) -> Result<Vec<Triangle>, SolidError> {
        let mut corners: Vec<[f64; 3]> = Vec::new();
        let mut rings: Vec<Vec<usize>> = Vec::new();
        for polygon in cell.polygons(self.cell_mm, self.profile) {
            let facet = &cell.facets[polygon.facet];
            let start = corners.len();
            corners.extend(polygon.vertices_mm.iter().map(|&v| [v[0], v[1], facet.height_mm(v)]));
            rings.push((start..corners.len()).collect());
        }
        let same = weld(&corners);
        for ring in &mut rings {
            ring.iter_mut().for_each(|corner| *corner = same[*corner]);
            ring.dedup();
            if ring.first() == ring.last() {
                ring.pop();
            }
        }
        rings.retain(|ring| ring.len() > 2);
        let border = border(&rings);
        let half = 0.5 * self.cell_mm;
        let on_side = |corner: usize, axis: usize| {
            let at = corners[corner][axis];
            (at.abs() - half).abs() < 10.0 * WELD_MM
        };
        let inner = border.iter().filter(|(a, b)| {
            !(0..2).any(|axis| {
                on_side(*a, axis) && (corners[*a][axis] - corners[*b][axis]).abs() < 20.0 * WELD_MM
            })
        });
        let open = inner.count();
        if open > 0 {
            return Err(SolidError::Open { column: cell.column, row: cell.row, edges: open });
        }
        let [x, y] = self.centre_mm(cell);
        let top = |corner: usize| {
            let v = corners[corner];
            [v[0] + x, v[1] + y, v[2] + cell.elevation_mm]
        };
        let bottom = |corner: usize| [corners[corner][0] + x, corners[corner][1] + y, base_mm];
        let mut solid = Vec::new();
        for ring in &rings {
            for k in 2..ring.len() {
                solid.push(triangle([top(ring[0]), top(ring[k - 1]), top(ring[k])]));
            }
        }
        for &(a, b) in &border {
            solid.push(triangle([bottom(a), bottom(b), top(b)]));
            solid.push(triangle([bottom(a), top(b), top(a)]));
            solid.push(triangle([[x, y, base_mm], bottom(b), bottom(a)]));
        }
        Ok(solid)
    }
}

/// For every corner the first one that it coincides with.
fn weld(corners: &[[f64; 3]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..corners.len()).collect();
    order.sort_by(|&a, &b| corners[a][0].total_cmp(&corners[b][0]).then(a.cmp(&b)));
    let mut same: Vec<usize> = (0..corners.len()).collect();
    for (at, &corner) in order.iter().enumerate() {
        let near = order[..at].iter().rev().take_while(|&&b| corners[corner][0] - corners[b][0] <= WELD_MM);
        let first = near.copied().find(|&b| (corners[corner][1] - corners[b][1]).abs() <= WELD_MM);
        if let Some(first) = first {
            same[corner] = same[first];
        }
    }
    same
}

/// The directed edges whose opposite is missing.
fn border(rings: &[Vec<usize>]) -> Vec<(usize, usize)> {
    let edges = |ring: &Vec<usize>| -> Vec<(usize, usize)> {
        (0..ring.len()).map(|k| (ring[k], ring[(k + 1) % ring.len()])).collect()
    };
    let mut all: Vec<(usize, usize)> = rings.iter().flat_map(edges).collect();
    all.sort_unstable();
    all.iter().copied().filter(|&(a, b)| all.binary_search(&(b, a)).is_err()).collect()
}

fn triangle(corners: [[f64; 3]; 3]) -> Triangle {
    let [a, b, c] = corners.map(glam::DVec3::from_array);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    Triangle {
        normal: Normal::new(normal.as_vec3().to_array()),
        vertices: corners.map(|v| Vertex::new(v.map(|z| z as f32))),
    }
}
