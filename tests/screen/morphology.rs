//! What a ball cutter leaves of a designed cell, by the definitions alone: heights from the planes in the container,
//! dilation and erosion offset by offset, light by the law of reflection. Shares nothing with the crate but the
//! design and the half-spaces of the audience.

use glam::{DVec2, DVec3};
use screenmill::screen::{Design, Profile, Scene, Seam};

/// Of one cell.
#[derive(Clone, Copy, Debug)]
pub struct Left {
    /// Part of the area whose normal is off by more than a degree.
    pub turned: f64,
    /// Part of the area that stands over the design by more than 5 um.
    pub raised: f64,
    /// Part of the reflected light that misses the audience.
    pub leak: f64,
}

/// Square, row-major.
struct Square<T> {
    side: usize,
    values: Vec<T>,
}

impl<T: Copy> Square<T> {
    fn new(side: usize, of: impl Fn(usize, usize) -> T) -> Square<T> {
        Square { side, values: (0..side * side).map(|at| of(at % side, at / side)).collect() }
    }

    fn at(&self, column: usize, row: usize) -> T {
        self.values[row * self.side + column]
    }
}

/// Height and gradient over the part's frame: of all cells that have a say the highest bump or lowest dish.
fn surface(design: &Design, p: [f64; 2]) -> (f64, DVec2) {
    let dish = design.profile == Profile::Dish;
    let place = p.map(|length| (length / design.cell_mm).floor() as i32);
    let reach = if design.seam == Seam::Stitched { 1 } else { 0 };
    let mut best: Option<(f64, DVec2)> = None;
    for cell in &design.cells {
        let from = [cell.column - design.core.c0, cell.row - design.core.r0];
        if (from[0] - place[0]).abs() > reach || (from[1] - place[1]).abs() > reach {
            continue;
        }
        let q = [0, 1].map(|k| p[k] - (f64::from(from[k]) + 0.5) * design.cell_mm);
        let planes = cell.facets.iter().map(|facet| {
            let [gx, gy] = facet.gradient;
            (cell.elevation_mm + gx * q[0] + gy * q[1] + facet.offset_mm, DVec2::new(gx, gy))
        });
        let own = planes.reduce(|a, b| if (b.0 > a.0) == dish { b } else { a }).expect("facets");
        let better = best.is_none_or(|best| (own.0 < best.0) == dish);
        if better {
            best = Some(own);
        }
    }
    best.expect("a cell there")
}

/// The middle one of 3 x 3 cells under a ball of `radius` samples.
pub fn under_a_ball(scene: &Scene, design: &Design, radius: usize, step_mm: f64) -> Left {
    let across = (design.cell_mm / step_mm).round() as usize;
    let halo = 2 * radius + 1;
    let first_mm = design.cell_mm - halo as f64 * step_mm;
    let place = |at: usize| first_mm + (at as f64 + 0.5) * step_mm;
    let all = Square::new(across + 2 * halo, |column, row| surface(design, [place(column), place(row)]));
    // The ball's surface over its lowest point, turned over: 0 in the middle, -radius at the rim.
    let r = radius as isize;
    let ball: Vec<(isize, isize, f64)> = (-r..=r)
        .flat_map(|dy| (-r..=r).map(move |dx| (dx, dy)))
        .filter(|(dx, dy)| dx * dx + dy * dy <= r * r)
        .map(|(dx, dy)| (dx, dy, step_mm * (((r * r - dx * dx - dy * dy) as f64).sqrt() - r as f64)))
        .collect();
    let moved = |at: usize, by: isize| (at + radius).wrapping_add_signed(by);
    let locations = Square::new(all.side - 2 * radius, |column, row| {
        let over = ball.iter().map(|&(dx, dy, s)| all.at(moved(column, dx), moved(row, dy)).0 + s);
        over.fold(f64::NEG_INFINITY, f64::max)
    });
    let closing = Square::new(locations.side - 2 * radius, |column, row| {
        let under = ball.iter().map(|&(dx, dy, s)| locations.at(moved(column, dx), moved(row, dy)) - s);
        under.fold(f64::INFINITY, f64::min)
    });

    let cell = design.cell(design.core.c0 + 1, design.core.r0 + 1).expect("the middle one");
    let x = scene.centre_m(f64::from(cell.column), f64::from(cell.row), 1e-3 * cell.elevation_mm);
    let i = (scene.projector_m - x).normalize();
    let normal = |gradient: DVec2| DVec3::new(-gradient.x, -gradient.y, 1.0).normalize();
    let (mut turned, mut raised, mut light, mut lost) = (0, 0, 0.0, 0.0);
    for row in 1..=across {
        for column in 1..=across {
            let (z, designed) = all.at(column + 2 * radius, row + 2 * radius);
            let over_mm = closing.at(column, row) - z;
            assert!(over_mm > -1e-12, "a closing lies on or over the surface");
            // What the ball touches keeps its facet's slope; elsewhere differences tell it.
            let gradient = if over_mm < 1e-5 {
                designed
            } else {
                let across = closing.at(column + 1, row) - closing.at(column - 1, row);
                let up = closing.at(column, row + 1) - closing.at(column, row - 1);
                DVec2::new(across, up) / (2.0 * step_mm)
            };
            let h = normal(gradient);
            turned += u32::from(h.angle_between(normal(designed)) > 1_f64.to_radians());
            raised += u32::from(over_mm > 5e-3);
            let flux = i.dot(h).max(0.0) / h.z;
            light += flux;
            // From the middle of the cell, which facets are aimed from.
            if !meets(scene, x, 2.0 * i.dot(h) * h - i) {
                lost += flux;
            }
        }
    }
    let part = |samples: u32| f64::from(samples) / (across * across) as f64;
    Left { turned: part(turned), raised: part(raised), leak: lost / light }
}

/// Whether a ray meets an audience; a direction on its edge does.
fn meets(scene: &Scene, from: DVec3, o: DVec3) -> bool {
    scene.audience.iter().any(|audience| {
        let (mut near, mut far) = (0.0_f64, f64::INFINITY);
        for face in audience.half_spaces() {
            let (room, speed) = (face.offset_m - face.normal.dot(from), face.normal.dot(o));
            if speed > 0.0 {
                far = far.min(room / speed);
            } else if speed < 0.0 {
                near = near.max(room / speed);
            } else if room < 0.0 {
                return false;
            }
        }
        near <= far + 1e-9
    })
}
