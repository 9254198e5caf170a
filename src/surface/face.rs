//! The facets of a designed surface as polygons, and the walls between its cells.

use super::Designed;
use super::envelope::{Plane, Rect, clip, clip_to, doubled_area};
use crate::screen::{CellRange, Seam};

/// A planar piece of a designed surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// dz/dx and dz/dy.
    pub gradient: [f64; 2],
    /// Corners, counter-clockwise seen from above, x and y from the lattice's lower left corner.
    pub outline_mm: Vec<[f64; 3]>,
}

/// A vertical triangle between two cells, and its outward normal (x, y).
pub(super) type Wall = ([[f64; 3]; 3], [f64; 2]);

impl Designed {
    /// What of the lattice's rectangle the facets of one cell cover. Together the faces of a cell
    /// cover it once: with vertical steps each facet is a convex polygon; a stitched facet, which
    /// ends where a neighbour's function takes over, may be several.
    pub fn faces(&self, column: i32, row: i32) -> Vec<Face> {
        self.region().map_or_else(Vec::new, |region| self.faces_within(column, row, &region))
    }

    /// The same in any rectangle, from the core's lower left corner.
    pub(super) fn faces_within(&self, column: i32, row: i32, region: &Rect) -> Vec<Face> {
        let mut faces = Vec::new();
        let Some(cell) = self.cell(column, row) else { return faces };
        let centre = self.centre(column, row);
        let square = Rect::square(0.5 * self.design.cell_mm).moved(centre);
        let Some(seen) = square.intersection(region) else { return faces };
        let mut shapes = vec![(cell, centre)];
        if self.design.seam == Seam::Stitched {
            for (dr, dc) in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)] {
                if let Some(cell) = self.cell(column + dc, row + dr) {
                    shapes.push((cell, self.centre(column + dc, row + dr)));
                }
            }
        }
        let around = |centre: [f64; 2]| [self.origin_mm[0] - centre[0], self.origin_mm[1] - centre[1]];
        // Every function in the lattice's own frame, with its polygons inside what is seen.
        let functions: Vec<Vec<(Plane, Vec<[f64; 2]>)>> = shapes
            .iter()
            .map(|(cell, centre)| {
                let domain = seen.moved([-centre[0], -centre[1]]);
                let [dx, dy] = around(*centre);
                let mut all = Vec::with_capacity(cell.planes.all().len());
                cell.planes.polygons(&domain, |plane, polygon| {
                    let polygon = polygon.iter().map(|p| [p[0] - dx, p[1] - dy]).collect();
                    let offset =
                        plane.offset + plane.gradient[0] * dx + plane.gradient[1] * dy + cell.elevation;
                    all.push((Plane { offset, ..*plane }, polygon));
                });
                all
            })
            .collect();
        for (index, function) in functions.iter().enumerate() {
            for (plane, polygon) in function {
                let mut pieces = vec![polygon.clone()];
                for (other, rival) in functions.iter().enumerate() {
                    if other != index {
                        pieces =
                            pieces.into_iter().flat_map(|p| below(p, plane, rival, other < index)).collect();
                    }
                }
                for piece in pieces {
                    let outline_mm = piece.iter().map(|&p| [p[0], p[1], self.sign * plane.at(p)]).collect();
                    let gradient = [self.sign * plane.gradient[0], self.sign * plane.gradient[1]];
                    faces.push(Face { gradient, outline_mm });
                }
            }
        }
        faces
    }

    /// The vertical walls between neighbouring cells, as triangles that face the lower side. A
    /// stitched surface has none.
    pub(super) fn walls(&self) -> Vec<Wall> {
        let mut walls = Vec::new();
        if self.design.seam == Seam::Stitched {
            return walls;
        }
        let CellRange { c0, r0, c1, r1 } = self.material;
        for row in r0..r1 {
            for column in c0..c1 {
                for (axis, right, above) in [(0, column + 1, row), (1, column, row + 1)] {
                    if self.material.contains(right, above) {
                        let border = self.centre(right, above)[axis]
                            - 0.5 * self.design.cell_mm
                            - self.origin_mm[axis];
                        let low_side = edge(&self.faces(column, row), axis, border);
                        let high_side = edge(&self.faces(right, above), axis, border);
                        between(&low_side, &high_side, axis, border, &mut walls);
                    }
                }
            }
        }
        walls
    }
}

