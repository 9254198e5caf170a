//! What the cut is against the design: deviation, gouge, cavities.
pub mod light;
