//! Slanted passes on a grid that does not meet their lines.
//!
//! At each position there are two grid points, on either side of the line and less than a unit from it. A move goes
//! from one of them to one of a later position, straight in X and Y, so that it too is beside the line at what lies
//! between. With the point a units from the line, the exact location g on the line and s its rise for a unit across, a
//! cutter that stands between z and z + 1 over its location there is
//!
//! ```text
//!   sqrt(a^2 + (s a + 1)^2)        from the line's curve at most: on a steep side more than a unit of the grid.
//! ```
//!
//! So points are chosen that hold a whole unit within a unit and the simplification's share of the line's curve, and
//! z is chosen there. One of both always does where the surface is a plane: the one on the lower side may stand as far
//! above its own location as the line's lies. Every controller of a job follows the line's curve, each on its own
//! grid, and so they follow each other.
//!
//! Heights are counted from the slope across, z - s a, for stretches of positions where it is the same: there moves
//! keep heights in a line and what [`super::ends`] finds for straight passes it finds for these.

use super::ends::{Measure, lay_between};
use super::funnel::Vertex;
use super::passes::Layout;
use super::slant::{Beside, SIDES};
use super::table::Bounds;
use super::{GridPoint, Site};

/// Slopes across, in units for a unit, of a stretch may differ by this and by [`SPREAD_SIMPLIFY`] of the
/// simplification's share; by half of which at most what lies between counts as higher.
const SPREAD: f64 = 0.1;
const SPREAD_SIMPLIFY: f64 = 0.2;

/// What a point costs that lies a unit from its line, against one that holds less than a whole unit, and one that holds
/// no grid point at all.
const NARROW: f64 = 100.0;
const NOTHING: f64 = 1e4;

/// Positions of a pass in a row.
pub(super) struct Part<'a> {
    pub(super) pass: usize,
    pub(super) first: usize,
    /// The exact location on the line, and what has to be kept there, in units.
    pub(super) exact: &'a [f64],
    pub(super) line: &'a [f64],
    pub(super) leave_mm: f64,
}

struct Run<'a> {
    site: &'a Site<'a>,
    layout: &'a Layout,
    part: &'a Part<'a>,
    beside: &'a [Beside],
    simplify: f64,
}

/// The grid point that was chosen for a position.
#[derive(Clone, Copy)]
struct Point {
    /// 0 before the line, 1 after it.
    side: usize,
    across: i32,
    /// From the line.
    off: f64,
    /// The lowest and the highest that the cutter may stand there.
    low: f64,
    high: f64,
}

/// Lays a part of a pass between grid points; and how far each position stands above its exact location, in units.
pub(super) fn lay(
    site: &Site,
    layout: &Layout,
    part: &Part,
    beside: &[Beside],
    measure: &Measure,
) -> (Vec<GridPoint>, Vec<f64>) {
    let run = Run { site, layout, part, beside, simplify: site.budget.simplify_mm / site.unit_mm };
    let points = run.choose();
    let vertices = run.join(&points, measure);
    (run.bends(&points, &vertices), run.above(&points, &vertices))
}

