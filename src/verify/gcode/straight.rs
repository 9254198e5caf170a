//! The block that long programs are made of, taken apart in one go: G0 or G1, axes, a feed, and nothing else.

use super::block::TENS;
use super::{Modal, Sink};
use crate::verify::error::Error;
use crate::verify::reading::{Event, Motion};

/// What was read of a buffer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Passed {
    pub blocks: u64,
    pub bytes: usize,
}

impl Modal {
    /// Runs the straight blocks with which a buffer begins, up to a line that is anything else, or longer than `longest`.
    /// `line` is the last line's number. What [`Modal::run`] would refuse or note is left to it.
    pub(super) fn straights(
        &mut self,
        text: &[u8],
        longest: usize,
        line: &mut u64,
        each: &mut Sink,
    ) -> Result<Passed, Error> {
        let mut passed = Passed::default();
        while let Some(block) = Straight::of(&text[passed.bytes..]) {
            if block.length > longest {
                break;
            }
            let Some(motion) = self.straight(&block, *line + 1) else { break };
            *line += 1;
            passed.blocks += 1;
            passed.bytes += block.taken;
            each(&Event::Move(motion))?;
        }
        Ok(passed)
    }

    /// Runs one such block.
    fn straight(&mut self, block: &Straight, line: u64) -> Option<Motion> {
        let motion = block.motion.or(self.motion)?;
        if self.relative || self.from_zero || motion > 10 || block.axes == [None; 3] {
            return None;
        }
        let mut feed_mm_min = self.feed_mm_min;
        if let Some(feed) = block.feed {
            feed_mm_min = feed * self.unit_mm;
            if !(0.0..=1e6).contains(&feed_mm_min) {
                return None;
            }
        }
        let mut to_mm = self.at_mm;
        for (mm, word) in to_mm.iter_mut().zip(block.axes) {
            if let Some(word) = word {
                *mm = word * self.unit_mm;
                if !(-1e5..=1e5).contains(mm) {
                    return None;
                }
            }
        }
        let told = self.spindle || self.spindle_noted;
        if motion != 0 && (feed_mm_min <= 0.0 || !told || to_mm.iter().any(|mm| mm.is_nan())) {
            return None;
        }
        (self.motion, self.feed_mm_min, self.at_mm) = (Some(motion), feed_mm_min, to_mm);
        let feed_mm_min = if motion == 0 { f32::INFINITY } else { feed_mm_min as f32 };
        Some(Motion { to_mm, feed_mm_min, line: u32::try_from(line).unwrap_or(u32::MAX) })
    }
}

/// The words of such a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Straight {
    /// G0 or G1 in tenths, where the block names it.
    pub motion: Option<u16>,
    pub axes: [Option<f64>; 3],
    pub feed: Option<f64>,
    /// Bytes without the line's end, and with it.
    pub length: usize,
    pub taken: usize,
}

/// A longer number of a block is left to the reading of any block.
const MOST_DIGITS: usize = 15;

