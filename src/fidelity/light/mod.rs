//! Where the projector's light goes: every sample of a heightfield as a small mirror in front of the audience.
//!
//! A sample of projected area dA with surface normal N = (-z_x, -z_y, 1) takes E (i . N) dA of the light, unless
//! the surface stands in the projector's way. What the metal reflects leaves in one direction (a rough metal's is
//! drawn from its lobe), and that ray meets the surface again, the audience, or neither. Normals are central
//! differences at the raster step, for the design and for the cut alike.

mod ground;
mod known;
mod lit;
mod metal;
mod planes;
mod relief;
mod row;
mod tally;
mod view;

pub use known::Known;
pub use metal::Metal;
pub(crate) use metal::draw;
pub use planes::{Plane, planes};
pub use relief::{End, Relief};
pub use tally::{LightTally, ROOM_BINS, Shares};
pub use view::View;

use glam::{DMat3, DVec3};

use crate::screen::{Polyhedron, Silhouette};

/// Where a tile stands: screen point in metres = origin + rotation . p / 1000, p in mm of the tile's frame.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    pub origin_m: DVec3,
    pub rotation: DMat3,
}

impl Pose {
    /// A point of the tile's frame in the screen's.
    pub fn point_m(&self, p_mm: DVec3) -> DVec3 {
        self.origin_m + self.rotation * p_mm * 1e-3
    }
}

/// The room that the light is judged in.
#[derive(Clone, Copy)]
pub struct Room<'a> {
    pub projector_m: DVec3,
    pub audience: &'a [Polyhedron],
    pub metal: Metal,
    /// Steepest face of the surface: past what is given of it, a ray that leaves steeper than this is free.
    pub steepest: f64,
    pub far_field: Option<&'a Centres>,
}

/// Cells' centres in the tile's frame: in the far field light arrives at, and leaves from, the centre of a
/// cell, so that only directions count.
#[derive(Clone, Debug)]
pub struct Centres {
    pub cell_mm: f64,
    pub columns: usize,
    /// By row, then column, lowest y first.
    pub z_mm: Vec<f64>,
}

impl Centres {
    /// The centre of the cell at a place, in mm; the nearest cell's for one outside.
    #[inline]
    pub fn near(&self, x_mm: f64, y_mm: f64) -> DVec3 {
        let rows = self.z_mm.len() / self.columns;
        let index = |mm: f64, count: usize| ((mm / self.cell_mm).max(0.0) as usize).min(count - 1);
        let (column, row) = (index(x_mm, self.columns), index(y_mm, rows));
        DVec3::new(
            (column as f64 + 0.5) * self.cell_mm,
            (row as f64 + 0.5) * self.cell_mm,
            self.z_mm[row * self.columns + column],
        )
    }
}

/// The room as a piece of a tile sees it, in the tile's frame and metres from a point of it.
pub(crate) struct Stage<'a> {
    middle_mm: DVec3,
    rotation: DMat3,
    projector_m: DVec3,
    silhouette: Silhouette,
    metal: Metal,
    far_field: Option<&'a Centres>,
}

impl<'a> Stage<'a> {
    /// For places of the tile up to `within_mm` from `middle_mm`.
    pub fn new(room: &Room<'a>, pose: &Pose, middle_mm: DVec3, within_mm: f64) -> Stage<'a> {
        let cell_mm = room.far_field.map_or(0.0, |centres| 2.0 * centres.cell_mm);
        let middle_m = pose.point_m(middle_mm);
        Stage {
            middle_mm,
            rotation: pose.rotation,
            projector_m: pose.rotation.transpose() * (room.projector_m - middle_m),
            silhouette: Silhouette::new(room.audience, middle_m, 1e-3 * (within_mm + cell_mm), pose.rotation),
            metal: room.metal,
            far_field: room.far_field,
        }
    }

    /// Where light is taken to arrive and leave for a point of the tile, in m from the middle.
    #[inline]
    fn place_m(&self, p_mm: DVec3) -> DVec3 {
        let at = self.far_field.map_or(p_mm, |centres| centres.near(p_mm.x, p_mm.y));
        (at - self.middle_mm) * 1e-3
    }
}

/// An upright cube that stands for an audience.
#[cfg(test)]
fn body(centre: DVec3, half: f64) -> Polyhedron {
    let corners: Vec<DVec3> = (0..8)
        .map(|k| {
            let side = |bit: i32| if k & bit == 0 { -half } else { half };
            centre + DVec3::new(side(1), side(2), side(4))
        })
        .collect();
    Polyhedron::hull("body", &corners).expect("a solid")
}
