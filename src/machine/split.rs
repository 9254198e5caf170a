use super::{Error, Fixture, Machine};

/// Whether every tile is cut from its own blank, or the whole part from one sheet that is held
/// anew for each tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blanks {
    PerTile,
    One,
}

/// The metal that tiles are cut from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stock {
    /// From the blank's underside to its top, `top_allowance_mm` included.
    pub thickness_mm: f64,
    /// Metal above the tile's highest point.
    pub top_allowance_mm: f64,
    /// Metal around a tile.
    pub margin_mm: f64,
    /// Metal that has to be left under the deepest cut.
    pub min_floor_mm: f64,
    pub blanks: Blanks,
}

/// What a part may be divided by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantum {
    /// Cuts between whole microgeometries.
    Cell { cell_mm: f64 },
    /// Cuts between samples, for meshes and height images.
    Sample { step_mm: f64 },
}

impl Quantum {
    fn length_mm(self) -> f64 {
        match self {
            Quantum::Cell { cell_mm } => cell_mm,
            Quantum::Sample { step_mm } => step_mm,
        }
    }

    fn noun(self) -> &'static str {
        match self {
            Quantum::Cell { .. } => "microgeometry",
            Quantum::Sample { .. } => "sample",
        }
    }
}

/// A piece of the part that is cut in one setup. Its corner is in the part's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// r0c0 is the lower left tile; rows count upwards.
    pub name: String,
    pub row: usize,
    pub column: usize,
    pub x_mm: f64,
    pub y_mm: f64,
    pub width_mm: f64,
    pub height_mm: f64,
}

/// A part of `size_mm` in tiles that one setup can hold: the cutter's `overrun_mm` past each side
/// stays within travel, the blank within the fixture's usable area. Tiles differ by one quantum at
/// most; only the last takes a remainder of the part that is no whole quantum. Rows from the
/// bottom, columns from the left.
///
/// Errors: a single quantum does not fit.
pub fn split(
    size_mm: [f64; 2],
    quantum: Quantum,
    overrun_mm: f64,
    stock: &Stock,
    machine: &Machine,
    fixture: &Fixture,
) -> Result<Vec<Tile>, Error> {
    let counts = counts(size_mm, quantum, overrun_mm, stock, machine, fixture)?;
    Ok(grid(size_mm, quantum, counts))
}

/// As [`split`], and divided further until `refusal` finds nothing against any tile: its Z, or the blank that it needs
/// once it is turned level. Pieces do not get shorter than `smallest_mm`.
///
/// Errors: those of `refusal` itself, and what it finds against the first tile of the undivided part.
#[expect(clippy::too_many_arguments, reason = "those of split, and what a tile must keep")]
pub fn split_to_fit<E: From<Error>>(
    size_mm: [f64; 2],
    quantum: Quantum,
    overrun_mm: f64,
    smallest_mm: f64,
    stock: &Stock,
    machine: &Machine,
    fixture: &Fixture,
    mut refusal: impl FnMut(&Tile) -> Result<Option<Error>, E>,
) -> Result<Vec<Tile>, E> {
    let mut counts = counts(size_mm, quantum, overrun_mm, stock, machine, fixture)?;
    let mut first_refusal: Option<Error> = None;
    loop {
        let tiles = grid(size_mm, quantum, counts);
        let mut found = None;
        for tile in &tiles {
            found = refusal(tile)?;
            if found.is_some() {
                break;
            }
        }
        let Some(found) = found else { return Ok(tiles) };
        let length = |axis: usize| size_mm[axis] / counts[axis] as f64;
        // Too wide a blank asks for shorter tiles along that side, too much Z along the longer one.
        let axis = match &found {
            Error::Blank { axis, .. } => usize::from(*axis == "Y"),
            _ => usize::from(length(0) < length(1)),
        };
        let refusal = first_refusal.take().unwrap_or(found);
        let shortest = smallest_mm.max(quantum.length_mm());
        if length(axis) < 2.0 * shortest {
            return Err(refusal.into());
        }
        first_refusal = Some(refusal);
        // A setup more than needed costs an operator more than a division that is tried in vain.
        counts[axis] += counts[axis].div_ceil(4);
    }
}

