//! Machines, fixtures, tools, and the split of a part into what a machine can hold.

mod collision;
mod error;
mod fixture;
mod profile;
mod setup;
mod spindle;
mod split;
mod tool;

pub use collision::{Guard, Met};
pub use error::Error;
pub use fixture::{Border, Clamp, Fixture, KeepOut, Side};
pub use profile::{Coolant, Corner, Machine, Motion, PerAxis, Rate, Spindle, SpindleLaw, Transfer, Travel};
pub use setup::{Bounds, Obstacle, Setup};
pub use spindle::SpindleSetting;
pub use split::{Blanks, Quantum, Stock, Tile, ZNeed, fits_z, floor_mm, split, split_to_fit};
pub use tool::{Body, Cylinder, Library, Tool};
