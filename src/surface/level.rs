//! Levelling: a rigid rotation that makes the best-fit plane of a part horizontal.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::mesh::Triangles;
use super::{Designed, Error, Mesh};
use crate::screen::CellRange;

/// More than this is not a wedge but a part on its side.
const MOST_TILT_DEG: f64 = 60.0;

/// A part turned level. Point p of the source (x and y from its lower left corner, z as it came)
/// stands at rotation * p + shift.
pub struct Level {
    /// The turned faces. Its rectangle is the turned outline's bounding box; samples of it outside
    /// the outline are NaN.
    pub surface: Mesh,
    /// Rx(about_x) Ry(about_y), rows first; its transpose puts every normal back.
    pub rotation: [[f64; 3]; 3],
    /// Along x and y only: z turns about the source's own origin.
    pub shift_mm: [f64; 3],
    /// Wedge angles, right-handed: the part is turned about Y first, then about X.
    pub about_x_deg: f64,
    pub about_y_deg: f64,
    /// Faces and step walls that lean over after the turn and that no vertical cutter reaches.
    pub undercuts: usize,
    /// Their area as seen from below.
    pub undercut_area_mm2: f64,
}

type Triangle = [[f64; 3]; 3];

impl Level {
    pub(super) fn of_design(designed: &Designed) -> Result<Level, Error> {
        let CellRange { c0, r0, c1, r1 } = designed.material();
        let cells: Vec<(i32, i32)> = (r0..r1).flat_map(|row| (c0..c1).map(move |c| (c, row))).collect();
        let faces: Vec<Triangle> = cells
            .par_iter()
            .flat_map_iter(|&(column, row)| designed.faces(column, row))
            .flat_map_iter(|face| fan(&face.outline_mm))
            .collect();
        let rotation = rotation(&faces)?;
        let walls = designed.walls();
        let mut under = Undercuts::default();
        for t in &faces {
            under.see(t, &rotation, turned_normal(t, &rotation).z);
        }
        for (t, normal) in &walls {
            under.see(t, &rotation, (rotation * DVec3::new(normal[0], normal[1], 0.0)).z);
        }
        let all = faces.into_iter().chain(walls.into_iter().map(|(t, _)| t)).collect();
        Level::turn(all, rotation, under, designed.lattice.step_mm)
    }

    pub(super) fn of_mesh(mesh: &Mesh) -> Result<Level, Error> {
        let all: Vec<Triangle> = (0..mesh.triangles()).map(|index| mesh.triangle(index)).collect();
        // From above a solid is its upward faces; base and walls have no say in the plane.
        let up = |t: &&Triangle| turned_normal(t, &DMat3::IDENTITY).z * mesh.outward > 0.0;
        let faces: Vec<Triangle> = all.iter().filter(up).copied().collect();
        let rotation = rotation(&faces)?;
        let mut under = Undercuts::default();
        for t in &all {
            let before = turned_normal(t, &DMat3::IDENTITY) * mesh.outward;
            // What already looked down is the source's own doing.
            if before.z >= -1e-12 * before.length() {
                under.see(t, &rotation, (rotation * before).z);
            }
        }
        let step_mm = super::Surface::lattice(mesh).step_mm;
        Level::turn(all, rotation, under, step_mm)
    }

    fn turn(mut all: Vec<Triangle>, rotation: DMat3, under: Undercuts, step_mm: f64) -> Result<Level, Error> {
        let mut low = DVec3::INFINITY;
        for corner in all.iter_mut().flatten() {
            let p = rotation * DVec3::from(*corner);
            low = low.min(p);
            *corner = p.to_array();
        }
        for corner in all.iter_mut().flatten() {
            corner[0] -= low.x;
            corner[1] -= low.y;
        }
        let surface = Mesh::new(Triangles::Double(all), step_mm, "levelled part", 'z')?;
        let rows = rotation.transpose().to_cols_array_2d();
        // With R = Rx(a) Ry(b): third row is (-cos a sin b, sin a, cos a cos b).
        Ok(Level {
            surface,
            about_x_deg: rows[2][1].atan2(rows[1][1]).to_degrees(),
            about_y_deg: rows[0][2].atan2(rows[0][0]).to_degrees(),
            rotation: rows,
            shift_mm: [-low.x, -low.y, 0.0],
            undercuts: under.count,
            undercut_area_mm2: under.area_mm2,
        })
    }

