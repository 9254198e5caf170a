use glam::DVec3;

use crate::grid::Heights;

/// Heights as places and normals.
pub(super) struct Ground<'a> {
    pub heights: &'a Heights,
    pub step_mm: f64,
}

impl Ground<'_> {
    #[inline]
    fn at(&self, column: i64, row: i64) -> f64 {
        let window = &self.heights.window;
        let (c, r) = (column - window.column, row - window.row);
        if c >= 0 && (c as usize) < window.columns && r >= 0 && (r as usize) < window.rows {
            f64::from(self.heights.z_mm[r as usize * window.columns + c as usize])
        } else {
            f64::NAN
        }
    }

    /// Whether samples of a row have neighbours within the heights on every side.
    pub fn surrounded(&self, column: i64, end: i64, row: i64) -> bool {
        let window = &self.heights.window;
        column > window.column && end < window.column_end() && row > window.row && row + 1 < window.row_end()
    }

    /// A sample's place in mm and the normal (-z_x, -z_y, 1) there; None without data or neighbours.
    #[inline]
    pub fn sample(&self, column: i64, row: i64) -> Option<(DVec3, DVec3)> {
        let z = self.at(column, row);
        if z.is_nan() {
            return None;
        }
        let zx = slope(self.at(column - 1, row), z, self.at(column + 1, row), self.step_mm)?;
        let zy = slope(self.at(column, row - 1), z, self.at(column, row + 1), self.step_mm)?;
        let place = DVec3::new((column as f64 + 0.5) * self.step_mm, (row as f64 + 0.5) * self.step_mm, z);
        Some((place, DVec3::new(-zx, -zy, 1.0)))
    }
}

#[inline]
fn slope(before: f64, here: f64, after: f64, step_mm: f64) -> Option<f64> {
    match (before.is_nan(), after.is_nan()) {
        (false, false) => Some((after - before) / (2.0 * step_mm)),
        (true, false) => Some((after - here) / step_mm),
        (false, true) => Some((here - before) / step_mm),
        (true, true) => None,
    }
}
