//! Triangles seen from above: the highest z at every sample.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::envelope::Rect;
use super::face::range_in;
use super::{Error, Level, Surface, WALL_DEG, columns_mm, covering, mirrored_columns_mm, reversed};
use crate::grid::{Heights, Lattice, Window};

/// A sample this near to a triangle in mm counts as covered by it, so that no sample falls between
/// two that share an edge.
const ON_EDGE_MM: f64 = 1e-9;

/// Triangles narrower than this across in mm have no slope to speak of: single precision made it.
const SLIVER_MM: f64 = 5e-4;

/// More entries than this and the buckets are made larger.
const MOST_ENTRIES: usize = 1 << 27;

/// Corners as they were read, with the way into the part frame, or in it already.
pub(super) enum Triangles {
    Single { corners: Vec<[[f32; 3]; 3]>, frame: DAffine3 },
    Double(Vec<[[f64; 3]; 3]>),
}

impl Triangles {
    pub fn len(&self) -> usize {
        match self {
            Triangles::Single { corners, .. } => corners.len(),
            Triangles::Double(corners) => corners.len(),
        }
    }

    /// A length that single precision leaves whole steps, as whole steps: 6 mm written in inches
    /// comes back a hair longer, which must not make a column of its own.
    fn whole_steps(&self, length_mm: f64, step_mm: f64) -> f64 {
        let Triangles::Single { corners, frame } = self else { return length_mm };
        let largest = corners.iter().flatten().flatten().fold(0f32, |largest, c| largest.max(c.abs()));
        let scale = frame.matrix3.x_axis.length();
        let slack = f64::from(largest) * scale * f64::from(f32::EPSILON);
        let whole = (length_mm / step_mm).round() * step_mm;
        if (length_mm - whole).abs() <= slack { whole } else { length_mm }
    }

    pub fn get(&self, index: usize) -> [[f64; 3]; 3] {
        match self {
            Triangles::Single { corners, frame } => {
                corners[index].map(|c| frame.transform_point3(DVec3::from(c.map(f64::from))).to_array())
            }
            Triangles::Double(corners) => corners[index],
        }
    }
}

/// A mesh in its part frame: origin at the lower left corner of its bounding box, z as it came.
pub struct Mesh {
    triangles: Triangles,
    lattice: Lattice,
    top_mm: f64,
    bottom_mm: f64,
    steepest: [f64; 2],
    /// 1 where the faces of the top look up by their winding, -1 where the mesh is inside out.
    pub(super) outward: f64,
    buckets: Buckets,
}

/// Triangles by the square of the part they touch.
struct Buckets {
    size_mm: f64,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    entries: Vec<u32>,
}

/// Twice the signed area of a triangle's picture from above, and its slopes.
fn seen_from_above(t: &[[f64; 3]; 3]) -> (f64, [f64; 2]) {
    let [a, b, c] = t;
    let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
    let area2 = u[0] * v[1] - u[1] * v[0];
    (area2, [(u[2] * v[1] - u[1] * v[2]) / area2, (u[0] * v[2] - u[2] * v[0]) / area2])
}

/// Whether a triangle is one of the surface's faces, by its slopes and width: neither a wall nor a
/// sliver.
fn is_face(t: &[[f64; 3]; 3], area2: f64, slopes: [f64; 2]) -> bool {
    let side = |p: &[f64; 3], q: &[f64; 3]| ((p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2)).sqrt();
    let perimeter = side(&t[0], &t[1]) + side(&t[1], &t[2]) + side(&t[2], &t[0]);
    slopes[0].hypot(slopes[1]) < WALL_DEG.to_radians().tan() && 2.0 * area2.abs() / perimeter > SLIVER_MM
}

