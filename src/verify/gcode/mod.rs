//! An interpreter of RS274/NGC as small mills run it, for programs of any origin.
//!
//! Read: G0 G1 G2 G3 (with G17 G18 G19, I J K relative or absolute, R, helices, turns by P), G4, G20 G21,
//! G28 G30, G40, G43 G49, G53 with G0, G54-G59.3, G61 G61.1 G64 G187, G80, G90 G91, G90.1 G91.1, G94, G98
//! G99, M0-M9, M12 M13, M30, M48 M49, M60, F H N O S T, comments, `%`; G15, G50, G67, G69 and G97, which end
//! what is not read while it holds. Everything else is refused: a judge that skips a word has judged another program.

mod arc;
mod block;
mod straight;

use std::io::BufRead;

use super::error::{Error, Place};
use super::line;
use super::reading::{Event, Language, LineLimit, Motion, Note, Options, PathMode, Summary};
use arc::Arc;
use block::{Block, Group};

const INCH_MM: f64 = 25.4;
const LONGEST_LINE: usize = 4096;
/// A dwell that no spindle needs.
const LONG_DWELL_S: f64 = 120.0;

/// What a block leaves behind for the next.
struct Modal {
    at_mm: [f64; 3],
    /// The axes are taken to stand at 0 until they are named.
    from_zero: bool,
    motion: Option<u16>,
    plane: u16,
    unit_mm: f64,
    relative: bool,
    centre_absolute: bool,
    feed_mm_min: f64,
    offset: Option<u16>,
    spindle: bool,
    spindle_noted: bool,
}

type Sink<'a> = dyn FnMut(&Event) -> Result<(), Error> + 'a;

/// Reads G-code line by line in constant memory.
pub(super) fn read(source: &mut dyn BufRead, options: &Options, each: &mut Sink) -> Result<Summary, Error> {
    let mut modal = Modal {
        at_mm: [f64::NAN; 3],
        from_zero: options.from_zero,
        motion: None,
        plane: 170,
        unit_mm: 1.0,
        relative: false,
        centre_absolute: false,
        feed_mm_min: 0.0,
        offset: None,
        spindle: false,
        spindle_noted: false,
    };
    let mut summary = Summary { language: Language::GCode, blocks: 0, bytes: 0, notes: Vec::new() };
    let mut text = Vec::with_capacity(256);
    let mut block = Block::new();
    let (mut number, mut opened, mut ended) = (0u64, false, false);
    let longest = options.line.map_or(LONGEST_LINE, |limit| limit.bytes.min(LONGEST_LINE));
    loop {
        if !ended {
            let passed = modal.straights(source.fill_buf()?, longest, &mut number, each)?;
            source.consume(passed.bytes);
            summary.bytes += passed.bytes as u64;
            summary.blocks += passed.blocks;
        }
        let taken = line::next(source, &mut text, LONGEST_LINE)?;
        if taken == 0 {
            break;
        }
        number += 1;
        summary.bytes += taken as u64;
        if text.len() > LONGEST_LINE {
            return Err(Error::LineTooLong { line: number, most: LONGEST_LINE });
        }
        if ended {
            // What follows the end is never run.
            continue;
        }
        if let Some(limit) = options.line {
            held(limit, &text, number, &mut summary.notes)?;
        }
        block.parse(&text, number)?;
        if block.words > 0 {
            summary.blocks += 1;
            ended = modal.run(&mut block, &mut summary.notes, each)?;
        }
        if block.percent {
            // The first opens the text if nothing stood before it.
            ended |= opened || summary.blocks > 0;
            opened = true;
        }
    }
    if !ended {
        return Err(if summary.blocks == 0 { Error::Empty } else { Error::NoEnd { line: number } });
    }
    Ok(summary)
}

/// Holds a line against what its controller takes.
fn held(limit: LineLimit, text: &[u8], line: u64, notes: &mut Vec<Note>) -> Result<(), Error> {
    let most = limit.bytes;
    let Some(cut) = cut(limit, text) else { return Ok(()) };
    let at = Place { line, column: cut as u64 + 1 };
    if limit.confirmed {
        let counted = if limit.words_only { " without blanks and comments" } else { "" };
        return Err(Error::LineCut { at, most, counted });
    }
    if !notes.iter().any(|note| matches!(note, Note::LongLine { .. })) {
        notes.push(Note::LongLine { line, column: at.column, most });
    }
    Ok(())
}

