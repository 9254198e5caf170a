//! A stopped program taken up again: the same text from a pass on, below a start that leaves the
//! controller as it was.
//!
//! ```text
//!   start      everything before the first descent: modes, lift, spindle and its wait
//!   state      what the passes that are left out would have changed
//!   way        on the plane of the start to above pass N, then down to where pass N stood
//!   rest       the text from pass N's descent on, byte for byte
//! ```
//!
//! A pass begins where the cutter leaves the plane of its travels downward. Where a text marks its
//! passes with comments (`(pass 12)`) these are the numbers; otherwise descents are counted from 1.

mod error;
mod gcode;
mod passes;
mod rml;

pub use error::Error;

use crate::verify::{self, Language, Options, Reading};

/// A program that begins again at one of its passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Resumed {
    pub text: Vec<u8>,
    /// Of the program: pass numbers that can be asked for.
    pub first: u64,
    pub last: u64,
    /// Where pass N leaves the travel plane, in the program's frame.
    pub at_mm: [f64; 3],
    /// Line of the program with which the rest begins.
    pub line: u64,
}

/// The program again from pass `at` on.
///
/// # Errors
/// A text that is not read; a pass that it does not have; a change of tool, relative coordinates
/// or several passes on one line, which the text alone does not place.
pub fn resume(text: &[u8], at: u64, options: &Options) -> Result<Resumed, Error> {
    let reading = Reading::of(text, options)?;
    let passes = passes::passes(text, &reading);
    let (Some(first), Some(last)) = (passes.first(), passes.last()) else { return Err(Error::NoPass) };
    let Some(pass) = passes.iter().find(|pass| pass.number == at) else {
        return Err(Error::Pass { at, first: first.number, last: last.number });
    };
    let whole = Whole { text, reading: &reading, first, pass };
    let resumed = if pass.number == first.number {
        text.to_vec()
    } else if passes.iter().filter(|other| other.line == pass.line).count() > 1
        || first.line >= pass.line
        || pass.before_mm.iter().chain(&first.before_mm).any(|mm| !mm.is_finite())
    {
        return Err(Error::SameLine { at, line: pass.line });
    } else {
        match verify::language(text) {
            Language::GCode => gcode::resumed(&whole)?,
            Language::Rml1 => rml::resumed(&whole, options)?,
        }
    };
    // The judge's own reading has to find the same motions from the pass on.
    let again = Reading::of(&resumed, options)?;
    let left = &reading.motions[pass.motion..];
    let cut = &again.motions[again.motions.len().saturating_sub(left.len())..];
    let same = left.len() == cut.len()
        && left.iter().zip(cut).all(|(a, b)| a.feed_mm_min == b.feed_mm_min && near(a.to_mm, b.to_mm));
    if !same {
        return Err(Error::Differs { at });
    }
    Ok(Resumed {
        text: resumed,
        first: first.number,
        last: last.number,
        at_mm: pass.before_mm,
        line: u64::from(pass.line),
    })
}

/// What both languages work on.
struct Whole<'a> {
    text: &'a [u8],
    reading: &'a Reading,
    first: &'a passes::Pass,
    pass: &'a passes::Pass,
}

impl Whole<'_> {
    /// The lines of the text with their endings, and how many stand before a line number.
    fn lines(&self) -> Vec<&[u8]> {
        verify::lines(self.text)
    }

    fn ending(&self) -> &'static [u8] {
        match verify::lines(self.text).first() {
            Some(line) if line.ends_with(b"\r\n") => b"\r\n",
            Some(line) if line.ends_with(b"\r") => b"\r",
            _ => b"\n",
        }
    }

    /// Where the cutter stands when the start is over.
    fn started_mm(&self) -> [f64; 3] {
        self.first.before_mm
    }
}

fn near(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9 || (a.is_nan() && b.is_nan()))
}
