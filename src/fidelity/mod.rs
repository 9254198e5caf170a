//! What the cut is against the design: deviation, gouge, cavities.