impl Straight {
    /// Takes the first line of a buffer apart. None says nothing about the line but that it is not such a block, or that the
    /// buffer does not hold it whole.
    pub fn of(text: &[u8]) -> Option<Straight> {
        let mut block = Straight::default();
        let (mut at, mut numbered) = (0, false);
        loop {
            let letter = *text.get(at)?;
            // Lower case is upper case and this bit.
            match letter & !0x20 {
                axis @ b'X'..=b'Z' => {
                    let place = &mut block.axes[usize::from(axis - b'X')];
                    if place.is_some() {
                        return None;
                    }
                    let (value, after) = number(text, at + 1)?;
                    (*place, at) = (Some(value), after);
                }
                b'F' if block.feed.is_none() => {
                    let (value, after) = number(text, at + 1)?;
                    (block.feed, at) = (Some(value), after);
                }
                b'G' if block.motion.is_none() => {
                    at += 1 + usize::from(*text.get(at + 1)? == b'0');
                    let (code, after) = match (*text.get(at)?, text[at - 1]) {
                        (b'0', _) => (0, at + 1),
                        (b'1', _) => (10, at + 1),
                        // The zero before it was the whole of it.
                        (_, b'0') => (0, at),
                        _ => return None,
                    };
                    (block.motion, at) = (Some(code), after);
                }
                b'N' if !numbered => {
                    let digits = text[at + 1..].iter().take_while(|byte| byte.is_ascii_digit()).count();
                    if !(1..=MOST_DIGITS).contains(&digits) {
                        return None;
                    }
                    (numbered, at) = (true, at + 1 + digits);
                }
                // Blanks come between the words, not within the numbers.
                _ if letter == b' ' => {
                    at += 1;
                    continue;
                }
                _ if letter == b'\n' => {
                    (block.length, block.taken) = (at, at + 1);
                    return Some(block);
                }
                _ if letter == b'\r' => {
                    let both = *text.get(at + 1)? == b'\n';
                    (block.length, block.taken) = (at, at + 1 + usize::from(both));
                    return Some(block);
                }
                _ => return None,
            }
            // A number goes on behind blanks, and what it is then is told elsewhere.
            let mut next = at;
            while *text.get(next)? == b' ' {
                next += 1;
            }
            if matches!(text[next], b'0'..=b'9' | b'.' | b'+' | b'-' | b'\t') {
                return None;
            }
            at = next;
        }
    }
}

/// A number without blanks and where it ends, to the bit as [`super::block`] reads it.
fn number(text: &[u8], from: usize) -> Option<(f64, usize)> {
    let sign = *text.get(from)?;
    let at = from + usize::from(matches!(sign, b'+' | b'-'));
    let first = Eight::of(text, at)?;
    let whole = first.digits();
    let (mantissa, decimals, end) = if first.bytes[whole % 8] != b'.' || whole == 8 {
        (first.number(whole)?, 0, at + whole)
    } else if let Some(end) = first.second_end() {
        (first.without(whole).number(end - 1)?, end - 1 - whole, at + end)
    } else {
        let after = Eight::of(text, at + whole + 1)?;
        let decimals = after.digits();
        let mantissa = first.number(whole)? * POWERS.get(decimals)? + after.number(decimals)?;
        (mantissa, decimals, at + whole + 1 + decimals)
    };
    // A point alone is no number.
    if end - at == usize::from(first.bytes[0] == b'.') {
        return None;
    }
    let value = mantissa as f64 / TENS[decimals];
    Some((if sign == b'-' { -value } else { value }, end))
}

const POWERS: [u64; 8] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000];
const LOW: u64 = u64::from_ne_bytes([0x7f; 8]);

/// Eight bytes that are looked at together.
#[derive(Clone, Copy)]
struct Eight {
    bytes: [u8; 8],
    /// What digits are worth; the first in the lowest byte.
    worth: u64,
    /// The top bit of each byte that is no digit.
    others: u64,
}

impl Eight {
    /// None where a text does not have so many any more.
    fn of(text: &[u8], at: usize) -> Option<Eight> {
        let bytes = *text.get(at..)?.first_chunk::<8>()?;
        let worth = u64::from_le_bytes(bytes) ^ u64::from_ne_bytes([b'0'; 8]);
        // More than 9 carries into the top bit, and none into the next byte.
        let others = (((worth & LOW) + u64::from_ne_bytes([0x76; 8])) | worth) & !LOW;
        Some(Eight { bytes, worth, others })
    }

    /// How many digits come first.
    fn digits(self) -> usize {
        self.others.trailing_zeros() as usize / 8
    }

    /// Where the digits behind the first byte that is none end, if they do.
    fn second_end(self) -> Option<usize> {
        let second = self.others & self.others.wrapping_sub(1);
        (second != 0).then(|| second.trailing_zeros() as usize / 8)
    }

    /// All but one byte.
    fn without(self, at: usize) -> Eight {
        let before = (1 << (8 * at)) - 1;
        Eight { worth: (self.worth & before) | ((self.worth >> 8) & !before), ..self }
    }