impl Mesh {
    /// Triangles in the part frame (lower left corner at 0, 0). `path` and `up` are for messages.
    pub(super) fn new(triangles: Triangles, step_mm: f64, path: &str, up: char) -> Result<Mesh, Error> {
        let count = triangles.len();
        let mut high = [f64::NEG_INFINITY; 3];
        let (mut signed, mut unsigned, mut volume) = (0.0, 0.0, 0.0);
        for index in 0..count {
            let t = triangles.get(index);
            for corner in &t {
                for axis in 0..3 {
                    high[axis] = high[axis].max(corner[axis]);
                }
            }
            let (area2, _) = seen_from_above(&t);
            signed += area2;
            unsigned += area2.abs();
            volume += area2 * (t[0][2] + t[1][2] + t[2][2]);
        }
        if unsigned == 0.0 {
            return Err(Error::NoFaces { path: path.into(), triangles: count as u64, up });
        }
        let size = [0, 1].map(|axis| triangles.whole_steps(high[axis], step_mm));
        let lattice = covering(size[0], size[1], step_mm)?;
        let open = signed.abs() > 1e-6 * unsigned;
        let outward = if (if open { signed } else { volume }) < 0.0 { -1.0 } else { 1.0 };
        let (mut bottom_mm, mut steepest) = (f64::INFINITY, [0.0f64; 2]);
        for index in 0..count {
            let t = triangles.get(index);
            let (area2, slopes) = seen_from_above(&t);
            if area2 * outward <= 0.0 {
                continue;
            }
            bottom_mm = t.iter().fold(bottom_mm, |low, corner| low.min(corner[2]));
            if is_face(&t, area2, slopes) {
                for axis in 0..2 {
                    steepest[axis] = steepest[axis].max(slopes[axis].abs());
                }
            }
        }
        let buckets = Buckets::new(&triangles, &lattice);
        Ok(Mesh { triangles, lattice, top_mm: high[2], bottom_mm, steepest, outward, buckets })
    }

    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Corners of one triangle in mm, x and y in the part frame.
    pub fn triangle(&self, index: usize) -> [[f64; 3]; 3] {
        self.triangles.get(index)
    }

    fn sample(&self, xs: &[f64], window: Window, datum_mm: f64) -> Heights {
        let mut heights = Heights::empty(window);
        if window.samples() == 0 {
            return heights;
        }
        const ROWS: usize = 16;
        heights.z_mm.par_chunks_mut(ROWS * window.columns).enumerate().for_each(|(chunk, out)| {
            let first = window.row + (chunk * ROWS) as i64;
            let ys: Vec<f64> =
                (0..out.len() / window.columns).map(|row| self.lattice.y_mm(first + row as i64)).collect();
            self.fill(xs, &ys, out, datum_mm);
        });
        heights
    }

    fn fill(&self, xs: &[f64], ys: &[f64], out: &mut [f32], datum_mm: f64) {
        let buckets = &self.buckets;
        let mut from_row = 0;
        while from_row < ys.len() {
            let Some(row) = buckets.row_of(ys[from_row]) else {
                from_row += 1;
                continue;
            };
            let mut to_row = from_row + 1;
            while to_row < ys.len() && buckets.row_of(ys[to_row]) == Some(row) {
                to_row += 1;
            }
            let mut from = xs.partition_point(|&x| x < -ON_EDGE_MM);
            while from < xs.len() {
                let Some(column) = buckets.column_of(xs[from]) else { break };
                let to = if column + 1 == buckets.columns {
                    xs.len()
                } else {
                    from + xs[from..].partition_point(|&x| x < (column + 1) as f64 * buckets.size_mm)
                };
                // Rounding may leave a border sample's bucket without it; it then takes one step.
                let to = to.max(from + 1);
                for &index in buckets.entries(row, column) {
                    let rising = Rising::new(self.triangles.get(index as usize));
                    for row in from_row..to_row {
                        if let Some(ends) = rising.cut(ys[row]) {
                            let line = &mut out[row * xs.len()..][from..to];
                            fill_span(ends, &xs[from..to], line, datum_mm);
                        }
                    }
                }
                from = to;
            }
            from_row = to_row;
        }
    }
}

/// A triangle with its corners by rising y.
struct Rising {
    corners: [[f64; 3]; 3],
}

