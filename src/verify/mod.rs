//! The judge: reads a program's text back by its own interpreters, cuts it through the stock in
//! simulation, and times it. It shares no code with what planned or wrote the program.

mod body;
mod contact;
mod error;
mod feeds;
mod gcode;
mod judged;
mod line;
mod reading;
mod rml;
mod skyline;
mod sweep;
mod text;
mod time;
mod travel;

pub use body::{BodyHit, body_hits};
pub use error::{Error, Place};
pub use feeds::{Fastest, Feeds};
pub use judged::{Blank, Judged, LateralRapid};
pub use line::lines;
pub use reading::{
    Arc, Event, Extent, Language, LineLimit, Motion, Note, Options, PathMode, Reading, Summary,
};
pub use sweep::{Bite, ProgramCut, Swept, sweep};
pub use text::{language, read};
pub use time::{Clock, Command, Corner, Interpreter, Kinematics, Planner, Timing, time};
pub use travel::{Travel, TravelSearch};