    /// A direction of the levelled part, a facet's normal say, as it stood in the source.
    pub fn back(&self, direction: [f64; 3]) -> [f64; 3] {
        let r = &self.rotation;
        std::array::from_fn(|k| (0..3).map(|row| r[row][k] * direction[row]).sum())
    }
}

#[derive(Default)]
struct Undercuts {
    count: usize,
    area_mm2: f64,
}

impl Undercuts {
    /// `up` is the z of the turned normal's direction: below 0 by more than rounding it leans over.
    fn see(&mut self, t: &Triangle, rotation: &DMat3, up: f64) {
        let normal = turned_normal(t, rotation);
        if up < 0.0 && normal.z.abs() > 1e-12 * normal.length() {
            self.count += 1;
            self.area_mm2 += 0.5 * normal.z.abs();
        }
    }
}

fn fan(outline: &[[f64; 3]]) -> Vec<Triangle> {
    (2..outline.len()).map(|k| [outline[0], outline[k - 1], outline[k]]).collect()
}

/// Normal of the turned triangle, as long as twice its area.
fn turned_normal(t: &Triangle, rotation: &DMat3) -> DVec3 {
    let [a, b, c] = t.map(DVec3::from);
    *rotation * (b - a).cross(c - a)
}

/// The rotation that makes the least-squares plane of the faces, weighted by their area as seen
/// from above, horizontal.
///
/// Over a triangle of area A and corners f_i, g_i of two linear functions,
/// integral f g = A/12 (sum f_i g_i + sum f_i sum g_i).
fn rotation(faces: &[Triangle]) -> Result<DMat3, Error> {
    let area = |t: &Triangle| (0.5 * turned_normal(t, &DMat3::IDENTITY).z).abs();
    let total: f64 = faces.iter().map(area).sum();
    let mut centre = DVec3::ZERO;
    for t in faces {
        let [a, b, c] = t.map(DVec3::from);
        centre += (a + b + c) / 3.0 * (area(t) / total);
    }
    let (mut xx, mut xy, mut yy, mut xz, mut yz) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for t in faces {
        let corners = t.map(|p| DVec3::from(p) - centre);
        let sum = corners[0] + corners[1] + corners[2];
        let weight = area(t) / 12.0;
        let moment = |f: fn(&DVec3) -> f64, g: fn(&DVec3) -> f64| {
            weight * (corners.iter().map(|p| f(p) * g(p)).sum::<f64>() + f(&sum) * g(&sum))
        };
        xx += moment(|p| p.x, |p| p.x);
        xy += moment(|p| p.x, |p| p.y);
        yy += moment(|p| p.y, |p| p.y);
        xz += moment(|p| p.x, |p| p.z);
        yz += moment(|p| p.y, |p| p.z);
    }
    let determinant = xx * yy - xy * xy;
    let slope_x = (xz * yy - yz * xy) / determinant;
    let slope_y = (yz * xx - xz * xy) / determinant;
    let tilt_deg = slope_x.hypot(slope_y).atan().to_degrees();
    if !(tilt_deg <= MOST_TILT_DEG) {
        return Err(Error::TooSteep { tilt_deg, limit_deg: MOST_TILT_DEG });
    }
    let normal = DVec3::new(-slope_x, -slope_y, 1.0).normalize();
    let about_y = (-normal.x).atan2(normal.z);
    let about_x = normal.y.atan2(normal.x.hypot(normal.z));
    Ok(DMat3::from_rotation_x(about_x) * DMat3::from_rotation_y(about_y))
}
