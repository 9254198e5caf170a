//! From a scene to designed cells: the paper's sections 3 and 4.
//!
//! The paper is Piovarci, Wessely, Jagielski, Alexa, Matusik and Didyk, "Design and Analysis of
//! Directional Front Projection Screens". Scenes are in metres, cells in mm.

mod audience;
mod calibration;
mod container;
mod damped;
mod design;
mod directions;
mod elevation;
mod error;
mod facets;
mod laplacian;
mod limits;
mod make;
mod microgeometry;
mod opening;
mod owned;
mod pieces;
mod power;
mod repair;
mod rows;
mod scene;
mod sight;
mod silhouette;
mod solid;
mod stitching;
mod top;

pub use audience::{HalfSpace, Polyhedron, View};
pub use calibration::{Calibration, Figures, base_gradient, calibrate, projected_sr};
pub use container::{ContainerError, DesignWriter};
pub use design::{Cell, CellRange, Design, Facet, FacetPolygon, Frame, Profile, Seam};
pub use directions::{Directions, MOST_SAMPLES, directions};
pub use elevation::{Elevation, elevation};
pub use error::Error;
pub use facets::{Grazing, Wanted, facets};
pub use limits::{Acuity, Field, Margins, Plane, Worst, acuity, limits};
pub use make::{design, design_streamed, frame};
pub use microgeometry::{NotConverged, Solution, Workspace, solve};
pub use opening::Opening;
pub use scene::{AreaRule, ElevationMethod, Microgeometry, Reflector, Scene};
pub use silhouette::Silhouette;
pub use solid::{SolidError, SolidWriter};
pub use stitching::{AreaError, Stitching};
