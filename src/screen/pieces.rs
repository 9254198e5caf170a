//! What each facet owns of a cell's square, where neighbours' planes reach into it too.

use super::power::{Diagram, SIDES, Vertex, area, clip};
use super::{Cell, Profile};

/// Pieces below this area, in mm2, are rounding.
const NOTHING_MM2: f64 = 1e-15;
/// Labels of edges are a plane's index, over this many times the place of its cell among those given.
const LABELS_A_CELL: u32 = 1 << 20;

/// One cell's planes as a bump, p in mm from the centre of a square that may be another cell's:
/// dishes are upside down.
#[derive(Clone, Debug, Default)]
pub(super) struct Planes {
    pub gx: Vec<f64>,
    pub gy: Vec<f64>,
    pub c: Vec<f64>,
    /// Index of each among the cell's facets.
    pub facet: Vec<usize>,
}

/// A convex part of a facet that is on the surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    /// Index of the cell among those given.
    pub cell: usize,
    /// Index into the planes of that cell as they were given.
    pub plane: usize,
    /// Corners, counter-clockwise.
    pub outline: Vec<[f64; 2]>,
}

impl Planes {
    /// Of a cell whose centre stands at `from` as seen from the square's; heights over `datum_mm`.
    pub fn of(cell: &Cell, profile: Profile, from: [f64; 2], datum_mm: f64) -> Planes {
        let sign = profile.sign();
        let mut planes = Planes::default();
        for (facet, f) in cell.facets.iter().enumerate() {
            let g = f.gradient.map(|g| sign * g);
            let c = sign * (f.offset_mm + (cell.elevation_mm - datum_mm));
            planes.gx.push(g[0]);
            planes.gy.push(g[1]);
            planes.c.push(c - (g[0] * from[0] + g[1] * from[1]));
            planes.facet.push(facet);
        }
        planes
    }

    pub fn at(&self, plane: usize, p: [f64; 2]) -> f64 {
        self.gx[plane] * p[0] + self.gy[plane] * p[1] + self.c[plane]
    }

    pub fn len(&self) -> usize {
        self.c.len()
    }

    /// Lowest and highest value of a plane in the square.
    fn range(&self, plane: usize, half: f64) -> [f64; 2] {
        let swing = half * (self.gx[plane].abs() + self.gy[plane].abs());
        [self.c[plane] - swing, self.c[plane] + swing]
    }

    /// Only the planes that can be the lowest somewhere in the square, by their ranges, and what the
    /// lowest plane of all cannot exceed there.
    fn near(&self, half: f64) -> (Planes, f64) {
        let ranges: Vec<[f64; 2]> = (0..self.len()).map(|k| self.range(k, half)).collect();
        let ceiling = ranges.iter().map(|r| r[1]).fold(f64::INFINITY, f64::min);
        let mut near = Planes::default();
        for k in (0..self.len()).filter(|&k| ranges[k][0] <= ceiling) {
            near.gx.push(self.gx[k]);
            near.gy.push(self.gy[k]);
            near.c.push(self.c[k]);
            near.facet.push(self.facet[k]);
        }
        (near, ceiling)
    }
}

/// The pieces of the square of side 2 `half` on which each plane of the cells is the surface, the
/// highest of the cells' lowest planes: together they cover the square once. On ties the earlier
/// cell wins.
pub(super) fn pieces(diagram: &mut Diagram, cells: &[Planes], half: f64) -> Vec<Piece> {
    let Some(own) = cells.first() else { return Vec::new() };
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    // Concave, so lowest at a corner of the square.
    let lowest = |planes: &Planes, p: [f64; 2]| {
        (0..planes.len()).map(|k| planes.at(k, p)).fold(f64::INFINITY, f64::min)
    };
    let floor = corners.iter().map(|&p| lowest(own, p)).fold(f64::INFINITY, f64::min);
    let functions: Vec<(usize, Function)> = cells
        .iter()
        .enumerate()
        .filter_map(|(index, planes)| {
            if index == 0 {
                return Some((index, Function::new(diagram, planes, [-half; 2], [half; 2])));
            }
            let (near, ceiling) = planes.near(half);
            (ceiling > floor).then(|| (index, Function::new(diagram, &near, [-half; 2], [half; 2])))
        })
        .collect();
    let mut found = Vec::new();
    let mut scratch = Scratch::default();
    for (at, (cell, function)) in functions.iter().enumerate() {
        for (plane, polygon) in function.polygons.iter().enumerate().filter(|(_, p)| p.len() > 2) {
            let mut parts = vec![polygon.clone()];
            for (other, (_, rival)) in functions.iter().enumerate() {
                if other == at {
                    continue;
                }
                let mut kept = Vec::new();
                for part in parts {
                    scratch.subtract(&part, function, plane, rival, other < at, &mut kept);
                }
                parts = kept;
            }
            found.extend(parts.into_iter().map(|part| Piece {
                cell: *cell,
                plane: function.planes.facet[plane],
                outline: part.into_iter().map(|v| v.0).collect(),
            }));
        }
    }
    found
}

