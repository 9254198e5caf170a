//! Planar faces and the edges between them that can hold a cutter.
//!
//! A cutter that rests on an edge at a point rises nowhere by following a face from there, or it would not be
//! the drop: with c the slope of the cutter at that point and n the direction across the edge into a face of
//! gradient g, c . n >= g . n. Between two faces that leaves the slopes from one face's to the other's, none in a
//! valley. With no face on a side (a border, the top of a wall) all steeper slopes remain. Each such
//! condition is necessary by itself, so a neighbour that is not found costs time and no height.

use super::ridges::{Edge, Ridge, ridges};
use super::weld::{SAME_MM, weld};

/// Part of the length of a normal that its z must be at least; what is steeper is taken as vertical.
const UPRIGHT: f64 = 1e-9;

/// Faces as any cutter meets them.
#[derive(Debug, Default)]
pub struct Facets {
    /// Of all faces, one after another.
    pub(super) corners: Vec<[f64; 3]>,
    /// Those that are not vertical.
    pub(super) faces: Vec<Face>,
    pub(super) ridges: Vec<Ridge>,
}

/// A convex planar face that is not vertical.
#[derive(Debug)]
pub(super) struct Face {
    pub(super) gradient: [f64; 2],
    first: u32,
    count: u32,
}

impl Facets {
    /// Of convex outlines, corners in order, x and y in the frame of the samples and z with their datum.
    pub fn new<O: AsRef<[[f64; 3]]>>(outlines: impl IntoIterator<Item = O>) -> Facets {
        let mut corners = Vec::new();
        let mut ends = Vec::new();
        for outline in outlines {
            let outline = outline.as_ref();
            if !outline.is_empty() && outline.iter().flatten().all(|mm| mm.is_finite()) {
                corners.extend_from_slice(outline);
                ends.push(corners.len());
            }
        }
        let weld = weld(&corners);
        let mut around = Around::new(&corners, &weld.corner);
        let mut faces = Vec::new();
        let mut first = 0;
        for end in ends {
            let face = first..end;
            let gradient = gradient(&corners[face.clone()]);
            around.add(&corners[face.clone()], &weld.point[face], gradient);
            if let Some(gradient) = gradient {
                faces.push(Face { gradient, first: first as u32, count: (end - first) as u32 });
            }
            first = end;
        }
        let Around { edges, points, .. } = around;
        let ridges = ridges(&corners, &weld.corner, &edges, &points);
        Facets { corners, faces, ridges }
    }

    /// Whether there is nothing to touch.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    pub(super) fn corners_of(&self, face: &Face) -> &[[f64; 3]] {
        &self.corners[face.first as usize..][..face.count as usize]
    }
}

/// dz/dx and dz/dy by Newell's normal, which bears corners on a line; None where it is vertical or there is none.
fn gradient(corners: &[[f64; 3]]) -> Option<[f64; 2]> {
    let first = corners[0];
    let mut normal = [0.0; 3];
    for (i, a) in corners.iter().enumerate() {
        let b = &corners[(i + 1) % corners.len()];
        let (a, b) = ([0, 1, 2].map(|k| a[k] - first[k]), [0, 1, 2].map(|k| b[k] - first[k]));
        for (k, n) in normal.iter_mut().enumerate() {
            let (p, q) = ((k + 1) % 3, (k + 2) % 3);
            *n += a[p] * b[q] - a[q] * b[p];
        }
    }
    let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
    (normal[2].abs() > UPRIGHT * length).then(|| [-normal[0] / normal[2], -normal[1] / normal[2]])
}

/// What the faces around it say of a point.
pub(super) struct Point {
    /// The gradients of its faces lie between these.
    pub(super) low: [f64; 2],
    pub(super) high: [f64; 2],
    /// Not all of the directions from it lead into a face with a gradient.
    pub(super) open: bool,
    /// Something stands straight above it.
    pub(super) under: bool,
}

const NONE: u32 = u32::MAX;