/// Notes once that a program moves before it has positioned.
fn from_zero(line: u32, notes: &mut Vec<Note>) {
    if !notes.iter().any(|note| matches!(note, Note::FromZero { .. })) {
        notes.push(Note::FromZero { line });
    }
}

/// The first byte that a controller does not take any more.
fn cut(limit: LineLimit, text: &[u8]) -> Option<usize> {
    if text.len() <= limit.bytes {
        return None;
    }
    if !limit.words_only {
        return Some(limit.bytes);
    }
    let (mut depth, mut counted) = (0, 0);
    for (at, byte) in text.iter().enumerate() {
        match byte {
            b';' if depth == 0 => return None,
            b'(' => depth = 1,
            b')' => depth = 0,
            b' ' | b'\t' => {}
            _ if depth == 0 => counted += 1,
            _ => {}
        }
        if counted > limit.bytes {
            return Some(at);
        }
    }
    None
}

impl Modal {
    /// Runs one block in the order RS274/NGC gives; true if it ends the program.
    fn run(&mut self, block: &mut Block, notes: &mut Vec<Note>, each: &mut Sink) -> Result<bool, Error> {
        let line = u32::try_from(block.line).unwrap_or(u32::MAX);
        self.labels(block)?;
        if let Some((code, _)) = block.code(Group::Units) {
            let unit_mm = if code == 200 { INCH_MM } else { 1.0 };
            if unit_mm != self.unit_mm && block.has(b'F') {
                return Err(Error::FeedUnits { at: block.place(b'F') });
            }
            self.unit_mm = unit_mm;
        }
        if block.scaling && [b'X', b'Y', b'Z'].into_iter().any(|letter| block.has(letter)) {
            return Err(Error::Unread {
                at: block.first_place(b"XYZ"),
                code: "G50 with X, Y or Z",
                what: "a shift of the origin, or of a scaling",
                hint: "G50 alone, or without it",
            });
        }
        if let Some(feed) = block.take(b'F') {
            self.feed_mm_min =
                self.bounded(block, b'F', "the feed in mm/min", feed * self.unit_mm, 0.0, 1e6)?;
        }
        if let Some(speed) = block.take(b'S') {
            self.bounded(block, b'S', "the spindle speed", speed, 0.0, 1e6)?;
        }
        if block.code(Group::ToolChange).is_some() {
            each(&Event::Pause { line })?;
        }
        if let Some((code, _)) = block.code(Group::Spindle) {
            self.spindle = code != 50;
        }
        self.modes(block, each)?;
        let once = block.code(Group::Once);
        let mut waits_by_x = false;
        if let Some((40, at)) = once {
            let (mut seconds, mut letter) = (block.take(b'P'), b'P');
            if seconds.is_none() {
                (seconds, letter) = (block.take(b'X'), b'X');
                waits_by_x = true;
            }
            let seconds = seconds.ok_or(Error::DwellTime { at })?;
            self.bounded(block, letter, "the dwell in seconds", seconds, 0.0, 1e6)?;
            if seconds > LONG_DWELL_S {
                notes.push(Note::LongDwell { line, seconds });
            }
            each(&Event::Dwell { seconds, line })?;
        }
        let moves = block.code(Group::Motion);
        if let Some((code, _)) = moves {
            self.motion = (code != 800).then_some(code);
        }
        match once {
            Some((280 | 300, _)) => self.go_home(block, line, each)?,
            Some((530, at)) => {
                if self.motion != Some(0) {
                    return Err(Error::Unread {
                        at,
                        code: "G53",
                        what: "a feed motion in machine coordinates",
                        hint: "only G0 is read with G53",
                    });
                }
                self.leave(block, line, each)?;
            }
            // G4 X3. waits three seconds and moves nothing.
            _ if waits_by_x => {}
            _ if block.has(b'X') || block.has(b'Y') || block.has(b'Z') => {
                self.travel(block, line, notes, each)?;
            }
            // A full turn in the modal plane names no axis.
            _ if matches!(moves, Some((20 | 30, _))) => self.travel(block, line, notes, each)?,
            _ => {}
        }
        block.all_used()?;
        match block.code(Group::Stop) {
            Some((20 | 300, _)) => return Ok(true),
            Some(_) => each(&Event::Pause { line })?,
            None => {}
        }
        Ok(false)
    }

