//! From a toolpath to the text of a program, by the word tables of posts/.

mod dialect;
mod error;
mod header;
mod program;
mod writer;

pub use dialect::{
    Blocks, Comment, Dialect, Feed, FeedUnit, LengthUnit, Limits, LineEnding, Motion, Number, Place, Point,
    When, Words,
};
pub use error::Error;
pub use program::{Program, StockFacts, ZZero};
pub use writer::{Written, write};
