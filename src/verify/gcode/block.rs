//! One block of G-code: letters, numbers and comments, before anything is meant by them.

use super::super::error::{Error, Place};

/// The modal group of a G code: two of one group in one block contradict each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Group {
    Once,
    Motion,
    Plane,
    Distance,
    ArcDistance,
    FeedMode,
    Units,
    CutterSide,
    LengthOffset,
    Return,
    Offset,
    PathMode,
    Stop,
    ToolChange,
    Spindle,
    Coolant,
    Override,
    Air,
    /// Ends something that is not read while it holds; any number of them may stand in a block.
    End,
}
const GROUPS: usize = 19;

/// Words of one block. Codes are kept in tenths: G91.1 is 911.
pub(super) struct Block {
    codes: [Option<(u16, u32)>; GROUPS],
    present: u32,
    used: u32,
    value: [f64; 26],
    column: [u32; 26],
    pub line: u64,
    pub words: usize,
    pub percent: bool,
    /// G50 or G50.1 stands in it.
    pub scaling: bool,
}

impl Block {
    pub fn new() -> Block {
        Block {
            codes: [None; GROUPS],
            present: 0,
            used: 0,
            value: [0.0; 26],
            column: [0; 26],
            line: 0,
            words: 0,
            percent: false,
            scaling: false,
        }
    }

    /// The code of a group in tenths and its place.
    pub fn code(&self, group: Group) -> Option<(u16, Place)> {
        self.codes[group as usize].map(|(code, column)| (code, self.at(column)))
    }

    /// A word's number, which then counts as used.
    pub fn take(&mut self, letter: u8) -> Option<f64> {
        let bit = 1u32 << (letter - b'A');
        self.used |= bit;
        (self.present & bit != 0).then(|| self.value[(letter - b'A') as usize])
    }

    pub fn has(&self, letter: u8) -> bool {
        self.present & (1u32 << (letter - b'A')) != 0
    }

    pub fn place(&self, letter: u8) -> Place {
        self.at(self.column[(letter - b'A') as usize])
    }

    fn at(&self, column: u32) -> Place {
        Place { line: self.line, column: u64::from(column) }
    }

    /// The place of the first of these words, or of the block.
    pub fn first_place(&self, letters: &[u8]) -> Place {
        let columns = letters.iter().filter(|l| self.has(**l)).map(|l| self.place(*l).column);
        Place { line: self.line, column: columns.min().unwrap_or(1) }
    }

    /// A word that nothing took is refused.
    pub fn all_used(&self) -> Result<(), Error> {
        let left = self.present & !self.used;
        if left == 0 {
            return Ok(());
        }
        let letter = b'A' + left.trailing_zeros() as u8;
        Err(Error::Unused { at: self.place(letter), letter: letter as char })
    }

    /// Takes one line apart.
    pub fn parse(&mut self, text: &[u8], line: u64) -> Result<(), Error> {
        self.codes = [None; GROUPS];
        self.present = 0;
        self.used = 0;
        self.words = 0;
        self.line = line;
        self.percent = false;
        self.scaling = false;
        let mut i = 0;
        while i < text.len() {
            let byte = text[i];
            let at = Place { line, column: i as u64 + 1 };
            match byte {
                b' ' | b'\t' => i += 1,
                b'(' => i = self.comment(text, i)?,
                b';' => {
                    ascii(&text[i..], at)?;
                    break;
                }
                b'%' => {
                    self.percent = true;
                    ascii(&text[i..], at)?;
                    break;
                }
                b'/' => return Err(Error::BlockDelete { at }),
                b'#' | b'[' | b'<' | b'=' => return Err(Error::Expression { at, found: byte as char }),
                b'a'..=b'z' | b'A'..=b'Z' => {
                    let letter = byte.to_ascii_uppercase();
                    let (value, after) = number(text, i + 1, letter, line).map_err(|error| match error {
                        // O100 call, O100 while [...]
                        Error::NumberMissing { .. } if self.has(b'O') => Error::Unread {
                            at: self.place(b'O'),
                            code: "O",
                            what: "a subprogram or a loop",
                            hint: "write its motions out with G0 and G1",
                        },
                        other => other,
                    })?;
                    self.word(letter, value, at)?;
                    i = after;
                }
                0x21..=0x7e => return Err(Error::Character { at, found: byte as char }),
                _ => return Err(Error::NotAscii { at, byte }),
            }
        }
        Ok(())
    }