/// Edges and points as faces are added.
struct Around<'a> {
    corners: &'a [[f64; 3]],
    corner_of: &'a [u32],
    edges: Vec<Edge>,
    /// The newest edge from each point to one of a higher number, and from there to older ones.
    newest: Vec<u32>,
    older: Vec<u32>,
    points: Vec<Point>,
}

impl<'a> Around<'a> {
    fn new(corners: &'a [[f64; 3]], corner_of: &'a [u32]) -> Around<'a> {
        let point =
            || Point { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2], open: false, under: false };
        Around {
            corners,
            corner_of,
            edges: Vec::new(),
            newest: vec![NONE; corner_of.len()],
            older: Vec::new(),
            points: corner_of.iter().map(|_| point()).collect(),
        }
    }

    fn edge(&mut self, a: u32, b: u32) -> usize {
        let (a, b) = (a.min(b), a.max(b));
        let mut at = self.newest[a as usize];
        while at != NONE {
            if self.edges[at as usize].b == b {
                return at as usize;
            }
            at = self.older[at as usize];
        }
        self.older.push(self.newest[a as usize]);
        self.newest[a as usize] = self.edges.len() as u32;
        self.edges.push(Edge::new(a, b));
        self.edges.len() - 1
    }

    fn place(&self, point: u32) -> [f64; 3] {
        self.corners[self.corner_of[point as usize] as usize]
    }

    fn add(&mut self, corners: &[[f64; 3]], points: &[u32], gradient: Option<[f64; 2]>) {
        let mut shallowest_mm = f64::INFINITY;
        for i in 0..points.len() {
            let (from, to) = (points[i], points[(i + 1) % points.len()]);
            if from == to {
                continue;
            }
            let (a, b) = (self.place(from.min(to)), self.place(from.max(to)));
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let length = (dx * dx + dy * dy).sqrt();
            if length <= SAME_MM {
                let lower = if a[2] < b[2] { from.min(to) } else { from.max(to) };
                self.points[lower as usize].under = true;
                continue;
            }
            let edge = self.edge(from, to);
            let across = [-dy / length, dx / length];
            let (mut left, mut right) = (0f64, 0f64);
            for corner in corners {
                let off = (corner[0] - a[0]) * across[0] + (corner[1] - a[1]) * across[1];
                (left, right) = (left.max(off), right.max(-off));
            }
            let deep_mm = left.max(right);
            shallowest_mm = shallowest_mm.min(deep_mm);
            let edge = &mut self.edges[edge];
            match gradient {
                Some(g) => {
                    let slope = g[0] * across[0] + g[1] * across[1];
                    let slack = slack(g, deep_mm);
                    if left >= right {
                        edge.low = edge.low.max(slope - slack);
                        edge.left = true;
                    } else {
                        edge.high = edge.high.min(slope + slack);
                        edge.right = true;
                    }
                }
                None => {
                    let above = |corner: &[f64; 3]| {
                        let along = ((corner[0] - a[0]) * dx + (corner[1] - a[1]) * dy) / length;
                        corner[2] - a[2] - (b[2] - a[2]) * along / length
                    };
                    let (low, high) = corners
                        .iter()
                        .map(above)
                        .fold((0f64, 0f64), |(low, high), z| (low.min(z), high.max(z)));
                    // A wall that stands on this edge.
                    if high > 10.0 * SAME_MM && low > -SAME_MM {
                        edge.dead = true;
                    }
                }
            }
        }
        for &point in points {
            let point = &mut self.points[point as usize];
            match gradient {
                Some(g) if shallowest_mm > 0.0 => {
                    let slack = slack(g, shallowest_mm);
                    for (axis, g) in g.into_iter().enumerate() {
                        point.low[axis] = point.low[axis].min(g - slack);
                        point.high[axis] = point.high[axis].max(g + slack);
                    }
                }
                _ => point.open = true,
            }
        }
    }
}

/// How far a gradient is to be trusted on a face that reaches `deep_mm` away from an edge.
fn slack(gradient: [f64; 2], deep_mm: f64) -> f64 {
    SAME_MM * (1.0 + gradient[0].abs() + gradient[1].abs()) * (1.0 + 1.0 / deep_mm)
}
