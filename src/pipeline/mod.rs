//! The whole flow, from a job to a judged set of programs.
//!
//! ```text
//! job -> shop (machine, tools) -> part -> tiles -> for each tile and post: plan, write, read back
//!                                              -> for each tile: judge block by block, maps, cavities
//!                                              -> report
//! ```
//!
//! Everything is written under a staging folder that the caller renames when all of it stands.

mod beside;
mod check;
mod cut;
mod error;
mod estimate;
mod judge;
mod levelled;
mod light;
mod machine_calibration;
mod maps;
mod measure;
mod pages;
mod part;
mod plan;
mod press;
mod relit;
mod remarks;
mod report;
mod rescue;
mod share;
mod sheet;
mod shop;
mod tabs;
mod underside;

pub use check::{Checked, Look, Reach, StandardError, check};
pub use cut::{Milled, mill};
pub use error::Error;
pub use estimate::{Estimated, estimate};
pub use light::room_picture;
pub use machine_calibration::{
    Calibrated, Error as CalibrationError, Measured, calibrate as calibrate_machine,
    programs as programs_to_measure,
};
pub use relit::{Lit, Relit, relit};

/// Part of the area that has to lie within `limits.deviation_mm`.
const WITHIN: f64 = 0.99;