    fn comment(&self, text: &[u8], open: usize) -> Result<usize, Error> {
        let at = |i: usize| Place { line: self.line, column: i as u64 + 1 };
        for (i, &byte) in text.iter().enumerate().skip(open + 1) {
            match byte {
                b')' => return Ok(i + 1),
                b'(' => return Err(Error::CommentNested { at: at(i) }),
                b'\t' | 0x20..=0x7e => {}
                _ => return Err(Error::NotAscii { at: at(i), byte }),
            }
        }
        Err(Error::CommentOpen { at: at(open) })
    }

    fn word(&mut self, letter: u8, value: f64, at: Place) -> Result<(), Error> {
        self.words += 1;
        let column = at.column as u32;
        match letter {
            b'G' | b'M' => {
                let tenths = value * 10.0;
                let code = tenths.round();
                let group = if (tenths - code).abs() < 1e-6 && (0.0..10_000.0).contains(&code) {
                    if letter == b'G' { g_group(code as u16, at)? } else { m_group(code as u16, at)? }
                } else {
                    None
                };
                let letter = letter as char;
                let group = group.ok_or(Error::Code { at, letter, number: value })?;
                if let Some((first, _)) = self.codes[group as usize].filter(|_| group != Group::End) {
                    let first = f64::from(first) / 10.0;
                    return Err(Error::Conflict { at, letter, first, second: value });
                }
                self.codes[group as usize] = Some((code as u16, column));
                self.scaling |= matches!((letter, code as u16), ('G', 500 | 501));
            }
            b'X' | b'Y' | b'Z' | b'I' | b'J' | b'K' | b'R' | b'F' | b'S' | b'T' | b'N' | b'O' | b'P'
            | b'Q' | b'H' | b'L' | b'E' => {
                let index = (letter - b'A') as usize;
                if self.has(letter) {
                    return Err(Error::Repeated { at, letter: letter as char });
                }
                self.present |= 1 << index;
                self.value[index] = value;
                self.column[index] = column;
            }
            _ => return Err(Error::Word { at, letter: letter as char }),
        }
        Ok(())
    }
}

fn ascii(text: &[u8], from: Place) -> Result<(), Error> {
    match text.iter().position(|b| !matches!(b, b'\t' | 0x20..=0x7e)) {
        Some(i) => {
            Err(Error::NotAscii { at: Place { column: from.column + i as u64, ..from }, byte: text[i] })
        }
        None => Ok(()),
    }
}

/// Powers of ten that a double holds exactly.
pub(super) const TENS: [f64; 19] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18];

/// A number and where it ends. Blanks inside it are skipped, as RS274/NGC section 3.3.1 has it.
fn number(text: &[u8], from: usize, letter: u8, line: u64) -> Result<(f64, usize), Error> {
    let mut i = from;
    let (mut mantissa, mut digits, mut decimals) = (0u64, 0usize, 0usize);
    let (mut negative, mut signed, mut point) = (false, false, false);
    let mut end = from;
    while let Some(&byte) = text.get(i) {
        match byte {
            b'0'..=b'9' => {
                digits += 1;
                // Past 18 digits a double holds no more.
                if mantissa < 100_000_000_000_000_000 {
                    mantissa = mantissa * 10 + u64::from(byte - b'0');
                    decimals += usize::from(point);
                } else if !point {
                    let at = Place { line, column: from as u64 };
                    return Err(Error::Digits { at, letter: letter as char });
                }
                end = i + 1;
            }
            b'.' if !point => {
                point = true;
                end = i + 1;
            }
            b'+' | b'-' if !signed && !point && digits == 0 => {
                signed = true;
                negative = byte == b'-';
            }
            b'.' | b'+' | b'-' => {
                let at = Place { line, column: i as u64 + 1 };
                return Err(Error::NumberMalformed { at, letter: letter as char });
            }
            b' ' | b'\t' => {}
            _ => break,
        }
        i += 1;
    }
    if digits == 0 {
        let at = Place { line, column: from as u64 };
        return match text.get(i) {
            Some(&found @ (b'#' | b'[' | b'<')) => {
                let at = Place { line, column: i as u64 + 1 };
                Err(Error::Expression { at, found: found as char })
            }
            _ => Err(Error::NumberMissing { at, letter: letter as char }),
        };
    }
    if exponent(&text[end..]) && matches!(letter, b'X'..=b'Z' | b'I'..=b'K' | b'R' | b'F') {
        let at = Place { line, column: from as u64 };
        return Err(Error::Exponent { at, letter: letter as char });
    }
    // Both are exact below 2^53, so the quotient is the nearest double to what is written.
    let value = mantissa as f64 / TENS[decimals];
    Ok((if negative { -value } else { value }, end))
}

