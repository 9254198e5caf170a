//! An interpreter of RML-1 after Roland's "RML-1 Programing Guideline" (2002), for three axes.
//!
//! Mode 1 (one letter, `^` before a mode 2 command), mode 2 (two letters) and the common `!`
//! commands are read; a text keeps to the mode it began in, since EGX-300 class machines have one. An
//! out-of-range value is refused, where the machine would clamp it.

use std::io::BufRead;
use std::ops::Range;

use super::error::{Error, Place};
use super::reading::{Event, Language, Motion, Note, Options, Summary};

/// The range of RML-1's float parameter.
const LOWEST: f64 = -8_388_608.0;
const HIGHEST: f64 = 8_388_607.0;
const MOST_NUMBERS: usize = 3 * 4096;
const MOST_DIGITS: usize = 40;

type Sink<'a> = dyn FnMut(&Event) -> Result<(), Error> + 'a;

/// Reads RML-1 command by command.
pub(super) fn read(source: &mut dyn BufRead, options: &Options, each: &mut Sink) -> Result<Summary, Error> {
    let mut scanner = Scanner::new(source);
    scanner.advance()?;
    let mut machine = Machine {
        unit_mm: options.rml_unit_mm,
        at_mm: [f64::NAN; 3],
        relative: false,
        speed_3d_mm_s: None,
        speed_down_mm_s: None,
        down_units: 0.0,
        up_units: None,
        dwell_ms: 0.0,
        turns: false,
        began: None,
    };
    let mut summary = Summary { language: Language::Rml1, blocks: 0, bytes: 0, notes: Vec::new() };
    let mut numbers = Vec::new();
    let mut last = None;
    while let Some((command, at)) = scanner.command(&mut numbers)? {
        summary.blocks += 1;
        last = Some(at);
        machine.run(command, &numbers, at, each)?;
    }
    summary.bytes = scanner.bytes;
    if machine.turns {
        let line = last.and_then(|at: Place| u32::try_from(at.line).ok()).unwrap_or(u32::MAX);
        summary.notes.push(Note::SpindleOn { line });
    }
    if summary.blocks == 0 {
        return Err(Error::Empty);
    }
    Ok(summary)
}

/// A command's spelling without its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Command {
    name: &'static str,
    /// 0 for the commands common to both modes.
    mode: u8,
}

/// Every command that is known, read or refused by name.
const COMMANDS: [(&str, u8); 28] = [
    ("D", 1),
    ("F", 1),
    ("H", 1),
    ("I", 1),
    ("J", 1),
    ("M", 1),
    ("R", 1),
    ("V", 1),
    ("W", 1),
    ("Z", 1),
    ("@", 1),
    ("DF", 2),
    ("IN", 2),
    ("PA", 2),
    ("PD", 2),
    ("PR", 2),
    ("PU", 2),
    ("VS", 2),
    ("!DW", 0),
    ("!MC", 0),
    ("!NR", 0),
    ("!PZ", 0),
    ("!RC", 0),
    ("!VZ", 0),
    ("!ZM", 0),
    ("!ZZ", 0),
    ("!ZO", 0),
    ("!ZE", 0),
];

fn known(name: &[u8]) -> Option<Command> {
    let same = |known: &str| known.as_bytes().first() == name.first() && known.as_bytes() == name;
    COMMANDS.iter().find(|c| same(c.0)).map(|&(name, mode)| Command { name, mode })
}

fn spelled(name: &[u8]) -> String {
    String::from_utf8_lossy(name).into_owned()
}

/// A parameter and where it stands.
#[derive(Clone, Copy)]
struct Number {
    value: f64,
    at: Place,
}

/// Bytes that are taken from the source at once.
const CHUNK: usize = 1 << 16;

struct Scanner<'a> {
    source: &'a mut dyn BufRead,
    chunk: Box<[u8]>,
    /// What of the chunk is not looked at yet.
    left: Range<usize>,
    next: Option<u8>,
    line: u64,
    column: u64,
    bytes: u64,
}

