//! What a designed screen does for its audience: the paper's section 5.2.
//!
//! Every cell is the sum of its facets' beams, as designed and from the cell's centre: no raster, cutter or polish
//! stands between. What a cut does to the light is for `light` and `mill` to say.

mod beams;
mod evaluate;
mod gain;
mod misalignment;
mod seats;
mod uniformity;
mod wall;

pub use beams::{Beam, CellLight, Grid, patch};
pub use evaluate::{Claim, Evaluation, FRAGMENT_MM, evaluate};
pub use gain::{Curve, HIGH_GAIN_PEAK, gain_curves, high_gain, high_gain_towards};
pub use misalignment::{Tolerance, misalignment};
pub use seats::{Seat, seats, section, thrown};
pub use uniformity::{AudienceMap, SeatView, audience_map, seat_view};
pub use wall::{Wall, wall};
