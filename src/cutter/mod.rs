//! Cutters: a rotary profile as height over radius, and only that.

mod shape;

pub use shape::{ParseError, Shape};