impl Scanner<'_> {
    fn new(source: &mut dyn BufRead) -> Scanner<'_> {
        let chunk = vec![0; CHUNK].into_boxed_slice();
        Scanner { source, chunk, left: 0..0, next: None, line: 1, column: 0, bytes: 0 }
    }

    #[inline(always)]
    fn advance(&mut self) -> Result<(), Error> {
        let last = self.next;
        if self.left.is_empty() {
            self.left = 0..read_some(self.source, &mut self.chunk)?;
        }
        self.next = self.left.next().map(|place| self.chunk[place]);
        // CR alone ends a line too.
        if last == Some(b'\n') || (last == Some(b'\r') && self.next != Some(b'\n')) {
            self.line += 1;
            self.column = 0;
        }
        if let Some(byte) = self.next {
            self.column += 1;
            self.bytes += 1;
            if byte >= 0x7f || (byte < 0x20 && !matches!(byte, b'\t' | b'\r' | b'\n')) {
                return Err(Error::NotAscii { at: self.at(), byte });
            }
        }
        Ok(())
    }

    fn at(&self) -> Place {
        Place { line: self.line, column: self.column }
    }

    fn letter(&self) -> Option<u8> {
        self.next.map(|b| b.to_ascii_uppercase()).filter(u8::is_ascii_uppercase)
    }

    /// The next command with its numbers, up to its terminator or the next command.
    fn command(&mut self, numbers: &mut Vec<Number>) -> Result<Option<(Command, Place)>, Error> {
        while self.next.is_some_and(|b| b <= b' ' || b == b';') {
            self.advance()?;
        }
        let at = self.at();
        let Some(first) = self.next else { return Ok(None) };
        let command = match first.to_ascii_uppercase() {
            b'0'..=b'9' | b'+' | b'-' | b'.' | b',' => return Err(Error::Loose { at }),
            mark @ (b'!' | b'^') => {
                self.advance()?;
                let mut name = [mark, 0, 0];
                for place in 1..3 {
                    let Some(letter) = self.letter() else {
                        return Err(Error::Command { at, name: spelled(&name[..place]) });
                    };
                    name[place] = letter;
                    self.advance()?;
                }
                let command = known(&name[usize::from(mark == b'^')..]).filter(|c| c.mode != 1);
                let command = command.ok_or_else(|| Error::Command { at, name: spelled(&name) })?;
                // ^ makes a mode 2 command one of mode 1.
                Command { mode: if mark == b'^' { 1 } else { 0 }, ..command }
            }
            b'@' => {
                self.advance()?;
                Command { name: "@", mode: 1 }
            }
            letter @ b'A'..=b'Z' => {
                self.advance()?;
                let second = self.letter();
                if let Some(command) = second.and_then(|second| known(&[letter, second])) {
                    self.advance()?;
                    command
                } else {
                    let name = || spelled(&[Some(letter), second].into_iter().flatten().collect::<Vec<u8>>());
                    known(&[letter]).ok_or_else(|| Error::Command { at, name: name() })?
                }
            }
            other => return Err(Error::Command { at, name: (other as char).to_string() }),
        };
        self.numbers(numbers)?;
        if self.next.is_none() {
            return Err(Error::Terminator { at });
        }
        Ok(Some((command, at)))
    }

    fn blanks(&mut self) -> Result<(), Error> {
        while self.next == Some(b' ') {
            self.advance()?;
        }
        Ok(())
    }

    fn numbers(&mut self, numbers: &mut Vec<Number>) -> Result<(), Error> {
        numbers.clear();
        self.blanks()?;
        while matches!(self.next, Some(b'0'..=b'9' | b'+' | b'-' | b'.')) {
            let at = self.at();
            numbers.push(Number { value: self.number()?, at });
            if numbers.len() > MOST_NUMBERS {
                return Err(Error::LineTooLong { line: at.line, most: MOST_NUMBERS });
            }
            self.blanks()?;
            if self.next != Some(b',') {
                break;
            }
            self.advance()?;
            self.blanks()?;
            if !matches!(self.next, Some(b'0'..=b'9' | b'+' | b'-' | b'.')) {
                return Err(Error::Comma { at: self.at() });
            }
        }
        Ok(())
    }

    fn number(&mut self) -> Result<f64, Error> {
        let at = self.at();
        let mut text = [0; MOST_DIGITS];
        let mut length = 0;
        while let Some(byte @ (b'0'..=b'9' | b'+' | b'-' | b'.')) = self.next {
            *text.get_mut(length).ok_or(Error::Signs { at })? = byte;
            length += 1;
            self.advance()?;
        }
        let text = &text[..length];
        whole(text).or_else(|| std::str::from_utf8(text).ok()?.parse().ok()).ok_or(Error::Signs { at })
    }
}

