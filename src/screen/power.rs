//! The power diagram that planes cut out of a square: where each plane is the lowest.

/// A vertex and the label of the edge that begins there: a plane's index, or one of [`SIDES`].
pub(super) type Vertex = ([f64; 2], u32);

/// Labels of the square's own edges: bottom, right, top, left.
pub(super) const SIDES: [u32; 4] = [u32::MAX - 3, u32::MAX - 2, u32::MAX - 1, u32::MAX];

/// Planes a box of the grid holds on average, when nothing is known of the neighbours yet: what
/// stands in the 3 x 3 boxes around a plane is clipped by first.
const PLANES_A_BOX: f64 = 1.4;

/// For every plane i the polygon {x in the rectangle: g_i . x + c_i <= g_j . x + c_j for all j},
/// counter-clockwise. Buffers are kept from one diagram to the next.
#[derive(Default)]
pub(super) struct Diagram {
    start: Vec<usize>,
    vertices: Vec<Vertex>,
    /// The neighbours of the last diagram, which most often are this one's too.
    hints: Vec<u32>,
    hint_start: Vec<usize>,
    /// Whether hints are the edges of a polygon in their order, the square's included.
    rings: bool,
    lines: Vec<Line>,
    /// For each plane the last one that it was a first clip of.
    clipped: Vec<usize>,
    misses: Vec<f64>,
    suspects: Vec<u32>,
    polygon: Vec<Vertex>,
    spare: Vec<Vertex>,
}