/// Whether what follows a number's digits makes it one in powers of ten. Where a block has a word E it stands
/// with P alone.
fn exponent(text: &[u8]) -> bool {
    matches!(text, [b'e' | b'E', b'0'..=b'9', ..] | [b'e' | b'E', b'+' | b'-', b'0'..=b'9', ..])
}

fn g_group(code: u16, at: Place) -> Result<Option<Group>, Error> {
    let unread = |code, what, hint| Err(Error::Unread { at, code, what, hint });
    Ok(Some(match code {
        40 | 280 | 300 | 530 => Group::Once,
        0 | 10 | 20 | 30 | 800 => Group::Motion,
        170 | 180 | 190 => Group::Plane,
        900 | 910 => Group::Distance,
        901 | 911 => Group::ArcDistance,
        940 => Group::FeedMode,
        200 | 210 => Group::Units,
        400 => Group::CutterSide,
        430 | 490 => Group::LengthOffset,
        980 | 990 => Group::Return,
        150 | 500 | 501 | 670 | 690 | 970 => Group::End,
        540 | 550 | 560 | 570 | 580 | 590 | 591 | 592 | 593 => Group::Offset,
        610 | 611 | 640 | 1870 => Group::PathMode,
        930 => return unread("G93", "inverse time feed", "write feeds in mm/min (G94)"),
        950 => return unread("G95", "feed per revolution", "write feeds in mm/min (G94)"),
        410 | 411 => {
            return unread("G41", "cutter compensation by the controller", "write the cutter's own path");
        }
        420 | 421 => {
            return unread("G42", "cutter compensation by the controller", "write the cutter's own path");
        }
        431 | 432 => {
            return unread("G43.1", "a length offset the text sets", "let the tool table hold the length");
        }
        730 | 740 | 760 | 810..=890 => {
            return unread("G73-G89", "a canned cycle", "write its motions out with G0 and G1");
        }
        920..=923 => return unread("G92", "a shift of the origin", "set the work offset in the controller"),
        520 => return unread("G52", "a shift of the origin", "set the work offset in the controller"),
        100 => return unread("G10", "a change of offsets", "set the work offset in the controller"),
        160 => return unread("G16", "polar coordinates", "write the motions as they are cut"),
        510 | 511 | 680 => {
            return unread("G51/G68", "a scaling or rotation", "write the motions as they are cut");
        }
        380..=385 => return unread("G38", "a probing motion", "probe before the program starts"),
        330 | 331 => return unread("G33", "a spindle-synchronised motion", "use G1"),
        50..=53 => {
            return unread(
                "G5",
                "a spline, or a way of looking ahead",
                "write a spline out with G1, leave the other out",
            );
        }
        650 | 660 => return unread("G65", "a macro call", "write its motions out with G0 and G1"),
        960 => return unread("G96", "a constant surface speed", "name the spindle's speed (G97)"),
        _ => return Ok(None),
    }))
}

fn m_group(code: u16, at: Place) -> Result<Option<Group>, Error> {
    Ok(Some(match code {
        0 | 10 | 20 | 300 | 600 => Group::Stop,
        60 => Group::ToolChange,
        30 | 40 | 50 => Group::Spindle,
        70 | 80 | 90 => Group::Coolant,
        480 | 490 => Group::Override,
        120 | 130 => Group::Air,
        970..=990 => {
            return Err(Error::Unread {
                at,
                code: "M97-M99",
                what: "a subprogram",
                hint: "write its motions out with G0 and G1",
            });
        }
        _ => return Ok(None),
    }))
}