    fn labels(&self, block: &mut Block) -> Result<(), Error> {
        if let Some(number) = block.take(b'O')
            && (block.words > 1 || number.fract() != 0.0)
        {
            return Err(Error::Unread {
                at: block.place(b'O'),
                code: "O",
                what: "a subprogram or a condition",
                hint: "write its motions out with G0 and G1",
            });
        }
        block.take(b'N');
        if let Some(tool) = block.take(b'T') {
            self.bounded(block, b'T', "the tool's number", tool, 0.0, 1e8)?;
        }
        if block.code(Group::LengthOffset).is_some() || block.code(Group::ToolChange).is_some() {
            block.take(b'H');
        }
        Ok(())
    }

    fn modes(&mut self, block: &mut Block, each: &mut Sink) -> Result<(), Error> {
        if let Some((code, _)) = block.code(Group::Plane) {
            self.plane = code;
        }
        if let Some((code, at)) = block.code(Group::Offset) {
            if let Some(first) = self.offset.filter(|first| *first != code) {
                let (first, second) = (f64::from(first) / 10.0, f64::from(code) / 10.0);
                return Err(Error::Offsets { at, first, second });
            }
            self.offset = Some(code);
        }
        if let Some((code, _)) = block.code(Group::PathMode) {
            let mode = match code {
                610 => PathMode::Exact,
                611 => PathMode::Stop,
                1870 => {
                    // Haas: P names a smoothness, E the largest rounding of a corner.
                    block.take(b'P');
                    let tolerance_mm = block.take(b'E').map(|e| e * self.unit_mm).filter(|e| *e > 0.0);
                    PathMode::Blend { tolerance_mm, merge_mm: None }
                }
                _ => {
                    // P0 is what no P is: LinuxCNC then rounds without bound.
                    let tolerance_mm = block.take(b'P').map(|p| p * self.unit_mm).filter(|p| *p > 0.0);
                    let merge_mm = block.take(b'Q').map(|q| q * self.unit_mm);
                    PathMode::Blend { tolerance_mm, merge_mm }
                }
            };
            each(&Event::Path(mode))?;
        }
        if let Some((code, _)) = block.code(Group::Distance) {
            self.relative = code == 910;
        }
        if let Some((code, _)) = block.code(Group::ArcDistance) {
            self.centre_absolute = code == 901;
        }
        Ok(())
    }

    /// The axes' programmed target; what is not named stays.
    fn target(&self, block: &mut Block) -> Result<[f64; 3], Error> {
        let mut target = self.at_mm;
        for (axis, letter) in [b'X', b'Y', b'Z'].into_iter().enumerate() {
            if let Some(value) = block.take(letter) {
                let value =
                    self.bounded(block, letter, "the coordinate in mm", value * self.unit_mm, -1e5, 1e5)?;
                target[axis] = if self.relative { target[axis] + value } else { value };
            }
        }
        Ok(target)
    }

    fn bounded(
        &self,
        block: &Block,
        letter: u8,
        what: &'static str,
        value: f64,
        low: f64,
        high: f64,
    ) -> Result<f64, Error> {
        if (low..=high).contains(&value) {
            Ok(value)
        } else {
            Err(Error::Range { at: block.place(letter), what, value, low, high })
        }
    }

    fn rapid(&mut self, to_mm: [f64; 3], line: u32, each: &mut Sink) -> Result<(), Error> {
        self.at_mm = to_mm;
        each(&Event::Move(Motion { to_mm, feed_mm_min: f32::INFINITY, line }))
    }

    /// G28, G30: a rapid through the target to the machine's home, which the text does not place.
    fn go_home(&mut self, block: &mut Block, line: u32, each: &mut Sink) -> Result<(), Error> {
        self.from_zero = false;
        let named = [b'X', b'Y', b'Z'].map(|letter| block.has(letter));
        let through = self.target(block)?;
        if (0..3).any(|axis| named[axis] && through[axis] != self.at_mm[axis]) {
            self.rapid(through, line, each)?;
        }
        let all = !named.contains(&true);
        let home = std::array::from_fn(|axis| if all || named[axis] { f64::NAN } else { self.at_mm[axis] });
        self.rapid(home, line, each)
    }