impl Diagram {
    /// Number of planes.
    pub fn len(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// The polygon of one plane; empty if the plane is nowhere the lowest.
    pub fn polygon(&self, plane: usize) -> &[Vertex] {
        &self.vertices[self.start[plane]..self.start[plane + 1]]
    }

    /// Computes the diagram in the rectangle low..high. The outcome depends on the planes and on
    /// the diagram before it by no more than rounding; `forget` starts afresh.
    pub fn compute(&mut self, gx: &[f64], gy: &[f64], c: &[f64], low: [f64; 2], high: [f64; 2]) {
        let n = gx.len();
        if self.hint_start.len() != n + 1 {
            self.first_hints(gx, gy);
        }
        self.vertices.clear();
        self.start.clear();
        self.start.push(0);
        self.clipped.clear();
        self.clipped.resize(n, usize::MAX);
        self.misses.resize(n, 0.0);
        let [left, bottom] = low;
        let [right, top] = high;
        for i in 0..n {
            let hints = self.hint_start[i]..self.hint_start[i + 1];
            if !(self.rings && self.ring(gx, gy, c, i, low, high)) {
                self.polygon.clear();
                self.polygon.extend([
                    ([left, bottom], SIDES[0]),
                    ([right, bottom], SIDES[1]),
                    ([right, top], SIDES[2]),
                    ([left, top], SIDES[3]),
                ]);
                for at in hints {
                    let label = self.hints[at];
                    if label < SIDES[0] {
                        let j = label as usize;
                        self.clipped[j] = i;
                        self.clip([gx[i] - gx[j], gy[i] - gy[j]], c[j] - c[i], label);
                    }
                }
            }
            // Clipping only shrinks the polygon: what its first disc is safe from stays harmless.
            let mut disc = Disc::around(&self.polygon);
            misses(gx, gy, c, i, &disc, &mut self.misses);
            negative(&self.misses, &mut self.suspects);
            for at in 0..self.suspects.len() {
                let j = self.suspects[at] as usize;
                // A second clip by one plane would put a corner into the middle of its edge.
                if self.clipped[j] == i || disc.miss(gx, gy, c, i, j) >= 0.0 {
                    continue;
                }
                if self.clip([gx[i] - gx[j], gy[i] - gy[j]], c[j] - c[i], j as u32) {
                    disc = Disc::around(&self.polygon);
                }
                if self.polygon.is_empty() {
                    break;
                }
            }
            self.vertices.extend_from_slice(&self.polygon);
            self.start.push(self.vertices.len());
        }
    }

    /// Takes this diagram's neighbours as the first clips of the next.
    pub fn remember(&mut self) {
        self.hints.clear();
        self.hints.extend(self.vertices.iter().map(|v| v.1));
        self.hint_start.clone_from(&self.start);
        self.rings = true;
    }

    /// Forgets the last diagram's neighbours.
    pub fn forget(&mut self) {
        self.hint_start.clear();
        self.rings = false;
    }

    /// Makes the polygon of plane i from the edges that it had in the last diagram: each corner is
    /// where two successive lines meet. An edge that comes out backwards has vanished and is left
    /// out. The gradients are the same, so the lines still turn once around; as long as successive
    /// ones turn left by less than half a turn and all edges run forward, the polygon is what the
    /// half-planes have in common. False if the edges that are left are not enough for that.
    fn ring(&mut self, gx: &[f64], gy: &[f64], c: &[f64], i: usize, low: [f64; 2], high: [f64; 2]) -> bool {
        self.lines.clear();
        let square = [
            Line { normal: [0.0, -1.0], offset: -low[1], label: SIDES[0] },
            Line { normal: [1.0, 0.0], offset: high[0], label: SIDES[1] },
            Line { normal: [0.0, 1.0], offset: high[1], label: SIDES[2] },
            Line { normal: [-1.0, 0.0], offset: -low[0], label: SIDES[3] },
        ];
        for &label in &self.hints[self.hint_start[i]..self.hint_start[i + 1]] {
            self.lines.push(if label >= SIDES[0] {
                square[(label - SIDES[0]) as usize]
            } else {
                let j = label as usize;
                Line { normal: [gx[i] - gx[j], gy[i] - gy[j]], offset: c[j] - c[i], label }
            });
        }
        loop {
            let count = self.lines.len();
            if count < 3 {
                return false;
            }
            self.polygon.clear();
            let mut before = self.lines[count - 1];
            for &line in &self.lines {
                let Some(corner) = before.meets(&line) else { return false };
                self.polygon.push((corner, line.label));
                before = line;
            }
            let mut gone = 0;
            for at in 0..count {
                let (from, to) =
                    (self.polygon[at].0, self.polygon[if at + 1 < count { at + 1 } else { 0 }].0);
                let line = self.lines[at];
                if (to[1] - from[1]) * line.normal[0] - (to[0] - from[0]) * line.normal[1] > 0.0 {
                    self.lines[at - gone] = line;
                } else {
                    gone += 1;
                }
            }
            if gone == 0 {
                let mut sides = [false; 4];
                for line in &self.lines {
                    if line.label < SIDES[0] {
                        self.clipped[line.label as usize] = i;
                    } else {
                        sides[(line.label - SIDES[0]) as usize] = true;
                    }
                }
                for (line, is_edge) in square.iter().zip(sides) {
                    if !is_edge {
                        self.clip(line.normal, line.offset, line.label);
                    }
                }
                return true;
            }
            self.lines.truncate(count - gone);
        }
    }

    /// Near gradients, which around the quadratic start are the neighbours: those in the 3 x 3
    /// boxes around each.
    fn first_hints(&mut self, gx: &[f64], gy: &[f64]) {
        self.hints.clear();
        self.hint_start.clear();
        self.hint_start.push(0);
        let n = gx.len();
        let side = (n as f64 / PLANES_A_BOX).sqrt().ceil().max(1.0);
        let boxes = side as usize;
        let place = |values: &[f64]| -> Vec<usize> {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let scale = if high > low { side / (high - low) } else { 0.0 };
            values.iter().map(|v| (((v - low) * scale) as usize).min(boxes - 1)).collect()
        };
        let (x, y) = (place(gx), place(gy));
        let mut start = vec![0; boxes * boxes + 1];
        for i in 0..n {
            start[y[i] * boxes + x[i] + 1] += 1;
        }
        for k in 1..start.len() {
            start[k] += start[k - 1];
        }
        let mut next = start.clone();
        let mut held = vec![0; n];
        for i in 0..n {
            let slot = &mut next[y[i] * boxes + x[i]];
            held[*slot] = i as u32;
            *slot += 1;
        }
        for i in 0..n {
            let columns = x[i].saturating_sub(1)..=(x[i] + 1).min(boxes - 1);
            for row in y[i].saturating_sub(1)..=(y[i] + 1).min(boxes - 1) {
                let (from, to) =
                    (start[row * boxes + columns.start()], start[row * boxes + columns.end() + 1]);
                self.hints.extend(held[from..to].iter().filter(|&&j| j as usize != i));
            }
            self.hint_start.push(self.hints.len());
        }
    }

    fn clip(&mut self, normal: [f64; 2], offset: f64, label: u32) -> bool {
        clip(&mut self.polygon, &mut self.spare, normal, offset, label)
    }
}

/// Smallest sine of the angle in which two lines are taken to meet at a point.
const SMALLEST_SINE: f64 = 1e-4;

/// The half-plane normal . x <= offset.
#[derive(Clone, Copy)]
struct Line {
    normal: [f64; 2],
    offset: f64,
    label: u32,
}

impl Line {
    /// Where the border of the next line to the left meets this one's; None if they hardly do.
    fn meets(&self, next: &Line) -> Option<[f64; 2]> {
        let ([ax, ay], [bx, by]) = (self.normal, next.normal);
        let cross = ax * by - ay * bx;
        let least = SMALLEST_SINE * SMALLEST_SINE * (ax * ax + ay * ay) * (bx * bx + by * by);
        if cross <= 0.0 || cross * cross <= least {
            return None;
        }
        let scale = 1.0 / cross;
        Some([(self.offset * by - next.offset * ay) * scale, (next.offset * ax - self.offset * bx) * scale])
    }
}

/// A disc that holds a polygon, about the middle of its bounding box.
struct Disc {
    x: f64,
    y: f64,
    radius2: f64,
}

impl Disc {
    fn around(polygon: &[Vertex]) -> Disc {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for &([x, y], _) in polygon {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        let (cx, cy) = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]));
        let distance2 = |&([x, y], _): &Vertex| (x - cx) * (x - cx) + (y - cy) * (y - cy);
        let radius2 = polygon.iter().map(distance2).fold(0.0, f64::max);
        // A hair larger, so that rounding never skips a clip that counts.
        Disc { x: cx, y: cy, radius2: radius2 * (1.0 + 1e-12) }
    }

    /// Not negative if the half-plane in which plane i is below plane j holds the whole disc, and
    /// so all of the polygon: with z = z_j - z_i at the centre, z |z| - |g_i - g_j|^2 r^2.
    #[inline(always)]
    fn miss(&self, gx: &[f64], gy: &[f64], c: &[f64], i: usize, j: usize) -> f64 {
        let (dx, dy) = (gx[i] - gx[j], gy[i] - gy[j]);
        let room = (c[j] - c[i]) - (dx * self.x + dy * self.y);
        room * room.abs() - (dx * dx + dy * dy) * self.radius2
    }
}