impl Rising {
    fn new([mut a, mut b, mut c]: [[f64; 3]; 3]) -> Rising {
        if a[1] > b[1] {
            std::mem::swap(&mut a, &mut b);
        }
        if b[1] > c[1] {
            std::mem::swap(&mut b, &mut c);
        }
        if a[1] > b[1] {
            std::mem::swap(&mut a, &mut b);
        }
        Rising { corners: [a, b, c] }
    }

    /// x and z of the two points where a row cuts the edges, from left to right. An edge is cut the
    /// same way from both its sides.
    fn cut(&self, y: f64) -> Option<[[f64; 2]; 2]> {
        let [a, b, c] = self.corners;
        if y < a[1] - ON_EDGE_MM || y > c[1] + ON_EDGE_MM || a[1] == c[1] {
            return None;
        }
        let y = y.clamp(a[1], c[1]);
        let cut = |p: [f64; 3], q: [f64; 3]| {
            let t = (y - p[1]) / (q[1] - p[1]);
            [p[0] + t * (q[0] - p[0]), p[2] + t * (q[2] - p[2])]
        };
        let long = cut(a, c);
        let short = if y == b[1] {
            [b[0], b[2]]
        } else if y > b[1] {
            cut(b, c)
        } else {
            cut(a, b)
        };
        Some(if long[0] <= short[0] { [long, short] } else { [short, long] })
    }
}

/// Raises the samples between two points of a row to the height between them.
fn fill_span([left, right]: [[f64; 2]; 2], xs: &[f64], out: &mut [f32], datum_mm: f64) {
    let from = xs.partition_point(|&x| x < left[0] - ON_EDGE_MM);
    let count = xs[from..].partition_point(|&x| x <= right[0] + ON_EDGE_MM);
    let width = right[0] - left[0];
    let (z, slope) =
        if width > 0.0 { (left[1], (right[1] - left[1]) / width) } else { (left[1].max(right[1]), 0.0) };
    for (x, out) in xs[from..from + count].iter().zip(&mut out[from..from + count]) {
        let height = z + slope * (x - left[0]).clamp(0.0, width);
        // A sample without data gives way to any height.
        *out = out.max((height - datum_mm) as f32);
    }
}

impl Buckets {
    fn new(triangles: &Triangles, lattice: &Lattice) -> Buckets {
        let area = lattice.width_mm * lattice.height_mm;
        // About eight triangles a bucket, but never smaller than 16 samples across.
        let mut size_mm = (8.0 * area / triangles.len() as f64).sqrt().max(16.0 * lattice.step_mm);
        size_mm = size_mm.max(lattice.width_mm.max(lattice.height_mm) / 30_000.0);
        loop {
            let columns = ((lattice.width_mm / size_mm).ceil() as usize).max(1);
            let rows = ((lattice.height_mm / size_mm).ceil() as usize).max(1);
            let mut buckets = Buckets { size_mm, columns, rows, starts: Vec::new(), entries: Vec::new() };
            let total: usize = (0..triangles.len())
                .filter_map(|index| buckets.touched(&triangles.get(index)))
                .map(|[low, high]| (high[0] - low[0] + 1) * (high[1] - low[1] + 1))
                .sum();
            if total <= MOST_ENTRIES || columns * rows == 1 {
                buckets.sort_in(triangles, total);
                return buckets;
            }
            size_mm *= 2.0;
        }
    }

    fn sort_in(&mut self, triangles: &Triangles, total: usize) {
        let mut next = vec![0u32; self.columns * self.rows + 1];
        let slots = |touched: [[usize; 2]; 2]| {
            let [low, high] = touched;
            let columns = self.columns;
            (low[1]..=high[1])
                .flat_map(move |row| (low[0]..=high[0]).map(move |column| row * columns + column))
        };
        for index in 0..triangles.len() {
            for slot in self.touched(&triangles.get(index)).into_iter().flat_map(slots) {
                next[slot + 1] += 1;
            }
        }
        for slot in 1..next.len() {
            next[slot] += next[slot - 1];
        }
        let starts = next.clone();
        let mut entries = vec![0u32; total];
        for index in 0..triangles.len() {
            for slot in self.touched(&triangles.get(index)).into_iter().flat_map(slots) {
                entries[next[slot] as usize] = index as u32;
                next[slot] += 1;
            }
        }
        self.starts = starts;
        self.entries = entries;
    }

