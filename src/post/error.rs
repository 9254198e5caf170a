use crate::{catalogue, machine, settings};

/// Why a dialect or a program was refused. Nothing of a refused program has been written, except
/// where writing itself failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Find(#[from] catalogue::Error),
    #[error(transparent)]
    File(#[from] settings::Error),
    #[error(transparent)]
    Machine(#[from] machine::Error),
    #[error(
        "{path}:{line}: {decimals} decimals cannot name every multiple of unit_mm = {unit_mm}; hint: more decimals or a larger unit_mm"
    )]
    Decimals { path: String, line: usize, decimals: u32, unit_mm: f64 },
    #[error(
        "{path}:{line}: block \"{block}\": {message}; hint: see the blocks of the dialects that come with screenmill"
    )]
    Block { path: String, line: usize, block: &'static str, message: String },
    #[error("{path}:{line}: {key}: {message}; hint: it is written into programs as it stands")]
    Spelling { path: String, line: usize, key: String, message: String },
    #[error(
        "the program for {dialect} cannot be written: {message}; hint: check the [limits] and [block] of the dialect"
    )]
    Line { dialect: String, message: String },
    #[error(
        "the toolpath lies on a grid of {unit_mm} mm, {dialect} names multiples of {dialect_unit_mm} mm; hint: plan one toolpath for each grid"
    )]
    Grid { unit_mm: f64, dialect: String, dialect_unit_mm: f64 },
    #[error("the toolpath has no moves; hint: there is nothing to cut, leave the operation out")]
    Empty,
    #[error(
        "the toolpath begins at z = {z_mm:.4} mm, below the clearance plane at {clearance_mm} mm; hint: its first move is a rapid on that plane"
    )]
    Start { z_mm: f64, clearance_mm: f64 },
    #[error(
        "the clearance plane at {clearance_mm} mm is not above the stock's top at {stock_top_mm} mm; hint: clearance_mm above 0"
    )]
    Clearance { clearance_mm: f64, stock_top_mm: f64 },
    #[error(
        "move {index} is a rapid in X or Y at z = {z_mm:.4} mm, below the stock's top at {stock_top_mm} mm; hint: such a move has to be a cut"
    )]
    RapidInStock { index: usize, z_mm: f64, stock_top_mm: f64 },
    #[error(
        "{axis} {value_mm:.4} mm is out of the range of {dialect}, +-{limit_mm:.0} mm; hint: smaller tiles"
    )]
    Value { axis: &'static str, value_mm: f64, dialect: String, limit_mm: f64 },
    #[error(
        "a feed of {feed_mm_min} mm/min cannot be named by {dialect}, whose smallest is {least_mm_min} mm/min; hint: a feed of at least that"
    )]
    Feed { feed_mm_min: f64, dialect: String, least_mm_min: f64 },
    #[error(
        "spin_up_s of {machine} is {spin_up_s}, {dialect} can wait {limit_s} s at most; hint: lower it and warm the spindle up by hand"
    )]
    Dwell { machine: String, spin_up_s: f64, dialect: String, limit_s: f64 },
    #[error(
        "a program of {bytes} bytes does not go into the memory of {machine}, {memory_bytes} bytes; hint: smaller tiles, or pattern = \"one-way\", which can be cut in sections at every pass"
    )]
    Memory { bytes: u64, machine: String, memory_bytes: u64 },
    #[error("wcs \"{wcs}\" is not one of {dialect}; hint: {hint}")]
    Wcs { wcs: String, dialect: String, hint: String },
    #[error("the program could not be written: {0}")]
    Write(#[from] std::io::Error),
}
