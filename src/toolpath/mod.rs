//! Roughing, parallel finishing and the links between passes, on the controller's own grid.

/// How a move is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Fastest travel, never in X or Y below the stock's top.
    Rapid,
    /// Straight down into material at the plunge feed.
    Plunge,
    /// Cutting, at the operation's feed.
    Cut,
}

/// A point of the program frame in whole units of the controller's grid.
pub type GridPoint = [i32; 3];

/// A straight move from where the cutter stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Move {
    pub kind: Kind,
    pub to: GridPoint,
}

/// One operation's path in the program frame of its tile. `moves[0]` is a rapid that names X and Y at
/// the clearance plane; `pass_starts` are indices of the moves with which a pass begins, each
/// reached by a rapid above the stock.
#[derive(Clone, Debug, Default)]
pub struct Toolpath {
    /// mm per grid unit: 0.01 for RML-1, 0.0001 for LinuxCNC.
    pub unit_mm: f64,
    pub moves: Vec<Move>,
    pub pass_starts: Vec<usize>,
}
