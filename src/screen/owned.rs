//! What the facets of a cell have of a stitched surface, and how that changes with their planes.

use super::pieces::{Function, Planes, Scratch, beyond};
use super::power::{Diagram, SIDES, Vertex, area, clip};

/// Edges below this length, in mm, are rounding.
const NO_EDGE_MM: f64 = 1e-12;

/// How the area of one plane of the first cell changes with the height of another: by `mm2_per_mm` for
/// each mm that the other rises, and by as much less for each mm of its own. Positive inside a cell, where
/// the lower plane is the surface; negative across seams, where the higher one is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coupling {
    pub plane: u32,
    /// Place of the other's cell among those given.
    pub cell: u32,
    pub other: u32,
    pub mm2_per_mm: f64,
}

/// The first of some cells, before the others: all as bumps, in its frame.
pub(super) struct Owner {
    low: [f64; 2],
    high: [f64; 2],
    own: Function,
    rivals: Vec<Function>,
    scratch: Scratch,
}

impl Owner {
    /// The cells beside one that shape its surface must all be given, the own first. What is owned is
    /// looked for as far as the squares of those cells go: `there` says whether there is a neighbour a
    /// column and a row further.
    pub fn new(
        diagram: &mut Diagram,
        cells: &[Planes],
        cell_mm: f64,
        there: impl Fn(i32, i32) -> bool,
    ) -> Option<Owner> {
        let (own, rivals) = cells.split_first()?;
        let half = 0.5 * cell_mm;
        let reach = |dc: i32, dr: i32| if there(dc, dr) { 3.0 * half } else { half };
        let (low, high) = ([-reach(-1, 0), -reach(0, -1)], [reach(1, 0), reach(0, 1)]);
        let rivals = rivals.iter().enumerate().map(|(at, planes)| Function::unseen(planes, at + 1)).collect();
        Some(Owner {
            low,
            high,
            own: Function::new(diagram, own, low, high),
            rivals,
            scratch: Scratch::default(),
        })
    }

    /// Of each plane the area in mm2 over which it is the surface.
    pub fn areas(&mut self) -> Vec<f64> {
        let mut areas = vec![0.0; self.own.planes.len()];
        for at in 0..self.own.seen.len() {
            let plane = self.own.seen[at];
            areas[plane] = self.parts(plane, self.own.polygon(plane).to_vec()).iter().map(|p| area(p)).sum();
        }
        areas
    }

    /// The same, and what they depend on.
    pub fn areas_and_couplings(&mut self) -> (Vec<f64>, Vec<Coupling>) {
        let mut areas = vec![0.0; self.own.planes.len()];
        let mut couplings = Vec::new();
        for at in 0..self.own.seen.len() {
            let plane = self.own.seen[at];
            for part in self.parts(plane, self.own.polygon(plane).to_vec()) {
                areas[plane] += area(&part);
                self.couple(plane, &part, &mut couplings);
            }
        }
        (areas, couplings)
    }

    /// Lowers each plane that has less than `lost` of its wanted area until it has `kept` of it, one
    /// after the other and by at most `most_mm`; those that this does not help stay. By how much each went.
    pub fn uncover(&mut self, wanted: &[f64], lost: f64, kept: f64, most_mm: f64) -> Vec<f64> {
        const HALVINGS: usize = 12;
        let areas = self.areas();
        let mut lowered = vec![0.0; areas.len()];
        for plane in (0..areas.len()).filter(|&plane| areas[plane] < lost * wanted[plane]) {
            let height = self.own.planes.c[plane];
            let mut enough = |by: f64| {
                self.own.planes.c[plane] = height - by;
                let polygon = self.polygon(plane);
                self.parts(plane, polygon).iter().map(|p| area(p)).sum::<f64>() >= kept * wanted[plane]
            };
            let mut high = most_mm / f64::from(1 << HALVINGS);
            while high <= most_mm && !enough(high) {
                high *= 2.0;
            }
            let mut low = 0.0;
            if high <= most_mm {
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    if enough(middle) { high = middle } else { low = middle }
                }
                lowered[plane] = high;
            }
            self.own.planes.c[plane] = height - lowered[plane];
        }
        lowered
    }

    /// What a plane has of the rectangle against the others of its cell, as they now are.
    fn polygon(&self, plane: usize) -> Vec<Vertex> {
        let Planes { gx, gy, c, .. } = &self.own.planes;
        let ([left, bottom], [right, top]) = (self.low, self.high);
        let mut polygon = vec![
            ([left, bottom], SIDES[0]),
            ([right, bottom], SIDES[1]),
            ([right, top], SIDES[2]),
            ([left, top], SIDES[3]),
        ];
        let mut spare = Vec::new();
        for j in (0..c.len()).filter(|&j| j != plane) {
            let normal = [gx[plane] - gx[j], gy[plane] - gy[j]];
            clip(&mut polygon, &mut spare, normal, c[j] - c[plane], j as u32);
        }
        polygon
    }

    /// The parts of a plane's polygon that are on the surface.
    fn parts(&mut self, plane: usize, polygon: Vec<Vertex>) -> Vec<Vec<Vertex>> {
        let mut parts = vec![polygon];
        for rival in &self.rivals {
            let mut kept = Vec::new();
            for part in parts.into_iter().filter(|part| part.len() > 2) {
                if rival.is_below(&part, &self.own, plane) {
                    kept.push(part);
                } else {
                    self.scratch.subtract(&part, &self.own, plane, rival, false, &mut kept);
                }
            }
            parts = kept;
        }
        parts
    }

    /// The edge to each neighbour over the difference of slopes: as far as it goes, a part of a cell's
    /// area moves when one of the two planes rises by 1 mm.
    fn couple(&self, plane: usize, part: &[Vertex], couplings: &mut Vec<Coupling>) {
        for (at, &(from, label)) in part.iter().enumerate() {
            let Some((cell, other)) = beyond(label) else { continue };
            let to = part[if at + 1 < part.len() { at + 1 } else { 0 }].0;
            let planes = if cell == 0 { &self.own.planes } else { &self.rivals[cell - 1].planes };
            let slope = (self.own.planes.gx[plane] - planes.gx[other])
                .hypot(self.own.planes.gy[plane] - planes.gy[other]);
            let length_mm = (to[0] - from[0]).hypot(to[1] - from[1]);
            // Parts are cut along whole lines: only where the other is its cell's lowest do the two meet.
            let meeting = if cell == 0 { 1.0 } else { lowest_along(planes, other, from, to) };
            if length_mm * meeting > NO_EDGE_MM {
                let mm2_per_mm = if cell == 0 { 1.0 } else { -1.0 } * length_mm * meeting / slope;
                couplings.push(Coupling {
                    plane: plane as u32,
                    cell: cell as u32,
                    other: other as u32,
                    mm2_per_mm,
                });
            }
        }
    }
}

/// The part of a segment on which a plane is the lowest of its cell.
fn lowest_along(planes: &Planes, plane: usize, from: [f64; 2], to: [f64; 2]) -> f64 {
    let (mut start, mut end) = (0.0f64, 1.0f64);
    let [at_start, at_end] = [from, to].map(|p| planes.at(plane, p));
    for other in (0..planes.len()).filter(|&other| other != plane) {
        let (a, b) = (planes.at(other, from) - at_start, planes.at(other, to) - at_end);
        match (a < 0.0, b < 0.0) {
            (true, true) => return 0.0,
            (true, false) => start = start.max(a / (a - b)),
            (false, true) => end = end.min(a / (a - b)),
            (false, false) => {}
        }
    }
    (end - start).max(0.0)
}
