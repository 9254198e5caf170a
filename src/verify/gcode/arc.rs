//! Arcs as chords.

use super::super::error::{Error, Place};

/// How far a chord may stand off its arc.
const CHORD_MM: f64 = 1e-4;

/// An arc about an axis of the frame, possibly a helix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    /// The plane's first and second axis, and the one along which a helix climbs.
    axes: [usize; 3],
    centre: [f64; 2],
    start: [f64; 3],
    end: [f64; 3],
    radius: [f64; 2],
    angle: f64,
    sweep: f64,
    pub chords: u32,
}

impl Arc {
    /// The axes of G17, G18 or G19, so that turning from the first to the second is counterclockwise
    /// seen from the end of the third.
    pub fn axes(plane: u16) -> [usize; 3] {
        match plane {
            180 => [2, 0, 1],
            190 => [1, 2, 0],
            _ => [0, 1, 2],
        }
    }

    /// The arc about a centre in mm. The rule for radii that differ is Grbl's: refused past 0.5 mm, or
    /// past 0.005 mm and a thousandth.
    pub fn about(
        axes: [usize; 3],
        start: [f64; 3],
        end: [f64; 3],
        centre: [f64; 2],
        counterclockwise: bool,
        turns: u32,
        at: Place,
    ) -> Result<Arc, Error> {
        let from = [start[axes[0]] - centre[0], start[axes[1]] - centre[1]];
        let to = [end[axes[0]] - centre[0], end[axes[1]] - centre[1]];
        let radius = [from[0].hypot(from[1]), to[0].hypot(to[1])];
        let off = (radius[0] - radius[1]).abs();
        if off > 0.5 || (off > 0.005 && off > 0.001 * radius[0]) || radius[0] < 1e-6 {
            return Err(Error::ArcRadius { at, start_mm: radius[0], end_mm: radius[1] });
        }
        let full = std::f64::consts::TAU;
        let angle = from[1].atan2(from[0]);
        let mut sweep = to[1].atan2(to[0]) - angle;
        // The same point again is a whole turn; text rounds, so "the same" has a width.
        if counterclockwise {
            if sweep <= 1e-9 {
                sweep += full;
            }
            sweep += full * f64::from(turns - 1);
        } else {
            if sweep >= -1e-9 {
                sweep -= full;
            }
            sweep -= full * f64::from(turns - 1);
        }
        let larger = radius[0].max(radius[1]);
        let step = 2.0 * (1.0 - (CHORD_MM / larger).min(1.0)).acos();
        let chords = (sweep.abs() / step).ceil().clamp(1.0, 1e8) as u32;
        Ok(Arc { axes, centre, start, end, radius, angle, sweep, chords })
    }

    /// The arc of a radius in mm; a negative one takes the longer way round.
    pub fn of_radius(
        axes: [usize; 3],
        start: [f64; 3],
        end: [f64; 3],
        radius_mm: f64,
        counterclockwise: bool,
        at: Place,
    ) -> Result<Arc, Error> {
        let d = [end[axes[0]] - start[axes[0]], end[axes[1]] - start[axes[1]]];
        let apart = d[0].hypot(d[1]);
        let radius = radius_mm.abs();
        // A half circle's radius is rounded in the text.
        if apart < 1e-9 || radius < 1e-6 || apart > 2.0 * radius + 0.005 {
            return Err(Error::ArcReach { at, radius_mm, apart_mm: apart });
        }
        let off = (radius * radius - 0.25 * apart * apart).max(0.0).sqrt();
        let side = if counterclockwise == (radius_mm > 0.0) { 1.0 } else { -1.0 };
        let centre = [
            start[axes[0]] + 0.5 * d[0] - side * off * d[1] / apart,
            start[axes[1]] + 0.5 * d[1] + side * off * d[0] / apart,
        ];
        Arc::about(axes, start, end, centre, counterclockwise, 1, at)
    }

    pub fn radius_mm(&self) -> f64 {
        self.radius[0]
    }

    /// The end of chord `index`, counted from 1.
    pub fn point(&self, index: u32) -> [f64; 3] {
        if index >= self.chords {
            return self.end;
        }
        let part = f64::from(index) / f64::from(self.chords);
        let radius = self.radius[0] + (self.radius[1] - self.radius[0]) * part;
        let (sin, cos) = (self.angle + self.sweep * part).sin_cos();
        let mut point = [0.0; 3];
        point[self.axes[0]] = self.centre[0] + radius * cos;
        point[self.axes[1]] = self.centre[1] + radius * sin;
        let (low, high) = (self.start[self.axes[2]], self.end[self.axes[2]]);
        point[self.axes[2]] = low + (high - low) * part;
        point
    }
}