fn counts(
    size_mm: [f64; 2],
    quantum: Quantum,
    overrun_mm: f64,
    stock: &Stock,
    machine: &Machine,
    fixture: &Fixture,
) -> Result<[usize; 2], Error> {
    let travel = [machine.travel.x_mm, machine.travel.y_mm];
    let border = [fixture.border_mm.x, fixture.border_mm.y];
    let mut counts = [1; 2];
    for axis in 0..2 {
        let usable = travel[axis] - 2.0 * border[axis];
        let room = match stock.blanks {
            Blanks::PerTile => (travel[axis] - 2.0 * overrun_mm).min(usable - 2.0 * stock.margin_mm),
            Blanks::One => usable - 2.0 * overrun_mm,
        };
        let most = fixture.blank_max_mm.map_or(f64::INFINITY, |most| [most.x, most.y][axis]);
        let blank = size_mm[axis] + 2.0 * stock.margin_mm;
        let room = match stock.blanks {
            Blanks::One if blank > most => {
                let (fixture, axis) = (fixture.name.clone(), ["X", "Y"][axis]);
                return Err(Error::Sheet { length_mm: blank, fixture, most_mm: most, axis });
            }
            Blanks::One => room,
            Blanks::PerTile => room.min(most - 2.0 * stock.margin_mm),
        };
        if size_mm[axis] <= room {
            continue;
        }
        let length = quantum.length_mm();
        let whole = quanta(size_mm[axis], length);
        // A room of exactly n quanta holds n of them, whatever the last bit of the division says.
        let fit = (room / length + 1e-9).floor();
        if fit < 1.0 {
            return Err(Error::Room {
                what: quantum.noun(),
                length_mm: length,
                axis: ["X", "Y"][axis],
                room_mm: room,
                machine: machine.name.clone(),
                travel_mm: travel[axis],
                border_mm: border[axis],
                margin_mm: stock.margin_mm,
                overrun_mm,
            });
        }
        counts[axis] = whole.div_ceil(fit as usize);
    }
    Ok(counts)
}

fn quanta(length_mm: f64, quantum_mm: f64) -> usize {
    (length_mm / quantum_mm - 1e-6).ceil().max(1.0) as usize
}

fn grid(size_mm: [f64; 2], quantum: Quantum, counts: [usize; 2]) -> Vec<Tile> {
    let length = quantum.length_mm();
    let cuts = |axis: usize| -> Vec<f64> {
        let whole = quanta(size_mm[axis], length);
        let pieces = counts[axis].min(whole);
        let mut cuts: Vec<f64> = (0..pieces).map(|i| (i * whole / pieces) as f64 * length).collect();
        cuts.push(size_mm[axis]);
        cuts
    };
    let (x, y) = (cuts(0), cuts(1));
    let mut tiles = Vec::with_capacity((x.len() - 1) * (y.len() - 1));
    for row in 0..y.len() - 1 {
        for column in 0..x.len() - 1 {
            tiles.push(Tile {
                name: format!("r{row}c{column}"),
                row,
                column,
                x_mm: x[column],
                y_mm: y[row],
                width_mm: x[column + 1] - x[column],
                height_mm: y[row + 1] - y[row],
            });
        }
    }
    tiles
}

/// The Z that a tile asks of machine and blank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZNeed {
    /// From the tile's highest design point down to the deepest that a cutter's tip goes.
    pub depth_mm: f64,
    pub top_allowance_mm: f64,
    /// From the stock's top up to the clearance plane.
    pub clearance_mm: f64,
}

impl ZNeed {
    /// Stroke from the deepest cut to the clearance plane.
    pub fn stroke_mm(&self) -> f64 {
        self.depth_mm + self.top_allowance_mm + self.clearance_mm
    }
}

/// Refuses a tile that asks for more Z than the machine has.
pub fn fits_z(tile: &str, need: ZNeed, machine: &Machine) -> Result<(), Error> {
    let (needed_mm, travel_mm) = (need.stroke_mm(), machine.travel.z_mm);
    if needed_mm <= travel_mm {
        return Ok(());
    }
    Err(Error::Travel { tile: tile.into(), needed_mm, machine: machine.name.clone(), travel_mm })
}

/// Refuses a tile whose deepest cut leaves too little of its blank, and gives what it leaves.
pub fn floor_mm(tile: &str, need: ZNeed, stock: &Stock) -> Result<f64, Error> {
    let floor_mm = stock.thickness_mm - stock.top_allowance_mm - need.depth_mm;
    if floor_mm >= stock.min_floor_mm {
        return Ok(floor_mm);
    }
    Err(Error::Floor {
        tile: tile.into(),
        floor_mm,
        thickness_mm: stock.thickness_mm,
        min_floor_mm: stock.min_floor_mm,
    })
}
