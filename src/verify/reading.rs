use std::fmt;

use super::Error;
use super::travel::{Travel, TravelSearch};

/// A straight motion from where the last one ended, in the program frame. An axis that the text has
/// not named yet, or that stands at the machine's home, is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pub to_mm: [f64; 3],
    /// Infinite for a rapid.
    pub feed_mm_min: f32,
    /// Line of the text, from 1.
    pub line: u32,
}

impl Motion {
    /// Whether the controller makes this motion as fast as it can.
    pub fn rapid(&self) -> bool {
        self.feed_mm_min == f32::INFINITY
    }

    /// Whether all three axes are known at its end.
    pub fn known(&self) -> bool {
        self.to_mm.iter().all(|v| v.is_finite())
    }
}

/// How the controller may leave the programmed path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathMode {
    /// G61: the path is followed, corners slow the motion.
    Exact,
    /// G61.1: every block ends in a stop.
    Stop,
    /// G64: corners may be cut by at most this; None is without bound.
    Blend { tolerance_mm: Option<f64>, merge_mm: Option<f64> },
}

/// What a text makes the machine do, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    Move(Motion),
    /// The next `chords` moves are an arc of this radius.
    Arc {
        radius_mm: f64,
        chords: u32,
    },
    Dwell {
        seconds: f64,
        line: u32,
    },
    Path(PathMode),
    /// The machine waits for its operator, or changes its tool.
    Pause {
        line: u32,
    },
}

/// The language of a text, found from the text itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    GCode,
    Rml1,
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Language::GCode => "G-code",
            Language::Rml1 => "RML-1",
        })
    }
}

/// Something in a text that runs, and that an operator should know.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// The first feed motion comes with the spindle off.
    SpindleOff { line: u32 },
    /// The text of an RML-1 program ends while the spindle turns.
    SpindleOn { line: u32 },
    /// The first line that its controller may not take whole.
    LongLine { line: u64, column: u64, most: usize },
    /// The first feed motion, or one by an increment, comes before a position that the text names.
    FromZero { line: u32 },
    /// Some controllers count P in milliseconds.
    LongDwell { line: u32, seconds: f64 },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Note::SpindleOff { line } => {
                write!(f, "line {line}: the first feed motion comes with the spindle off")
            }
            Note::SpindleOn { line } => {
                write!(
                    f,
                    "line {line}: the text ends while the spindle turns, without !MC0 or H; hint: is the file complete?"
                )
            }
            Note::LongLine { line, column, most } => {
                write!(
                    f,
                    "line {line}, column {column}: longer than {most} bytes, which no source confirms this controller takes"
                )
            }
            Note::FromZero { line } => {
                write!(f, "line {line}: moves before it has positioned, it is taken to start at its zero")
            }
            Note::LongDwell { line, seconds } => {
                write!(
                    f,
                    "line {line}: a dwell of {seconds} s; hint: some controllers count P in milliseconds"
                )
            }
        }
    }
}

/// What a whole text was.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    pub language: Language,
    /// G-code blocks with at least one word, or RML-1 commands.
    pub blocks: u64,
    pub bytes: u64,
    pub notes: Vec<Note>,
}

/// Facts about the reader's machine that a text does not carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// mm of one RML-1 unit: 0.01, but 0.025 on MDX-15 and MDX-20.
    pub rml_unit_mm: f64,
    /// What its controller takes of a line of G-code; None where it is not known which one reads it.
    pub line: Option<LineLimit>,
    /// G-code that cuts, or moves by increments, before it has positioned is taken to start at its zero, and a note says so. Enough for its
    /// time; a judge must know where the cutter is, and such a program is refused to it.
    pub from_zero: bool,
}

/// How long a line of G-code may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineLimit {
    pub bytes: usize,
    /// Blanks and comments do not count.
    pub words_only: bool,
    /// Where no source confirms it, a longer line is only noted.
    pub confirmed: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options { rml_unit_mm: 0.01, line: None, from_zero: false }
    }
}

/// An arc among a reading's motions: `chords` of them from `first`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    pub first: usize,
    pub chords: usize,
    pub radius_mm: f64,
}

/// A whole program as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    pub summary: Summary,
    pub motions: Vec<Motion>,
    /// Dwells in seconds, each before the motion of this index.
    pub dwells: Vec<(usize, f64)>,
    pub arcs: Vec<Arc>,
    /// Path modes, each in force from the motion of this index.
    pub path_modes: Vec<(usize, PathMode)>,
    pub pauses: Vec<(usize, u32)>,
}

/// 3.2 GB of motions; a program past this is cut in parts.
const MOST_MOTIONS: usize = 100_000_000;

impl Reading {
    /// Reads a whole text. See [`super::read`] for what is refused.
    pub fn of(text: &[u8], options: &Options) -> Result<Reading, Error> {
        let mut source = text;
        Reading::from(&mut source, options)
    }

