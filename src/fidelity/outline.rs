//! The outline of a region: traced from its samples while it is small, its convex hull once it is not.

use geo::{
    BoundingRect, Coord, LineString, MapCoords, MultiPolygon, Polygon, Rect, SimplifyVwPreserve, unary_union,
};

use super::cavities::Run;

/// Polygons in mm of the part frame; more than one where a region hangs together by corners only.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    pub polygons: MultiPolygon<f64>,
    /// Traced along the samples' edges, corners of less than 0.6 sample areas dropped; else the convex hull.
    pub traced: bool,
}

impl Outline {
    /// Lowest and highest corner of the bounding box in mm.
    pub fn bounds_mm(&self) -> Option<[[f64; 2]; 2]> {
        let bounds = self.polygons.bounding_rect()?;
        Some([[bounds.min().x, bounds.min().y], [bounds.max().x, bounds.max().y]])
    }
}

/// Samples of a region, or the corners of its convex hull, counter-clockwise.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    Runs(Vec<Run>),
    Hull(Vec<(i32, i32)>),
}

/// Regions below this many samples keep every corner.
const FEW: usize = 16;

impl Shape {
    /// Takes over another shape. A hull of hulls is the hull of the whole, so the order of joining cannot show.
    pub fn absorb(&mut self, other: Shape) {
        match (&mut *self, other) {
            (Shape::Runs(mine), Shape::Runs(mut theirs)) => {
                if theirs.len() > mine.len() {
                    std::mem::swap(mine, &mut theirs);
                }
                mine.append(&mut theirs);
            }
            (_, other) => {
                let mut corners = self.corners();
                corners.extend(other.corners());
                *self = Shape::Hull(convex_hull(corners));
            }
        }
    }

    /// Keeps the hull only.
    pub fn give_up_runs(&mut self) {
        if let Shape::Runs(_) = self {
            *self = Shape::Hull(convex_hull(self.corners()));
        }
    }

    fn corners(&self) -> Vec<(i32, i32)> {
        match self {
            Shape::Hull(corners) => corners.clone(),
            Shape::Runs(runs) => runs
                .iter()
                .flat_map(|run| {
                    [
                        (run.start, run.row),
                        (run.end, run.row),
                        (run.end, run.row + 1),
                        (run.start, run.row + 1),
                    ]
                })
                .collect(),
        }
    }

    /// The outline in mm, sample (0, 0) filling the square from 0 to one step.
    pub fn outline(self, step_mm: f64) -> Outline {
        let (polygons, traced) = match self {
            Shape::Hull(corners) => {
                let ring: LineString<f64> =
                    corners.iter().map(|&(x, y)| Coord { x: f64::from(x), y: f64::from(y) }).collect();
                (MultiPolygon(vec![Polygon::new(ring, Vec::new())]), false)
            }
            Shape::Runs(runs) => (trace(runs), true),
        };
        let polygons = polygons.map_coords(|Coord { x, y }| Coord { x: x * step_mm, y: y * step_mm });
        Outline { polygons, traced }
    }
}

fn trace(mut runs: Vec<Run>) -> MultiPolygon<f64> {
    runs.sort_unstable();
    // A run cut by a block's side is one run again, so that blocks leave no trace.
    runs.dedup_by(|right, left| {
        let joins = right.row == left.row && right.start == left.end;
        if joins {
            left.end = right.end;
        }
        joins
    });
    let samples: usize = runs.iter().map(|run| (run.end - run.start) as usize).sum();
    let rectangles: Vec<Polygon<f64>> = runs
        .iter()
        .map(|run| {
            let (start, end, row) = (f64::from(run.start), f64::from(run.end), f64::from(run.row));
            Rect::new(Coord { x: start, y: row }, Coord { x: end, y: row + 1.0 }).to_polygon()
        })
        .collect();
    let whole = unary_union(&rectangles).map_coords(|Coord { x, y }| Coord { x: x.round(), y: y.round() });
    if samples < FEW { whole } else { whole.simplify_vw_preserve(0.6) }
}

/// Andrew's monotone chain in whole numbers: exact, no three corners on a line.
fn convex_hull(mut points: Vec<(i32, i32)>) -> Vec<(i32, i32)> {
    points.sort_unstable();
    points.dedup();
    let turns_left = |a: (i32, i32), b: (i32, i32), c: (i32, i32)| {
        let (abx, aby) = (i128::from(b.0 - a.0), i128::from(b.1 - a.1));
        let (acx, acy) = (i128::from(c.0 - a.0), i128::from(c.1 - a.1));
        abx * acy - aby * acx > 0
    };
    let chain = |points: &mut dyn Iterator<Item = (i32, i32)>| {
        let mut hull: Vec<(i32, i32)> = Vec::new();
        for point in points {
            while hull.len() >= 2 && !turns_left(hull[hull.len() - 2], hull[hull.len() - 1], point) {
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    hull
}