    /// The number that the first `count` bytes spell, less than eight.
    fn number(self, count: usize) -> Option<u64> {
        if count > 7 {
            return None;
        }
        // Zeros before the first digit change nothing.
        let word = (self.worth << 8) << (56 - 8 * count);
        // Pairs, then fours, then all eight (Lemire's parse_eight_digits_unrolled).
        let pairs = word.wrapping_mul(10).wrapping_add(word >> 8);
        let every = 0x0000_00ff_0000_00ff;
        let fours = (pairs & every).wrapping_mul(100 + (1_000_000 << 32));
        Some(fours.wrapping_add(((pairs >> 16) & every).wrapping_mul(1 + (10_000 << 32))) >> 32)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::block::Block;
    use super::*;

    fn taken_apart(text: &str) -> Option<Block> {
        let mut block = Block::new();
        block.parse(text.as_bytes(), 1).is_ok().then_some(block)
    }

    fn straight(text: &str) -> Option<Straight> {
        Straight::of(format!("{text}\nN1 X0 Y0 ").as_bytes())
    }

    /// Whatever is taken apart here has the same words there, to the bit.
    fn same(text: &str) -> Result<bool, TestCaseError> {
        let Some(found) = straight(text) else { return Ok(false) };
        let Some(mut block) = taken_apart(text) else {
            return Err(TestCaseError::fail(format!("{text:?} is refused")));
        };
        let words = found.axes.iter().chain([&found.feed]).flatten().count();
        prop_assert_eq!((found.length, found.taken), (text.len(), text.len() + 1));
        for (letter, value) in (b'X'..=b'Z').chain([b'F']).zip(found.axes.into_iter().chain([found.feed])) {
            prop_assert_eq!(block.take(letter).map(f64::to_bits), value.map(f64::to_bits), "{}", text);
        }
        let code = block.code(super::super::Group::Motion).map(|code| code.0);
        prop_assert_eq!(code, found.motion);
        prop_assert_eq!(block.words, words + usize::from(code.is_some()) + usize::from(block.has(b'N')));
        Ok(true)
    }

    #[test]
    fn usual_blocks_are_taken_apart() {
        for text in [
            "G1 X1.5 Y-2.25 Z0.001",
            "G01X-.5Y+3.Z0000001",
            "g0 z5",
            "G00 Z5.0000 ",
            "N1234567890 G1 X1 F600",
            "X1.2345678Y9",
            "  G1  F12.5  Y-0",
            "F600 N7 Z1 G0",
            "G0X1",
            "",
            " ",
        ] {
            assert!(same(text).expect("the same"), "{text:?}");
        }
    }

    #[test]
    fn everything_else_is_left_alone() {
        let texts = "G2 X1 Y1 I1|G10 X1|G000 X1|G1.1 X1|G 1 X1|X1 5|X1 .5|X 1|X|X-|X.|X1.2.3|X--1|X1 X2|G0 G1 X1|F1 F2|N1 N2|N|N1.5 X1|X12345678|X1.23456789|X1e3|X1 (c)|X1;|%|/X1|X#1|M3|X1\t|X1 -2|\u{b0}X1|S100|A1";
        for text in texts.split('|') {
            assert_eq!(straight(text), None, "{text:?}");
        }
        // The end of the line must be there, and behind CR what follows.
        assert_eq!(Straight::of(b"X1.5 Y2        "), None);
        assert_eq!(Straight::of(b"X1.5         \r"), None);
        for (text, taken) in [("X1.5 \r\nX1      ", 7), ("X1.5 \rX1       ", 6)] {
            let found = Straight::of(text.as_bytes()).expect("a block");
            assert_eq!((found.length, found.taken), (5, taken));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_has_the_same_words(text in "[GXYZFNgx]{1}[-+ .0-9]{0,9}([ XYZFNGxyzfng][-+ .0-9]{0,9}){0,4}[ (%;\t]{0,1}") {
            same(&text)?;
        }

        #[test]
        fn coordinates_are_read_to_the_bit(x in -99_999_999i64..99_999_999, y in any::<i32>(), decimals in 0usize..8) {
            let text = format!("G1 X{:.*} Y{:.*}", decimals.min(4), x as f64 * 1e-4, decimals, f64::from(y) * 1e-5);
            same(&text)?;
        }
    }
}
