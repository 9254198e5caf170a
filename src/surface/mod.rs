//! What is to be cut: a designed tile, a mesh or a height image, as a heightfield that any window
//! of can be asked for.

use crate::grid::{Heights, Lattice, Window};

/// A surface that is a single height over every point of a rectangle.
///
/// `z_mm` is the source's own z. The part frame's z = 0 is [`Surface::top_mm`].
pub trait Surface: Send + Sync {
    /// Size and samples, fixed for the life of the surface.
    fn lattice(&self) -> Lattice;

    /// Highest point of the surface itself (a vertex, not a sample), in the source's z.
    fn top_mm(&self) -> f64;

    /// Lowest point of the surface itself, in the source's z.
    fn bottom_mm(&self) -> f64;

    /// The steepest |dz/dx| and |dz/dy| of the surface's faces; vertical walls and steps are not
    /// faces. It sets the stepover of a scallop and how far a cutter runs past an open edge.
    fn steepest(&self) -> [f64; 2];

    /// Heights of the samples in `window` less `datum_mm`, subtracted in double precision so that
    /// a single float keeps its nanometres on a part that stands at 40 mm. Samples outside the
    /// part, and holes in it, are NaN. The same sample gets the same bits whatever the window.
    fn heights(&self, window: Window, datum_mm: f64) -> Result<Heights, Error>;
}

/// Why a surface was refused.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{path}: {source}")]
    Io { path: String, source: std::io::Error },
}
