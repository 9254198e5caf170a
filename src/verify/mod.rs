//! The judge: reads a program's text back by its own interpreters, cuts it through the stock in
//! simulation, and times it. It shares no code with what planned or wrote the program.

mod error;
mod gcode;
mod reading;
mod rml;
mod text;

pub use error::{Error, Place};
pub use reading::{Arc, Event, Extent, Language, Motion, Note, Options, PathMode, Reading, Summary};
pub use text::{language, read};