/// Planes whose signs are looked at together.
const GROUP: usize = 8;

/// What [`Disc::miss`] gives for plane i and every other. All pairs, but in a loop that vectorises:
/// up to a few thousand planes that beats any search among them.
fn misses(gx: &[f64], gy: &[f64], c: &[f64], i: usize, disc: &Disc, out: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function is compiled for.
        return unsafe { misses_avx2(gx, gy, c, i, disc, out) };
    }
    misses_inline(gx, gy, c, i, disc, out);
}

/// The same, four at a time. No product is fused with a sum: every processor finds the same.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn misses_avx2(gx: &[f64], gy: &[f64], c: &[f64], i: usize, disc: &Disc, out: &mut [f64]) {
    misses_inline(gx, gy, c, i, disc, out);
}

#[inline(always)]
fn misses_inline(gx: &[f64], gy: &[f64], c: &[f64], i: usize, disc: &Disc, out: &mut [f64]) {
    let (own_x, own_y, own_c) = (gx[i], gy[i], c[i]);
    let (mid_x, mid_y, radius2) = (disc.x, disc.y, disc.radius2);
    for (((miss, x), y), c) in out.iter_mut().zip(gx).zip(gy).zip(c) {
        let (dx, dy) = (own_x - x, own_y - y);
        let room = (c - own_c) - (dx * mid_x + dy * mid_y);
        *miss = room * room.abs() - (dx * dx + dy * dy) * radius2;
    }
}

