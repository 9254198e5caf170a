//! The surface over one cell's square as triangles that meet those of its neighbours.

use std::collections::HashMap;

use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::pieces::{Piece, Planes, pieces};
use super::power::Diagram;

/// Points of a square, ready to be triangulated. Coordinates are those that a mesh file can hold:
/// rounding comes before anything is joined, so that what is closed here is closed in the file.
pub(super) struct Sketch {
    points: Vec<[f32; 3]>,
    edges: Vec<[Place; 2]>,
    /// Points along the bottom, right, top and left side by rising place, both corners included.
    pub sides: [Vec<[f32; 3]>; 4],
    tolerance: f32,
}

#[derive(Clone, Copy, PartialEq)]
enum Place {
    Inside(u32),
    /// Which side, and how far along it.
    Side(usize, f32),
}

/// Triangles, counter-clockwise seen from above.
pub(super) struct Top {
    pub points: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

/// Where a square lies in the part, and how the heights of its planes become those of the part.
#[derive(Clone, Copy)]
pub(super) struct Square {
    /// Left, bottom, right and top in mm: equal to the bit for neighbours.
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub datum_mm: f64,
    /// -1 for dishes, whose planes are upside down.
    pub sign: f64,
}

/// Steps of single precision that make one place.
const ONE_PLACE: f64 = 4.0;

impl Sketch {
    /// Draws the pieces of a square; `corners` are the heights at its corners, counter-clockwise
    /// from the lower left.
    pub fn new(diagram: &mut Diagram, cells: &[Planes], square: &Square, corners: [f32; 4]) -> Sketch {
        let half = 0.5 * (square.high[0] - square.low[0]);
        let reach = square.low.iter().chain(&square.high).fold(0.0, |most: f64, v| most.max(v.abs()));
        let tolerance = (ONE_PLACE * reach * f64::from(f32::EPSILON) / 2.0) as f32;
        let drawn = pieces(diagram, cells, half);
        let mut sketch =
            Sketch { points: Vec::new(), edges: Vec::new(), sides: Default::default(), tolerance };
        let mut known = HashMap::new();
        let [low, high] = [square.low.map(|v| v as f32), square.high.map(|v| v as f32)];
        for (corner, (x, y)) in [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
            .into_iter()
            .enumerate()
        {
            let point = [x, y, corners[corner]];
            for side in [(corner + 3) % 4, corner] {
                sketch.sides[side].push(point);
            }
        }
        let centre = [0.5 * (square.low[0] + square.high[0]), 0.5 * (square.low[1] + square.high[1])];
        for Piece { cell, plane, outline } in &drawn {
            let ring: Vec<Place> = outline
                .iter()
                .map(|&v| {
                    let z = square.datum_mm + square.sign * cells[*cell].at(*plane, v);
                    // Adding zero turns -0 into 0: one place has one key.
                    let point = [(v[0] + centre[0]) as f32 + 0.0, (v[1] + centre[1]) as f32 + 0.0, z as f32];
                    sketch.place(point, low, high, &mut known)
                })
                .collect();
            for (at, &from) in ring.iter().enumerate() {
                let to = ring[if at + 1 < ring.len() { at + 1 } else { 0 }];
                sketch.edges.push([from, to]);
            }
        }
        for (side, points) in sketch.sides.iter_mut().enumerate() {
            let axis = side % 2;
            points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
            // Corners, which come from the same sum in all the squares that meet there, stay.
            let (first, last) = (points[0], points[points.len() - 1]);
            points.retain(|p| p[axis] - first[axis] > tolerance && last[axis] - p[axis] > tolerance);
            points.dedup_by(|b, a| b[axis] - a[axis] <= tolerance);
            points.insert(0, first);
            points.push(last);
        }
        sketch
    }

    fn place(
        &mut self,
        point: [f32; 3],
        low: [f32; 2],
        high: [f32; 2],
        known: &mut HashMap<[u32; 2], u32>,
    ) -> Place {
        let near = |a: f32, b: f32| (a - b).abs() <= self.tolerance;
        let sides = [
            near(point[1], low[1]),
            near(point[0], high[0]),
            near(point[1], high[1]),
            near(point[0], low[0]),
        ];
        if let Some(side) = sides.iter().position(|&on| on) {
            let mut exact = point;
            exact[1 - side % 2] = [low[1], high[0], high[1], low[0]][side];
            if !sides[(side + 1) % 4] && !sides[(side + 3) % 4] {
                self.sides[side].push(exact);
            }
            return Place::Side(side, point[side % 2]);
        }
        let next = self.points.len() as u32;
        let at = *known.entry([point[0].to_bits(), point[1].to_bits()]).or_insert(next);
        if at == next {
            self.points.push(point);
        }
        Place::Inside(at)
    }

    /// Triangulates between the given sides, which may be those of the neighbours: whatever
    /// rounding did inside, the outline is exactly theirs.
    pub fn triangulated(&self, sides: &[&[[f32; 3]]; 4]) -> Option<Top> {
        let mut points: Vec<[f32; 3]> = Vec::new();
        let mut first = [0; 4];
        // Counter-clockwise from the lower left, each corner once.
        for (side, list) in sides.iter().enumerate() {
            first[side] = points.len();
            let count = list.len() - 1;
            if side < 2 {
                points.extend(&list[..count]);
            } else {
                points.extend(list[1..].iter().rev());
            }
        }
        let outline = points.len();
        points.extend(&self.points);
        let index = |place: Place| match place {
            Place::Inside(at) => Some(outline + at as usize),
            Place::Side(side, along) => {
                let (list, axis) = (sides[side], side % 2);
                let after = list.partition_point(|p| p[axis] < along);
                let (before, after) = (after.saturating_sub(1), after.min(list.len() - 1));
                let off = |at: usize| (list[at][axis] - along).abs();
                let at = if off(before) <= off(after) { before } else { after };
                let step = if side < 2 { at } else { list.len() - 1 - at };
                (off(at) <= 4.0 * self.tolerance).then_some((first[side] + step) % outline)
            }
        };
        let mut edges: Vec<[usize; 2]> = Vec::new();
        for &[from, to] in &self.edges {
            let (Some(a), Some(b)) = (index(from), index(to)) else { continue };
            if a != b && (a >= outline || b >= outline || !same_side(from, to)) {
                edges.push([a.min(b), a.max(b)]);
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let edges = split(&points, outline, edges, self.tolerance);
        let plane = points.iter().map(|p| Point2::new(f64::from(p[0]), f64::from(p[1]))).collect();
        // Edges that rounding made cross are left out: a Delaunay edge of the same length stands there.
        let mesh =
            ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(plane, edges, |_| ()).ok()?;
        let triangles =
            mesh.inner_faces().map(|face| face.vertices().map(|vertex| vertex.index() as u32)).collect();
        (mesh.num_vertices() == points.len()).then_some(Top { points, triangles })
    }
}

fn same_side(a: Place, b: Place) -> bool {
    matches!((a, b), (Place::Side(s, _), Place::Side(t, _)) if s == t)
}

/// Leads every edge through the points that stand on it, where pieces of other facets end.
fn split(points: &[[f32; 3]], outline: usize, edges: Vec<[usize; 2]>, tolerance: f32) -> Vec<[usize; 2]> {
    let mut out = Vec::with_capacity(edges.len());
    let mut on = Vec::new();
    for [a, b] in edges {
        let (p, q) = (points[a], points[b]);
        let (dx, dy) = (f64::from(q[0] - p[0]), f64::from(q[1] - p[1]));
        let length2 = dx * dx + dy * dy;
        let box_of = |axis: usize| (p[axis].min(q[axis]) - tolerance, p[axis].max(q[axis]) + tolerance);
        let ((left, right), (bottom, top)) = (box_of(0), box_of(1));
        on.clear();
        // Points of the outline stand on no edge but their own: the square is convex.
        for (at, v) in points.iter().enumerate().skip(outline) {
            if v[0] < left || v[0] > right || v[1] < bottom || v[1] > top || at == a || at == b {
                continue;
            }
            let (vx, vy) = (f64::from(v[0] - p[0]), f64::from(v[1] - p[1]));
            let (across, along) = (dx * vy - dy * vx, dx * vx + dy * vy);
            let near = across * across <= f64::from(tolerance).powi(2) * length2;
            if near && along > 0.0 && along < length2 {
                on.push((along, at));
            }
        }
        on.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut from = a;
        for &(_, at) in &on {
            out.push([from.min(at), from.max(at)]);
            from = at;
        }
        out.push([from.min(b), from.max(b)]);
    }
    out.sort_unstable();
    out.dedup();
    out
}
