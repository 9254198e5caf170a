//! From a scene to designed cells: the paper's sections 3 and 4.

mod design;

pub use design::{Cell, CellRange, Design, Facet, Profile, Seam};
