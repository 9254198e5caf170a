//! Dilation by the cutter, closing and residual on sampled heights.
//!
//! ```text
//!   CL(x)      = max over |d| <= R of h(x + d) + s(d)       lowest z of the cutter that touches h
//!   closing(x) = min over |d| <= R of CL(x + d) - s(d)      what the cutter leaves at best
//!   residual   = closing - h >= 0                           what no position of it can remove
//! ```
//!
//! with s(d) = -height of the cutter's profile at |d|, tabulated in f32 from f64. Every function
//! here gives the bits of the naive double loop over these definitions in f32, whatever the
//! thread count, the tiling or the processor: (max, +) on the same values does not depend on
//! order, and samples are left out only where a neighbour is proved to stand higher.
//!
//! Heights are mm above a datum near the surface, so that f32 keeps nanometres; NaN and infinite
//! samples are no data. Outside a window there is no data: pass windows grown by
//! [`Profile::reach`] (twice that for a closing).

mod ball;
mod band;
mod blocks;
mod bounded;
mod boxes;
mod brute;
mod bundle;
mod chains;
mod chord;
mod closing;
mod cones;
mod contact;
mod drop;
mod edges;
mod facets;
mod feed;
mod field;
mod flank;
mod folded;
mod held;
mod interval;
mod lanes;
mod listed;
mod marked;
mod meridian;
mod outlet;
mod pairs;
mod passes;
mod patches;
mod places;
mod profile;
mod ridges;
mod rim;
mod rolling;
mod runs;
mod search;
mod slopes;
mod stencil;
mod stream;
mod strips;
mod sweep;
mod tables;
mod tiles;
mod touch;
mod unboxed;
mod way;
mod weld;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use band::{Band, OutOfReach, Wanted};
pub use closing::{CAVITY_MM, Closings, closing, residual};
pub use drop::{Faces, lift};
pub use facets::Facets;
pub use marked::Marked;
pub use passes::{RowPass, RowTarget, machined_by_rows, points, row, rows, rows_by};
pub use places::Places;
pub use profile::Profile;
pub use stream::{stream, stream_bytes};
pub use tables::Tables;
#[doc(hidden)]
pub use tiles::cutter_location_by;
pub use tiles::{cutter_location, cutter_location_rows, cutter_location_rows_into, erode};
#[doc(hidden)]
pub use way::Way;

/// Why a compensation was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    #[error("a pitch of {step_mm} mm is no length; hint: 0.01 is the usual pitch")]
    Step { step_mm: f64 },
    #[error("a lateral allowance of {allowance_mm} mm is no length; hint: 0 or more")]
    Allowance { allowance_mm: f64 },
    #[error(
        "cutter {cutter} has a radius of {radius_mm} mm, less than one sample of {step_mm} mm; hint: a finer --step-mm"
    )]
    SmallerThanSample { cutter: String, radius_mm: f64, step_mm: f64 },
    #[error(
        "cutter {cutter} spans {samples:.0} samples of {step_mm} mm from its axis, {most} at most can be tabulated; hint: a step of {hint_mm:.4} mm or more"
    )]
    TooManySamples { cutter: String, samples: f64, most: f64, step_mm: f64, hint_mm: f64 },
    #[error("every {every} rows: there is no such row; hint: 1 is every row")]
    Every { every: usize },
    #[error(
        "every {every} rows of {step_mm} mm leave strips that cutter {cutter} with a radius of {radius_mm} mm does not touch; hint: --every {most} at most"
    )]
    Strips { every: usize, step_mm: f64, cutter: String, radius_mm: f64, most: usize },
    #[error(
        "{columns} columns under cutter {cutter} take {needed_gb:.1} GB of memory a band, {there_gb:.1} GB are free; hint: a coarser --step-mm or a part of the file"
    )]
    Memory { columns: usize, cutter: String, needed_gb: f64, there_gb: f64 },
    #[error(
        "none of the {samples} samples has data; hint: a finer --step-mm, or is the part seen from its side?"
    )]
    NoData { samples: usize },
}
