//! Where passes lie: on the controller's grid, on one lattice for all tiles of a part.

use super::{Error, Site};
use crate::cutter::Shape;
use crate::grid::{Heights, Window};
use crate::surface::Surface;

/// The axis that passes run along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    X,
    Y,
}

impl Axis {
    /// The axis of a direction in degrees, 0 or 90.
    pub fn from_deg(direction_deg: f64) -> Result<Axis, Error> {
        if direction_deg == 0.0 || direction_deg == 180.0 {
            Ok(Axis::X)
        } else if direction_deg == 90.0 || direction_deg == 270.0 {
            Ok(Axis::Y)
        } else {
            Err(Error::Direction { direction_deg })
        }
    }

    /// (along, across) of a value per X and Y.
    pub(super) fn split<T: Copy>(self, xy: [T; 2]) -> (T, T) {
        match self {
            Axis::X => (xy[0], xy[1]),
            Axis::Y => (xy[1], xy[0]),
        }
    }

    /// A grid point from its place along and across the passes.
    pub(super) fn point(self, u: i32, v: i32, z: i32) -> [i32; 3] {
        match self {
            Axis::X => [u, v, z],
            Axis::Y => [v, u, z],
        }
    }

    /// Heights of a window that is counted along (columns) and across (rows) the passes.
    pub(super) fn heights(self, surface: &dyn Surface, window: Window) -> Result<Heights, Error> {
        let datum_mm = surface.top_mm();
        match self {
            Axis::X => Ok(surface.heights(window, datum_mm)?),
            Axis::Y => {
                let turned = Window {
                    column: window.row,
                    row: window.column,
                    columns: window.rows,
                    rows: window.columns,
                };
                let from = surface.heights(turned, datum_mm)?;
                let mut z_mm = vec![f32::NAN; window.samples()];
                const BLOCK: usize = 32;
                for row in (0..window.rows).step_by(BLOCK) {
                    for column in (0..window.columns).step_by(BLOCK) {
                        for r in row..(row + BLOCK).min(window.rows) {
                            for c in column..(column + BLOCK).min(window.columns) {
                                z_mm[r * window.columns + c] = from.z_mm[c * window.rows + r];
                            }
                        }
                    }
                }
                Ok(Heights { window, z_mm })
            }
        }
    }
}

/// The cutter locations of an operation: `count` positions along each pass, in whole units of the
/// controller's grid, tile frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    pub along: Axis,
    pub unit_mm: f64,
    /// First position along a pass, in units.
    pub start: i32,
    /// Between positions, in units; never more than a sample step, unless one unit is.
    pub pitch: i32,
    /// Positions of a pass.
    pub count: usize,
    /// Where the passes lie across, in units, rising.
    pub passes: Vec<i32>,
}

impl Layout {
    /// Covers the tile and `overrun_mm` (along, across) beyond it with passes `stepover` units apart.
    pub(super) fn covering(site: &Site, along: Axis, stepover: i32, overrun_mm: [f64; 2]) -> Layout {
        let lattice = site.surface.lattice();
        let unit = site.unit_mm;
        let (length_mm, breadth_mm) = along.split([lattice.width_mm, lattice.height_mm]);
        let (origin_u, origin_v) = along.split(site.origin_mm.map(|o| (o / unit).round() as i64));
        let pitch = ((lattice.step_mm / unit + 1e-9).floor() as i64).max(1);
        let span = |step: i64, origin: i64, length_mm: f64, overrun_mm: f64| {
            let low = (-overrun_mm / unit).round() as i64 + origin;
            let high = ((length_mm + overrun_mm) / unit).round() as i64 + origin;
            (low.div_euclid(step), -((-high).div_euclid(step)))
        };
        let (first, last) = span(pitch, origin_u, length_mm, overrun_mm[0]);
        let (low, high) = span(i64::from(stepover), origin_v, breadth_mm, overrun_mm[1]);
        Layout {
            along,
            unit_mm: unit,
            start: (first * pitch - origin_u) as i32,
            pitch: pitch as i32,
            count: (last - first + 1) as usize,
            passes: (low..=high).map(|k| (k * i64::from(stepover) - origin_v) as i32).collect(),
        }
    }

    /// First position along a pass in mm.
    pub fn start_mm(&self) -> f64 {
        f64::from(self.start) * self.unit_mm
    }

    /// Between positions along a pass in mm.
    pub fn pitch_mm(&self) -> f64 {
        f64::from(self.pitch) * self.unit_mm
    }

    /// Where pass `k` lies across, in mm.
    pub fn across_mm(&self, k: usize) -> f64 {
        f64::from(self.passes[k]) * self.unit_mm
    }

    /// Position `i` of pass `k` in the tile's frame.
    pub(super) fn place_mm(&self, k: usize, i: usize) -> [f64; 2] {
        let [x, y, _] = self.along.point(self.at(i), self.passes[k], 0);
        [f64::from(x) * self.unit_mm, f64::from(y) * self.unit_mm]
    }

    /// Place along a pass of position `i`, in units.
    pub(super) fn at(&self, i: usize) -> i32 {
        self.start + i as i32 * self.pitch
    }
}

/// Radius in mm of the round tip, 0 if there is none.
pub(super) fn tip_radius_mm(shape: &Shape) -> f64 {
    match *shape {
        Shape::Ball { diameter_mm } => 0.5 * diameter_mm,
        Shape::Bull { corner_radius_mm, .. } => corner_radius_mm,
        Shape::Taper { tip_diameter_mm, .. } => 0.5 * tip_diameter_mm,
        Shape::Flat { .. } | Shape::Vee { .. } => 0.0,
    }
}

/// How far from its axis, in mm, a cutter touches a face of this slope.
pub(super) fn contact_radius_mm(shape: &Shape, slope: f64) -> f64 {
    let sin = slope / slope.hypot(1.0);
    let radius = shape.radius_mm();
    match *shape {
        Shape::Ball { .. } => radius * sin,
        Shape::Flat { .. } => radius,
        Shape::Bull { corner_radius_mm, .. } => radius - corner_radius_mm + corner_radius_mm * sin,
        Shape::Vee { included_angle_deg, tip_diameter_mm, .. } => {
            let flank = 1.0 / (0.5 * included_angle_deg).to_radians().tan();
            if slope < flank { 0.5 * tip_diameter_mm } else { radius }
        }
        Shape::Taper { tip_diameter_mm, half_angle_deg, .. } => {
            let flank = 1.0 / half_angle_deg.to_radians().tan();
            if slope < flank { 0.5 * tip_diameter_mm * sin } else { radius }
        }
    }
}
