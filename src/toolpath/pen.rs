//! Writes moves: what rises, travels and descends between passes.

use super::{GridPoint, Kind, Move, Retract, Site, Toolpath};

/// Rapids stop this far above what may stand below them, in mm.
pub const APPROACH_MM: f64 = 0.5;

/// After a peck the cutter comes down to this far above the hole's bottom, in mm.
const PECK_MM: f64 = 0.1;

/// A link on the retract plane keeps this far from clamps, in mm.
const SPARE_MM: f64 = 1.0;

/// Every so many passes begin on the clearance plane whatever stands, so that the program can start again there.
const RESTART_PASSES: usize = 50;

pub(super) struct Pen<'a> {
    path: Toolpath,
    at: Option<GridPoint>,
    begun: usize,
    /// Length cut since the last pass that began on the clearance plane, in units.
    cut: f64,
    clearance: i32,
    /// A lower plane in units, where there is one.
    retract: Option<(i32, Retract<'a>)>,
    /// The program's zero above the stock's top, in mm.
    zero_mm: f64,
    top: i32,
    approach: i32,
}

impl<'a> Pen<'a> {
    pub(super) fn new(site: &Site<'a>) -> Pen<'a> {
        Pen {
            path: Toolpath { unit_mm: site.unit_mm, ..Toolpath::default() },
            at: None,
            begun: 0,
            cut: 0.0,
            retract: site
                .retract
                .map(|plane| (site.unit_above(site.top_allowance_mm + plane.above_mm), plane)),
            zero_mm: site.z_zero_mm - site.top_allowance_mm,
            clearance: site.unit_above(site.top_allowance_mm + site.clearance_mm),
            top: site.unit_above(site.top_allowance_mm),
            approach: (APPROACH_MM / site.unit_mm).ceil() as i32,
        }
    }

    /// The stock's top in units.
    pub(super) fn top(&self) -> i32 {
        self.top
    }

    /// Retracts, travels to above `to` and comes down to it. `cleared` is the height in units up to which
    /// nothing stands there.
    pub(super) fn begin(&mut self, to: GridPoint, cleared: i32) {
        let plane = self.plane(to);
        if let Some(at) = self.at {
            self.go(Kind::Rapid, [at[0], at[1], plane]);
        }
        if plane == self.clearance {
            self.path.pass_starts.push(self.path.moves.len());
            self.cut = 0.0;
        }
        self.begun += 1;
        // Named even if the cutter stands there already: a program may start again here.
        let over = [to[0], to[1], plane];
        self.path.moves.push(Move { kind: Kind::Rapid, to: over });
        self.at = Some(over);
        let approach = (cleared.min(self.top) + self.approach).min(plane).max(to[2]);
        self.go(Kind::Rapid, [to[0], to[1], approach]);
        self.go(Kind::Plunge, to);
    }

    /// The plane in units for the way from where the cutter stands to above `to`: the lowest on which no part of the
    /// tool comes near what stands in the way.
    fn plane(&self, to: GridPoint) -> i32 {
        let (Some(at), Some((retract, plane))) = (self.at, self.retract) else { return self.clearance };
        let far = self.cut * self.path.unit_mm > plane.restart_mm;
        if far || self.begun.is_multiple_of(RESTART_PASSES) {
            return self.clearance;
        }
        let place = |p: GridPoint| {
            let [x, y, z] = [p[0], p[1], retract].map(|units| f64::from(units) * self.path.unit_mm);
            [x, y, z + self.zero_mm]
        };
        let near = plane.guard.meets(place(at), place(to), SPARE_MM);
        if near { self.clearance } else { retract.min(self.clearance) }
    }

    /// Straight up to above what stood here, to clear the chips, and down again to just above where the cutter was.
    pub(super) fn peck(&mut self) {
        let Some(at) = self.at else { return };
        self.go(Kind::Rapid, [at[0], at[1], self.top + self.approach]);
        let gap = ((PECK_MM * f64::from(self.approach) / APPROACH_MM).ceil() as i32).max(1);
        self.go(Kind::Rapid, [at[0], at[1], (at[2] + gap).min(self.top + self.approach)]);
    }

    /// A straight cut; straight down it is a plunge.
    pub(super) fn cut(&mut self, to: GridPoint) {
        let down = self.at.is_some_and(|at| at[0] == to[0] && at[1] == to[1] && to[2] < at[2]);
        self.go(if down { Kind::Plunge } else { Kind::Cut }, to);
    }

    fn go(&mut self, kind: Kind, to: GridPoint) {
        if self.at != Some(to) {
            if let Some(at) = self.at
                && kind != Kind::Rapid
            {
                let square: f64 =
                    (0..3).map(|axis| f64::from(to[axis]) - f64::from(at[axis])).map(|d| d * d).sum();
                self.cut += square.sqrt();
            }
            self.path.moves.push(Move { kind, to });
            self.at = Some(to);
        }
    }

    /// The path, ending on the clearance plane.
    pub(super) fn finish(mut self) -> Toolpath {
        if let Some(at) = self.at {
            self.go(Kind::Rapid, [at[0], at[1], self.clearance]);
        }
        self.path
    }
}
