//! What is cut beside the surface: a run in air around it, holes and marks in the margin or in the underside, and
//! the slot that takes a tile out of its blank.

mod cut_out;
mod holes;
mod mark;
mod outline;

pub use cut_out::{CutOut, Tab, cut_out};
pub use holes::{Holes, holes};
pub use mark::{Mark, Room, mark};
pub use outline::outline;
