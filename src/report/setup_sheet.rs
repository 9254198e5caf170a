//! `setup-sheet.html`: what the operator needs at the machine, one printed page a tile.

use std::path::Path;

use serde::Serialize;

use super::template::{self, Template};
use super::{Bounds, Error};

/// All words and numbers of a setup sheet; nothing is worked out from them but the sketch.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SetupSheet {
    pub title: String,
    pub machine: String,
    pub material: String,
    /// `screenmill 0.1.0`.
    pub made_by: String,
    pub warnings: Vec<String>,
    /// Values no source confirms; each is marked "verify against your machine".
    pub unconfirmed: Vec<String>,
    /// What machine and controller ask of the operator.
    pub machine_notes: Vec<String>,
    /// How to stop the machine and what to do then.
    pub abort: Vec<String>,
    pub safety: Vec<String>,
    pub tiles: Vec<SheetTile>,
}

/// One setup: a blank on the machine.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SheetTile {
    pub name: String,
    /// Lower left corner in the part frame.
    pub place_mm: [f64; 2],
    pub size_mm: [f64; 2],
    /// Along x, along y, thickness.
    pub blank_mm: [f64; 3],
    /// Metal around the tile.
    pub margin_mm: f64,
    /// Lower left corner of the tile above the blank's lower left corner.
    pub origin_on_blank_mm: [f64; 2],
    pub fixture: String,
    pub fixture_notes: Vec<String>,
    /// Keep-out boxes seen from above, in the program frame: x low, y low, x high, y high.
    pub keep_out_mm: Vec<[f64; 4]>,
    pub wcs: String,
    pub xy_zero: String,
    pub z_zero: String,
    /// Where Z0 is found again once the tile's own top is cut away.
    pub re_zero: String,
    /// What holds the blank, on which sides.
    pub clamped: String,
    /// Mounting wedge about x and about y; zero without levelling.
    pub wedge_deg: [f64; 2],
    pub tools: Vec<SheetTool>,
    /// In run order, post after post.
    pub programs: Vec<SheetProgram>,
    /// Of the first post's programs.
    pub time_s: f64,
    /// What to measure, and when.
    pub checks: Vec<String>,
    /// What the cut cannot do better, in numbers.
    pub limits: Vec<String>,
    pub notes: Vec<String>,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct SheetTool {
    pub number: u32,
    pub name: String,
    pub cutter: String,
    pub flutes: Option<u32>,
    /// Diameter and length of what may go down beside the metal.
    pub neck_mm: Option<[f64; 2]>,
    /// The collet's size.
    pub shank_mm: Option<f64>,
    pub tool_life_m: Option<f64>,
    pub stick_out_mm: Option<f64>,
    pub spindle_rpm: f64,
    /// The machine's own code of this speed, e.g. `!RC12`.
    pub spindle_code: Option<String>,
    pub feed_mm_min: f64,
    pub plunge_mm_min: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct SheetProgram {
    pub file: String,
    /// Set where the programs of another post begin.
    pub begins_post: Option<String>,
    pub operation: String,
    pub tool_number: u32,
    pub tool: String,
    pub time_s: f64,
    pub bounds_mm: Bounds,
    /// Of the whole file, in hexadecimal.
    pub sha256: String,
    /// Set where the tool differs from the program before.
    pub re_zero_z: bool,
    /// Set where the blank is turned over before it, in words.
    pub turn: Option<String>,
}

/// The blank seen from above in a 420 x 300 drawing, y down.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Sketch {
    blank: [f64; 4],
    tile: [f64; 4],
    keep_out: Vec<[f64; 4]>,
    origin: [f64; 2],
}

impl Sketch {
    fn of(tile: &SheetTile) -> Sketch {
        let [blank_width, blank_height, _] = tile.blank_mm;
        let scale = (300.0 / blank_width.max(1e-9)).min(200.0 / blank_height.max(1e-9));
        let left = 210.0 - 0.5 * blank_width * scale;
        let bottom = 150.0 + 0.5 * blank_height * scale;
        let corner = tile.origin_on_blank_mm;
        // Boxes are x, y of the upper left corner, width and height; the inputs are in the program frame.
        let boxed = |low: [f64; 2], high: [f64; 2]| {
            let x = left + (low[0] + corner[0]) * scale;
            let y = bottom - (high[1] + corner[1]) * scale;
            [x, y, (high[0] - low[0]) * scale, (high[1] - low[1]) * scale]
        };
        let blank_high = [blank_width - corner[0], blank_height - corner[1]];
        Sketch {
            blank: boxed([-corner[0], -corner[1]], blank_high),
            tile: boxed([0.0, 0.0], tile.size_mm),
            keep_out: tile.keep_out_mm.iter().map(|b| boxed([b[0], b[1]], [b[2], b[3]])).collect(),
            origin: [left + corner[0] * scale, bottom - corner[1] * scale],
        }
    }
}

/// Writes the sheet, whole or not at all.
pub fn write_setup_sheet(path: &Path, sheet: &SetupSheet) -> Result<(), Error> {
    let filled = Filled { sheet, sketches: sheet.tiles.iter().map(Sketch::of).collect() };
    template::write(path, Template::SetupSheet, &filled)
}

/// What the template reads.
#[derive(Serialize)]
struct Filled<'a> {
    sheet: &'a SetupSheet,
    sketches: Vec<Sketch>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sketch_keeps_proportions_and_puts_the_origin_at_the_tiles_lower_left() {
        let tile = SheetTile {
            size_mm: [100.0, 40.0],
            blank_mm: [106.0, 46.0, 20.0],
            origin_on_blank_mm: [3.0, 3.0],
            ..SheetTile::default()
        };
        let sketch = Sketch::of(&tile);
        let [x, y, width, height] = sketch.tile;
        assert!((width / height - 2.5).abs() < 1e-9);
        assert!((sketch.origin[0] - x).abs() < 1e-9 && (sketch.origin[1] - (y + height)).abs() < 1e-9);
        assert!((sketch.blank[2] - 300.0).abs() < 1e-9 && sketch.blank[0] + 300.0 < 420.0);
    }
}
