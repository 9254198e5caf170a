//! RML-1's commands and their numbers, byte by byte.

use std::io::BufRead;
use std::ops::Range;

use crate::verify::error::{Error, Place};

const MOST_NUMBERS: usize = 3 * 4096;
const MOST_DIGITS: usize = 40;

/// A command's spelling without its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Command {
    pub(super) name: &'static str,
    /// 0 for the commands common to both modes.
    pub(super) mode: u8,
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
pub(super) struct Number {
    pub(super) value: f64,
    pub(super) at: Place,
}

/// Bytes that are taken from the source at once.
const CHUNK: usize = 1 << 16;

pub(super) struct Scanner<'a> {
    source: &'a mut dyn BufRead,
    chunk: Box<[u8]>,
    /// What of the chunk is not looked at yet.
    left: Range<usize>,
    next: Option<u8>,
    line: u64,
    column: u64,
    pub(super) bytes: u64,
}

impl Scanner<'_> {
    pub(super) fn new(source: &mut dyn BufRead) -> Scanner<'_> {
        let chunk = vec![0; CHUNK].into_boxed_slice();
        Scanner { source, chunk, left: 0..0, next: None, line: 1, column: 0, bytes: 0 }
    }

    #[inline(always)]
    pub(super) fn advance(&mut self) -> Result<(), Error> {
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
    pub(super) fn command(&mut self, numbers: &mut Vec<Number>) -> Result<Option<(Command, Place)>, Error> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::{Options, Reading};

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
