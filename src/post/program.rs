use crate::machine::Tool;
use crate::toolpath::Toolpath;

/// Which height the program calls Z0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZZero {
    /// The top of the blank.
    StockTop,
    /// The tile's highest design point.
    PartTop,
}

/// The blank, for the header: its size with the margin around the tile.
#[derive(Clone, Debug, PartialEq)]
pub struct StockFacts {
    pub material: String,
    pub width_mm: f64,
    pub height_mm: f64,
    pub thickness_mm: f64,
    pub top_allowance_mm: f64,
}

/// Which of several programs that cut one operation after each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// From 1.
    pub index: u32,
    pub count: u32,
    /// Whether it begins with a cutter that has not cut yet.
    pub fresh_cutter: bool,
}

/// One operation of one tile with all that its text says. Lengths are in the program's frame.
#[derive(Clone, Debug)]
pub struct Program<'a> {
    pub path: &'a Toolpath,
    pub part: &'a str,
    pub tile: &'a str,
    pub operation: &'a str,
    /// Among the programs of its tile, from 1; controllers that number programs are told it.
    pub number: u32,
    /// None where the operation is one program.
    pub section: Option<Section>,
    /// Its feeds and speed are those of the program.
    pub tool: &'a Tool,
    pub stock: &'a StockFacts,
    pub z_zero: ZZero,
    /// Whether the spindle turns; false for a run in air.
    pub spindle: bool,
    /// Work coordinate system, "G54" and the like; not named by dialects that have none.
    pub wcs: &'a str,
    /// z of the plane between passes, in the program's frame.
    pub clearance_mm: f64,
    /// What else an operator should read in the header, as (label, text).
    pub notes: &'a [(&'a str, String)],
}

impl Program<'_> {
    /// z of the stock's top in the program's frame.
    pub fn stock_top_mm(&self) -> f64 {
        match self.z_zero {
            ZZero::StockTop => 0.0,
            ZZero::PartTop => self.stock.top_allowance_mm,
        }
    }
}