/// One cell's planes and what each has of the square while no other cell is looked at.
pub(super) struct Function {
    pub planes: Planes,
    polygons: Vec<Vec<Vertex>>,
    /// Planes that have a polygon at all.
    pub seen: Vec<usize>,
    /// Of the edges that its planes cut, over the plane's index.
    label: u32,
}

impl Function {
    pub fn new(diagram: &mut Diagram, planes: &Planes, low: [f64; 2], high: [f64; 2]) -> Function {
        diagram.forget();
        diagram.compute(&planes.gx, &planes.gy, &planes.c, low, high);
        let polygons: Vec<Vec<Vertex>> = (0..planes.len()).map(|k| diagram.polygon(k).to_vec()).collect();
        let seen = (0..planes.len()).filter(|&k| polygons[k].len() > 2).collect();
        Function { planes: planes.clone(), polygons, seen, label: 0 }
    }

    /// Of planes that only stand against others, as cell number `at` of those given: any may be the lowest
    /// somewhere.
    pub fn unseen(planes: &Planes, at: usize) -> Function {
        let seen = (0..planes.len()).collect();
        Function { planes: planes.clone(), polygons: Vec::new(), seen, label: at as u32 * LABELS_A_CELL }
    }

    /// What a plane has of the square while no other cell is looked at.
    pub fn polygon(&self, plane: usize) -> &[Vertex] {
        &self.polygons[plane]
    }

    /// Whether the plane that is the lowest in the middle of a polygon shows that none of it is this
    /// cell's: most polygons are decided so.
    pub fn is_below(&self, polygon: &[Vertex], other: &Function, plane: usize) -> bool {
        let count = polygon.len() as f64;
        let [x, y] = [0, 1].map(|axis| polygon.iter().map(|v| v.0[axis]).sum::<f64>() / count);
        let (mut lowest, mut height) = (0, f64::INFINITY);
        let Planes { gx, gy, c, .. } = &self.planes;
        for (j, ((gx, gy), c)) in gx.iter().zip(gy).zip(c).enumerate() {
            let z = gx * x + gy * y + c;
            if z < height {
                (lowest, height) = (j, z);
            }
        }
        polygon.iter().all(|v| self.planes.at(lowest, v.0) < other.planes.at(plane, v.0))
    }
}

/// The cell, by its place among those given, and the plane that an edge between two facets belongs to;
/// None on the rectangle's own sides.
pub(super) fn beyond(label: u32) -> Option<(usize, usize)> {
    (label < SIDES[0]).then_some(((label / LABELS_A_CELL) as usize, (label % LABELS_A_CELL) as usize))
}

#[derive(Default)]
pub(super) struct Scratch {
    cutting: Vec<usize>,
    /// What the rival has of the polygon.
    lost: Vec<Vertex>,
    spare: Vec<Vertex>,
}

impl Scratch {
    /// The parts of a polygon of `plane` in which it is not below the rival: the polygon less the convex
    /// set in which every plane of the rival lies above it.
    pub fn subtract(
        &mut self,
        polygon: &[Vertex],
        function: &Function,
        plane: usize,
        rival: &Function,
        rival_wins_ties: bool,
        kept: &mut Vec<Vec<Vertex>>,
    ) {
        self.lost.clear();
        self.cutting.clear();
        let (own, planes) = (&function.planes, &rival.planes);
        let [mid_x, mid_y] = polygon[0].0;
        let reach2 = |&([x, y], _): &Vertex| (x - mid_x).powi(2) + (y - mid_y).powi(2);
        let reach2 = polygon.iter().map(reach2).fold(0.0, f64::max);
        for &j in &rival.seen {
            let (gx, gy, c) =
                (planes.gx[j] - own.gx[plane], planes.gy[j] - own.gy[plane], planes.c[j] - own.c[plane]);
            let room = gx * mid_x + gy * mid_y + c;
            if room > 0.0 && room * room > (gx * gx + gy * gy) * reach2 {
                continue;
            }
            let (mut worst, mut best) = (f64::INFINITY, f64::NEG_INFINITY);
            for &([x, y], _) in polygon {
                let above = gx * x + gy * y + c;
                (worst, best) = (worst.min(above), best.max(above));
            }
            if best < 0.0 || (best == 0.0 && !(worst == 0.0 && rival_wins_ties)) {
                kept.push(polygon.to_vec());
                return;
            }
            if worst < 0.0 {
                self.cutting.push(j);
            }
        }
        self.lost.extend_from_slice(polygon);
        for &j in &self.cutting {
            let normal = [planes.gx[j] - own.gx[plane], planes.gy[j] - own.gy[plane]];
            let offset = own.c[plane] - planes.c[j];
            let mut part = self.lost.clone();
            let label = rival.label + j as u32;
            clip(&mut part, &mut self.spare, normal, offset, label);
            if area(&part) > NOTHING_MM2 {
                kept.push(part);
            }
            clip(&mut self.lost, &mut self.spare, normal.map(|n| -n), -offset, label);
            if self.lost.is_empty() {
                break;
            }
        }
    }
}
