use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::math::Vector;

use super::fixture::Side;
use super::{Blanks, Error, Fixture, Machine, Stock, Tile};

/// Lowest and highest X, Y and Z in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub low_mm: [f64; 3],
    pub high_mm: [f64; 3],
}

/// A box that no cutter may enter, in the program's X and Y and in z above the stock's top.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    pub name: String,
    pub bounds: Bounds,
}

/// One tile on the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    pub tile: Tile,
    /// The blank, in the tile's frame: X0 Y0 at the tile's lower left corner, z = 0 on the
    /// stock's top.
    pub blank: Bounds,
    /// Where the tile's lower left corner on the stock's top stands in the table's frame.
    pub zero_on_table_mm: [f64; 3],
    /// Clamps and other keep-out boxes in the tile's frame, as `blank`.
    pub obstacles: Vec<Obstacle>,
}

impl Setup {
    /// Puts a tile of a part of `part_mm` on the machine: the tile's middle over the middle of
    /// the travel, so that the cutter's overrun and the margin stay inside what [`super::split`]
    /// allows for.
    pub fn place(
        tile: Tile,
        part_mm: [f64; 2],
        stock: &Stock,
        machine: &Machine,
        fixture: &Fixture,
    ) -> Setup {
        let margin = stock.margin_mm;
        let (low, high) = match stock.blanks {
            Blanks::PerTile => ([-margin; 2], [tile.width_mm + margin, tile.height_mm + margin]),
            Blanks::One => (
                [-tile.x_mm - margin, -tile.y_mm - margin],
                [part_mm[0] - tile.x_mm + margin, part_mm[1] - tile.y_mm + margin],
            ),
        };
        let blank =
            Bounds { low_mm: [low[0], low[1], -stock.thickness_mm], high_mm: [high[0], high[1], 0.0] };
        let zero = [
            0.5 * (machine.travel.x_mm - tile.width_mm),
            0.5 * (machine.travel.y_mm - tile.height_mm),
            fixture.height_mm + stock.thickness_mm,
        ];
        let clamps = fixture.clamp.iter().map(|clamp| {
            let across = |axis: usize| {
                let middle = 0.5 * (low[axis] + high[axis]);
                [middle - 0.5 * clamp.width_mm, middle + 0.5 * clamp.width_mm]
            };
            let at_low = |axis: usize| [low[axis] - clamp.out_mm, low[axis] + clamp.reach_mm];
            let at_high = |axis: usize| [high[axis] - clamp.reach_mm, high[axis] + clamp.out_mm];
            let (x, y) = match clamp.side {
                Side::Left => (at_low(0), across(1)),
                Side::Right => (at_high(0), across(1)),
                Side::Front => (across(0), at_low(1)),
                Side::Back => (across(0), at_high(1)),
            };
            let bounds =
                Bounds { low_mm: [x[0], y[0], -stock.thickness_mm], high_mm: [x[1], y[1], clamp.height_mm] };
            Obstacle { name: clamp.name.clone(), bounds }
        });
        let boxes = fixture.keep_out.iter().map(|keep_out| {
            let (a, b) = (keep_out.min_mm, keep_out.max_mm);
            let bounds = Bounds {
                low_mm: [a.x - zero[0], a.y - zero[1], a.z - zero[2]],
                high_mm: [b.x - zero[0], b.y - zero[1], b.z - zero[2]],
            };
            Obstacle { name: keep_out.name.clone(), bounds }
        });
        let obstacles = clamps.chain(boxes).collect();
        Setup { tile, blank, zero_on_table_mm: zero, obstacles }
    }

    /// Refuses motions of a cutter's tip within `motions` (X and Y of the program, z above the
    /// stock's top) that leave the travel, or whose cutter and all above it, taken as one column
    /// of `radius_mm`, could enter a clamp or another keep-out box. Rapids to the first point
    /// come at `clearance_mm` above the stock from anywhere, so everything has to be lower.
    ///
    /// The box of all motions stands for the motions: what it refuses may still be free, what it
    /// passes is.
    pub fn check(
        &self,
        motions: &Bounds,
        radius_mm: f64,
        clearance_mm: f64,
        machine: &Machine,
    ) -> Result<(), Error> {
        let tile = || self.tile.name.clone();
        for (axis, travel_mm) in [machine.travel.x_mm, machine.travel.y_mm].into_iter().enumerate() {
            let low_mm = motions.low_mm[axis] + self.zero_on_table_mm[axis];
            let high_mm = motions.high_mm[axis] + self.zero_on_table_mm[axis];
            if low_mm < 0.0 || high_mm > travel_mm {
                let axis = ["X", "Y"][axis];
                let machine = machine.name.clone();
                return Err(Error::Stroke { tile: tile(), axis, low_mm, high_mm, machine, travel_mm });
            }
        }
        let column = Bounds {
            low_mm: [motions.low_mm[0] - radius_mm, motions.low_mm[1] - radius_mm, motions.low_mm[2]],
            high_mm: [
                motions.high_mm[0] + radius_mm,
                motions.high_mm[1] + radius_mm,
                motions.high_mm[2].max(clearance_mm) + 1000.0,
            ],
        };
        for obstacle in &self.obstacles {
            let top_mm = obstacle.bounds.high_mm[2];
            if top_mm >= clearance_mm {
                let name = obstacle.name.clone();
                return Err(Error::Clearance { tile: tile(), name, top_mm, clearance_mm });
            }
            if aabb(&column).intersects(&aabb(&obstacle.bounds)) {
                let overlap = |axis: usize| {
                    let (a, b) = (&column, &obstacle.bounds);
                    a.high_mm[axis].min(b.high_mm[axis]) - a.low_mm[axis].max(b.low_mm[axis])
                };
                let overlap_mm = overlap(0).min(overlap(1));
                let name = obstacle.name.clone();
                return Err(Error::KeepOut { tile: tile(), name, overlap_mm, top_mm });
            }
        }
        Ok(())
    }
}

/// In single precision, and a hair larger for it.
fn aabb(bounds: &Bounds) -> Aabb {
    let corner = |c: [f64; 3]| Vector::new(c[0] as f32, c[1] as f32, c[2] as f32);
    Aabb::new(corner(bounds.low_mm), corner(bounds.high_mm)).loosened(1e-3)
}