/// Reads into the chunk; 0 at the end of the source.
fn read_some(source: &mut dyn BufRead, chunk: &mut [u8]) -> std::io::Result<usize> {
    loop {
        match source.read(chunk) {
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

/// A number of up to 15 digits, which 64 bits hold exactly, with a sign or without: nearly all of them are. None for any other.
fn whole(text: &[u8]) -> Option<f64> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || digits.len() > 15 {
        return None;
    }
    let mut value = 0u64;
    for digit in digits {
        value = 10 * value + u64::from(digit.is_ascii_digit().then(|| digit - b'0')?);
    }
    Some(if negative { -(value as f64) } else { value as f64 })
}

struct Machine {
    unit_mm: f64,
    at_mm: [f64; 3],
    relative: bool,
    /// V, !VZ.
    speed_3d_mm_s: Option<f64>,
    /// F, VS.
    speed_down_mm_s: Option<f64>,
    /// !PZ, @: the tool's two heights; the upper is unknown until named.
    down_units: f64,
    up_units: Option<f64>,
    dwell_ms: f64,
    /// Whether !MC has the spindle turn.
    turns: bool,
    began: Option<u8>,
}

fn ranged(number: Number, what: &'static str, low: f64, high: f64) -> Result<f64, Error> {
    if (low..=high).contains(&number.value) {
        Ok(number.value)
    } else {
        Err(Error::Range { at: number.at, what, value: number.value, low, high })
    }
}

fn coordinate(number: Number) -> Result<f64, Error> {
    let value = ranged(number, "the coordinate in units", LOWEST, HIGHEST)?;
    // Whole within the range, which is less than 32 bits hold.
    if f64::from(value as i32) == value { Ok(value) } else { Err(Error::Fraction { at: number.at, value }) }
}

impl Machine {
    fn run(&mut self, command: Command, numbers: &[Number], at: Place, each: &mut Sink) -> Result<(), Error> {
        let name = command.name;
        if command.mode != 0 {
            let began = *self.began.get_or_insert(command.mode);
            if began != command.mode {
                let hint = if began == 1 {
                    format!("in mode 1 write ^{name} for a mode 2 command")
                } else {
                    "stay in mode 2".to_string()
                };
                return Err(Error::Mode { at, command: name, mode: command.mode, began, hint });
            }
        }
        let count = |allowed: fn(usize) -> bool, wanted: &'static str| {
            if allowed(numbers.len()) {
                Ok(())
            } else {
                Err(Error::Count { at, command: name, found: numbers.len(), wanted })
            }
        };
        let line = u32::try_from(at.line).unwrap_or(u32::MAX);
        match name {
            "DF" | "IN" => {
                count(|n| n == 0, "none")?;
                self.relative = false;
                self.speed_3d_mm_s = None;
                self.speed_down_mm_s = None;
                (self.down_units, self.up_units) = (0.0, None);
                self.dwell_ms = 0.0;
                self.turns = false;
                if name == "IN" {
                    self.at_mm = [f64::NAN; 3];
                }
            }
            "PA" | "PR" => {
                count(|n| n % 2 == 0, "pairs of x, y")?;
                self.relative = name == "PR";
                if !numbers.is_empty() {
                    // The tool's state decides how a bare PA moves, and the text may not tell it.
                    return Err(Error::Unread {
                        at,
                        code: "PA x,y",
                        what: "a move in the tool's last state",
                        hint: "write PU or PD with the coordinates",
                    });
                }
            }
            "V" | "!VZ" | "F" | "VS" => {
                count(|n| n == 1, "one speed in mm/s")?;
                let speed = Some(ranged(numbers[0], "the speed in mm/s", 0.1, 1000.0)?);
                if matches!(name, "V" | "!VZ") {
                    self.speed_3d_mm_s = speed;
                } else {
                    self.speed_down_mm_s = speed;
                }
            }
            "W" | "!DW" => {
                count(|n| n <= 1, "one time in ms")?;
                self.dwell_ms =
                    numbers.first().map_or(Ok(0.0), |n| ranged(*n, "the dwell in ms", 0.0, 32_767.0))?;
            }
            "!MC" => {
                count(|n| n <= 1, "one switch")?;
                for number in numbers {
                    ranged(*number, "the switch", -32_768.0, 32_767.0)?;
                }
                self.turns = numbers.first().is_none_or(|number| number.value != 0.0);
            }
            "!RC" => {
                count(|n| n == 1, "one speed code")?;
                let Number { value, at } = numbers[0];
                if !((0.0..=15.0).contains(&value) || (100.0..=32_767.0).contains(&value)) {
                    return Err(Error::SpeedCode { at, value });
                }
            }
            "J" => {
                count(|n| n == 1, "one tool number")?;
                each(&Event::Pause { line })?;
            }
            "!NR" => {
                count(|n| n == 0, "none")?;
                each(&Event::Pause { line })?;
            }
            "!PZ" | "@" => {
                count(|n| n == 1 || n == 2, "one or two heights")?;
                self.down_units = coordinate(numbers[0])?;
                if let Some(up) = numbers.get(1) {
                    self.up_units = Some(coordinate(*up)?);
                }
            }
            "H" => {
                count(|n| n == 0, "none")?;
                self.turns = false;
                // To the top, then to the origin: where the top is, only the machine knows.
                let up = [self.at_mm[0], self.at_mm[1], f64::NAN];
                self.go(up, f64::INFINITY, line, each)?;
                self.at_mm = [f64::NAN; 3];
            }
            "!ZM" => {
                count(|n| n == 1, "one z")?;
                let speed = self.speed(true, at, name)?;
                let to = [self.at_mm[0], self.at_mm[1], self.axis(2, coordinate(numbers[0])?)];
                self.go(to, speed, line, each)?;
            }
            "Z" | "!ZZ" => {
                count(|n| n > 0 && n.is_multiple_of(3), "triples of x, y, z")?;
                let speed = self.speed(true, at, name)?;
                for point in numbers.chunks_exact(3) {
                    let to = [
                        self.axis(0, coordinate(point[0])?),
                        self.axis(1, coordinate(point[1])?),
                        self.axis(2, coordinate(point[2])?),
                    ];
                    self.cut(to, speed, line, at, each)?;
                }
            }
            "PU" | "M" | "R" => {
                count(|n| n.is_multiple_of(2), "pairs of x, y")?;
                let up = self.up_units.map_or(f64::NAN, |z| z * self.unit_mm);
                self.go([self.at_mm[0], self.at_mm[1], up], f64::INFINITY, line, each)?;
                for point in numbers.chunks_exact(2) {
                    let to = self.flat(point, name, up)?;
                    self.go(to, f64::INFINITY, line, each)?;
                }
            }
            "PD" | "D" | "I" => {
                count(|n| n.is_multiple_of(2), "pairs of x, y")?;
                let down = self.down_units * self.unit_mm;
                let plunge = self.speed(true, at, name)?;
                self.cut([self.at_mm[0], self.at_mm[1], down], plunge, line, at, each)?;
                if !numbers.is_empty() {
                    let speed = self.speed(false, at, name)?;
                    for point in numbers.chunks_exact(2) {
                        let to = self.flat(point, name, down)?;
                        self.cut(to, speed, line, at, each)?;
                    }
                }
            }
            "!ZO" => {
                return Err(Error::Unread {
                    at,
                    code: "!ZO",
                    what: "a new Z origin",
                    hint: "set the origin on the machine",
                });
            }
            _ => {
                return Err(Error::Unread {
                    at,
                    code: "!ZE",
                    what: "a move by lettered axes",
                    hint: "write it with Z or !ZZ",
                });
            }
        }
        Ok(())
    }

    fn speed(&self, three_axes: bool, at: Place, command: &'static str) -> Result<f64, Error> {
        let (value, speed) =
            if three_axes { (self.speed_3d_mm_s, "V or !VZ") } else { (self.speed_down_mm_s, "F or VS") };
        value.map(|mm_s| 60.0 * mm_s).ok_or(Error::Speed { at, command, speed })
    }

    /// Units to mm. A whole number of hundredths divided by 100 is the nearest double to what the
    /// same point says in G-code.
    fn axis(&self, axis: usize, units: f64) -> f64 {
        let mm = self.mm(units);
        if self.relative { self.at_mm[axis] + mm } else { mm }
    }

    fn mm(&self, units: f64) -> f64 {
        if self.unit_mm == 0.01 { units / 100.0 } else { units * self.unit_mm }
    }

    fn flat(&self, point: &[Number], name: &str, z_mm: f64) -> Result<[f64; 3], Error> {
        let units = [coordinate(point[0])?, coordinate(point[1])?];
        let relative = match name {
            "M" | "D" => false,
            "R" | "I" => true,
            _ => self.relative,
        };
        let at = |axis: usize| {
            let mm = self.mm(units[axis]);
            if relative { self.at_mm[axis] + mm } else { mm }
        };
        Ok([at(0), at(1), z_mm])
    }

    fn cut(&mut self, to: [f64; 3], speed: f64, line: u32, at: Place, each: &mut Sink) -> Result<(), Error> {
        if to.iter().any(|v| v.is_nan()) {
            return Err(Error::Nowhere { at, axes: "an axis" });
        }
        self.go(to, speed, line, each)
    }

    /// The modal dwell comes before every motion.
    fn go(&mut self, to_mm: [f64; 3], speed_mm_min: f64, line: u32, each: &mut Sink) -> Result<(), Error> {
        if self.dwell_ms > 0.0 {
            each(&Event::Dwell { seconds: 1e-3 * self.dwell_ms, line })?;
        }
        self.at_mm = to_mm;
        each(&Event::Move(Motion { to_mm, feed_mm_min: speed_mm_min as f32, line }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::Reading;

    #[test]
    fn whole_numbers_are_what_parsing_gives() {
        for text in ["0", "-0", "-15", "007", "999999999999999", "-999999999999999"] {
            let parsed: f64 = text.parse().expect("a number");
            assert_eq!(whole(text.as_bytes()).map(f64::to_bits), Some(parsed.to_bits()), "{text}");
        }
        for text in ["", "-", "+1", "1.5", "1.", "--1", "1-2", "1234567890123456"] {
            assert_eq!(whole(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn commands_over_the_end_of_a_chunk_are_read_and_refused_where_they_stand() {
        let place = |line: usize| [line as i32 * 37 % 20_011, -(line as i32 % 997), -1 - line as i32 % 7];
        let lines = 3 * CHUNK / 16;
        let mut text = String::from("^DF\nV10\nZ0,0,0\n");
        for [x, y, z] in (0..lines).map(place) {
            text += &format!("Z{x},{y},{z}\r\n");
        }
        assert!(text.len() > 2 * CHUNK);
        let reading = Reading::of(text.as_bytes(), &Options::default()).expect("a program");
        for (k, motion) in reading.motions[1..].iter().enumerate() {
            let units = motion.to_mm.map(|mm| (100.0 * mm).round() as i32);
            assert_eq!((units, motion.line), (place(k), k as u32 + 4));
        }
        text += "Z1,2,3Q";
        let error = Reading::of(text.as_bytes(), &Options::default()).expect_err("no command");
        let at = Place { line: lines as u64 + 4, column: 7 };
        assert!(matches!(&error, Error::Command { at: found, .. } if *found == at), "{error}");
    }
}