    /// G53 G0: the axes named go where only the machine knows.
    fn leave(&mut self, block: &mut Block, line: u32, each: &mut Sink) -> Result<(), Error> {
        self.from_zero = false;
        let named = [b'X', b'Y', b'Z'].map(|letter| block.has(letter));
        self.target(block)?;
        let to = std::array::from_fn(|axis| if named[axis] { f64::NAN } else { self.at_mm[axis] });
        self.rapid(to, line, each)
    }

    fn travel(
        &mut self,
        block: &mut Block,
        line: u32,
        notes: &mut Vec<Note>,
        each: &mut Sink,
    ) -> Result<(), Error> {
        let at = block.first_place(b"XYZIJKR");
        if self.from_zero && self.motion.is_some_and(|motion| motion != 0) {
            self.from_zero = false;
            if self.at_mm.iter().any(|mm| mm.is_nan()) {
                from_zero(line, notes);
                self.rapid(self.at_mm.map(|mm| if mm.is_nan() { 0.0 } else { mm }), line, each)?;
            }
        }
        if self.from_zero && self.relative {
            for (axis, letter) in [b'X', b'Y', b'Z'].into_iter().enumerate() {
                if block.has(letter) && self.at_mm[axis].is_nan() {
                    self.at_mm[axis] = 0.0;
                    from_zero(line, notes);
                }
            }
        }
        let start = self.at_mm;
        let target = self.target(block)?;
        let Some(motion) = self.motion else {
            return Err(Error::NoMotion { at });
        };
        if motion == 0 {
            return self.rapid(target, line, each);
        }
        if self.feed_mm_min <= 0.0 {
            return Err(Error::Feed { at, feed_mm_min: self.feed_mm_min });
        }
        let lost = |p: &[f64; 3]| -> Option<&'static str> {
            match (p[0].is_nan() || p[1].is_nan(), p[2].is_nan()) {
                (false, false) => None,
                (true, false) => Some("X or Y"),
                (false, true) => Some("Z"),
                (true, true) => Some("every axis"),
            }
        };
        if let Some(axes) = lost(&target) {
            return Err(Error::Nowhere { at, axes });
        }
        if !self.spindle && !self.spindle_noted {
            self.spindle_noted = true;
            notes.push(Note::SpindleOff { line });
        }
        let feed_mm_min = self.feed_mm_min as f32;
        if motion == 10 {
            self.at_mm = target;
            return each(&Event::Move(Motion { to_mm: target, feed_mm_min, line }));
        }
        if let Some(axes) = lost(&start) {
            return Err(Error::Nowhere { at, axes });
        }
        let arc = self.arc(block, motion == 30, start, target, at)?;
        each(&Event::Arc { radius_mm: arc.radius_mm(), chords: arc.chords })?;
        for chord in 1..=arc.chords {
            each(&Event::Move(Motion { to_mm: arc.point(chord), feed_mm_min, line }))?;
        }
        self.at_mm = target;
        Ok(())
    }

    fn arc(
        &self,
        block: &mut Block,
        counterclockwise: bool,
        start: [f64; 3],
        end: [f64; 3],
        at: Place,
    ) -> Result<Arc, Error> {
        let axes = Arc::axes(self.plane);
        if let Some(radius) = block.take(b'R') {
            return Arc::of_radius(axes, start, end, radius * self.unit_mm, counterclockwise, at);
        }
        let letters = [b'I' + axes[0] as u8, b'I' + axes[1] as u8];
        if !letters.iter().any(|l| block.has(*l)) {
            return Err(Error::ArcCentre { at });
        }
        if self.centre_absolute && !letters.iter().all(|l| block.has(*l)) {
            return Err(Error::ArcAbsolute { at });
        }
        let mut centre = [0.0; 2];
        for i in 0..2 {
            let value = block.take(letters[i]).map(|v| v * self.unit_mm);
            let from = start[axes[i]];
            centre[i] =
                if self.centre_absolute { value.unwrap_or(from) } else { from + value.unwrap_or(0.0) };
        }
        let turns = block.take(b'P').unwrap_or(1.0);
        self.bounded(block, b'P', "the number of turns", turns, 1.0, 1000.0)?;
        if turns.fract() != 0.0 {
            return Err(Error::Fraction { at: block.place(b'P'), value: turns });
        }
        Arc::about(axes, start, end, centre, counterclockwise, turns as u32, at)
    }
}
