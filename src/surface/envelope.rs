//! Lower envelopes of planes: the polygons that the planes of one cell leave of each other, and
//! the envelope along a row of samples.

use crate::screen::Facet;

/// An axis-parallel rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub low: [f64; 2],
    pub high: [f64; 2],
}

impl Rect {
    pub fn square(half: f64) -> Rect {
        Rect { low: [-half; 2], high: [half; 2] }
    }

    pub fn moved(&self, by: [f64; 2]) -> Rect {
        Rect {
            low: [self.low[0] + by[0], self.low[1] + by[1]],
            high: [self.high[0] + by[0], self.high[1] + by[1]],
        }
    }

    /// What both cover, or None.
    pub fn intersection(&self, other: &Rect) -> Option<Rect> {
        let low = [self.low[0].max(other.low[0]), self.low[1].max(other.low[1])];
        let high = [self.high[0].min(other.high[0]), self.high[1].min(other.high[1])];
        (low[0] < high[0] && low[1] < high[1]).then_some(Rect { low, high })
    }

    pub fn corners(&self) -> [[f64; 2]; 4] {
        let Rect { low, high } = *self;
        [low, [high[0], low[1]], high, [low[0], high[1]]]
    }
}

/// The plane z = gradient . p + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    pub gradient: [f64; 2],
    pub offset: f64,
}

impl Plane {
    pub fn at(&self, p: [f64; 2]) -> f64 {
        self.gradient[0] * p[0] + (self.gradient[1] * p[1] + self.offset)
    }

    pub fn minus(&self, other: &Plane) -> Plane {
        Plane {
            gradient: [self.gradient[0] - other.gradient[0], self.gradient[1] - other.gradient[1]],
            offset: self.offset - other.offset,
        }
    }
}

/// Keeps the part of a convex polygon where `plane` is at most 0.
pub(super) fn clip(polygon: &mut Vec<[f64; 2]>, plane: &Plane, scratch: &mut Vec<[f64; 2]>) {
    scratch.clear();
    for (index, &p) in polygon.iter().enumerate() {
        let q = polygon[(index + 1) % polygon.len()];
        let (at_p, at_q) = (plane.at(p), plane.at(q));
        if at_p <= 0.0 {
            scratch.push(p);
        }
        if (at_p < 0.0 && at_q > 0.0) || (at_p > 0.0 && at_q < 0.0) {
            let t = at_p / (at_p - at_q);
            scratch.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
        }
    }
    std::mem::swap(polygon, scratch);
    if polygon.len() < 3 {
        polygon.clear();
    }
}

/// Keeps the part of a convex polygon inside a rectangle.
pub(super) fn clip_to(polygon: &mut Vec<[f64; 2]>, rect: &Rect, scratch: &mut Vec<[f64; 2]>) {
    for (axis, sign, bound) in
        [(0, -1.0, rect.low[0]), (0, 1.0, rect.high[0]), (1, -1.0, rect.low[1]), (1, 1.0, rect.high[1])]
    {
        let mut gradient = [0.0; 2];
        gradient[axis] = sign;
        clip(polygon, &Plane { gradient, offset: -sign * bound }, scratch);
    }
}

/// Twice the signed area of a polygon.
pub(super) fn doubled_area(polygon: &[[f64; 2]]) -> f64 {
    let mut sum = 0.0;
    for (index, p) in polygon.iter().enumerate() {
        let q = polygon[(index + 1) % polygon.len()];
        sum += p[0] * q[1] - p[1] * q[0];
    }
    sum
}

/// The planes of one cell by falling slope in x, as the lower envelope of a bump; a dish's planes
/// are negated. Each with the range of y in which it belongs to the envelope inside the domain:
/// outside that range it cannot touch the surface, so a row needs few of them.
pub(super) struct Planes {
    planes: Vec<Plane>,
    y_range: Vec<[f32; 2]>,
    /// The planes that cut each one's polygon, in the order in which they were tried: no others do in any part of
    /// the domain. Empty for more planes than it can number.
    cutting: Vec<u16>,
    /// Where each plane's begin, and where the last one's end.
    starts: Vec<u32>,
}

impl Planes {
    /// Sorts the facets of a cell and calls `each` with every facet's polygon on the envelope
    /// inside `domain` (counter-clockwise, cell coordinates). Facets without one are left out.
    pub fn new(facets: &[Facet], sign: f64, domain: &Rect, each: impl FnMut(&Plane, &[[f64; 2]])) -> Planes {
        let all = facets
            .iter()
            .map(|f| Plane {
                gradient: [sign * f.gradient[0], sign * f.gradient[1]],
                offset: sign * f.offset_mm,
            })
            .collect();
        Planes::of(all, domain, each)
    }