    /// Reads a whole program from a stream.
    pub fn from(source: &mut dyn std::io::BufRead, options: &Options) -> Result<Reading, Error> {
        let mut reading = Reading {
            summary: Summary { language: Language::GCode, blocks: 0, bytes: 0, notes: Vec::new() },
            motions: Vec::new(),
            dwells: Vec::new(),
            arcs: Vec::new(),
            path_modes: Vec::new(),
            pauses: Vec::new(),
        };
        let summary = super::read(source, options, &mut |event| {
            let next = reading.motions.len();
            match *event {
                Event::Move(motion) => {
                    if next == MOST_MOTIONS {
                        let at = super::Place { line: u64::from(motion.line), column: 1 };
                        return Err(Error::TooMany { at, motions: next });
                    }
                    reading.motions.push(motion);
                }
                Event::Arc { radius_mm, chords } => {
                    reading.arcs.push(Arc { first: next, chords: chords as usize, radius_mm });
                }
                Event::Dwell { seconds, .. } => reading.dwells.push((next, seconds)),
                Event::Path(mode) => reading.path_modes.push((next, mode)),
                Event::Pause { line } => reading.pauses.push((next, line)),
            }
            Ok(())
        })?;
        reading.summary = summary;
        if reading.motions.is_empty() {
            return Err(Error::Empty);
        }
        Ok(reading)
    }

    /// The events again, in their order.
    pub fn replay(&self, each: &mut dyn FnMut(&Event)) {
        let (mut dwells, mut arcs) = (self.dwells.iter().peekable(), self.arcs.iter().peekable());
        let (mut modes, mut pauses) = (self.path_modes.iter().peekable(), self.pauses.iter().peekable());
        for index in 0..=self.motions.len() {
            while let Some((_, mode)) = modes.next_if(|m| m.0 == index) {
                each(&Event::Path(*mode));
            }
            while let Some((_, line)) = pauses.next_if(|p| p.0 == index) {
                each(&Event::Pause { line: *line });
            }
            while let Some((_, seconds)) = dwells.next_if(|d| d.0 == index) {
                each(&Event::Dwell { seconds: *seconds, line: 0 });
            }
            while let Some(arc) = arcs.next_if(|a| a.first == index) {
                each(&Event::Arc { radius_mm: arc.radius_mm, chords: arc.chords as u32 });
            }
            if let Some(motion) = self.motions.get(index) {
                each(&Event::Move(*motion));
            }
        }
    }

    /// Length sums and bounds; RML-1's travels count as rapids.
    pub fn extent(&self) -> Extent {
        let mut extent = Extent::with_travel(self.travel());
        for motion in &self.motions {
            extent.add(motion);
        }
        extent
    }

    /// What tells the travels of an RML-1 program from its cuts; G-code has rapids.
    pub fn travel(&self) -> Travel {
        if self.summary.language != Language::Rml1 {
            return Travel::default();
        }
        let mut search = TravelSearch::default();
        for motion in &self.motions {
            search.add(motion);
        }
        search.found()
    }
}

/// Sums and bounds over motions, gathered one by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Lowest and highest end of every motion from the first that leaves X and Y known.
    pub low_mm: [f64; 3],
    pub high_mm: [f64; 3],
    /// Lines of the first motions that end there.
    pub low_line: [u32; 3],
    pub high_line: [u32; 3],
    /// Lengths of feed motions and of rapids between known points.
    pub cutting_mm: f64,
    pub rapid_mm: f64,
    travel: Travel,
    last: [f64; 3],
}

impl Default for Extent {
    fn default() -> Extent {
        Extent {
            low_mm: [f64::INFINITY; 3],
            high_mm: [f64::NEG_INFINITY; 3],
            low_line: [0; 3],
            high_line: [0; 3],
            cutting_mm: 0.0,
            rapid_mm: 0.0,
            travel: Travel::default(),
            last: [f64::NAN; 3],
        }
    }
}

impl Extent {
    /// Nothing yet; travels will count as rapids.
    pub fn with_travel(travel: Travel) -> Extent {
        Extent { travel, ..Extent::default() }
    }

    /// Takes the next motion in.
    pub fn add(&mut self, motion: &Motion) {
        let to = motion.to_mm;
        let delta: [f64; 3] = std::array::from_fn(|axis| to[axis] - self.last[axis]);
        let length = (delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2]).sqrt();
        if length.is_finite() {
            if self.travel.holds(self.last, motion) {
                self.rapid_mm += length;
            } else {
                self.cutting_mm += length;
            }
        }
        if to[0].is_finite() && to[1].is_finite() {
            for (axis, &value) in to.iter().enumerate() {
                // Neither holds of a NaN: the height of the machine's home is not known.
                if value < self.low_mm[axis] {
                    (self.low_mm[axis], self.low_line[axis]) = (value, motion.line);
                }
                if value > self.high_mm[axis] {
                    (self.high_mm[axis], self.high_line[axis]) = (value, motion.line);
                }
            }
        }
        self.last = to;
    }
}
