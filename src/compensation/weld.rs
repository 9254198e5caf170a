//! Corners of neighbouring faces that are one point.

/// Corners within this distance along each axis are one: far above the rounding of a part's coordinates, and no
/// farther than a rim reaches ([`super::profile::REACH_MM`]).
pub(super) const SAME_MM: f64 = 1e-9;

/// Side of the cells that corners are looked up by.
const CELL_MM: f64 = 1e-7;

const NONE: u32 = u32::MAX;

/// Which points the corners of some faces are.
pub(super) struct Weld {
    /// Of each corner.
    pub(super) point: Vec<u32>,
    /// The first corner of each point.
    pub(super) corner: Vec<u32>,
}

/// A table of points by cell, open addressing.
struct Table<'a> {
    corners: &'a [[f64; 3]],
    slots: Vec<u32>,
    weld: Weld,
}

fn hash(cell: [i64; 3]) -> u64 {
    let mut hash = 0u64;
    for part in cell {
        hash = (hash.rotate_left(23) ^ part as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    hash ^ hash >> 29
}

impl Table<'_> {
    /// The point at this place among those of a cell, or the free slot where their list ends.
    fn find(&self, cell: [i64; 3], place: &[f64; 3]) -> Result<u32, usize> {
        let mask = self.slots.len() - 1;
        let mut slot = hash(cell) as usize & mask;
        while self.slots[slot] != NONE {
            let point = self.slots[slot];
            let other = &self.corners[self.weld.corner[point as usize] as usize];
            if (0..3).all(|axis| (other[axis] - place[axis]).abs() <= SAME_MM) {
                return Ok(point);
            }
            slot = (slot + 1) & mask;
        }
        Err(slot)
    }

    fn add(&mut self, corner: u32) {
        let place = &self.corners[corner as usize];
        let cell = place.map(|mm| (mm / CELL_MM).floor());
        let own = cell.map(|at| at as i64);
        let found = self.find(own, place);
        let point = found.or_else(|free| self.near_border(cell, place).ok_or(free)).unwrap_or_else(|free| {
            let point = self.weld.corner.len() as u32;
            self.weld.corner.push(corner);
            self.slots[free] = point;
            point
        });
        self.weld.point.push(point);
    }

    /// The point in a cell next to this one, where the place lies within reach of it.
    fn near_border(&self, cell: [f64; 3], place: &[f64; 3]) -> Option<u32> {
        let mut aside = [0i64; 3];
        for axis in 0..3 {
            let from_mm = place[axis] - cell[axis] * CELL_MM;
            if from_mm <= SAME_MM {
                aside[axis] = -1;
            } else if from_mm >= CELL_MM - SAME_MM {
                aside[axis] = 1;
            }
        }
        let axes = |way: usize| [way & 1, way >> 1 & 1, way >> 2].map(|step| step as i64);
        (1..8).map(axes).filter(|steps| (0..3).all(|axis| steps[axis] == 0 || aside[axis] != 0)).find_map(
            |steps| {
                let beside = [0, 1, 2].map(|axis| cell[axis] as i64 + steps[axis] * aside[axis]);
                self.find(beside, place).ok()
            },
        )
    }
}

/// Finds the points of finite corners; the first corner of a point stands for all.
pub(super) fn weld(corners: &[[f64; 3]]) -> Weld {
    let slots = vec![NONE; (2 * corners.len()).next_power_of_two()];
    let weld = Weld { point: Vec::with_capacity(corners.len()), corner: Vec::new() };
    let mut table = Table { corners, slots, weld };
    (0..corners.len() as u32).for_each(|corner| table.add(corner));
    table.weld
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_apart_by_rounding_are_one_point_and_others_are_not() {
        let mut corners = Vec::new();
        for i in 0..200 {
            let place = [0.1 * f64::from(i % 20), 3e-8 * f64::from(i), 5.0 - 0.37 * f64::from(i % 7)];
            corners.push(place);
            corners.push([place[0] - 4e-13, place[1] + 2e-13, place[2] + 9e-13]);
            corners.push([place[0], place[1], place[2] + 2e-9]);
        }
        let weld = weld(&corners);
        assert_eq!(weld.corner.len(), 400);
        for i in (0..600).step_by(3) {
            assert_eq!(weld.point[i], weld.point[i + 1]);
            assert_ne!(weld.point[i], weld.point[i + 2]);
        }
    }
}
