//! Slanted passes on grids that do not meet their lines.
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
//! above its own location as the line's lies.
//!
//! All controllers of a job follow one curve, each on its own grid, and so they follow each other. It is planned on the
//! coarsest grid among them, with the tightest budget. It is that of the line but where a point of that grid is held:
//! beside walls, where a place a few micrometres away may lie much higher, in notches that hold less than a level plane
//! does on either side, and at both ends. There the curve leads through the point itself, at the height that has to be kept at it, and
//! the finer grids, of which the coarsest is a part, go there, too.
//!
//! Heights are counted from the slope across, z - s a, for stretches of positions where it is the same: there moves
//! keep heights in a line and what [`super::ends`] finds for straight passes it finds for these.

use super::ends::{Measure, lay_between};
use super::funnel::{self, Vertex};
use super::passes::Layout;
use super::slant::{Beside, SIDES};
use super::table::Bounds;
use super::{GridPoint, Site};
use crate::tolerance::EXCESS_MM;

/// Slopes across, in units for a unit, of a stretch may differ by this and by [`SPREAD_SIMPLIFY`] of the
/// simplification's share; by half of which at most what lies between counts as higher.
const SPREAD: f64 = 0.1;
const SPREAD_SIMPLIFY: f64 = 0.2;

/// What a point costs that lies a unit from its line, against one that holds less than a whole unit, and one that holds
/// no grid point at all.
const NARROW: f64 = 100.0;
const NOTHING: f64 = 1e4;

/// Noise in units.
const SAME: f64 = 1e-6;

/// Positions of a pass in a row.
pub(super) struct Part<'a> {
    pub(super) pass: usize,
    pub(super) first: usize,
    /// The exact location on the line in mm, and what is known beside it.
    pub(super) cl_mm: &'a [f32],
    pub(super) beside: &'a [Beside],
    pub(super) leave_mm: f64,
}

/// The part on one of the grids; all in its units.
struct Run<'a> {
    site: &'a Site<'a>,
    layout: &'a Layout,
    part: &'a Part<'a>,
    /// Of which so many make one of the coarsest grid.
    times: f64,
    simplify: f64,
    /// How far from the common curve the cutter may be.
    most: f64,
    /// The exact location on the line, and what has to be kept there.
    exact: Vec<f64>,
    line: Vec<f64>,
}

/// A grid point at a position.
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

/// A point of the coarsest grid that the common curve leads through.
#[derive(Clone, Copy)]
struct Held {
    across: i32,
    off: f64,
    height: f64,
}

/// Lays a part of a pass between grid points of the first layout, which is the second one or a finer one; also what had
/// to be kept at each position, and how far it stands above its exact location, in units.
pub(super) fn lay(
    site: &Site,
    [layout, common]: [&Layout; 2],
    part: &Part,
    measure: &Measure,
) -> (Vec<GridPoint>, Vec<f64>, Vec<f64>) {
    let all = site.common();
    let held = Run::new(&all, common, part, 1.0).hold();
    let run = Run::new(site, layout, part, f64::from(site.times()));
    let points = run.points(&held);
    let vertices = match layout.on_grid() {
        true => run.along(&points, &held),
        false => run.join(&points, &held, measure),
    };
    let kept = run.line.iter().zip(&held).map(|(&line, held)| match held {
        Some(held) => line.max(run.times * held.height),
        None => line,
    });
    (run.bends(&points, &vertices), kept.collect(), run.above(&points, &vertices))
}