/// The parts of `polygon` in which `plane` is not below the envelope of `rival`: the polygon less
/// the convex set in which every plane of the rival lies above it. On ties the earlier cell wins.
fn below(
    polygon: Vec<[f64; 2]>,
    plane: &Plane,
    rival: &[(Plane, Vec<[f64; 2]>)],
    rival_wins_ties: bool,
) -> Vec<Vec<[f64; 2]>> {
    let hidden_by = |other: &Plane| {
        let by = other.minus(plane);
        let worst = polygon.iter().map(|&p| by.at(p)).fold(f64::INFINITY, f64::min);
        let best = polygon.iter().map(|&p| by.at(p)).fold(f64::NEG_INFINITY, f64::max);
        (worst, best)
    };
    let mut cutting = Vec::new();
    for (other, _) in rival {
        let (worst, best) = hidden_by(other);
        if best < 0.0 || (best == 0.0 && !(worst == 0.0 && rival_wins_ties)) {
            return vec![polygon];
        }
        if worst < 0.0 {
            cutting.push(other.minus(plane));
        }
    }
    if rival.is_empty() {
        return vec![polygon];
    }
    let mut pieces = Vec::new();
    let (mut rest, mut scratch) = (polygon, Vec::new());
    for by in cutting {
        let mut piece = rest.clone();
        clip(&mut piece, &by, &mut scratch);
        if doubled_area(&piece) > 0.0 {
            pieces.push(piece);
        }
        let above = Plane { gradient: by.gradient.map(|g| -g), offset: -by.offset };
        clip(&mut rest, &above, &mut scratch);
        if rest.is_empty() {
            break;
        }
    }
    pieces
}

/// The heights along a border: the corners that lie on it, by rising place.
fn edge(faces: &[Face], axis: usize, border: f64) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = faces
        .iter()
        .flat_map(|face| &face.outline_mm)
        .filter(|corner| (corner[axis] - border).abs() < 1e-9)
        .map(|corner| [corner[1 - axis], corner[2]])
        .collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup_by(|a, b| a[0] - b[0] < 1e-12);
    points
}

fn height_along(edge: &[[f64; 2]], place: f64) -> f64 {
    let after = edge.partition_point(|p| p[0] < place).clamp(1, edge.len() - 1);
    let [a, b] = [edge[after - 1], edge[after]];
    a[1] + (b[1] - a[1]) * ((place - a[0]) / (b[0] - a[0])).clamp(0.0, 1.0)
}

/// Walls between the two heights along a border, split where they cross.
fn between(left: &[[f64; 2]], right: &[[f64; 2]], axis: usize, border: f64, walls: &mut Vec<Wall>) {
    if left.len() < 2 || right.len() < 2 {
        return;
    }
    let mut places: Vec<f64> = left.iter().chain(right).map(|p| p[0]).collect();
    places.sort_by(f64::total_cmp);
    places.dedup_by(|a, b| *a - *b < 1e-12);
    let point = |place: f64, z: f64| if axis == 0 { [border, place, z] } else { [place, border, z] };
    let mut quad = |a: f64, b: f64, za: [f64; 2], zb: [f64; 2]| {
        let rise = (za[0] - za[1]) + (zb[0] - zb[1]);
        if rise == 0.0 {
            return;
        }
        // The wall looks from the higher cell towards the lower one.
        let mut normal = [0.0; 2];
        normal[axis] = rise.signum();
        for triangle in [
            [point(a, za[0]), point(b, zb[0]), point(b, zb[1])],
            [point(a, za[0]), point(b, zb[1]), point(a, za[1])],
        ] {
            walls.push((triangle, normal));
        }
    };
    for pair in places.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let za = [height_along(left, a), height_along(right, a)];
        let zb = [height_along(left, b), height_along(right, b)];
        let (da, db) = (za[0] - za[1], zb[0] - zb[1]);
        if da * db < 0.0 {
            let t = da / (da - db);
            let middle = a + t * (b - a);
            let z = za[0] + t * (zb[0] - za[0]);
            quad(a, middle, za, [z, z]);
            quad(middle, b, [z, z], zb);
        } else {
            quad(a, b, za, zb);
        }
    }
}

/// A polygon clipped to a rectangle and its lowest and highest z.
pub(super) fn range_in(triangle: &[[f64; 3]; 3], rect: &Rect) -> Option<[f64; 2]> {
    let [a, b, c] = *triangle;
    let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
    let area2 = u[0] * v[1] - u[1] * v[0];
    if area2 == 0.0 {
        return None;
    }
    let gradient = [(u[2] * v[1] - u[1] * v[2]) / area2, (u[0] * v[2] - u[2] * v[0]) / area2];
    let low = a[2].min(b[2]).min(c[2]);
    let high = a[2].max(b[2]).max(c[2]);
    let inside = |p: &[f64; 3]| (0..2).all(|k| p[k] >= rect.low[k] && p[k] <= rect.high[k]);
    if [a, b, c].iter().all(inside) {
        return Some([low, high]);
    }
    let mut polygon = vec![[a[0], a[1]], [b[0], b[1]], [c[0], c[1]]];
    clip_to(&mut polygon, rect, &mut Vec::new());
    let z =
        |p: &[f64; 2]| (a[2] + gradient[0] * (p[0] - a[0]) + gradient[1] * (p[1] - a[1])).clamp(low, high);
    polygon.iter().map(z).fold(None, |range: Option<[f64; 2]>, z| {
        Some(range.map_or([z, z], |[low, high]| [low.min(z), high.max(z)]))
    })
}
