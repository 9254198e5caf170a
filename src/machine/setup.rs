use super::fixture::Side;
use super::{Blanks, Error, Fixture, Machine, Stock, Tile};

/// Room between the clearance plane and the highest clamp.
const OVER_CLAMPS_MM: f64 = 2.0;

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
    /// The tile's width and height as it lies on the machine; a levelled one is turned, and wider than its place.
    pub size_mm: [f64; 2],
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
                let start = low[axis] + clamp.along * (high[axis] - low[axis] - clamp.width_mm);
                [start, start + clamp.width_mm]
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
        let size_mm = [tile.width_mm, tile.height_mm];
        Setup { tile, size_mm, blank, zero_on_table_mm: zero, obstacles }
    }

    /// The plane in mm above the stock's top on which the tool may come from and go to anywhere: `retract_mm`, or
    /// higher where a clamp stands above that.
    pub fn clearance_mm(&self, retract_mm: f64) -> f64 {
        let tops = self.obstacles.iter().map(|obstacle| obstacle.bounds.high_mm[2] + OVER_CLAMPS_MM);
        tops.fold(retract_mm, f64::max)
    }

    /// Refuses a blank that is larger than what machine and fixture take.
    pub fn check_blank(&self, machine: &Machine, fixture: &Fixture) -> Result<(), Error> {
        let travel = [machine.travel.x_mm, machine.travel.y_mm];
        let border = [fixture.border_mm.x, fixture.border_mm.y];
        for axis in 0..2 {
            let length_mm = self.blank.high_mm[axis] - self.blank.low_mm[axis];
            let most = fixture.blank_max_mm.map_or(f64::INFINITY, |most| [most.x, most.y][axis]);
            let room_mm = (travel[axis] - 2.0 * border[axis]).min(most);
            if length_mm > room_mm + 1e-9 {
                return Err(Error::Blank {
                    tile: self.tile.name.clone(),
                    length_mm,
                    axis: ["X", "Y"][axis],
                    room_mm,
                    machine: machine.name.clone(),
                    fixture: fixture.name.clone(),
                });
            }
        }
        Ok(())
    }

    /// Refuses a tile that a cutter cannot get to for clamps: boxes that stand in the tile, or nearer to it than
    /// `reach_mm`, how far past the tile's edges the operations cut, the cutter's radius included; with what of a tool is
    /// wider than its cutter they go up to `widest_mm`, for which the hint asks.
    ///
    /// Only what stands above the deepest cut counts, `depth_mm` below the stock's top.
    pub fn check_reach(
        &self,
        reach_mm: f64,
        widest_mm: f64,
        depth_mm: f64,
        margin_mm: f64,
    ) -> Result<(), Error> {
        let size = self.size_mm;
        for Obstacle { name, bounds } in &self.obstacles {
            if bounds.high_mm[2] <= -depth_mm {
                continue;
            }
            let gap = |axis: usize| (-bounds.high_mm[axis]).max(bounds.low_mm[axis] - size[axis]);
            let gap_mm = gap(0).max(gap(1));
            if gap_mm < reach_mm {
                return Err(Error::InTheWay {
                    tile: self.tile.name.clone(),
                    name: name.clone(),
                    place: if gap_mm < 0.0 {
                        format!("{:.3} mm inside it", -gap_mm)
                    } else {
                        format!("{gap_mm:.3} mm from it")
                    },
                    reach_mm,
                    margin_mm,
                    needed_um: (margin_mm + widest_mm.max(reach_mm) - gap_mm) * 1000.0 - 1e-6,
                });
            }
        }
        Ok(())
    }

    /// Refuses motions of a cutter's tip within `motions` (X and Y of the program, z above the stock's top) that leave
    /// the travel, or go deeper than the blank and what may be cut under it.
    pub fn check(&self, motions: &Bounds, sacrificial_mm: f64, machine: &Machine) -> Result<(), Error> {
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
        let needed_mm = motions.high_mm[2] - motions.low_mm[2];
        if needed_mm > machine.travel.z_mm + 1e-9 {
            let (machine, travel_mm) = (machine.name.clone(), machine.travel.z_mm);
            return Err(Error::Travel { tile: tile(), needed_mm, machine, travel_mm });
        }
        let below_mm = self.blank.low_mm[2] - motions.low_mm[2];
        if below_mm > sacrificial_mm + 1e-9 {
            return Err(Error::Under { tile: tile(), below_mm, sacrificial_mm });
        }
        Ok(())
    }
}
