//! Which language a text is in, and the way into its interpreter.

use std::io::BufRead;

use super::error::Error;
use super::reading::{Event, Language, Options, Summary};
use super::{gcode, rml};

/// Reads a program's text event by event in constant memory; its language is found from its
/// beginning.
///
/// # Errors
/// Everything that a controller could take in more than one way, or that this reader does not
/// know, is refused with line and column: unknown words and codes, feeds of 0, subprograms,
/// compensation by the controller, a text that ends in the middle. What `each` returns is handed on.
pub fn read(
    source: &mut dyn BufRead,
    options: &Options,
    each: &mut dyn FnMut(&Event) -> Result<(), Error>,
) -> Result<Summary, Error> {
    match language(source.fill_buf()?) {
        Language::GCode => gcode::read(source, options, each),
        Language::Rml1 => rml::read(source, options, each),
    }
}

/// The language of a text by the first line that tells.
pub fn language(text: &[u8]) -> Language {
    for line in text.split(|b| matches!(b, b'\n' | b'\r')) {
        let line = line.trim_ascii();
        // `;` begins a comment in G-code and ends a command in RML-1.
        let after = &line[line.iter().position(|b| *b != b';').unwrap_or(line.len())..];
        let separated = after.len() < line.len();
        if tells_rml(after) {
            return Language::Rml1;
        }
        if !separated && tells_gcode(line) {
            return Language::GCode;
        }
    }
    Language::GCode
}

fn tells_rml(line: &[u8]) -> bool {
    let upper: Vec<u8> = line.iter().take(3).map(u8::to_ascii_uppercase).collect();
    match upper.first() {
        Some(b'^' | b'!' | b'@') => true,
        Some(b'V') => true,
        Some(b'H') => line.len() == 1 || line[1] == b';',
        Some(b'Z' | b'M' | b'D') if line.contains(&b',') => {
            line[1..].iter().all(|b| matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b',' | b' ' | b';'))
        }
        Some(_) if upper.len() >= 2 => {
            let known = matches!(&upper[..2], b"PA" | b"PR" | b"PU" | b"PD" | b"IN" | b"DF" | b"VS");
            known && upper.get(2).is_none_or(|b| matches!(b, b';' | b'0'..=b'9' | b'-' | b'+' | b'!' | b'^'))
        }
        _ => false,
    }
}

fn tells_gcode(line: &[u8]) -> bool {
    match line.first().map(u8::to_ascii_uppercase) {
        Some(b'%' | b'(') => true,
        Some(b'G' | b'M' | b'N' | b'O' | b'T') => {
            line.get(1).is_some_and(|b| b.is_ascii_digit() || *b == b' ')
        }
        _ => false,
    }
}
