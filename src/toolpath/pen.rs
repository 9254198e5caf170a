//! Writes moves: what rises, travels and descends between passes.

use super::{GridPoint, Kind, Move, Site, Toolpath};

/// Rapids stop this far above what may stand below them, in mm.
const APPROACH_MM: f64 = 0.5;

pub(super) struct Pen {
    path: Toolpath,
    at: Option<GridPoint>,
    clearance: i32,
    top: i32,
    approach: i32,
}

impl Pen {
    pub(super) fn new(site: &Site) -> Pen {
        Pen {
            path: Toolpath { unit_mm: site.unit_mm, ..Toolpath::default() },
            at: None,
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
        if let Some(at) = self.at {
            self.go(Kind::Rapid, [at[0], at[1], self.clearance]);
        }
        self.path.pass_starts.push(self.path.moves.len());
        // Named even if the cutter stands there already: a program may start again here.
        let over = [to[0], to[1], self.clearance];
        self.path.moves.push(Move { kind: Kind::Rapid, to: over });
        self.at = Some(over);
        let approach = (cleared.min(self.top) + self.approach).min(self.clearance).max(to[2]);
        self.go(Kind::Rapid, [to[0], to[1], approach]);
        self.go(Kind::Plunge, to);
    }

    /// A straight cut; straight down it is a plunge.
    pub(super) fn cut(&mut self, to: GridPoint) {
        let down = self.at.is_some_and(|at| at[0] == to[0] && at[1] == to[1] && to[2] < at[2]);
        self.go(if down { Kind::Plunge } else { Kind::Cut }, to);
    }

    fn go(&mut self, kind: Kind, to: GridPoint) {
        if self.at != Some(to) {
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