impl<'a> Run<'a> {
    fn new(site: &'a Site<'a>, layout: &'a Layout, part: &'a Part<'a>, times: f64) -> Run<'a> {
        let simplify = site.budget.simplify_mm / site.unit_mm;
        let exact = part.cl_mm.iter().map(|&z| site.units(f64::from(z) + part.leave_mm)).collect();
        let kept = part.cl_mm.iter().zip(part.beside);
        let kept = kept.map(|(&z, beside)| site.units(f64::from(z) + part.leave_mm + beside.lift_mm));
        // A finer grid takes no more than its share.
        let most = if times > 1.0 { simplify.max(1.0) } else { 1.0 + simplify };
        Run { site, layout, part, times, simplify, most, exact, line: kept.collect() }
    }

    fn count(&self) -> usize {
        self.exact.len()
    }

    /// How far above or below the line's curve a cutter may stand that is so far beside it.
    fn apart(&self, off: f64) -> f64 {
        (self.most * self.most - off * off).max(0.0).sqrt()
    }

    /// Exact location beside position `i`, on lines between what is known of it.
    fn location(&self, i: usize, off: f64) -> f64 {
        let sides = self.part.beside[i].cl_mm.map(|cl_mm| self.site.units(cl_mm + self.part.leave_mm));
        let known = [sides[0], sides[1], self.exact[i], sides[2], sides[3]];
        let at = (2.0 * (off / self.times + 1.0)).clamp(0.0, 4.0);
        let before = (at as usize).min(3);
        known[before] + (known[before + 1] - known[before]) * (at - before as f64)
    }

    fn lift(&self, i: usize) -> f64 {
        self.part.beside[i].lift_mm / self.site.unit_mm
    }

    fn slope(&self, i: usize) -> f64 {
        let [_, before, after, _] = self.part.beside[i].cl_mm;
        (after - before) / (self.times * self.site.unit_mm)
    }

    fn steep(&self, i: usize) -> bool {
        self.part.beside[i].steep
    }

    /// The points next to the line at a position.
    fn sides(&self, i: usize) -> [Point; 2] {
        let points = self.layout.points(self.part.pass, self.part.first + i);
        [0, 1].map(|side| {
            let (across, off) = points[side];
            let low = self.location(i, off) + self.lift(i) - self.simplify;
            let apart = self.apart(off);
            Point { side, across, off, low: low.max(self.line[i] - apart), high: self.line[i] + apart }
        })
    }

    /// One of the points of every position, the cheapest in all: those that hold a whole unit, and near the line.
    fn choose(&self, open: &[Vec<Point>], free: impl Fn(usize) -> bool) -> Vec<Point> {
        let alone = |i: usize, point: &Point| {
            let lacking =
                NARROW * (1.0 - point.room()).max(0.0) + NOTHING * (point.low.ceil() - point.high).max(0.0);
            point.off * point.off + if free(i) { 0.0 } else { lacking }
        };
        let mut cost: Vec<f64> = open[0].iter().map(|point| alone(0, point)).collect();
        let mut from: Vec<Vec<usize>> = vec![vec![0; open[0].len()]];
        for i in 1..open.len() {
            let way = |a: &Point, b: &Point, cost: f64| {
                if (a.off - b.off).abs() > self.times + SAME { f64::INFINITY } else { cost }
            };
            let best: Vec<(usize, f64)> = open[i]
                .iter()
                .map(|b| {
                    let ways = open[i - 1].iter().zip(&cost).map(|(a, &cost)| way(a, b, cost)).enumerate();
                    ways.fold((0, f64::INFINITY), |best, way| if way.1 < best.1 { way } else { best })
                })
                .collect();
            cost = best.iter().zip(&open[i]).map(|((_, cost), point)| cost + alone(i, point)).collect();
            from.push(best.into_iter().map(|(before, _)| before).collect());
        }
        let mut at = usize::from(cost.len() > 1 && cost[1] < cost[0]);
        let mut chosen = vec![open[open.len() - 1][at]];
        for i in (1..open.len()).rev() {
            at = from[i][at];
            chosen.push(open[i - 1][at]);
        }
        chosen.reverse();
        chosen
    }

    /// Which points the common curve leads through, on the coarsest grid.
    fn hold(&self) -> Vec<Option<Held>> {
        let count = self.count();
        let open: Vec<Vec<Point>> = (0..count).map(|i| self.sides(i).to_vec()).collect();
        let points = self.choose(&open, |i| self.steep(i));
        let mut heights: Vec<f64> = (0..count)
            .map(|i| match self.steep(i) {
                true => self.units(self.part.beside[i].points_mm[points[i].side][0]),
                false => self.location(i, points[i].off),
            })
            .zip(0..)
            .map(|(height, i)| height + self.lift(i))
            .collect();
        for i in 1..count {
            if let Some([left, right]) = self.ends(i - 1, [points[i - 1].side, points[i].side]) {
                heights[i - 1] = heights[i - 1].max(left);
                heights[i] = heights[i].max(right);
            }
        }
        // On a level plane, half way between two points; a whole unit unless the grid is much coarser than the budget.
        let enough = (self.apart(0.5) + self.simplify).min(1.0) - SAME;
        let held = |i: usize| {
            let point = points[i];
            let holds = !self.steep(i) && point.room() >= enough && i > 0 && i + 1 < count;
            (!holds).then_some(Held { across: point.across, off: point.off, height: heights[i] })
        };
        (0..count).map(held).collect()
    }

    fn units(&self, z_mm: f64) -> f64 {
        self.site.units(z_mm + self.part.leave_mm)
    }

    /// What has to be kept at both ends of a steep interval from the point on one side of the line to that on another:
    /// exact locations raised by what lies between, or those of the widened cutter, whichever is lower.
    fn ends(&self, i: usize, [from, to]: [usize; 2]) -> Option<[f64; 2]> {
        let (left, right) = (&self.part.beside[i], &self.part.beside[i + 1]);
        if !(left.steep && right.steep) {
            return None;
        }
        let (a, b) = (left.points_mm[from], right.points_mm[to]);
        let curved = left.lifts_mm[from][to].map(|lift_mm| [a[0], b[0]].map(|mm| self.units(mm + lift_mm)));
        let steep = self.steep_ends(self.units(a[1]), self.units(b[1]));
        curved.filter(|curved| curved[0] + curved[1] <= steep[0] + steep[1]).or(Some(steep))
    }

    /// Each half of the interval must stand above its own end's location of the widened cutter: on a slope both ends
    /// are raised by half their difference, at a wall both stand at the higher one.
    fn steep_ends(&self, left: f64, right: f64) -> [f64; 2] {
        let apart = (left - right).abs();
        if apart * self.site.unit_mm <= self.layout.pitch_mm() {
            [left + 0.5 * apart, right + 0.5 * apart]
        } else {
            [left.max(right); 2]
        }
    }

    /// Where the cutter goes at each position: through what is held, and elsewhere near the line.
    fn points(&self, held: &[Option<Held>]) -> Vec<Point> {
        let through = |held: &Held| {
            let height = self.times * held.height;
            Point {
                side: 0,
                across: held.across * self.times as i32,
                off: held.off * self.times,
                low: height - self.simplify,
                high: height + if self.times > 1.0 { self.most } else { 1.0 },
            }
        };
        let open = held.iter().enumerate().map(|(i, held)| match held {
            Some(held) => vec![through(held)],
            None if self.layout.on_grid() => vec![self.near(i)],
            None => self.sides(i).to_vec(),
        });
        self.choose(&open.collect::<Vec<_>>(), |i| held[i].is_some())
    }

    /// The nearest point of a grid on which the cutter stands as good as everywhere, with what has to be kept on both
    /// sides of the line.
    fn near(&self, i: usize) -> Point {
        let [a, b] = self.layout.points(self.part.pass, self.part.first + i);
        let (across, off) = if b.1.abs() < a.1.abs() { b } else { a };
        let beside = [-0.5, 0.5].map(|off| self.location(i, off));
        let wanted = beside[0].max(beside[1]).max(self.exact[i]) + self.lift(i);
        let excess = (1.0 - self.simplify).max(0.0) + EXCESS_MM / self.site.unit_mm;
        Point { side: 0, across, off, low: wanted - self.simplify, high: wanted + excess }
    }

    /// Few moves along the line, which end at what is held and, since they are beside the line up to there, next to it.
    fn along(&self, points: &[Point], held: &[Option<Held>]) -> Vec<Vertex> {
        let mut out = Vec::new();
        let mut first = 0;
        for stretch in held.chunk_by(|a, b| a.is_none() && b.is_none()) {
            let of = &points[first..first + stretch.len()];
            let low: Vec<f64> = of.iter().map(|point| point.low).collect();
            let high: Vec<f64> = of.iter().map(|point| point.high).collect();
            let wanted: Vec<f64> = low.iter().map(|low| low + self.simplify).collect();
            out.extend(funnel::simplify(&low, &high, &wanted).into_iter().map(|(at, z)| (first + at, z)));
            first += stretch.len();
        }
        out
    }

    /// The last position of the stretch that begins at `start`: moves end there, and what they pass before has one
    /// slope across.
    fn stretch(&self, start: usize, held: &[Option<Held>]) -> usize {
        let spread = SPREAD + SPREAD_SIMPLIFY * self.simplify;
        let finer = self.times > 1.0;
        // What is held is many units of a finer grid away from the line.
        if finer && held[start].is_some() {
            return start + 1;
        }
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        (start + 1..self.count() - 1)
            .find(|&i| {
                (least, most) = (least.min(self.slope(i)), most.max(self.slope(i)));
                held[i].is_some() || finer && held[i + 1].is_some() || most - least > spread
            })
            .unwrap_or(self.count() - 1)
    }

    /// The best moves between the chosen points.
    fn join(&self, points: &[Point], held: &[Option<Held>], measure: &Measure) -> Vec<Vertex> {
        let count = self.count();
        // No move passes a position but within a stretch.
        let (mut low, mut high) = (vec![f64::INFINITY; count], vec![f64::NEG_INFINITY; count]);
        let mut off = vec![[0.0; 2]; count];
        let mut start = 0;
        while start + 1 < count {
            let end = self.stretch(start, held);
            let mut slopes: Vec<f64> = (start + 1..end).map(|i| self.slope(i)).collect();
            slopes.sort_by(f64::total_cmp);
            let slope = slopes.get(slopes.len() / 2).copied().unwrap_or(0.0);
            let stretch = &points[start..=end];
            let least = stretch.iter().fold(f64::INFINITY, |least, point| least.min(point.off));
            let most = stretch.iter().fold(f64::NEG_INFINITY, |most, point| most.max(point.off));
            let known = SIDES.into_iter().chain([0.0]).map(|side| side * self.times);
            let inside = known.filter(|side| (least..most).contains(side));
            let offs: Vec<f64> = inside.chain([least, most]).collect();
            for i in start + 1..end {
                let highest = offs
                    .iter()
                    .map(|&off| self.location(i, off) - slope * off)
                    .fold(f64::NEG_INFINITY, f64::max);
                let [floor, ceiling] = [-1.0, 1.0].map(|sign| {
                    // A concave height over the places beside the line: least at the ends.
                    let room = [least, most].map(|off| self.apart(off) - sign * slope * off);
                    self.line[i] + sign * room[0].min(room[1])
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
        lay_between(&bounds, &self.exact, measure)
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

impl Point {
    /// How much the cutter may stand higher or lower.
    fn room(&self) -> f64 {
        self.high - self.low
    }
}

/// Whether a point stands on the line between two others.
fn in_line(a: GridPoint, b: GridPoint, c: GridPoint) -> bool {
    let by = |from: GridPoint, to: GridPoint, axis: usize| i64::from(to[axis]) - i64::from(from[axis]);
    [1, 2].into_iter().all(|axis| by(a, b, axis) * by(b, c, 0) == by(b, c, axis) * by(a, b, 0))
}