impl Run<'_> {
    fn count(&self) -> usize {
        self.part.exact.len()
    }

    /// How far above or below the line's curve a cutter may stand that is so far beside it.
    fn apart(&self, off: f64) -> f64 {
        let most = 1.0 + self.simplify;
        (most * most - off * off).max(0.0).sqrt()
    }

    /// Exact location beside position `i`, on lines between what is known of it.
    fn location(&self, i: usize, off: f64) -> f64 {
        let sides = self.beside[i].cl_mm.map(|cl_mm| self.site.units(cl_mm + self.part.leave_mm));
        let known = [sides[0], sides[1], self.part.exact[i], sides[2], sides[3]];
        let at = (2.0 * (off + 1.0)).clamp(0.0, 4.0);
        let before = (at as usize).min(3);
        known[before] + (known[before + 1] - known[before]) * (at - before as f64)
    }

    fn lift(&self, i: usize) -> f64 {
        self.beside[i].lift_mm / self.site.unit_mm
    }

    fn slope(&self, i: usize) -> f64 {
        let [_, before, after, _] = self.beside[i].cl_mm;
        (after - before) / self.site.unit_mm
    }

    fn steep(&self, i: usize) -> bool {
        self.beside[i].steep
    }

    /// What has to be kept at both ends of a steep interval from one point to the other. The widened cutter's location at
    /// an end holds for the half next to it, so half way the higher of both does: the lower end may be raised less for it
    /// if the other is raised more.
    fn ends(&self, i: usize, [from, to]: [&Point; 2]) -> Option<[f64; 2]> {
        let (left, right) = (&self.beside[i], &self.beside[i + 1]);
        if !(left.steep && right.steep) {
            return None;
        }
        let (a, b) = (left.points_mm[from.side], right.points_mm[to.side]);
        let units = |mm: f64| self.site.units(mm + self.part.leave_mm) - self.simplify;
        let curved =
            left.lifts_mm[from.side][to.side].map(|lift_mm| [a[0], b[0]].map(|mm| units(mm + lift_mm)));
        let (a, b) = (units(a[1]), units(b[1]));
        let ([low, high], [lower, higher]) = if a < b { ([a, b], [from, to]) } else { ([b, a], [to, from]) };
        let raised = (lower.high - 1.0).max(low).min(high);
        let most = high + (high - raised);
        let (low, high) = if most <= higher.high { (raised, most) } else { (high, high) };
        let steep = if a < b { [low, high] } else { [high, low] };
        let over = |ends: [f64; 2]| (ends[0] - from.high).max(ends[1] - to.high);
        curved.filter(|curved| over(*curved) <= over(steep)).or(Some(steep))
    }

    /// One of the two points of every position, the cheapest in all.
    fn choose(&self) -> Vec<Point> {
        let open: Vec<[Point; 2]> = (0..self.count())
            .map(|i| {
                let points = self.layout.points(self.part.pass, self.part.first + i);
                [0, 1].map(|side| {
                    let (across, off) = points[side];
                    let low = self.location(i, off) + self.lift(i) - self.simplify;
                    let apart = self.apart(off);
                    Point {
                        side,
                        across,
                        off,
                        low: low.max(self.part.line[i] - apart),
                        high: self.part.line[i] + apart,
                    }
                })
            })
            .collect();
        // From low to high there should be a whole unit, and a grid point has to be.
        let lacking = |low: f64, point: &Point| {
            let low = low.max(point.low);
            NARROW * (1.0 - (point.high - low)).max(0.0) + NOTHING * (low.ceil() - point.high).max(0.0)
        };
        let alone = |point: &Point| point.off * point.off + lacking(f64::NEG_INFINITY, point);
        let mut cost = open[0].each_ref().map(alone);
        let mut from: Vec<[usize; 2]> = vec![[0, 1]];
        for i in 1..self.count() {
            let way = |side: usize, before: usize| {
                let (a, b) = (&open[i - 1][before], &open[i][side]);
                if (a.off - b.off).abs() > 1.0 + 1e-6 {
                    return f64::INFINITY;
                }
                let ends = self.ends(i - 1, [a, b]);
                let steep = ends.map_or(0.0, |[left, right]| lacking(left, a) + lacking(right, b));
                cost[before] + steep
            };
            let best = [0, 1].map(|side| {
                let ways = [0, 1].map(|before| way(side, before));
                if ways[1] < ways[0] { (1, ways[1]) } else { (0, ways[0]) }
            });
            cost = [0, 1].map(|side| best[side].1 + alone(&open[i][side]));
            from.push(best.map(|(before, _)| before));
        }
        let mut side = usize::from(cost[1] < cost[0]);
        let mut sides = vec![side; self.count()];
        for i in (1..self.count()).rev() {
            side = from[i][side];
            sides[i - 1] = side;
        }
        let mut points: Vec<Point> = open.iter().zip(&sides).map(|(open, &side)| open[side]).collect();
        for i in 1..self.count() {
            if let Some([left, right]) = self.ends(i - 1, [&points[i - 1], &points[i]]) {
                points[i - 1].low = points[i - 1].low.max(left);
                points[i].low = points[i].low.max(right);
            }
        }
        points
    }

    /// The last position of the stretch that begins at `start`: moves end there, and what they pass before has one
    /// slope across.
    fn stretch(&self, start: usize) -> usize {
        let spread = SPREAD + SPREAD_SIMPLIFY * self.simplify;
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        (start + 1..self.count() - 1)
            .find(|&i| {
                (least, most) = (least.min(self.slope(i)), most.max(self.slope(i)));
                self.steep(i) || most - least > spread
            })
            .unwrap_or(self.count() - 1)
    }

    /// The best moves between the chosen points.
    fn join(&self, points: &[Point], measure: &Measure) -> Vec<Vertex> {
        let count = self.count();
        // No move passes a position but within a stretch.
        let (mut low, mut high) = (vec![f64::INFINITY; count], vec![f64::NEG_INFINITY; count]);
        let mut off = vec![[0.0; 2]; count];
        let mut start = 0;
        while start + 1 < count {
            let end = self.stretch(start);
            let mut slopes: Vec<f64> = (start + 1..end).map(|i| self.slope(i)).collect();
            slopes.sort_by(f64::total_cmp);
            let slope = slopes.get(slopes.len() / 2).copied().unwrap_or(0.0);
            let stretch = &points[start..=end];
            let least = stretch.iter().fold(f64::INFINITY, |least, point| least.min(point.off));
            let most = stretch.iter().fold(f64::NEG_INFINITY, |most, point| most.max(point.off));
            let inside = SIDES.into_iter().chain([0.0]).filter(|side| (least..most).contains(side));
            let offs: Vec<f64> = inside.chain([least, most]).collect();
            for i in start + 1..end {
                let highest = offs
                    .iter()
                    .map(|&off| self.location(i, off) - slope * off)
                    .fold(f64::NEG_INFINITY, f64::max);
                let [floor, ceiling] = [-1.0, 1.0].map(|sign| {
                    // A concave height over the places beside the line: least at the ends.
                    let room = [least, most].map(|off| self.apart(off) - sign * slope * off);
                    self.part.line[i] + sign * room[0].min(room[1])
                });
                low[i] = (highest + self.lift(i) - self.simplify).max(floor);
                high[i] = ceiling;
            }
            off[start][1] -= slope * points[start].off + off[start][0];
            for i in start + 1..=end {
                off[i][0] = -slope * points[i].off;
            }
            start = end;
        }
        let ends: Vec<[f64; 2]> =
            points.iter().zip(&off).map(|(point, off)| [point.low + off[0], point.high + off[0]]).collect();
        let bounds = Bounds { low: &low, high: &high, ends: &ends, off: &off };
        lay_between(&bounds, self.part.exact, measure)
    }

    fn above(&self, points: &[Point], vertices: &[Vertex]) -> Vec<f64> {
        let mut above = Vec::with_capacity(self.count());
        for (nth, pair) in vertices.windows(2).enumerate() {
            let ((a, za), (b, zb)) = (pair[0], pair[1]);
            for i in a + usize::from(nth > 0)..=b {
                let part = (i - a) as f64 / (b - a) as f64;
                let between = |from: f64, to: f64| from + (to - from) * part;
                let z = between(f64::from(za), f64::from(zb));
                above.push(z - self.location(i, between(points[a].off, points[b].off)));
            }
        }
        above
    }

    /// The grid points at which the way bends.
    fn bends(&self, points: &[Point], vertices: &[Vertex]) -> Vec<GridPoint> {
        let mut out: Vec<GridPoint> = Vec::with_capacity(vertices.len());
        for &(i, z) in vertices {
            let point = [self.layout.at(self.part.first + i), points[i].across, z];
            while let [.., a, b] = out[..] {
                if !in_line(a, b, point) {
                    break;
                }
                out.pop();
            }
            out.push(point);
        }
        out
    }
}

/// Whether a point stands on the line between two others.
fn in_line(a: GridPoint, b: GridPoint, c: GridPoint) -> bool {
    let by = |from: GridPoint, to: GridPoint, axis: usize| i64::from(to[axis]) - i64::from(from[axis]);
    [1, 2].into_iter().all(|axis| by(a, b, axis) * by(b, c, 0) == by(b, c, axis) * by(a, b, 0))
}
