//! Cutter locations where the controller can stand, for a cutter as it is or widened by a disc.

use crate::cutter::Shape;
use crate::grid::Heights;

/// A cutter's profile, dilated by a disc of `allowance_mm`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    shape: Shape,
    allowance_mm: f64,
}

impl Profile {
    pub(super) fn new(shape: Shape, _step_mm: f64, allowance_mm: f64) -> Profile {
        Profile { shape, allowance_mm }
    }

    fn drop_mm(&self, d_mm: f64) -> Option<f64> {
        self.shape.height_mm((d_mm - self.allowance_mm).max(0.0)).map(|h| -h)
    }

    fn radius_mm(&self) -> f64 {
        self.shape.radius_mm() + self.allowance_mm
    }
}

/// CL at (x0 + i step, y); NaN where nothing is in reach.
pub(super) fn row(
    h: &Heights,
    step_mm: f64,
    profile: &Profile,
    x0_mm: f64,
    y_mm: f64,
    count: usize,
) -> Vec<f32> {
    let mut out = vec![f32::NEG_INFINITY; count];
    let radius = profile.radius_mm();
    let window = h.window;
    let first_row = (((y_mm - radius) / step_mm - 0.5).ceil() as i64).max(window.row);
    let last_row = (((y_mm + radius) / step_mm - 0.5).floor() as i64).min(window.row_end() - 1);
    // Sample columns relative to the point: column c of point i stands at x_c - x_i.
    let base = (x0_mm / step_mm - 0.5).floor() as i64;
    let reach = (radius / step_mm).ceil() as i64 + 1;
    for row in first_row..=last_row {
        let dy = (row as f64 + 0.5) * step_mm - y_mm;
        let samples = h.row(row);
        for k in -reach..=reach {
            let dx = (base + k) as f64 * step_mm + 0.5 * step_mm - x0_mm;
            let Some(drop) = profile.drop_mm(dx.hypot(dy)) else { continue };
            let drop = drop as f32;
            // point i meets column base + k + i
            let offset = base + k - window.column;
            let from = (-offset).max(0);
            let to = (window.columns as i64 - offset).min(count as i64);
            if from >= to {
                continue;
            }
            let seen = &samples[(from + offset) as usize..(to + offset) as usize];
            for (o, &s) in out[from as usize..to as usize].iter_mut().zip(seen) {
                let z = s + drop;
                *o = if z > *o { z } else { *o };
            }
        }
    }
    for o in &mut out {
        if *o == f32::NEG_INFINITY {
            *o = f32::NAN;
        }
    }
    out
}

/// CL at any points; NaN where nothing is in reach.
pub(super) fn points(h: &Heights, step_mm: f64, profile: &Profile, at_mm: &[[f64; 2]]) -> Vec<f64> {
    at_mm.iter().map(|&[x, y]| f64::from(row(h, step_mm, profile, x, y, 1)[0])).collect()
}
