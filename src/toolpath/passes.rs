//! Where passes lie: on the controller's grid, on one lattice for all tiles of a part.

use super::{Error, Site};
use crate::cutter::Shape;
use crate::grid::{Heights, Window};
use crate::surface::Surface;

/// Positions this part of their distance beside a line still make a line.
const STRAIGHT: f64 = 0.02;

/// A place is on the grid if it is so near to it, in units.
const SAME: f64 = 1e-6;

/// The axis that passes run along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    X,
    Y,
}

impl Axis {
    /// The axis that a direction in degrees is nearest to, and how far across passes go for each step along it.
    pub fn from_deg(direction_deg: f64) -> Result<(Axis, f64), Error> {
        if !direction_deg.is_finite() {
            return Err(Error::Number { name: "direction_deg", value: direction_deg, wanted: "a number" });
        }
        // A pass and its reverse are one.
        let turn = direction_deg.rem_euclid(180.0);
        let turn = if turn > 135.0 { turn - 180.0 } else { turn };
        let (axis, off) = if turn <= 45.0 { (Axis::X, turn) } else { (Axis::Y, 90.0 - turn) };
        Ok((axis, off.to_radians().tan()))
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

    /// Corners of the faces that reach into such a window, with the datum of [`Axis::heights`].
    pub(super) fn outlines(self, surface: &dyn Surface, window: Window) -> Vec<Vec<[f64; 3]>> {
        let step_mm = surface.lattice().step_mm;
        let low = [window.column, window.row].map(|sample| sample as f64 * step_mm);
        let high = [window.column_end(), window.row_end()].map(|sample| sample as f64 * step_mm);
        let turned = |[u, v]: [f64; 2]| match self {
            Axis::X => [u, v],
            Axis::Y => [v, u],
        };
        let datum_mm = surface.top_mm();
        let mut outlines = surface.outlines(turned(low), turned(high));
        for corner in outlines.iter_mut().flatten() {
            let [u, v] = turned([corner[0], corner[1]]);
            *corner = [u, v, corner[2] - datum_mm];
        }
        outlines
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
///
/// ```text
///   across = passes[k] + round(slope (along + origin))         slope in -1 .. 1, 0 along an axis
/// ```
///
/// so passes are one another shifted by whole units, and their positions half a unit from a line at most. Where they
/// lie and where they end is decided by the line, in whole units of the coarsest grid of the job: the same passes for
/// all of its controllers.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    pub along: Axis,
    pub slope: f64,
    pub unit_mm: f64,
    /// First position along a pass, in units.
    pub start: i32,
    /// Between positions, in units along the axis; never more than a sample step, unless one unit is.
    pub pitch: i32,
    /// Positions of a pass.
    pub count: usize,
    /// Where the passes lie across, in units, rising.
    pub passes: Vec<i32>,
    /// Lowest and highest place across of a line that is cut.
    across: [i32; 2],
    /// Between the positions at which a pass may end; a whole number of pitches.
    between_ends: i64,
    /// The tile's corner along the passes, in units.
    origin: i64,
    /// The coarsest unit among the job's controllers, in units.
    coarse: i64,
}

impl Layout {
    /// Covers the tile and `overrun_mm` (along, across) beyond it with passes `stepover` units apart across.
    pub(super) fn covering(
        site: &Site,
        (along, slope): (Axis, f64),
        stepover: i32,
        overrun_mm: [f64; 2],
    ) -> Layout {
        let lattice = site.surface.lattice();
        let unit = site.unit_mm;
        let coarse = ((site.apart_mm / unit).round() as i64).max(1);
        let (length_mm, breadth_mm) = along.split([lattice.width_mm, lattice.height_mm]);
        let coarse_mm = coarse as f64 * unit;
        let (origin_u, origin_v) =
            along.split(site.origin_mm.map(|o| (o / coarse_mm).round() as i64 * coarse));
        let between_ends = ((lattice.step_mm / coarse_mm + 1e-9).floor() as i64).max(1) * coarse;
        let pitch = pitch(between_ends, lattice.step_mm / unit);
        let span = |origin: i64, length_mm: f64, overrun_mm: f64| {
            // Outwards, so that passes of all grids end at the same positions.
            let low = (-overrun_mm / coarse_mm + 1e-6).floor() as i64 * coarse + origin;
            (low, ((length_mm + overrun_mm) / coarse_mm - 1e-6).ceil() as i64 * coarse + origin)
        };
        let (low, high) = span(origin_u, length_mm, overrun_mm[0]);
        let first = low.div_euclid(between_ends) * between_ends;
        let last = -(-high).div_euclid(between_ends) * between_ends;
        let across = span(origin_v, breadth_mm, overrun_mm[1]);
        let risen = [first, last].map(|u| slope * u as f64);
        let passes = [(across.0, risen[0].max(risen[1])), (across.1, risen[0].min(risen[1]))]
            .map(|(end, risen)| (end as f64 - risen) / f64::from(stepover));
        let (lowest, highest) = ((passes[0] + 1e-6).floor() as i64, (passes[1] - 1e-6).ceil() as i64);
        let within = |v: i64| (v - origin_v).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
        Layout {
            along,
            slope,
            unit_mm: unit,
            start: (first - origin_u) as i32,
            pitch: pitch as i32,
            count: ((last - first) / pitch + 1) as usize,
            passes: (lowest..=highest).map(|k| (k * i64::from(stepover) - origin_v) as i32).collect(),
            across: [within(across.0), within(across.1)],
            between_ends,
            origin: origin_u,
            coarse,
        }
    }

    /// The same passes and positions on a grid of which `times` units of this one's make one.
    pub(super) fn on_finer(&self, times: i32, unit_mm: f64) -> Layout {
        let wide = i64::from(times);
        Layout {
            unit_mm,
            start: self.start * times,
            pitch: self.pitch * times,
            passes: self.passes.iter().map(|across| across * times).collect(),
            across: self.across.map(|across| across.saturating_mul(times)),
            between_ends: self.between_ends * wide,
            origin: self.origin * wide,
            coarse: self.coarse * wide,
            ..*self
        }
    }

    /// Place across of pass `k` at a place along it, in units.
    pub(super) fn across(&self, k: usize, along: i32) -> i32 {
        self.passes[k] + (self.slope * (i64::from(along) + self.origin) as f64).round() as i32
    }

    /// Whether position `i` of pass `k` is to be cut: a straight pass wherever it lies, a slanted one between those of
    /// its ends that are inside.
    pub(super) fn covers(&self, k: usize, i: usize) -> bool {
        if self.slope == 0.0 {
            return true;
        }
        let along = i64::from(self.at(i)) + self.origin;
        let before = along.div_euclid(self.between_ends) * self.between_ends;
        let after = -(-along).div_euclid(self.between_ends) * self.between_ends;
        [before, after].into_iter().all(|along| {
            let across = f64::from(self.passes[k]) + self.slope * along as f64;
            let slack = 1e-3 * self.coarse as f64;
            across >= f64::from(self.across[0]) - slack && across <= f64::from(self.across[1]) + slack
        })
    }

    /// The rectangle (along, across) in mm of positions `from ..= to` of some passes; None where none of them is cut.
    pub(super) fn surroundings(
        &self,
        passes: &std::ops::Range<usize>,
        from: usize,
        to: usize,
    ) -> Option<([f64; 2], [f64; 2])> {
        let (u, v) = ([from, to].map(|i| self.at(i)), [passes.start, passes.end - 1]);
        let ends = [(v[0], u[0]), (v[0], u[1]), (v[1], u[0]), (v[1], u[1])].map(|(k, u)| self.across(k, u));
        let (mut low, mut high) = (ends.into_iter().min()?, ends.into_iter().max()?);
        if self.slope != 0.0 {
            (low, high) = (low.max(self.across[0] - 1), high.min(self.across[1] + 1));
        }
        let mm = |units: i32| f64::from(units) * self.unit_mm;
        (low <= high).then(|| ([mm(u[0]), mm(low)], [mm(u[1]), mm(high)]))
    }

    /// Between positions along a pass in mm, as the cutter goes.
    pub(super) fn length_mm(&self) -> f64 {
        self.pitch_mm() * self.slope.hypot(1.0)
    }

    /// The grid points next to position `i` of pass `k`: where they lie across, and how far from the line, -1 .. 0 and
    /// 0 .. 1, in units.
    pub(super) fn points(&self, k: usize, i: usize) -> [(i32, f64); 2] {
        let risen = self.slope * (i64::from(self.at(i)) + self.origin) as f64;
        // What is on the grid but for the noise of the product has its point below it.
        let below = (risen + SAME).floor();
        [below, below + 1.0].map(|point| (self.passes[k] + point as i32, point - risen))
    }

    /// Whether the grid meets the passes at all of their positions, but for what no move has to be bent for.
    pub(super) fn on_grid(&self) -> bool {
        self.aside_mm() <= STRAIGHT * self.pitch_mm()
    }

    /// How far a move, whose ends are on the grid, passes the line between them, in mm.
    pub(super) fn aside_mm(&self) -> f64 {
        let off = |i: usize| {
            let risen = self.slope * (i64::from(self.at(i)) + self.origin) as f64;
            (risen - risen.round()).abs()
        };
        // One pass is as good as any: they lie whole units apart.
        (0..self.count).map(off).fold(0.0, f64::max) * self.unit_mm
    }

    /// Between passes in mm, as the cutter meets them.
    pub(super) fn stepover_mm(&self) -> Option<f64> {
        let [first, second, ..] = self.passes[..] else { return None };
        Some(f64::from(second - first) * self.unit_mm / self.slope.hypot(1.0))
    }

    /// Position `i` on the line of pass `k`, along and across in mm.
    pub(super) fn turned_mm(&self, k: usize, i: usize) -> [f64; 2] {
        self.line_mm(k, self.at(i))
    }

    /// The line of pass `k` at a place along it in units, along and across in mm.
    pub(super) fn line_mm(&self, k: usize, along: i32) -> [f64; 2] {
        let risen = self.slope * (i64::from(along) + self.origin) as f64;
        [f64::from(along), f64::from(self.passes[k]) + risen].map(|units| units * self.unit_mm)
    }

    /// First position along a pass in mm.
    pub fn start_mm(&self) -> f64 {
        f64::from(self.start) * self.unit_mm
    }

    /// Between positions along a pass in mm.
    pub fn pitch_mm(&self) -> f64 {
        f64::from(self.pitch) * self.unit_mm
    }

    /// Where pass `k` lies across, in mm; a slanted one at the origin's along.
    pub fn across_mm(&self, k: usize) -> f64 {
        f64::from(self.passes[k]) * self.unit_mm
    }

    /// Position `i` on the line of pass `k` in the tile's frame.
    pub(super) fn place_mm(&self, k: usize, i: usize) -> [f64; 2] {
        let [along_mm, across_mm] = self.turned_mm(k, i);
        match self.along {
            Axis::X => [along_mm, across_mm],
            Axis::Y => [across_mm, along_mm],
        }
    }

    /// Place along a pass of position `i`, in units.
    pub(super) fn at(&self, i: usize) -> i32 {
        self.start + i as i32 * self.pitch
    }
}

/// The longest distance between positions, in units, that is no longer than a step and goes into `between_ends`; a unit
/// at least.
fn pitch(between_ends: i64, step: f64) -> i64 {
    let least = (between_ends as f64 / step - 1e-9).ceil().max(1.0) as i64;
    (least..between_ends).find(|parts| between_ends % parts == 0).map_or(1, |parts| between_ends / parts)
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
