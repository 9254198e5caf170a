//! The power diagram that planes cut out of a square: where each plane is the lowest.

/// A vertex and the label of the edge that begins there: a plane's index, or one of [`SIDES`].
pub(super) type Vertex = ([f64; 2], u32);

/// Labels of the square's own edges: bottom, right, top, left.
pub(super) const SIDES: [u32; 4] = [u32::MAX - 3, u32::MAX - 2, u32::MAX - 1, u32::MAX];

/// Planes that a cell is first clipped by, when nothing is known of its neighbours.
const FIRST_CLIPS: usize = 10;

/// For every plane i the polygon {x in the rectangle: g_i . x + c_i <= g_j . x + c_j for all j},
/// counter-clockwise. Buffers are kept from one diagram to the next.
#[derive(Default)]
pub(super) struct Diagram {
    start: Vec<usize>,
    vertices: Vec<Vertex>,
    /// The neighbours of the last diagram, which most often are this one's too.
    hints: Vec<u32>,
    hint_start: Vec<usize>,
    /// For each plane the last one that it was a first clip of.
    clipped: Vec<usize>,
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
        let [left, bottom] = low;
        let [right, top] = high;
        for i in 0..n {
            self.polygon.clear();
            self.polygon.extend([
                ([left, bottom], SIDES[0]),
                ([right, bottom], SIDES[1]),
                ([right, top], SIDES[2]),
                ([left, top], SIDES[3]),
            ]);
            for at in self.hint_start[i]..self.hint_start[i + 1] {
                let j = self.hints[at] as usize;
                self.clipped[j] = i;
                self.clip([gx[i] - gx[j], gy[i] - gy[j]], c[j] - c[i], j as u32);
            }
            let mut disc = Disc::around(&self.polygon);
            for j in 0..n {
                let (dx, dy) = (gx[i] - gx[j], gy[i] - gy[j]);
                let room = c[j] - c[i] - (dx * disc.x + dy * disc.y);
                // The half-plane holds all of the disc, and so all of the polygon.
                if room >= 0.0 && room * room >= (dx * dx + dy * dy) * disc.radius2 {
                    continue;
                }
                // A second clip by one plane would put a corner into the middle of its edge.
                if j != i && self.clipped[j] != i && self.clip([dx, dy], c[j] - c[i], j as u32) {
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
        self.hint_start.clear();
        self.hint_start.push(0);
        for i in 0..self.len() {
            let polygon = &self.vertices[self.start[i]..self.start[i + 1]];
            self.hints.extend(polygon.iter().map(|v| v.1).filter(|&label| label < SIDES[0]));
            self.hint_start.push(self.hints.len());
        }
    }

    /// Forgets the last diagram's neighbours.
    pub fn forget(&mut self) {
        self.hint_start.clear();
    }

    /// The nearest gradients, which around the quadratic start are the neighbours.
    fn first_hints(&mut self, gx: &[f64], gy: &[f64]) {
        self.hints.clear();
        self.hint_start.clear();
        self.hint_start.push(0);
        let mut nearest: Vec<(f64, u32)> = Vec::with_capacity(FIRST_CLIPS + 1);
        for i in 0..gx.len() {
            nearest.clear();
            for j in 0..gx.len() {
                let d = (gx[i] - gx[j]).powi(2) + (gy[i] - gy[j]).powi(2);
                let last = nearest.last().map_or(f64::INFINITY, |v| v.0);
                if j != i && (nearest.len() < FIRST_CLIPS || d < last) {
                    let at = nearest.partition_point(|v| v.0 <= d);
                    nearest.insert(at, (d, j as u32));
                    nearest.truncate(FIRST_CLIPS);
                }
            }
            self.hints.extend(nearest.iter().map(|v| v.1));
            self.hint_start.push(self.hints.len());
        }
    }

    fn clip(&mut self, normal: [f64; 2], offset: f64, label: u32) -> bool {
        clip(&mut self.polygon, &mut self.spare, normal, offset, label)
    }
}

/// A disc that holds a polygon: the bounding box's.
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
        let (dx, dy) = (0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1]));
        // A hair larger, so that rounding never skips a clip that counts.
        let radius2 = (dx * dx + dy * dy) * (1.0 + 1e-12);
        Disc { x: 0.5 * (low[0] + high[0]), y: 0.5 * (low[1] + high[1]), radius2 }
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