    /// The same from planes as they are.
    pub fn of(mut all: Vec<Plane>, domain: &Rect, mut each: impl FnMut(&Plane, &[[f64; 2]])) -> Planes {
        all.sort_by(|a, b| {
            let by_slope = b.gradient[0].total_cmp(&a.gradient[0]);
            by_slope.then(a.gradient[1].total_cmp(&b.gradient[1])).then(a.offset.total_cmp(&b.offset))
        });
        all.dedup();
        // A range is widened by a millionth of the domain: more than single precision loses.
        let slack = 1e-6 * (domain.high[1] - domain.low[1]);
        let mut out = Planes {
            planes: Vec::with_capacity(all.len()),
            y_range: Vec::with_capacity(all.len()),
            cutting: Vec::new(),
            starts: vec![0],
        };
        let mut cell = PowerCell::default();
        for index in 0..all.len() {
            cell.of(&all, index, domain, outward(index, all.len()));
            if cell.polygon.is_empty() {
                continue;
            }
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for p in &cell.polygon {
                low = low.min(p[1]);
                high = high.max(p[1]);
            }
            each(&all[index], &cell.polygon);
            out.planes.push(all[index]);
            out.y_range.push([(low - slack) as f32, (high + slack) as f32]);
            out.keep(&cell.cut_by);
        }
        if out.planes.len() < all.len() {
            // What a plane cut that is itself nowhere the lowest is cut by others again.
            (out.cutting, out.starts) = (Vec::new(), vec![0]);
            for index in 0..out.planes.len() {
                cell.of(&out.planes, index, domain, outward(index, out.planes.len()));
                out.keep(&cell.cut_by);
            }
        }
        out.cutting.shrink_to_fit();
        out
    }

    fn keep(&mut self, cut_by: &[usize]) {
        self.cutting.extend(cut_by.iter().filter_map(|&index| u16::try_from(index).ok()));
        self.starts.push(self.cutting.len() as u32);
    }

    /// Calls `each` with every plane's polygon inside `part` of the domain, counter-clockwise; planes that have none
    /// there are left out.
    pub fn polygons(&self, part: &Rect, mut each: impl FnMut(&Plane, &[[f64; 2]])) {
        let count = self.planes.len();
        let mut cell = PowerCell::default();
        for (index, plane) in self.planes.iter().enumerate() {
            if count <= usize::from(u16::MAX) {
                let [start, end] = [self.starts[index], self.starts[index + 1]].map(|at| at as usize);
                let cutting = self.cutting[start..end].iter().map(|&other| usize::from(other));
                cell.of(&self.planes, index, part, cutting);
            } else {
                cell.of(&self.planes, index, part, outward(index, count));
            }
            if !cell.polygon.is_empty() {
                each(plane, &cell.polygon);
            }
        }
    }

    /// The planes that the envelope can have between two y, by falling slope.
    pub fn between(&self, y_low: f64, y_high: f64, out: &mut Vec<Plane>) {
        out.clear();
        let (y_low, y_high) = (y_low as f32, y_high as f32);
        for (plane, range) in self.planes.iter().zip(&self.y_range) {
            if range[0] <= y_high && range[1] >= y_low {
                out.push(*plane);
            }
        }
    }

    /// Every plane of the envelope.
    pub fn all(&self) -> &[Plane] {
        &self.planes
    }
}

/// The others by rising distance in the order of slopes.
fn outward(index: usize, count: usize) -> impl Iterator<Item = usize> {
    (1..count).flat_map(move |by| {
        let after = index + by;
        [index.checked_sub(by), (after < count).then_some(after)].into_iter().flatten()
    })
}

/// What a plane keeps of a domain: where it is the lowest.
#[derive(Default)]
struct PowerCell {
    polygon: Vec<[f64; 2]>,
    /// The planes that cut something off.
    cut_by: Vec<usize>,
    scratch: Vec<[f64; 2]>,
}

