//! Half vector, Fresnel reflectance, microfacet lobe, solid angles and gain: pure light, no machining.

mod fresnel;
mod lobe;
mod solid_angle;

pub use fresnel::{ComplexIndex, Reflectance, Series};
pub use lobe::Lobe;
pub use solid_angle::{even_gain, projected_solid_angle};

use glam::DVec3;

/// The normal of a mirror that sends light from direction `i` to direction `o` (both unit vectors
/// pointing away from the mirror). NaN where `o` = -`i`.
pub fn half_vector(i: DVec3, o: DVec3) -> DVec3 {
    (o + i).normalize()
}
