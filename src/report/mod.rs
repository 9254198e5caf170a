//! Everything shown, nothing computed: JSON, maps and their pictures, lists of cavities, pages.

pub mod cavity_list;
pub mod design_space;
pub mod evaluation;
mod evaluation_tables;
pub mod figure;
pub mod files;
mod format;
pub mod light_picture;
pub mod maps;
pub mod mask;
pub mod pages;
mod palette;
pub mod picture;
mod scale;
pub mod schema;
pub mod screen_map;
pub mod setup_sheet;
mod template;
mod test_image;

pub use files::{write_beside, write_json, write_whole};
pub use schema::{
    Bounds, ByCause, Fidelity, Finding, GougeBudget, Light, MapFiles, Part, Parts, Polished, Program, Report,
    Severity, Tile, Times, Verdict, finding,
};

/// Why something could not be shown.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{path}: {source}; hint: the output folder must be writable and have room")]
    Io { path: String, source: std::io::Error },
    #[error(
        "a strip of {samples} samples was given for rows of {columns} columns with {rows_left} rows left; \
         hint: every layer must be of the same tile"
    )]
    Strip { samples: usize, columns: usize, rows_left: usize },
    #[error("{path} could not be drawn: {source}; hint: this is a fault of the program, please report it")]
    Figure { path: String, source: Box<dyn std::error::Error + Send + Sync> },
    #[error(
        "{page} could not be filled in: {source}; hint: this is a fault of the program, please report it"
    )]
    Page { page: &'static str, source: Box<minijinja::Error> },
}
