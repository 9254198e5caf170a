//! screenmill turns designed directional-screen tiles, meshes and height images into proved
//! 3-axis programs for engravers and small mills.
//!
//! ```text
//! scene -> facets -> microgeometry -> elevation -> tile        screen
//!   or mesh, height image                                      surface
//! -> heightfield at 10 um                                      surface
//! -> cutter-location surface, closing, residual                compensation
//! -> machine-volume tiles, stock, fixture, WCS                 machine
//! -> roughing, finishing, links                                toolpath
//! -> program text                                              post
//! -> read the text back, sweep the cutter                      verify
//! -> deviation, cavities                                       fidelity
//! -> report.json, maps, pages                                  report
//! ```
//!
//! Lengths are millimetres, feeds mm/min, times seconds, spindle speeds rpm; a scene is in
//! metres. The frame is drawn in [`grid`].

// Surfaces of tests/ are those of unit tests too.
#[cfg(test)]
extern crate self as screenmill;

pub mod catalogue;
pub mod cutter;
pub mod grid;
pub mod in_order;
pub mod memory;
pub mod optics;
pub mod progress;
pub mod settings;
pub mod tolerance;
pub mod whole;

pub mod screen;

pub mod surface;

pub mod compensation;

pub mod machine;

pub mod toolpath;

pub mod post;

pub mod resume;
pub mod verify;

pub mod fidelity;

pub mod evaluation;

pub mod report;

pub mod job;

pub mod pipeline;
