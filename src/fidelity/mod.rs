//! What the cut is against the design: deviation, gouge, cavities, light.
//!
//! [`Tally`] counts and [`Cavities`] joins block by block, so that no layer of a tile is ever held; both give the
//! same bits however a tile is cut into blocks.

mod bound;
pub mod cavities;
mod histogram;
pub mod light;
mod normals;
mod offsets;
mod outline;
mod pixels;
pub mod polish;
mod rounding;
mod tally;

pub use bound::{Lower, Peaks};
pub use cavities::{Cavities, Cavity, Found};
pub use histogram::Histogram;
pub use outline::Outline;
pub use pixels::Pixels;
pub use tally::{ByCause, CAVITY_THRESHOLD_MM, Figures, Layers, Params, Place, Tally};

use crate::grid::Window;

/// Why surfaces could not be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    #[error(
        "the {layer} surface has columns {}..{} and rows {}..{}, the block to judge columns {}..{} and rows {}..{}; \
         hint: both surfaces must be of the same part at the same step",
        has.column, has.column_end(), has.row, has.row_end(),
        needs.column, needs.column_end(), needs.row, needs.row_end()
    )]
    Uncovered { layer: &'static str, has: Window, needs: Window },
    #[error(
        "a block at column {column}, row {row} was given where column {wanted_column}, row {wanted_row} is next; \
         hint: blocks come row by row, lowest y first, all of one row equally high"
    )]
    Order { column: i64, row: i64, wanted_column: i64, wanted_row: i64 },
}
