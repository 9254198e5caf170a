//! Half vector, Fresnel reflectance: pure light, no machining.
