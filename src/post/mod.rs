//! From a toolpath to the text of a program, by the word tables of posts/.

mod block;
mod dialect;
mod error;
mod header;
mod number;
mod program;
mod sections;
mod writer;

pub use dialect::{
    Blocks, Comment, Dialect, Feed, FeedUnit, LengthUnit, Limits, LineCounts, LineEnding, Motion, Number,
    Place, Point, When, Words,
};
pub use error::Error;
pub use program::{Program, Section, StockFacts, ZZero};
pub use sections::{Piece, sections};
pub use writer::{Written, stamp_time, write};
