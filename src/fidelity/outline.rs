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

/// From one corner of the samples' grid to another.
type Edge = ((i32, i32), (i32, i32));

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

/// Sorted runs, those cut by a block's side whole again, so that blocks leave no trace.
fn merged(mut runs: Vec<Run>) -> Vec<Run> {
    runs.sort_unstable();
    runs.dedup_by(|right, left| {
        let joins = right.row == left.row && right.start == left.end;
        if joins {
            left.end = right.end;
        }
        joins
    });
    runs
}

fn trace(runs: Vec<Run>) -> MultiPolygon<f64> {
    let runs = merged(runs);
    let samples: usize = runs.iter().map(|run| (run.end - run.start) as usize).sum();
    let whole = match boundary(&runs) {
        Some(rings) => MultiPolygon(vec![rings]),
        None => united(&runs),
    };
    if samples < FEW { whole } else { whole.simplify_vw_preserve(0.6) }
}

/// Follows the samples' edges, region on the left; `None` where rings touch each other at a corner. Runs are
/// those of [`merged`].
fn boundary(runs: &[Run]) -> Option<Polygon<f64>> {
    let mut edges: Vec<Edge> = Vec::new();
    let mut below: &[Run] = &[];
    for row in runs.chunk_by(|a, b| a.row == b.row) {
        let y = row[0].row;
        let adjoining = below.first().is_some_and(|run| run.row + 1 == y);
        if !adjoining {
            level(below, &[], below.first().map_or(y, |run| run.row + 1), &mut edges);
        }
        level(if adjoining { below } else { &[] }, row, y, &mut edges);
        for run in row {
            edges.push(((run.end, y), (run.end, y + 1)));
            edges.push(((run.start, y + 1), (run.start, y)));
        }
        below = row;
    }
    level(below, &[], below.first()?.row + 1, &mut edges);
    edges.sort_unstable();
    if edges.windows(2).any(|pair| pair[0].0 == pair[1].0) {
        return None;
    }
    let mut followed = vec![false; edges.len()];
    let (mut exterior, mut interiors) = (None, Vec::new());
    for first in 0..edges.len() {
        let (mut at, mut ring) = (first, Vec::new());
        while !std::mem::replace(&mut followed[at], true) {
            ring.push(edges[at].0);
            at = edges.binary_search_by_key(&edges[at].1, |edge| edge.0).ok()?;
        }
        if ring.is_empty() {
            continue;
        }
        let corner = |i: usize| {
            let (a, b, c) = (ring[(i + ring.len() - 1) % ring.len()], ring[i], ring[(i + 1) % ring.len()]);
            (a.0 != b.0 || b.0 != c.0) && (a.1 != b.1 || b.1 != c.1)
        };
        let corners = (0..ring.len()).filter(|&i| corner(i)).map(|i| ring[i]);
        let line: LineString<f64> =
            corners.map(|(x, y)| Coord { x: f64::from(x), y: f64::from(y) }).collect();
        // Edges are sorted, so the first ring starts at the leftmost corner: it is the outer one.
        if exterior.is_none() { exterior = Some(line) } else { interiors.push(line) }
    }
    Some(Polygon::new(exterior?, interiors))
}

/// Edges along y between the runs of the row below and of the row above.
fn level(below: &[Run], above: &[Run], y: i32, edges: &mut Vec<Edge>) {
    let mut ends: Vec<(i32, bool)> = Vec::with_capacity(2 * (below.len() + above.len()));
    ends.extend(below.iter().flat_map(|run| [(run.start, false), (run.end, false)]));
    ends.extend(above.iter().flat_map(|run| [(run.start, true), (run.end, true)]));
    ends.sort_unstable();
    let (mut under, mut over, mut from) = (false, false, 0);
    for (x, of_above) in ends {
        if x > from && over && !under {
            edges.push(((from, y), (x, y)));
        } else if x > from && under && !over {
            edges.push(((x, y), (from, y)));
        }
        if of_above {
            over = !over
        } else {
            under = !under
        }
        from = x;
    }
}

/// The union of the runs, for regions that hang together or close a ring by corners.
fn united(runs: &[Run]) -> MultiPolygon<f64> {
    let rectangles: Vec<Polygon<f64>> = runs
        .iter()
        .map(|run| {
            let (start, end, row) = (f64::from(run.start), f64::from(run.end), f64::from(run.row));
            Rect::new(Coord { x: start, y: row }, Coord { x: end, y: row + 1.0 }).to_polygon()
        })
        .collect();
    unary_union(&rectangles).map_coords(|Coord { x, y }| Coord { x: x.round(), y: y.round() })
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

#[cfg(test)]
mod tests {
    use geo::{Area, Validation};

    use super::*;

    fn runs(picture: &[&str]) -> Vec<Run> {
        let samples = picture.iter().enumerate().flat_map(|(row, line)| {
            let filled = line.char_indices().filter(|&(_, sample)| sample == '#');
            filled.map(move |(column, _)| Run {
                row: row as i32,
                start: column as i32,
                end: column as i32 + 1,
            })
        });
        samples.collect()
    }

    #[test]
    fn both_ways_of_tracing_enclose_the_samples() {
        let ring = ["####", "#..#", "#.##", "###."];
        let gap = ["##..##", "##..##", "######", ".#....", "......"];
        for (picture, samples, holes, direct) in [
            (&ring[..], 12, 1, true),
            (&gap[..], 15, 0, true),
            (&["##..", "..##"][..], 4, 0, false),
            (&["###", "#.#", "##.", "..#"][..], 8, 1, false),
        ] {
            let runs = runs(picture);
            assert_eq!(boundary(&merged(runs.clone())).is_some(), direct, "{picture:?}");
            let outline = trace(runs);
            assert!(outline.is_valid(), "{picture:?}");
            assert_eq!(outline.unsigned_area(), f64::from(samples), "{picture:?}");
            assert_eq!(outline.0.iter().map(|polygon| polygon.interiors().len()).sum::<usize>(), holes);
        }
    }
}