    /// First and last column and row of the buckets that a triangle touches; None for a wall, which
    /// covers no sample.
    fn touched(&self, t: &[[f64; 3]; 3]) -> Option<[[usize; 2]; 2]> {
        if seen_from_above(t).0 == 0.0 {
            return None;
        }
        let mut touched = [[0; 2]; 2];
        for (axis, count) in [(0, self.columns), (1, self.rows)] {
            let low = t[0][axis].min(t[1][axis]).min(t[2][axis]) - ON_EDGE_MM;
            let high = t[0][axis].max(t[1][axis]).max(t[2][axis]) + ON_EDGE_MM;
            touched[0][axis] = ((low / self.size_mm).max(0.0) as usize).min(count - 1);
            touched[1][axis] = ((high / self.size_mm).max(0.0) as usize).min(count - 1);
        }
        Some(touched)
    }

    /// The bucket of a coordinate; None before the part. Past it the last one stands in.
    fn place(&self, position_mm: f64, count: usize) -> Option<usize> {
        (position_mm >= -ON_EDGE_MM).then(|| ((position_mm / self.size_mm).max(0.0) as usize).min(count - 1))
    }

    fn column_of(&self, x_mm: f64) -> Option<usize> {
        self.place(x_mm, self.columns)
    }

    fn row_of(&self, y_mm: f64) -> Option<usize> {
        self.place(y_mm, self.rows)
    }

    fn entries(&self, row: usize, column: usize) -> &[u32] {
        let slot = row * self.columns + column;
        &self.entries[self.starts[slot] as usize..self.starts[slot + 1] as usize]
    }
}

impl Surface for Mesh {
    fn lattice(&self) -> Lattice {
        self.lattice
    }

    fn top_mm(&self) -> f64 {
        self.top_mm
    }

    fn outlines(&self, low_mm: [f64; 2], high_mm: [f64; 2]) -> Vec<Vec<[f64; 3]>> {
        let reaches = |t: &[[f64; 3]; 3]| {
            (0..2).all(|axis| {
                t.iter().any(|corner| corner[axis] >= low_mm[axis])
                    && t.iter().any(|corner| corner[axis] <= high_mm[axis])
            })
        };
        (0..self.triangles()).map(|index| self.triangle(index)).filter(reaches).map(Vec::from).collect()
    }

    /// The lowest corner of a triangle that looks up, seen or not: the base of a solid does not
    /// count, a ledge under an overhang does.
    fn bottom_mm(&self) -> f64 {
        self.bottom_mm
    }

    fn steepest(&self) -> [f64; 2] {
        self.steepest
    }

    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        Ok(self.sample(&columns_mm(&self.lattice, &window), window, datum_mm))
    }

    fn heights_mirrored(&self, window: Window, datum_mm: f64) -> Result<Heights, Error> {
        Ok(reversed(self.sample(&mirrored_columns_mm(&self.lattice, &window), window, datum_mm)))
    }

    fn range_mm(&self, window: Window) -> Result<Option<[f64; 2]>, Error> {
        let step = self.lattice.step_mm;
        let rect = Rect {
            low: [window.column as f64 * step, window.row as f64 * step],
            high: [window.column_end() as f64 * step, window.row_end() as f64 * step],
        };
        let mut range: Option<[f64; 2]> = None;
        for index in 0..self.triangles.len() {
            let t = self.triangles.get(index);
            let (area2, _) = seen_from_above(&t);
            if area2 * self.outward <= 0.0 {
                continue;
            }
            if let Some([low, high]) = range_in(&t, &rect) {
                let range = range.get_or_insert([low, high]);
                *range = [range[0].min(low), range[1].max(high)];
            }
        }
        Ok(range)
    }

    fn levelled(&self) -> Result<Level, Error> {
        Level::of_mesh(self)
    }
}