impl PowerCell {
    /// Tries the others in their order. With the polygon inside a disc of radius rho about c, plane j cannot cut while
    /// (z_j - z_k)(c) >= |g_j - g_k| rho, which spares most clips.
    fn of(&mut self, planes: &[Plane], index: usize, domain: &Rect, others: impl Iterator<Item = usize>) {
        let PowerCell { polygon, cut_by, scratch } = self;
        cut_by.clear();
        polygon.clear();
        polygon.extend(domain.corners());
        let own = planes[index];
        let (mut centre, mut rho2) = disc(polygon);
        for other in others {
            let above = planes[other].minus(&own);
            let at_centre = above.at(centre);
            let slope2 = above.gradient[0] * above.gradient[0] + above.gradient[1] * above.gradient[1];
            if at_centre >= 0.0 && at_centre * at_centre >= slope2 * rho2 {
                continue;
            }
            let below = own.minus(&planes[other]);
            if polygon.iter().all(|&p| below.at(p) <= 0.0) {
                continue;
            }
            clip(polygon, &below, scratch);
            cut_by.push(other);
            if polygon.is_empty() {
                return;
            }
            (centre, rho2) = disc(polygon);
        }
    }
}

/// Centre and squared radius of a disc around a polygon.
fn disc(polygon: &[[f64; 2]]) -> ([f64; 2], f64) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in polygon {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let centre = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let radius2 =
        polygon.iter().map(|p| (p[0] - centre[0]).powi(2) + (p[1] - centre[1]).powi(2)).fold(0.0, f64::max);
    (centre, radius2)
}

/// One straight piece of an envelope along a row: z = slope x + intercept from `start` on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub start: f64,
    pub slope: f64,
    pub intercept: f64,
}

/// The lower envelope along the row at `y` of planes sorted by falling slope, from left to right:
/// in fixed y every plane is a line, and a line enters the lower envelope in the order of falling
/// slopes, so one stack suffices. The first piece starts at minus infinity.
#[inline]
pub(super) fn along_row(planes: &[Plane], y: f64, pieces: &mut Vec<Piece>) {
    pieces.clear();
    for plane in planes {
        let slope = plane.gradient[0];
        let intercept = plane.gradient[1] * y + plane.offset;
        let mut start = f64::NEG_INFINITY;
        while let Some(top) = pieces.last() {
            if slope == top.slope {
                if intercept >= top.intercept {
                    start = f64::NAN;
                    break;
                }
            } else {
                let x = (intercept - top.intercept) / (top.slope - slope);
                if x > top.start {
                    start = x;
                    break;
                }
            }
            pieces.pop();
        }
        if !start.is_nan() {
            pieces.push(Piece { start, slope, intercept });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

        /// Gradients on a coarse grid, so that planes are parallel, meet in one line or are nowhere the lowest.
        #[test]
        fn a_part_is_cut_by_no_others_than_the_whole(
            planes in proptest::collection::vec((-3..4i32, -3..4i32, 0..6i32), 1..40),
            low in proptest::array::uniform2(-1.0..0.5f64),
            size in proptest::array::uniform2(0.05..0.5f64),
        ) {
            let plane = |&(gx, gy, c): &(i32, i32, i32)| {
                let gradient = [f64::from(gx) * 0.1, f64::from(gy) * 0.1];
                Plane { gradient, offset: f64::from(c) * 0.05 + 2.0 * gradient[0].hypot(gradient[1]).powi(2) }
            };
            let planes: Vec<Plane> = planes.iter().map(plane).collect();
            let whole = Planes::of(planes.clone(), &Rect::square(1.0), |_, _| {});
            let part = Rect { low, high: [low[0] + size[0], low[1] + size[1]] };
            let (mut by_part, mut by_whole) = (Vec::new(), Vec::new());
            Planes::of(planes, &part, |plane, polygon| by_part.push((*plane, doubled_area(polygon))));
            whole.polygons(&part, |plane, polygon| by_whole.push((*plane, doubled_area(polygon))));
            // What is but a line or a point, one may have and the other not.
            for areas in [&mut by_part, &mut by_whole] {
                areas.retain(|(_, area)| *area > 1e-9);
            }
            prop_assert_eq!(by_part.len(), by_whole.len());
            for (a, b) in by_part.iter().zip(&by_whole) {
                prop_assert!(a.0 == b.0 && (a.1 - b.1).abs() < 1e-12, "{:?} and {:?}", a, b);
            }
            let all: f64 = by_whole.iter().map(|(_, area)| area).sum();
            prop_assert!((all - 2.0 * size[0] * size[1]).abs() < 1e-9, "{}", all);
        }
    }
}
