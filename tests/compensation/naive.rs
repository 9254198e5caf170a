//! The definitions as double loops, in the arithmetic that the fast ways promise the bits of.

use screenmill::compensation::{RowPass, RowTarget};
use screenmill::cutter::Shape;
use screenmill::grid::{Heights, Window};

pub struct Cutter {
    pub shape: Shape,
    pub step_mm: f64,
    pub allowance_mm: f64,
}

impl Cutter {
    pub fn reach(&self) -> i64 {
        ((self.shape.radius_mm() + self.allowance_mm) / self.step_mm).ceil() as i64 + 2
    }

    /// s at an offset in samples.
    pub fn s(&self, dx: f64, dy: f64) -> Option<f32> {
        let (dx_mm, dy_mm) = (dx * self.step_mm, dy * self.step_mm);
        let r_mm = (dx_mm * dx_mm + dy_mm * dy_mm).sqrt();
        let radius_mm = self.shape.radius_mm();
        if r_mm > radius_mm + self.allowance_mm + 1e-9 {
            return None;
        }
        let r_mm = (r_mm - self.allowance_mm).max(0.0).min(radius_mm);
        self.shape.height_mm(r_mm).map(|height_mm| (0.0 - height_mm) as f32)
    }

    /// Every offset in reach of a position that stands (fx, fy) samples off a sample.
    fn taps(&self, fx: f64, fy: f64) -> Vec<(i64, i64, f32)> {
        let reach = self.reach();
        let mut taps = Vec::new();
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                if let Some(s) = self.s(dx as f64 + fx, dy as f64 + fy) {
                    taps.push((dx, dy, s));
                }
            }
        }
        taps
    }
}

fn at(h: &Heights, column: i64, row: i64) -> f32 {
    let w = &h.window;
    if column < w.column || row < w.row || column >= w.column_end() || row >= w.row_end() {
        return f32::NAN;
    }
    h.row(row)[(column - w.column) as usize]
}

fn highest(h: &Heights, taps: &[(i64, i64, f32)], column: i64, row: i64) -> f32 {
    let mut best = f32::NAN;
    for &(dx, dy, s) in taps {
        let z = at(h, column + dx, row + dy);
        if z.is_finite() && (best.is_nan() || z + s > best) {
            best = z + s;
        }
    }
    best
}

pub fn cutter_location(h: &Heights, cutter: &Cutter, out: Window, every: i64) -> Heights {
    let taps = cutter.taps(0.0, 0.0);
    let mut z_mm = Vec::new();
    for row in (out.row..out.row_end()).step_by(every as usize) {
        for column in out.column..out.column_end() {
            z_mm.push(highest(h, &taps, column, row));
        }
    }
    Heights { window: Window { rows: out.rows.div_ceil(every as usize), ..out }, z_mm }
}

pub fn erode(cl: &Heights, cutter: &Cutter, out: Window) -> Heights {
    let taps = cutter.taps(0.0, 0.0);
    let mut z_mm = Vec::new();
    for row in out.row..out.row_end() {
        for column in out.column..out.column_end() {
            let mut best = f32::NAN;
            for &(dx, dy, s) in &taps {
                let z = at(cl, column + dx, row + dy);
                if z.is_finite() && (best.is_nan() || z - s < best) {
                    best = z - s;
                }
            }
            z_mm.push(best);
        }
    }
    Heights { window: out, z_mm }
}

pub fn row(h: &Heights, cutter: &Cutter, target: RowTarget) -> Vec<f32> {
    let (x, y) = (target.x0_mm / cutter.step_mm - 0.5, target.y_mm / cutter.step_mm - 0.5);
    let (column, row) = (x.round(), y.round());
    let snap = |f: f64| if f.abs() < 1e-7 { 0.0 } else { f };
    let taps = cutter.taps(0.0 - snap(x - column), 0.0 - snap(y - row));
    (0..target.count as i64).map(|i| highest(h, &taps, column as i64 + i, row as i64)).collect()
}

pub fn machined_by_rows(passes: &[RowPass], cutter: &Cutter, out: Window) -> Heights {
    let mut done = Heights::empty(out);
    let snap = |f: f64| if f.abs() < 1e-7 { 0.0 } else { f };
    for pass in passes {
        let (x, y) = (pass.x0_mm / cutter.step_mm - 0.5, pass.y_mm / cutter.step_mm - 0.5);
        let (column, row) = (x.round(), y.round());
        for (dx, dy, s) in cutter.taps(snap(x - column), snap(y - row)) {
            // The sample dx, dy before the position.
            let sample_row = row as i64 - dy;
            if sample_row < out.row || sample_row >= out.row_end() {
                continue;
            }
            for (i, z) in pass.z_mm.iter().enumerate() {
                let sample_column = column as i64 + i as i64 - dx;
                if !z.is_finite() || sample_column < out.column || sample_column >= out.column_end() {
                    continue;
                }
                let to =
                    (sample_row - out.row) as usize * out.columns + (sample_column - out.column) as usize;
                let best = &mut done.z_mm[to];
                if best.is_nan() || z - s < *best {
                    *best = z - s;
                }
            }
        }
    }
    done
}