/// The indices of negative numbers.
fn negative(values: &[f64], found: &mut Vec<u32>) {
    found.clear();
    for (group, values) in values.chunks(GROUP).enumerate() {
        if values.iter().fold(0, |bits, value| bits | value.to_bits()) >> 63 == 0 {
            continue;
        }
        let lanes = values.iter().enumerate().filter(|(_, value)| **value < 0.0);
        found.extend(lanes.map(|(lane, _)| (group * GROUP + lane) as u32));
    }
}

/// Keeps of a convex polygon what lies in normal . x <= offset; the new edge gets `label`. Whether
/// anything was cut off.
pub(super) fn clip(
    polygon: &mut Vec<Vertex>,
    spare: &mut Vec<Vertex>,
    normal: [f64; 2],
    offset: f64,
    label: u32,
) -> bool {
    let beyond = |p: [f64; 2]| normal[0] * p[0] + normal[1] * p[1] - offset;
    if polygon.iter().all(|v| beyond(v.0) <= 0.0) {
        return false;
    }
    spare.clear();
    let Some(&(mut p, mut edge)) = polygon.last() else { return false };
    let mut d = beyond(p);
    for &(q, next_edge) in polygon.iter() {
        let e = beyond(q);
        if (d <= 0.0) != (e <= 0.0) {
            let t = d / (d - e);
            let cut = [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
            spare.push((cut, if d <= 0.0 { label } else { edge }));
        }
        if e <= 0.0 {
            spare.push((q, next_edge));
        }
        (p, edge, d) = (q, next_edge, e);
    }
    std::mem::swap(polygon, spare);
    true
}

/// Area of a polygon in mm2.
pub(super) fn area(polygon: &[Vertex]) -> f64 {
    let Some(&([x, y], _)) = polygon.first() else { return 0.0 };
    let mut doubled = 0.0;
    for pair in polygon.windows(2).skip(1) {
        let ([ax, ay], [bx, by]) = (pair[0].0, pair[1].0);
        doubled += (ax - x) * (by - y) - (ay - y) * (bx - x);
    }
    0.5 * doubled
}

/// Area of a polygon in mm2 and its first moments (integrals of x and of y) in mm3.
pub(super) fn area_and_moments(polygon: &[Vertex]) -> (f64, [f64; 2]) {
    let Some(&(origin, _)) = polygon.first() else { return (0.0, [0.0; 2]) };
    // About the first vertex: small polygons far from the origin keep their digits.
    let (mut area, mut mx, mut my) = (0.0, 0.0, 0.0);
    for pair in polygon.windows(2).skip(1) {
        let (ax, ay) = (pair[0].0[0] - origin[0], pair[0].0[1] - origin[1]);
        let (bx, by) = (pair[1].0[0] - origin[0], pair[1].0[1] - origin[1]);
        let cross = ax * by - ay * bx;
        area += cross;
        mx += cross * (ax + bx);
        my += cross * (ay + by);
    }
    let area = 0.5 * area;
    (area, [mx / 6.0 + area * origin[0], my / 6.0 + area * origin[1]])
}
